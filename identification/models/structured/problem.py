"""The least-squares problem of a structured model in the time domain: residuals of experiments, and what a modal test says."""

import math
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from identification.errors import IdentificationError
from identification.experiments.experiment import Experiment
from identification.fitting.bounded_steps import bounded_minimum, qr_r
from identification.fitting.levenberg_marquardt import Minimum
from identification.fitting.result import FitStatus
from identification.fitting.threads import threads
from identification.linear.modes import LinearModes
from identification.models.structured.elements import at_rest
from identification.models.structured.model import StructuredModel
from identification.models.structured.nudging import Nudging
from identification.models.structured.parameters import Parameters
from identification.models.structured.progress import FitWatch
from identification.models.structured.transients import own_change, transient_factor
from vibrolock.arrays import Float

EVALUATIONS = 100
"""Simulations with derivatives at most. Chosen: fits of the benchmarks end after some ten."""

_FREQUENCY_STD, _DAMPING_STD, _SHAPE_STD, _RESIDUAL_STD = 1e-3, 0.1, 0.02, 0.3
"""What a modal test is trusted to: relative errors that are added to its own, and those of the residual mode."""
_UNSEEN = 0.01
"""Share of a number in what the data do not show above which they do not tell it. Chosen."""
_STEP = 1e-6
"""Step of the differences, of logarithms and relative to shapes; so large is their error."""


class ModalTest:
    """Frequencies, damping ratios and shapes of a modal test, which a model has to have in small vibrations.

    In a modal test sliders stick and springs have their slope at rest. What is compared are therefore the modes of
    `StructuredModel.linearised`, with the damping that couples them left out. The last mode is the residual of the modes above,
    of which little is known. Not modelled: a modal test at a level at which joints slip.

    ``linear``: the model of the test, without elements.
    """

    def __init__(self, parameters: Parameters, modes: LinearModes, linear: StructuredModel) -> None:
        self._parameters = parameters
        self._outputs = [o for o in range(len(linear.outputs)) if o not in parameters.tied]
        self._expected = self._seen(linear)
        count, measured = len(linear.frequency_hz), len(modes.frequency_hz)
        frequency, damping = np.full(count, _RESIDUAL_STD), np.ones(count)
        frequency[:measured] = np.hypot(modes.frequency_std_hz / modes.frequency_hz, _FREQUENCY_STD)
        damping[:measured] = np.hypot(modes.damping_ratio_std / modes.damping_ratio, _DAMPING_STD)
        largest = np.max(np.abs(linear.output_shapes), axis=0)
        shapes = np.where(np.arange(count) < measured, _SHAPE_STD, _RESIDUAL_STD) * largest
        rows = len(linear.inputs) + len(self._outputs)
        self.std = np.concatenate([frequency, damping, *[shapes] * rows])
        """Standard deviations of logarithms of frequencies and damping ratios, and of shapes."""

    def rows(self, vector: Float) -> Float:
        """float[n, P + 1]: derivatives and residuals, each over its standard deviation."""
        here, columns = self._seen(self._parameters.model(vector)), []
        for number, step in enumerate(_STEP * np.maximum(np.abs(vector), 1.0)):
            moved = vector.copy()
            moved[number] += step  # up, for some numbers go no further down
            columns.append((self._seen(self._parameters.model(moved)) - here) / step)
        return np.asarray(np.column_stack([np.array(columns).T, here - self._expected]) / self.std[:, None])

    def left(self, vector: Float) -> Float:
        """Return the residuals alone."""
        return np.asarray((self._seen(self._parameters.model(vector)) - self._expected) / self.std)

    def _seen(self, model: StructuredModel) -> Float:
        stiffness, damping = at_rest(model.omega, model.damping_ratio, model.elements)
        squares, shapes = np.linalg.eigh(stiffness)
        shapes = shapes * np.where(np.diag(shapes) < 0.0, -1.0, 1.0)
        omega = np.sqrt(np.maximum(squares, 1e-6 * squares[-1]))
        ratio = np.einsum("ij,ik,kj->j", shapes, damping, shapes) / (2.0 * omega)
        inputs, outputs = model.input_shapes.T @ shapes, model.output_shapes[self._outputs] @ shapes
        return np.concatenate([np.log(omega), np.log(ratio), inputs.ravel(), outputs.ravel()])


