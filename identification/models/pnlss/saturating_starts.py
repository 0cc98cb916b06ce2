"""Starts for models with saturating features, whose weights no linear model determines.

The fit is not convex in the weights, and from random ones it ends some dB apart. Starts are therefore taken from what the
linear model leaves unexplained: of many random directions of states and inputs, those are chosen, one after the other, whose
features explain most of it (orthogonal matching pursuit: Pati, Rezaiifar and Krishnaprasad, Asilomar Conference, 1993). That is
regression, without a simulation. Several such starts are ranked by the error of one simulation each, and the best of them are
begun to fit (`identification.models.pnlss.compared_starts`).

What the linear model leaves is estimated as disturbances of its states: ``x(k+1) = A x + B u + w``, ``y = C x + D u + e`` with
small w and e explains the measured outputs by a Kalman filter in its steady state forward, a disturbance smoother back (Durbin
and Koopman, Time Series Analysis by State Space Methods, 2nd ed., 2012, Section 4.5). Where the structure is nonlinear, w is
what its nonlinearity does to the states, and can be compared with features sample by sample: the inference step of inference
and learning (Floren, Noel, Swevers, Mechanical Systems and Signal Processing, 2025).
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import scipy

from identification.errors import IdentificationError
from identification.experiments.experiment import Experiment
from identification.models.pnlss.features import Features, function_of
from identification.models.pnlss.kernels import Matrices, simulate, workspace
from identification.models.pnlss.model import PnlssModel
from vibrolock.arrays import Float

_NOISE_FLOOR = 1e-8
"""Smallest mean square of e, relative to that of the output."""
_SETTLING = 50
"""Samples at the end of a record that do not count: the smoother has no outputs after them."""


class Residual(NamedTuple):
    """Estimated states and what moves them beside the linear model, at the samples of all experiments that count."""

    variables: Float
    """float[n_states + n_inputs, n], states and inputs."""
    disturbance: Float
    """float[n_states, n], w."""
    misfit: Float
    """float[n_outputs, n], e."""
    weight: Float
    """float[n], weight of the experiment of each sample."""


def linear_residual(model: PnlssModel, experiments: Sequence[Experiment], mobility: float) -> Residual:
    """Return states, disturbances and misfits that explain the outputs of all experiments by a stable linear model.

    ``mobility``: mean square of w relative to that of the state, where that of e is what the linear model alone leaves of the
    outputs; a larger one explains more of the outputs by disturbances. Raises `IdentificationError` if the filter of this model
    does not exist.
    """
    runs = [model.simulate(e.inputs) for e in experiments]
    counted = [slice(e.counted_from, None) for e in experiments]
    left = np.hstack([e.outputs[:, at] - r.outputs[:, at] for e, r, at in zip(experiments, runs, counted, strict=True)])
    size = np.mean(np.hstack([e.counted_outputs for e in experiments]) ** 2, axis=1)
    noise = np.diag(np.maximum(np.mean(left**2, axis=1), _NOISE_FLOOR * size))
    states = np.hstack([r.states[:, at] for r, at in zip(runs, counted, strict=True)])
    moved = mobility * np.diag(np.mean(states**2, axis=1))
    try:
        spread = scipy.linalg.solve_discrete_are(model.a.T, model.c.T, moved, noise)
    except (np.linalg.LinAlgError, ValueError) as error:
        raise IdentificationError(f"its Kalman filter could not be computed ({error})", field="linear") from None
    parts = [_smoothed(model, e, moved, noise, np.asarray(spread, dtype=float)) for e in experiments]
    return Residual(*(np.concatenate(rows, axis=-1) for rows in zip(*parts, strict=True)))


def _smoothed(model: PnlssModel, experiment: Experiment, moved: Float, noise: Float, spread: Float) -> Residual:
    """Return the estimates for one experiment, given the mean squares of w, e and the error of the filter's state."""
    a, b, c, d = model.linear_part
    u, y = experiment.inputs, experiment.outputs
    innovation = c @ spread @ c.T + noise
    gain = np.linalg.solve(innovation, c @ spread @ a.T).T
    closed = a - gain @ c
    filtered = _states(closed, np.hstack([b - gain @ d, gain]), np.vstack([u, y]))
    pulled = c.T @ np.linalg.solve(innovation, y - c @ filtered - d @ u)
    # r(k) = pulled(k) + closed' r(k+1), zero after the end: the same recursion, with time reversed.
    after = _states(closed.T, np.eye(len(a)), pulled[:, ::-1])[:, ::-1]
    states = filtered + spread @ (pulled + closed.T @ after)
    end = max(u.shape[1] - _SETTLING, experiment.counted_from + 1)
    at = slice(experiment.counted_from, end)
    return Residual(
        np.vstack([states, u])[:, at],
        (moved @ after)[:, at],
        (y - c @ states - d @ u)[:, at],
        np.full(end - experiment.counted_from, experiment.weight),
    )


