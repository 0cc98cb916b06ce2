"""The fit of one structured model: from its starts, each in stages with smaller and smaller nudging forces."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from identification.channels import find_role
from identification.errors import IdentificationError
from identification.experiments.experiment import Experiment
from identification.experiments.residuals import lacks_something, residual_over_noise, unsettled
from identification.fitting.levenberg_marquardt import Minimum
from identification.fitting.threads import threads
from identification.linear.modes import LinearModes
from identification.models.structured.element_trials import ElementPlan, Scores
from identification.models.structured.laws import Joint, Law
from identification.models.structured.missing import MissingForce, missing_forces
from identification.models.structured.model import StructuredModel
from identification.models.structured.nudging import Nudging, settling_periods, with_lead_in_periods
from identification.models.structured.parameters import Parameters
from identification.models.structured.problem import ModalTest, Problem
from identification.models.structured.progress import FitWatch
from identification.models.structured.screening import Screening, rough_steps
from identification.models.structured.start import Start, element_starts, with_further_element

_ROUGH, _FINE = 3e-2, 2e-4
"""Relative gains of a step below which the fits before the last one, and the last one, end."""
_STAGES = {
    False: ((0.05, False, False), (0.01, False, False), (0.0, False, False), (0.0, False, True)),
    True: (
        (0.05, False, False),
        (0.01, False, False),
        (0.01, True, False),
        (0.0, True, False),
        (0.0, True, True),
    ),
}
"""Damping ratio of the nudging forces in each fit, whether the support is free, and whether directions are; by whether the
support is asked for. Directions are free in the last stage only: earlier they absorb errors of nudging forces and law."""
_MISFIT = 0.01
"""Relative misfit of the samples against which the errors of the modal test are weighed at first; later that of the fit before,
if it is smaller."""
_SUPPORT = 0.01
"""Initial stiffness of the support relative to the first mode's at the drive point. Chosen."""
_STARTS = 4
"""Most starts of the fit of one element, as long as noise does not explain the residual. Chosen."""


class Fitted(NamedTuple):
    """A fitted model."""

    model: StructuredModel
    start: StructuredModel
    problem: Problem
    last: Minimum
    evaluations: int
    iterations: int

    def lacks_something(self) -> bool:
        """Whether the residual of any experiment is more than noise and not small (`lacks_something`).

        False where one has not settled (`unsettled`): it also moves the residuals of the others.
        """
        if unsettled(self.problem.experiments):
            return False
        for experiment in self.problem.experiments:
            simulated = self.model.simulate_experiment(experiment).outputs[:, experiment.counted_from :]
            measured = experiment.counted_outputs
            error = np.linalg.norm(simulated - measured, axis=1) / np.linalg.norm(measured, axis=1)
            if np.any(lacks_something(residual_over_noise(experiment, simulated), error)):
                return True
        return False


def best_fitted(starts: Sequence[StructuredModel], fit: Callable[[StructuredModel], Fitted]) -> Fitted:
    """Return the first fit whose residual the noise explains, or of all the one with the least error."""
    fitted = []
    for start in starts:
        try:
            fitted.append(fit(start))
        except IdentificationError:
            if not fitted:
                raise
            continue  # a further start that cannot be fitted takes nothing from the first
        if not fitted[-1].lacks_something():
            break
    best = min(fitted, key=lambda one: one.problem.error(one.last.vector))
    evaluations, iterations = (
        sum(counts) for counts in zip(*((one.evaluations, one.iterations) for one in fitted), strict=True)
    )
    return best._replace(evaluations=evaluations, iterations=iterations)