class Problem:
    """Least-squares problem that is kept as small as its parameters.

    With the QR decomposition ``[J r] = Q T`` of derivatives J and residuals r, the columns of the triangle T have the norms and
    scalar products of the samples, and give the same steps.
    """

    def __init__(
        self,
        parameters: Parameters,
        experiments: Sequence[Experiment],
        nudgings: Sequence[Nudging | None],
        test: ModalTest,
        misfit: float,
        watch: FitWatch,
    ) -> None:
        self.parameters, self.experiments, self.nudgings = parameters, experiments, nudgings
        self._test, self._misfit, self._watch = test, misfit, watch
        outputs = np.concatenate([experiment.counted_outputs for experiment in experiments], axis=1)
        self.count = outputs.size
        self._scale = np.sqrt(np.mean(outputs**2, axis=1))
        for channel, size in zip(experiments[0].output_channels, self._scale, strict=True):
            if not size > 0.0:
                raise IdentificationError(
                    f"output '{channel.name}': is zero throughout the training data; leave it out"
                )
        self._left: dict[bytes, float] = {}
        """Sums of squares of the samples at all vectors that were asked for."""

    def error(self, vector: Float) -> float:
        """RMS of the residual over that of the outputs."""
        if vector.tobytes() not in self._left:
            self._cost(vector)
        return float(np.sqrt(self._left[vector.tobytes()] / self.count))

    def triangle(self, vector: Float) -> Float:
        """float[P + 1, P + 1]: triangle of derivatives and residuals of experiments and of what is expected."""
        began_s = time.perf_counter()
        parts, tested = self._rows(self._of_one, vector)
        found = qr_r(np.concatenate([*parts, self._misfit * tested]))
        error = math.sqrt(sum(float(part[:, -1] @ part[:, -1]) for part in parts) / self.count)
        self._watch.linearised(error, time.perf_counter() - began_s)
        return found

    def uncertainty(self, vector: Float) -> tuple[Float, float, NDArray[np.bool_], float]:
        """Return the covariance, the share of the steps' errors that no change makes up for, what is unseen, and a transient.

        Unseen, bool[P], are numbers on which the data do not depend, or only together with others.
        The covariance is float[P, P], as if the residual of each experiment were white, with a size of its own.
        The estimate of White (Econometrica 48, 1980, 817) with one variance for each experiment; and what the steps of the
        simulation move, to first order, as one error that all numbers share. Errors of outputs fall with the square of the
        step, so that a run with half of it tells them (Richardson). Likewise what is left of a transient in each experiment,
        where the change of its periods exceeds their noise (`transient_factor`), and that noise. The transient is the largest
        change over the RMS of the outputs of its experiment, 0 if none stands out.
        """
        whole_parts, tested = self._rows(self._with_finer, vector)
        changes = [part[: part.shape[1], -3] for part in whole_parts]
        parts = [np.delete(part, -3, axis=1) for part in whole_parts]
        tested = self._misfit * np.insert(tested, -1, 0.0, axis=1)
        rows = np.concatenate([*parts, tested])
        inverse, unseen = _inverse(rows[:, :-2])
        freedom = max(1.0 - vector.size / self.count, 0.5)
        told = self.error(vector) * tested[:, :-2]
        middle = told.T @ told
        for part, one in zip(parts, self.experiments, strict=True):
            variance = float(part[:, -1] @ part[:, -1]) / one.counted_outputs.size
            middle = middle + variance * part[:, :-2].T @ part[:, :-2]
        of_steps = inverse @ (rows[:, :-2].T @ rows[:, -2])
        covariance = np.asarray(inverse @ middle @ inverse / freedom) + np.outer(of_steps, of_steps)
        transient, slowest = 0.0, self._slowest_1_s(vector)
        for part, change, one in zip(parts, changes, self.experiments, strict=True):
            factor = transient_factor(part, change, one, slowest)
            if factor > 0.0:
                shift = factor * (inverse @ (part[:, :-2].T @ change))
                assert one.period_change is not None
                variance = (one.period_change.periods - 1) * float(part[:, -1] @ part[:, -1]) / one.counted_outputs.size
                by_noise = factor**2 * variance * inverse @ (part[:, :-2].T @ part[:, :-2]) @ inverse
                covariance = covariance + np.outer(shift, shift) + by_noise
                transient = max(transient, self._share(change, one))
        column = qr_r(rows[:, :-1])[:, -1]
        whole = float(np.linalg.norm(column))
        left = float(abs(column[vector.size]) / whole) if whole > 0.0 and column.size > vector.size else 1.0
        return covariance, left, unseen, transient

    def _slowest_1_s(self, vector: Float) -> float:
        """Rate of the slowest decay of the model's modes in small vibrations."""
        model = self.parameters.model(vector)
        return float(np.min(model.omega * model.damping_ratio))

    def _share(self, change: Float, one: Experiment) -> float:
        scaled = one.counted_outputs / self._scale[:, None]
        return float(np.linalg.norm(change) / np.linalg.norm(np.sqrt(one.weight) * scaled))

    def _rows(self, of_one: Callable[..., Float], vector: Float) -> tuple[list[Float], Float]:
        """Return what ``of_one`` gives for each experiment, and the rows of the modal test."""
        model = self.parameters.model(vector)
        with threads() as count, ThreadPoolExecutor(count) as pool:
            parts = pool.map(partial(of_one, model), self.experiments, self.nudgings)
            tested = self._test.rows(vector)  # meanwhile: compiled runs leave the interpreter free
            return list(parts), tested

    def _with_finer(self, model: StructuredModel, experiment: Experiment, nudging: Nudging | None) -> Float:
        """float[P + 3, P + 3]: as `_of_one`, with the change of the periods and the errors by the steps as well."""
        finer = None if nudging is None else replace(nudging, steps=2 * nudging.steps)
        fine = self.parameters.outputs(
            replace(model, steps=2 * model.steps), experiment.inputs, experiment.counted_from, finer
        )
        return self._of_one(model, experiment, nudging, fine)

    def _of_one(
        self, model: StructuredModel, experiment: Experiment, nudging: Nudging | None, fine: Float | None = None
    ) -> Float:
        weight = np.sqrt(experiment.weight) / self._scale
        found, derivatives = self.parameters.derivatives(model, experiment.inputs, experiment.counted_from, nudging)
        of_steps = (
            [] if fine is None else [own_change(experiment, found)[..., None], 4.0 / 3.0 * (found - fine)[..., None]]
        )
        residual = (found - experiment.counted_outputs.T)[..., None]
        both = np.concatenate([derivatives, *of_steps, residual], axis=2) * weight[:, None]
        return qr_r(both.reshape(-1, both.shape[2]))

    def _cost(self, vector: Float) -> float:
        model = self.parameters.model(vector)

        def squares(experiment: Experiment, nudging: Nudging | None) -> float:
            weight = np.sqrt(experiment.weight) / self._scale
            found = self.parameters.outputs(model, experiment.inputs, experiment.counted_from, nudging)
            return float(np.sum(((found - experiment.counted_outputs.T) * weight) ** 2))

        with threads() as count, ThreadPoolExecutor(count) as pool:
            left = sum(pool.map(squares, self.experiments, self.nudgings))
        self._left[vector.tobytes()] = left
        return left + float(np.sum((self._misfit * self._test.left(vector)) ** 2))

    def solve(self, vector: Float, tolerance: float, evaluations: int = EVALUATIONS) -> Minimum:
        """Return the minimum; iterations end when one gains and promises less than ``tolerance`` of the cost."""
        bounds = self.parameters.bounds(vector)
        found = bounded_minimum(self.triangle, self._cost, vector, bounds, tolerance, evaluations)
        if found.ending.status is FitStatus.INTERRUPTED:
            raise KeyboardInterrupt
        return found


def _inverse(rows: Float) -> tuple[Float, NDArray[np.bool_]]:
    """Return the inverse of ``rows.T @ rows``, float[P, P], without what no row shows, and bool[P], the numbers in that.

    Columns are taken relative to their norms: a number in large units, such as a stiffness, has small derivatives. Singular
    values of the rows reach as far as rounding does, which eigenvalues of their products do to its root only.
    """
    norms = np.linalg.norm(rows, axis=0)
    scale = np.where(norms > 0.0, norms, 1.0)
    _, values, axes = np.linalg.svd(rows / scale, full_matrices=False)
    kept = axes[values > max(rows.shape) * np.finfo(float).eps * values[0]]
    over = kept / values[: kept.shape[0], None]
    return np.asarray(over.T @ over / np.outer(scale, scale)), 1.0 - np.sum(kept**2, axis=0) > _UNSEEN