def _states(a: Float, b: Float, u: Float) -> Float:
    """float[n_states, n]: states of ``x(k+1) = a x + b u`` from rest."""
    n, m = b.shape
    none = Features.none(n, m).table
    nothing = np.zeros((0, 0))
    parts = a, b, np.zeros((n, 0)), np.zeros((0, n)), np.zeros((0, m)), nothing
    matrices = Matrices(*map(np.ascontiguousarray, parts))
    x, y = np.zeros((u.shape[1], n)), np.zeros((u.shape[1], 0))
    simulate(
        matrices, none, none, np.ascontiguousarray(u.T), np.zeros(n), np.full(n, np.inf), workspace(matrices), x, y
    )
    return np.asarray(x.T)


_MOBILITIES = (1e-2, 1e-1, 1e-3)
"""Of the disturbances; starts take turns."""
_PROPOSALS = 12  # random starts drawn at least, of which the best are fitted; chosen
_POOL = 300
"""Directions from which each start takes its features."""
_STEEP = (0.3, 1.0)
"""Range of the standard deviation of weights, for variables of RMS one: from nearly linear to saturated at peaks."""
_OFF_CENTRE = 0.3
"""Standard deviation of biases relative to that of weights. A feature far off the centre acts in few samples, and a fit can
drive it out of them all: it then fits these samples alone, and is wrong by far where other data reach there."""
_SAMPLES = 10_000
"""Most samples of the regression."""
_PENALTY = 1e-6
"""On squared coefficients, relative to the mean square of what they multiply."""
_SHRUNK = (1.0, 0.5, 0.25, 0.1, 0.03)
"""Shares of the regression's coefficients that are tried until a simulation is no worse than the linear model's."""


def saturating_starts(
    linear: PnlssModel,
    experiments: Sequence[Experiment],
    phi: Features,
    chi: Features,
    counts: tuple[int, int],
    random: np.random.Generator,
    wanted: int,
    function: str = "tanh",
) -> list[PnlssModel]:
    """Return ``wanted`` models with the features ``phi`` and ``chi`` and ``counts`` additional saturating ones, best first.

    ``function``: name of another function in place of tanh. Coefficients of the features ``phi`` and ``chi`` are zero. All
    starts are bounded under the inputs of the experiments.
    """
    residuals = _residuals(linear, experiments)
    found = []
    for number in range(max(_PROPOSALS, wanted)):
        start = _proposed(linear, residuals[number % len(residuals)], phi, chi, counts, random, function)
        found.append(_bounded(linear, start, experiments))
    return [model for _, model in sorted(found, key=lambda pair: pair[0])[:wanted]]


