"""Numbers of the paper, and how far a result agrees with them, in a sentence.

M. Scheel, G. Kleyman, A. Tatar, M. R. W. Brake, S. Peter, J.-P. Noel, M. S. Allen and M. Krack, *Experimental assessment of
polynomial nonlinear state-space and nonlinear-mode models for near-resonant vibrations*: tables of relative errors.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple


class PaperError(NamedTuple):
    """Relative error of the models of one training set, tested at their own level; None where one of them was unstable."""

    mean: float | None
    standard_deviation: float | None

    def __str__(self) -> str:
        if self.mean is None or self.standard_deviation is None:
            return "unstable"
        return f"{100 * self.mean:.1f} % ({100 * self.standard_deviation:.1f} %)"


_UNSTABLE = PaperError(None, None)
SAME_LEVEL: Mapping[str, Mapping[str, PaperError]] = {
    "magnet-beam": {
        "0.5 N": PaperError(0.063, 0.051),
        "2.6 N": PaperError(0.013, 0.003),
        "5.2 N": _UNSTABLE,
        "mixed": _UNSTABLE,
    },
    "friction-beam": {
        "10 N": PaperError(0.089, 0.094),
        "30 N": PaperError(0.051, 0.016),
        "50 N": _UNSTABLE,
        "mixed": _UNSTABLE,
    },
}
"""Errors at the level of the training, by specimen and training set."""


def agreement(row: Mapping[str, Any], paper: PaperError | None) -> str:
    """Return one sentence on a row of the error table beside the paper's; ``row`` is that of all models of a training set."""
    unbounded, mean = row["unbounded_models"], row["mean"]
    if paper is None:
        return "The paper gives no number for this training set."
    if paper.mean is None or paper.standard_deviation is None:
        if unbounded:
            return f"As in the paper, some are unstable: {unbounded} of {row['models']} models diverged."
        return "Other than in the paper, none is unstable."
    if mean is None:
        return "Other than in the paper, every model diverged."
    away = abs(mean - paper.mean)
    if away <= paper.standard_deviation:
        return "Agrees: within one standard deviation of the paper's models."
    times = away / paper.standard_deviation
    side = "smaller" if mean < paper.mean else "larger"
    agrees = "Agrees to" if times <= 2.0 else "Does not agree: it differs by"
    return f"{agrees} {times:.1f} of the paper's standard deviations; the error is {side} here."
