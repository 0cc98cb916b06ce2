"""Fit of a structured model to experiments in the time domain, by least squares with exact derivatives."""

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from identification.channels import find_role
from identification.errors import IdentificationError
from identification.experiments.experiment import Experiment, excited_band, same_channels
from identification.fitting.result import FitProgress, FitResult
from identification.linear.modes import LinearModes
from identification.models.structured.candidates import AUTO
from identification.models.structured.element_trials import ElementPlan, ElementTrial
from identification.models.structured.identified import FittedNumber, fitted_numbers
from identification.models.structured.law_choice import USUAL_CHOICE, choose_law
from identification.models.structured.law_fits import ModelFits
from identification.models.structured.laws import Law, PolynomialDamper, PolynomialSpring
from identification.models.structured.missing import MissingForce
from identification.models.structured.model import StructuredModel
from identification.models.structured.parameters import Parameters
from identification.models.structured.problem import EVALUATIONS
from identification.models.structured.progress import FitWatch
from identification.models.structured.selection import select_elements, usual_fits
from identification.models.structured.stages import ElementFits
from identification.models.structured.start import linear_start
from vibrolock.arrays import Float

_LEAST, _PER_PERIOD = 2, 100.0
"""Fewest steps in a sample, and in a period of the highest excited frequency."""
_LARGEST_STATIC = 10.0
"""Largest static force relative to the largest RMS of the training forces."""
_SHARE = 0.1
"""Steps of central differences relative to the standard errors of the numbers. Chosen."""


@dataclass(frozen=True, eq=False, kw_only=True)
class StructuredFit(FitResult):
    """A fitted structured model; further fields are those of `identification.fitting.result.FitResult`.

    Parameters
    ----------
    model
        The model.
    start
        Its initial values.
    names
        Names of the free numbers (`identification.models.structured.parameters.Parameters`).
    values
        float[P], the free numbers.
    covariance
        float[P, P], of the free numbers, as if the residual of each experiment were white: a misfit that repeats makes it too
        small. What the steps of the simulation get wrong is in it, as one error that all numbers share.
    training_error
        RMS of the residual over that of the outputs, every output relative to its own RMS.
    trials
        All models that were fitted, in the order in which they were, with what their elements brought.
    steps_left
        Share of the errors of the simulation's steps that no change of the numbers makes up for; 1 if unknown.
    transient
        Largest change of the periods of an experiment, over the RMS of its outputs, where it is more than noise; 0 if none is.
        What it does to the numbers is in the covariance.
    missing
        What would explain the residual where noise does not, from the largest share; empty where noise does or is unknown.
    unseen
        Names of free numbers on which the training data do not depend, or only together with others. The covariance has zeros
        there, or too little.
    """

    model: StructuredModel
    start: StructuredModel
    names: tuple[str, ...]
    values: Float
    covariance: Float
    training_error: float
    trials: tuple[ElementTrial, ...] = ()
    steps_left: float = 1.0
    transient: float = 0.0
    unseen: tuple[str, ...] = ()
    missing: tuple[MissingForce, ...] = ()

    def __post_init__(self) -> None:
        count = len(self.names)
        if np.shape(self.values) != (count,) or np.shape(self.covariance) != (count, count):
            raise IdentificationError(
                f"structured fit: {count} names, but values of shape {np.shape(self.values)} and a covariance of shape "
                f"{np.shape(self.covariance)}"
            )

    @property
    def numbers(self) -> tuple[FittedNumber, ...]:
        """Frequencies, damping ratios, and numbers of laws and support with 95 % intervals, in their units."""
        return fitted_numbers(_parameters_of(self), self.values, self.covariance, self.unseen)

    @property
    def not_identified(self) -> tuple[str, ...]:
        """Names of those of `numbers` that the data do not tell: at a bound of the fit, or with an interval wider than they."""
        return tuple(number.name for number in self.numbers if number.unknown)