def _residuals(linear: PnlssModel, experiments: Sequence[Experiment]) -> list[Residual]:
    """Return the residuals of the linear model; where there is no filter, its own states and no residual."""
    found = []
    for mobility in _MOBILITIES:
        try:
            residual = linear_residual(linear, experiments, mobility)
        except IdentificationError:
            continue
        each = -(-residual.weight.size // _SAMPLES)
        found.append(Residual(*(part[..., ::each] for part in residual)))
    if found:
        return found
    runs = [linear.simulate(e.inputs) for e in experiments]
    states = np.hstack([run.states[:, e.counted_from :] for run, e in zip(runs, experiments, strict=True)])
    inputs = np.hstack([e.counted_inputs for e in experiments])
    left = [e.counted_outputs - run.outputs[:, e.counted_from :] for run, e in zip(runs, experiments, strict=True)]
    return [Residual(np.vstack([states, inputs]), np.zeros_like(states), np.hstack(left), np.ones(states.shape[1]))]


def _proposed(
    linear: PnlssModel,
    residual: Residual,
    phi: Features,
    chi: Features,
    counts: tuple[int, int],
    random: np.random.Generator,
    function: str,
) -> PnlssModel:
    n = linear.states
    size, of = _rms(residual.variables), function_of(function).of
    states = _regression(
        residual.variables / size[:, None], residual.disturbance, residual.weight, counts[0], random, of
    )
    outputs = _regression(residual.variables / size[:, None], residual.misfit, residual.weight, counts[1], random, of)
    grown = [
        own.with_functions(weights / np.append(size, 1.0), function)
        for own, (weights, _, _) in ((phi, states), (chi, outputs))
    ]
    start = linear.with_features(*grown)
    e, f = np.array(start.e), np.array(start.f)
    e[:, phi.count :], f[:, chi.count :] = states[2], outputs[2]
    to_states, to_outputs = states[1] / size, outputs[1] / size
    return replace(
        start,
        a=linear.a + to_states[:, :n],
        b=linear.b + to_states[:, n:],
        c=linear.c + to_outputs[:, :n],
        d=linear.d + to_outputs[:, n:],
        e=e,
        f=f,
    )


def _regression(
    v: Float, target: Float, weight: Float, count: int, random: np.random.Generator, of: Callable[[Float], Float]
) -> tuple[Float, Float, Float]:
    """Explain ``target`` (float[n_rows, n]) by variables ``v`` of RMS one and ``count`` features of them.

    Returns weights float[count, n_variables + 1], coefficients of the variables float[n_rows, n_variables], and of the features
    float[n_rows, count].
    """
    rows, n = target.shape
    if not count:
        return np.zeros((0, len(v) + 1)), np.zeros((rows, len(v))), np.zeros((rows, 0))
    pool = random.normal(size=(max(_POOL, 2 * count), len(v) + 1))
    pool[:, -1] *= _OFF_CENTRE
    pool *= np.exp(random.uniform(np.log(_STEEP[0]), np.log(_STEEP[1]), size=(len(pool), 1)))
    phi = of(pool[:, :-1] @ v + pool[:, -1:]) - of(pool[:, -1:])
    size = _rms(target)
    by = np.sqrt(weight / np.mean(weight))
    aim = target / size[:, None] * by
    chosen = _pursued(phi * by, v * by, aim, count)
    both = np.vstack([v, phi[chosen]])
    products = (both * by) @ (both * by).T
    found = np.linalg.solve(products + _PENALTY * n * np.eye(len(both)), (both * by) @ aim.T).T * size[:, None]
    return pool[chosen], found[:, : len(v)], found[:, len(v) :]


def _pursued(phi: Float, v: Float, aim: Float, count: int) -> list[int]:
    """Indices of the rows of ``phi`` that explain most of ``aim`` beside ``v`` and the rows chosen before."""
    base = np.linalg.qr(v.T)[0]
    free, left = phi - (phi @ base) @ base.T, aim - (aim @ base) @ base.T
    least = 1e-6 * np.sum(phi**2, axis=1)
    chosen: list[int] = []
    for _ in range(count):
        squares = np.sum(free**2, axis=1)
        gain = np.sum((free @ left.T) ** 2, axis=1) / np.maximum(squares, np.finfo(float).tiny)
        gain[squares <= least] = -1.0
        gain[chosen] = -np.inf
        chosen.append(int(np.argmax(gain)))
        along = free[chosen[-1]] / max(np.sqrt(squares[chosen[-1]]), np.finfo(float).tiny)
        left = left - np.outer(left @ along, along)
        free = free - np.outer(free @ along, along)
    return chosen


def _bounded(linear: PnlssModel, start: PnlssModel, experiments: Sequence[Experiment]) -> tuple[float, PnlssModel]:
    """Return the start with so much of its coefficients that it is no worse than the linear model, and its error."""
    limit = _error(linear, experiments)
    names = ("a", "b", "c", "d", "e", "f")
    found = start
    for share in _SHRUNK:
        moved = {name: share * getattr(start, name) for name in names[4:]}
        moved |= {
            name: getattr(linear, name) + share * (getattr(start, name) - getattr(linear, name)) for name in names[:4]
        }
        found = replace(start, **moved)
        error = _error(found, experiments)
        if error <= limit:
            return error, found
    return limit, replace(found, **{name: getattr(linear, name) for name in names[:4]})


def _error(model: PnlssModel, experiments: Sequence[Experiment]) -> float:
    """Weighted squared error of all outputs, each relative to its own squares; inf for an unbounded run."""
    squares = np.zeros((2, len(model.outputs)))
    for experiment in experiments:
        run = model.simulate(experiment.inputs)
        if not run.bounded:
            return float(np.inf)
        misfit = run.outputs[:, experiment.counted_from :] - experiment.counted_outputs
        with np.errstate(over="ignore"):
            squares += experiment.weight * np.array(
                [np.sum(part**2, axis=1) for part in (misfit, experiment.counted_outputs)]
            )
    return float(np.sum(squares[0] / squares[1]))


def _rms(rows: Float) -> Float:
    """RMS of each row; 1 where a row is zero."""
    found = np.sqrt(np.mean(rows**2, axis=1))
    return np.where(found > 0.0, found, 1.0)