class ElementFits:
    """Fits of all numbers of a model that has more elements than another, or than the ``linear`` one.

    Parameters
    ----------
    modes, experiments
        What the models are fitted to.
    validation
        Data on which they are compared; without any the training data.
    linear
        The model without elements.
    reach
        Largest displacement of the laws relative to the largest in the training data.
    support
        Whether the support is fitted.
    alone
        Whether there is one element only: then its fit begins again while its residual is more than noise. Of several the
        first is expected to leave a residual.
    watch
        Is told of every linearisation.
    """

    def __init__(
        self,
        modes: LinearModes,
        experiments: Sequence[Experiment],
        validation: Sequence[Experiment],
        linear: StructuredModel,
        *,
        reach: float,
        support: bool,
        alone: bool,
        watch: FitWatch,
    ) -> None:
        self._modes, self._experiments, self._validation = modes, experiments, validation
        self._linear, self._watch = linear, watch
        self._reach, self._support, self._starts = reach, support, _STARTS if alone else 1
        self._nudged = min(len(modes.frequency_hz), len(linear.outputs))  # modes whose motion the outputs tell apart
        self.evaluations = self.iterations = 0

    def more(self, before: Fitted | None, plans: Sequence[ElementPlan]) -> Fitted:
        """Return the fit with further elements; None for the model without elements."""
        self._watch.begin_fit()
        found = self._linear if before is None else before.model
        for plan in plans[:-1]:
            found = self._starts_with(found, plan.laws, plan.between)[0].model
        starts = self._starts_with(found, plans[-1].laws, plans[-1].between)
        return self.begun([one.model for one in starts[: self._starts]])

    def less(self, larger: Fitted, position: int) -> Fitted:
        """Return the fit without the element at a position, from a fit that has it."""
        self._watch.begin_fit()
        return self._counted(self._from(_taken_out(larger.model, position)))

    def scores(self, fit: Fitted) -> Scores:
        """Return the errors on the validation data; without any, that on the training data."""
        if self._validation:
            return Scores.of(fit.model, self._validation)
        return Scores(np.array([fit.problem.error(fit.last.vector)]))

    def scores_without(self, larger: Fitted, position: int) -> Scores:
        """Return the errors on the validation data with an element taken out and nothing fitted again."""
        return Scores.of(_taken_out(larger.model, position), self._validation)

    def missing(self, fit: Fitted) -> tuple[MissingForce, ...]:
        """Return what would explain the residual on the training data; nothing where noise does, or is unknown."""
        return missing_forces(fit.model, self._experiments, self._nudged) if fit.lacks_something() else ()

    def _counted(self, fitted: Fitted) -> Fitted:
        self.evaluations += fitted.evaluations
        self.iterations += fitted.iterations
        return fitted

    def starts(self, laws: Sequence[Law], between: tuple[str, ...], held: int = 0) -> list[Start]:
        """Return the starts of a model with one element, or with none without laws, the best first.

        The first ``held`` laws keep the numbers in which they are not linear.
        """
        return self._starts_with(self._linear, laws, between, held)

    def begun(self, starts: Sequence[StructuredModel]) -> Fitted:
        """Return the best of the fits from these starts, up to the first whose residual the noise explains."""
        return self._counted(best_fitted(starts, self._from))

    def screening(self) -> Screening:
        """Return short fits to one experiment."""
        return Screening(self._modes, self._experiments, self._linear, self._nudged, self._watch)

    def _starts_with(
        self, model: StructuredModel, laws: Sequence[Law], between: tuple[str, ...], held: int = 0
    ) -> list[Start]:
        with threads():  # the matrices are too small to share
            if model.elements or between:
                return [self._further(model, laws, between, held)]
            found = element_starts(model, self._experiments, self._nudged, laws, self._reach, held)
            if any(isinstance(law, Joint) and not law.sticks for law in laws):
                # that force jumps where the element turns, which is not where a mode does: a direction comes first
                return [self._further(model, laws, (), held)._replace(residual=found[0].residual), *found]
            return found

    def _further(self, model: StructuredModel, laws: Sequence[Law], between: tuple[str, ...], held: int) -> Start:
        return with_further_element(model, self._experiments, self._nudged, laws, between, self._reach, held)

    def _from(self, start: StructuredModel) -> Fitted:
        return _fitted(start, self._linear, self._modes, self._experiments, self._nudged, self._support, self._watch)


def _taken_out(model: StructuredModel, position: int) -> StructuredModel:
    return replace(model, elements=(*model.elements[:position], *model.elements[position + 1 :]))


def _fitted(
    start: StructuredModel,
    linear: StructuredModel,
    modes: LinearModes,
    experiments: Sequence[Experiment],
    nudged: int,
    support: bool,
    watch: FitWatch,
) -> Fitted:
    """Fit all numbers, in stages with smaller and smaller nudging forces."""
    measured = len(modes.frequency_hz)
    tied = (find_role(start.outputs, "drive"),)
    stiffness = _SUPPORT * (linear.omega[0] / linear.input_shapes[0, 0]) ** 2
    found, evaluations, iterations, misfit = start, 0, 0, _MISFIT
    seen = float(linear.frequency_hz[-1]) < 0.5 * linear.sample_rate_hz  # the last may be the residual's
    poles = len(linear.frequency_hz) if seen else measured
    rough = rough_steps(start)
    slowest = float(np.min((linear.omega * linear.damping_ratio)[:nudged]))
    for number, (ratio, free, turned) in enumerate(_STAGES[support], 1):
        watch.begin(f"stage {number} of {len(_STAGES[support])}")
        if free and not found.support_n_m:
            found = replace(found, support_n_m=stiffness)
        # the last fit runs without nudging for so long before it counts that its effect has decayed
        lengths = [0 if ratio or not e.period_samples else settling_periods(e, slowest) for e in experiments]
        settled = [with_lead_in_periods(e, count) for e, count in zip(experiments, lengths, strict=True)]
        begun = start if turned else replace(start, steps=rough)
        nudgings = [
            Nudging.of(linear, e, nudged, ratio, begun.steps, e.counted_from - count * e.period_samples)
            if e.period_samples
            else None
            for e, count in zip(settled, lengths, strict=True)
        ]
        parameters = Parameters(begun, tied, free, turned, poles if turned else measured, measured)
        problem = Problem(parameters, settled, nudgings, ModalTest(parameters, modes, linear), misfit, watch)
        end = problem.solve(parameters.vector(found), _FINE if turned else _ROUGH)
        found = parameters.model(end.vector)
        evaluations, iterations = evaluations + end.evaluations, iterations + end.iterations
        misfit = min(_MISFIT, problem.error(end.vector))
    return Fitted(found, start, problem, end, evaluations, iterations)
