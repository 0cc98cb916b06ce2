"""The frequency response of a nonlinear state-space model: its points, folds and notes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.pnlss.steady.states import SteadyStates
from identification.prediction.steady_prediction import SteadyPrediction

__all__ = ["PnlssResponse"]


@dataclass(frozen=True, eq=False, kw_only=True)
class PnlssResponse:
    """Frequency response of a nonlinear state-space model at constant force, with all harmonics.

    Parameters
    ----------
    force_n, force
        What is held, as in `SteadyPrediction`.
    points, folds
        The vibrations along the curve, and those where it turns back in frequency.
    branch
        int[n], 0 for the response that begins at the lowest frequency; 1 for the part that was reached from the highest,
        where the first did not get there.
    notes
        What a user should know about these numbers, one line each.
    complete
        Whether every path reached the far end of the band; else a note says where it ended and why.
    """

    force_n: float
    force: str
    points: SteadyStates
    folds: SteadyStates
    branch: NDArray[np.int64]
    notes: tuple[str, ...]
    complete: bool = True

    @property
    def prediction(self) -> SteadyPrediction:
        """The fundamental harmonics; the modal amplitude is unknown, for no mode shape is needed."""
        count, folds = self.points.count, self.folds.count
        return SteadyPrediction(
            force_n=self.force_n,
            force=self.force,
            channels=self.points.channels,
            frequency_hz=self.points.frequency_hz,
            modal_amplitude=np.full(count, np.nan),
            fundamental_n=np.abs(self.points.force_n[:, 1]),
            displacement_m=self.points.displacement_m[:, 1],
            stable=self.points.stable,
            branch=self.branch,
            range_use=np.asarray(self.points.range_use),
            fold_frequency_hz=self.folds.frequency_hz,
            fold_amplitude_m=np.abs(self.folds.displacement_m[:, 1, 0]),
            fold_modal_amplitude=np.full(folds, np.nan),
            notes=self.notes,
            complete=self.complete,
        )
