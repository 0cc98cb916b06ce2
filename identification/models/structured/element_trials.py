"""Elements to be fitted, how well models with some of them fit, and whether further ones pay."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from identification.errors import IdentificationError
from identification.experiments.errors import errors_of
from identification.experiments.experiment import Experiment
from identification.experiments.residuals import ResidualAndNoise, log_likelihood_ratio, residual_and_noise
from identification.models.structured.laws import Law, PolynomialDamper, PolynomialSpring
from identification.models.structured.model import StructuredModel
from identification.validation import convert_fields
from vibrolock.arrays import Float

_SURE = 0.95
"""Confidence of what is told of the gain."""
LEAST_GAIN = 1.05
"""Smallest factor by which errors have to fall for each further element. Chosen."""
LEAST_LIKELIHOOD = math.log(1.0 / 0.05)
"""Smallest logarithm of the likelihood ratio: noise alone exceeds it in at most 5 % of cases."""


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

    @property
    def name(self) -> str:
        """Its laws and where it acts, as in ``jenkins@tip:drive``."""
        return names_of(self.laws) + ("@" if self.between else "") + ":".join(self.between)


def names_of(laws: Sequence[Law]) -> str:
    """Return kinds of laws, with the side of a stop that is not above, as in ``stop below,jenkins``."""
    sides = [getattr(law, "sides", "above") for law in laws]
    return ",".join(
        law.kind if side == "above" else f"{law.kind} {side}" for law, side in zip(laws, sides, strict=True)
    )


@dataclass(frozen=True, kw_only=True)
class ElementTrial:
    """A fitted model with some of the elements, compared with the model that was kept until then.

    Elements are added while they pay. With one element more, errors on the validation data have to fall by 5 % or more, the
    geometric mean over all experiments; with two more, twice. Both models were fitted to other data, so that a larger number
    of parameters by itself lowers no error here. If the residual is an error of the model, far above the noise, it is the same
    in every repetition, and a gain is no chance however few experiments there are: the 5 % decide. If the residual is noise, a
    gain may be chance. Where the periods show the noise, ``likelihood`` therefore has to be log(20) or more as well. If the
    smaller model is right as it was fitted, the likelihood ratio on data that neither model was fitted to exceeds 20 in at most
    5 % of cases, however much data there are and whatever the models (Wasserman, Ramdas and Balakrishnan, Universal inference,
    PNAS 117, 2020, 16880: the split likelihood ratio).

    Parameters
    ----------
    laws, between
        Kinds of laws and outputs of the element that was added (of a pair the last one) or left out.
    elements
        The model's elements, with kinds of laws and places as in ``jenkins@tip:drive``, in its order; empty in earlier files.
        Where laws were chosen, ``linear`` for the model without an element.
    compared
        Elements of the model with which it is compared; empty if with none.
    error
        RMS of the relative errors on the validation data; NaN without any, inf if the model could not be fitted.
    gain
        Factor by which errors are smaller than those of the model with which it is compared; below 1 if they are larger, NaN
        without that model or without data.
    at_least
        Lower limit of the gain, 95 % sure by Student's t over experiments; NaN with fewer than two. It decides nothing: two or
        three experiments of the same gain tell little of its scatter.
    likelihood
        Natural logarithm of the likelihood ratio of the larger of both to the smaller, on the validation data
        (`identification.experiments.residuals.log_likelihood_ratio`); NaN where the noise is unknown.
    kept
        Whether the elements were kept then: added if they pay, left out if they do not.
    regression, screening
        Where laws were chosen: what the regression leaves of what it leaves without an element, and the relative error of a
        short fit to the loudest experiment, led by the measured motion; NaN where it was not needed.
    over_noise
        Where laws were chosen: largest residual over noise in the validation data; NaN where the noise is unknown.
    """

    laws: tuple[str, ...]
    between: tuple[str, ...]
    elements: tuple[str, ...] = ()
    compared: tuple[str, ...] = ()
    error: float
    gain: float
    at_least: float
    likelihood: float = math.nan
    kept: bool
    regression: float = math.nan
    screening: float = math.nan
    over_noise: float = math.nan


class Scores(NamedTuple):
    """How well a model fits, to be compared with others on the same data."""

    errors: Float
    """float[n_experiments], relative RMS errors; inf if there is no model."""
    residuals: ResidualAndNoise | None = None
    """The residual against the noise, float[n_experiments, n_outputs] each; None if it is not known."""

    @classmethod
    def of(cls, model: StructuredModel, experiments: Sequence[Experiment]) -> "Scores":
        """Simulate all experiments."""
        runs = [model.simulate_experiment(one) for one in experiments]
        waiting = iter(runs)
        residuals = [
            residual_and_noise(one, run.outputs[:, one.counted_from :])
            for one, run in zip(experiments, runs, strict=True)
        ]
        return cls(
            errors_of(model, experiments, lambda _: next(waiting)).overall,
            ResidualAndNoise(*(np.array(part) for part in zip(*residuals, strict=True))),
        )

    @property
    def size(self) -> float:
        """Geometric mean of the errors."""
        return float(np.exp(np.mean(np.log(np.maximum(self.errors, np.finfo(float).tiny)))))

    @property
    def rms(self) -> float:
        """RMS of the errors."""
        return float(np.sqrt(np.mean(self.errors**2)))

    @property
    def over_noise(self) -> Float:
        """float[n_experiments, n_outputs], RMS of the residual over that of the noise; NaN where it is not known."""
        if self.residuals is None:
            return np.full((self.errors.size, 1), np.nan)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(np.sqrt(self.residuals.residual / self.residuals.noise))

    def gain_over(self, other: "Scores") -> float:
        """Return the factor by which errors are smaller than those of another model."""
        return other.size / self.size

    def gain_at_least(self, other: "Scores") -> float:
        """Return the lower limit of `gain_over`, 95 % sure by Student's t over experiments; NaN with fewer than two."""
        from scipy.special import stdtrit  # only on use: it takes long to load

        if self.errors.size < 2 or not np.all(np.isfinite(self.errors)):
            return math.nan
        ratio = np.log(other.errors / self.errors)
        half = stdtrit(ratio.size - 1, _SURE) * np.std(ratio, ddof=1) / np.sqrt(ratio.size)
        return float(np.exp(np.mean(ratio) - half))

    def likelihood_over(self, smaller: "Scores") -> float:
        """Return the natural logarithm of the likelihood ratio of this model and a smaller one; NaN if it is not known."""
        if self.residuals is None or smaller.residuals is None:
            return math.nan
        return log_likelihood_ratio(smaller.residuals, self.residuals)

    def pays_over(self, smaller: "Scores", elements: int) -> bool:
        """Return whether this model, with so many elements more than a smaller one, pays (`ElementTrial`)."""
        chance = self.likelihood_over(smaller) < LEAST_LIKELIHOOD  # False where it is not known
        return self.gain_over(smaller) >= LEAST_GAIN**elements and not chance
