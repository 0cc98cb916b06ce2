"""Bands of sweeps and multisines, and which predictions beyond the training data are refused."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from identification import ExtrapolationError, SimulatedRun, StructuredFit, SweepPrediction
from identification.models import check_input, peak_band, run_band
from vibrolock.arrays import Float

BEYOND = 1.01
"""Range use above which a prediction goes beyond the training data; rounding is below."""
UNKNOWN = "goes beyond the training data, and without the fit of the model its error is unknown"


@dataclass(frozen=True)
class OpenBands:
    """What is to be said of predictions over time of a structured model."""

    fit: StructuredFit | None
    """The fit; None for a model alone, or with scatter from run to run."""
    asked: bool
    """Whether bands are asked for."""
    allowed: bool
    """Whether predictions without a band are allowed beyond the training data."""

    def wanted(self, use: float, known: bool = False) -> bool:
        """Return whether a prediction with this range use gets a band: asked for, or beyond the training data.

        ``known``: it was measured, so that its errors are known.
        """
        return self.asked or (use > BEYOND and not self.allowed and not known)

    def of_run(self, run: SimulatedRun, outputs: Float, respond: Callable[[Any], Float], known: bool) -> SimulatedRun:
        """Return a run with bands; ``known``: it was measured, so that what is too uncertain is only left without.

        Raises `ExtrapolationError` for a prediction that is too uncertain.
        """

        def banded() -> SimulatedRun:
            assert self.fit is not None
            rms, peak, error = run_band(self.fit, run.name, run.range_use, outputs, respond)
            return replace(run, rms_band=rms, peak_band=peak, error_band=error)

        found, _ = self._judged(run.name, run.range_use, known or not run.bounded, banded)
        return found or run

    def of_sweep(
        self,
        sweep: SweepPrediction,
        shape: float,
        respond: Callable[[Any], tuple[float, float]],
        known: bool,
    ) -> SweepPrediction:
        """Return a sweep with the band of its peak; ``shape``: mode shape at the drive point, otherwise as `of_run`."""
        where = int(np.argmax(np.abs(sweep.drive_m)))
        peak_m, peak_hz = sweep.peak()
        power = abs(sweep.force[where]) * shape**2 / ((2.0 * np.pi * peak_hz) ** 2 * peak_m)

        def banded() -> SweepPrediction:
            assert self.fit is not None
            found = peak_band(self.fit, sweep.origin, sweep.range_use, (peak_m, peak_hz), 0.5 * power, respond)
            (low_m, low_hz), (high_m, high_hz) = found.tolist()
            return replace(sweep, peak_band_m=(low_m, high_m), peak_band_hz=(low_hz, high_hz))

        known = known or sweep.unbounded_at_s is not None
        found, said = self._judged(sweep.origin, sweep.range_use, known, banded)
        return found or replace(sweep, notes=(*sweep.notes, *said))

    def _judged(
        self, name: str, use: float, known: bool, banded: Callable[[], Any]
    ) -> tuple[Any | None, tuple[str, ...]]:
        if not self.wanted(use, known):
            return None, ()
        if self.fit is None:
            if not known:
                check_input(name, use)
            return None, (UNKNOWN,) if use > BEYOND else ()
        try:
            return banded(), ()
        except ExtrapolationError as error:
            if known:
                return None, (f"has no band: {error}",)
            raise
