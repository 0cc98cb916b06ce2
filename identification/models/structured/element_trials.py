"""Elements to be fitted, and whether each pays on data to which the model was not fitted."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.errors import IdentificationError
from identification.experiments.errors import errors_of
from identification.experiments.experiment import Experiment
from identification.models.structured.laws import Law, PolynomialDamper, PolynomialSpring
from identification.models.structured.model import StructuredModel
from identification.validation import convert_fields
from vibrolock.arrays import Float

_SURE = 0.95
"""Confidence that errors fall. Chosen."""
_LEAST_GAIN = 1.05
"""Smallest factor by which errors have to fall. Chosen."""


@dataclass(frozen=True)
class ElementPlan:
    """An element to be fitted.

    Raises `IdentificationError` if there are no laws, or more than two channels.

    Parameters
    ----------
    laws
        Its laws.
    between
        Names of output channels: one for the displacement there, two for that of the first relative to the second. Empty: the
        direction is found.
    """

    laws: tuple[Law, ...] = (PolynomialSpring(), PolynomialDamper())
    between: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        convert_fields(self, tuple, "laws", "between")
        IdentificationError.raise_if(not self.laws, "is empty", field="laws", allowed="one at least")
        if len(self.between) > 2 or len(set(self.between)) < len(self.between):
            raise IdentificationError(
                f"is {', '.join(self.between)}", field="between", allowed="one or two different outputs"
            )


@dataclass(frozen=True, kw_only=True)
class ElementTrial:
    """A model with one element more than the one before.

    Errors of both on every validation experiment are compared in pairs: the logarithm of their ratio has a mean, and a
    one-sided 95 % limit by Student's t with as many degrees of freedom as experiments less one. An element is kept if errors
    fall by 5 % or more at that limit; with one experiment, by 5 % or more.

    Parameters
    ----------
    laws, between
        Kinds of the element's laws, and outputs where it acts.
    error
        RMS of the relative errors on the validation data; NaN without any.
    gain
        Factor by which errors fell, the geometric mean over experiments; NaN for the first element, or without data.
    at_least
        Lower limit of the gain, 95 % sure; NaN where there is none.
    kept
        Whether the element is in the model.
    """

    laws: tuple[str, ...]
    between: tuple[str, ...]
    error: float
    gain: float
    at_least: float
    kept: bool

    @classmethod
    def of(
        cls,
        model: StructuredModel,
        before: StructuredModel | None,
        plan: ElementPlan,
        validation: Sequence[Experiment],
    ) -> "ElementTrial":
        """Compare a model with the one that has an element less; None for the first element."""
        error = gain = at_least = np.nan
        if validation:
            own = errors_of(model, validation).overall
            error = float(np.sqrt(np.mean(own**2)))
            if before is not None:
                gain, at_least = _gain(errors_of(before, validation).overall, own)
        return cls(
            laws=tuple(law.kind for law in plan.laws),
            between=plan.between,
            error=error,
            gain=gain,
            at_least=at_least,
            kept=before is None or not validation or (gain if np.isnan(at_least) else at_least) >= _LEAST_GAIN,
        )


def _gain(before: Float, after: Float) -> tuple[float, float]:
    from scipy.stats import t  # only on use: it takes long to load

    ratio = np.log(before / after)
    if ratio.size < 2:
        return float(np.exp(ratio[0])), float("nan")
    limit = np.mean(ratio) - t.ppf(_SURE, ratio.size - 1) * np.std(ratio, ddof=1) / np.sqrt(ratio.size)
    return float(np.exp(np.mean(ratio))), float(np.exp(limit))
