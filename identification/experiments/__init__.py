"""Experiments, models that simulate them, and time records from elsewhere that become experiments."""

from typing import TYPE_CHECKING

from vibrolock.on_use import on_use

if TYPE_CHECKING:
    from identification.experiments.experiment import InitialState as InitialState
    from identification.experiments.noise import (
        PeriodChange as PeriodChange,
        mean_covariance as mean_covariance,
        period_change as period_change,
    )
    from identification.experiments.periodicity import period_remark as period_remark
    from identification.experiments.residuals import (
        EXPLAINED as EXPLAINED,
        lacks_something as lacks_something,
        residual_over_noise as residual_over_noise,
        unsettled as unsettled,
    )
    from identification.experiments.simulators import Simulator as Simulator
    from identification.experiments.time_experiments import suitable_rate_hz as suitable_rate_hz
else:
    __getattr__, __dir__, __all__ = on_use(__name__)