def fit_structured(
    modes: LinearModes,
    experiments: Sequence[Experiment],
    *,
    laws: Sequence[Law] | Literal["auto"] = (PolynomialSpring(), PolynomialDamper()),
    between: Sequence[str] = (),
    elements: Sequence[ElementPlan] = (),
    validation: Sequence[Experiment] = (),
    reach: float = 3.0,
    support: bool | float = True,
    steps: int | None = None,
    progress: Callable[[FitProgress], None] | None = None,
) -> StructuredFit:
    """Fit a structured model with one nonlinear element whose direction is free, or with several.

    Derivatives of one experiment per thread are held at once: some 32 bytes for each counted sample, output and free number,
    15 MB for 8000 samples with three outputs.

    Raises `IdentificationError` if experiments differ in channels or rate, have no force, do not match the modes, or do not
    begin at rest.

    Parameters
    ----------
    modes
        Linear modes at a low level, of the same channels.
    experiments
        Training data with one force as input; one at least is periodic. All are simulated from rest.
    laws
        Laws of the element (`laws`): what they declare as linear and as tried gets initial values
        from the data. ``"auto"``: they are chosen by the validation data
        (`identification.models.structured.law_choice.choose_law`), in two to four times the time of one fit; the result may
        have no element. `trials` of the result has all that was tried.
    between
        Outputs between which, or at which, the element with ``laws`` acts, as in `ElementPlan`; empty: it is found.
    elements
        Elements in place of the one with ``laws``; their order does not matter. With n of them n (n + 1) / 2 to n^2 models
        are usually fitted, each with all its numbers (`trials` of the result).
    validation
        Data that say which elements are kept (`ElementTrial`): forward, with a backward look, and in pairs where none pays
        alone. Without them all are kept.
    reach
        Largest displacement of the laws relative to the largest of the mode in the training data.
    support
        Stiffness of the exciter's suspension, N/m, if it is known (`Exciter.suspension_stiffness_n_m`). The suspension makes a
        static force that force sensors do not show (`StructuredModel`). True: it is fitted, which takes experiments at several
        levels, for at one level a spring does the same. False: there is none.
    steps
        Steps in a sample; None for a hundred in a period of the highest excited frequency, two in a sample at least. Errors of
        the simulation fall with their square: with 23 in a period they were 1.3 % of a response of the magnet beam.
    progress
        Called after every linearisation (`FitProgress`).
    """
    began = time.perf_counter()
    same_channels(experiments)
    first = experiments[0]
    if [channel.role for channel in first.input_channels] != ["force"]:
        names = ", ".join(f"{channel.name} ({channel.role})" for channel in first.input_channels)
        raise IdentificationError(f"are {names}", field="inputs", allowed="one force alone")
    for number, experiment in enumerate(experiments):
        if experiment.initial_state != "zero":
            raise IdentificationError(
                field=f"experiments[{number}].initial_state",
                value=experiment.initial_state,
                allowed="zero, a run from rest",
            )
    if steps is None:
        band = excited_band(experiments)
        steps = _LEAST if band is None else max(_LEAST, math.ceil(_PER_PERIOD * band[1] / first.sample_rate_hz))
    IdentificationError.unless_at_least("steps", steps, 1)
    wanted = _wanted(laws, tuple(between), elements, validation)
    linear = linear_start(modes, first, steps)
    linear = replace(linear, training=tuple(e.name or f"experiment {i + 1}" for i, e in enumerate(experiments)))
    largest = _LARGEST_STATIC * max(float(np.sqrt(np.mean(one.inputs[0] ** 2))) for one in experiments)
    known = 0.0 if isinstance(support, bool) else float(support)
    if not 0.0 <= known < math.inf:
        raise IdentificationError(f"is {known:g} N/m", field="support", allowed="0 or above, True or False")
    for at in (between, *(plan.between for plan in wanted)):
        linear.output_selector(tuple(at))  # refused here, not after the fits of others
    watch = FitWatch(progress, usual_fits(len(wanted)) if wanted else USUAL_CHOICE, EVALUATIONS)
    fits = ElementFits(
        modes,
        experiments,
        validation,
        replace(linear, support_largest_n=largest, support_n_m=known),
        reach=reach,
        support=support is True,
        alone=len(wanted) <= 1,
        watch=watch,
    )
    if wanted:
        kept, trials = select_elements(wanted, fits, selective=bool(validation))
    else:
        kept, trials = choose_law(ModelFits(fits, tuple(between), watch), tuple(between))
    covariance, steps_left, unseen, transient = kept.problem.uncertainty(kept.last.vector)
    return StructuredFit(
        model=kept.model.trained_with(experiments),
        start=kept.start,
        names=kept.problem.parameters.names,
        values=kept.last.vector,
        covariance=covariance,
        training_error=kept.problem.error(kept.last.vector),
        evaluations=fits.evaluations,
        iterations=fits.iterations,
        seconds=time.perf_counter() - began,
        status=kept.last.ending.status,
        message=kept.last.ending.message,
        trials=trials,
        steps_left=steps_left,
        transient=transient,
        missing=fits.missing(kept),
        unseen=tuple(name for name, one in zip(kept.problem.parameters.names, unseen, strict=True) if one),
    )


