"""What steps the law sample by sample, for compiled callers: kernels, codes of modes and states, and records of a period."""

from typing import TYPE_CHECKING

from vibrolock.on_use import on_use

if TYPE_CHECKING:
    from controller.amplitude import (
        FORCE as FORCE,
        FORCE_RMS as FORCE_RMS,
        RESPONSE as RESPONSE,
        VOLTAGE as VOLTAGE,
        demand as demand,
        held_amplitude as held_amplitude,
        take_over as take_over,
        track_saturation as track_saturation,
    )
    from controller.detector import ADAPTIVE as ADAPTIVE, detect as detect, force_rms as force_rms
    from controller.feed_forward import (
        add_to_backbone as add_to_backbone,
        follow_backbone as follow_backbone,
        foretold_slope as foretold_slope,
        forget_backbone as forget_backbone,
        logarithmic_slope as logarithmic_slope,
        steepness as steepness,
    )
    from controller.frequency import (
        FREQUENCY_ERROR as FREQUENCY_ERROR,
        follow as follow,
        frequency_error as frequency_error,
    )
    from controller.law import measure_phase as measure_phase
    from controller.lock import (
        LOCK as LOCK,
        LOCKED as LOCKED,
        LOST as LOST,
        MOST_LAG_SLOWING as MOST_LAG_SLOWING,
        SEARCHING as SEARCHING,
        STEEP_PERIODS as STEEP_PERIODS,
        begin_ramp as begin_ramp,
        forget_lag as forget_lag,
        mind_steepness as mind_steepness,
        next_lock_state as next_lock_state,
        reacquire as reacquire,
    )
    from controller.period import PERIOD as PERIOD, add_sample as add_sample, end_period as end_period
    from controller.primitives import (
        TWO_PI as TWO_PI,
        advance_phase as advance_phase,
        size as size,
        track as track,
        wrap as wrap,
    )
else:
    __getattr__, __dir__, __all__ = on_use(__name__)
