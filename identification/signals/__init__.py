"""Evaluate sampled signals: Fourier coefficients, transients over time, sweeps, decimation."""

from typing import TYPE_CHECKING

from vibrolock.on_use import on_use

if TYPE_CHECKING:
    from identification.signals.chunks import spans as spans, unwrapped as unwrapped
    from identification.signals.decimation import EDGE_SAMPLES as EDGE_SAMPLES, LARGEST_FACTOR as LARGEST_FACTOR
    from identification.signals.even_phase import EvenPhase as EvenPhase
    from identification.signals.fourier import vibration_in as vibration_in
else:
    __getattr__, __dir__, __all__ = on_use(__name__)
