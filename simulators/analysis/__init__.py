"""Computed analysis of a virtual rig: frequency responses, and periodic vibrations by harmonic balance."""

from typing import TYPE_CHECKING

from vibrolock.on_use import on_use

if TYPE_CHECKING:
    from simulators.analysis.frequency_responses import (
        FrequencyResponses as FrequencyResponses,
        frequency_response as frequency_response,
    )
    from simulators.analysis.harmonic_balance import (
        constant_displacement_response as constant_displacement_response,
        constant_force_response as constant_force_response,
        forced_response as forced_response,
        phase_resonance_backbone as phase_resonance_backbone,
    )
    from simulators.analysis.images import (
        ImageBias as ImageBias,
        image_bias as image_bias,
        image_shares as image_shares,
    )
    from simulators.analysis.responses import (
        HysteresisLoop as HysteresisLoop,
        NotConvergedError as NotConvergedError,
        PeriodicResponses as PeriodicResponses,
    )
    from simulators.analysis.site_forces import hysteresis_loops as hysteresis_loops
    from simulators.modes import LinearModes as LinearModes
else:
    __getattr__, __dir__, __all__ = on_use(__name__)