def _wanted(
    laws: Sequence[Law] | str,
    between: tuple[str, ...],
    elements: Sequence[ElementPlan],
    validation: Sequence[Experiment],
) -> tuple[ElementPlan, ...]:
    """Return the elements, none where a law is chosen."""
    if elements and (between or isinstance(laws, str)):
        name, value = ("between", between) if between else ("laws", laws)
        raise IdentificationError(
            field=name, value=value, allowed="nothing beside `elements`, each of which has its own"
        )
    if not isinstance(laws, str):
        return tuple(elements) or (ElementPlan(tuple(laws), between),)
    if laws != AUTO:
        raise IdentificationError(field="laws", value=laws, allowed=f"laws, or '{AUTO}'")
    ElementPlan(between=between)  # is refused with more than two outputs
    if not validation:
        raise IdentificationError(
            "are none", field="validation", allowed=f"one at least with laws='{AUTO}': they decide"
        )
    return ()


def std_of(fit: StructuredFit, quantity: Callable[[StructuredModel], Float]) -> Float:
    """Return standard errors of what a function computes of a model, float[k], by central differences along the free numbers.

    Linear in the errors, and as certain as `StructuredFit.covariance`. The steps follow the principal axes of the covariance,
    so that what the data do not tell apart moves together.
    """
    parameters, parts = _parameters_of(fit), []
    for axis in _axes_of(fit):
        step = _SHARE * axis
        more, less = (quantity(parameters.model(fit.values + sign * step)) for sign in (1.0, -1.0))
        parts.append((more - less) / (2.0 * _SHARE))
    return np.asarray(np.linalg.norm(parts, axis=0))


def drawn(fit: StructuredFit, count: int, seed: int = 0) -> Iterator[StructuredModel]:
    """Yield ``count`` models whose free numbers are drawn about those of a fit, from a normal distribution with its covariance.

    Numbers that leave the bounds of a fit are set to them.
    """
    parameters, axes, random = _parameters_of(fit), _axes_of(fit), np.random.default_rng(seed)
    bounds = parameters.bounds(fit.values)
    for _ in range(count):
        yield parameters.model(np.clip(fit.values + random.standard_normal(len(axes)) @ axes, *bounds))


def _parameters_of(fit: StructuredFit) -> Parameters:
    drive = find_role(fit.start.outputs, "drive")
    poles = sum(name.startswith("frequency ") for name in fit.names)
    return Parameters(fit.start, (drive,), "support" in fit.names, poles=poles)


def _axes_of(fit: StructuredFit) -> Float:
    """float[k, P]: principal axes of the covariance, each as long as its standard error."""
    size = np.sqrt(np.diag(fit.covariance))
    unit = np.where(size > 0.0, size, 1.0)
    values, axes = np.linalg.eigh(fit.covariance / np.outer(unit, unit))
    kept = values > 0.0
    return np.asarray((axes[:, kept] * np.sqrt(values[kept])).T * size)
