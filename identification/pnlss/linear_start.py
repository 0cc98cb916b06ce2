"""The linear model that the fit of a nonlinear one begins from: responses, subspace, weighted fit, well-chosen states."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_lyapunov

from identification.errors import IdentificationError
from identification.linear.response_matrix import FrequencyResponseMatrix
from identification.linear.state_space_fit import StateSpaceFit, fit_state_space, spectral_radius
from identification.linear.subspace import StateSpace, subspace, telling_rows
from identification.pnlss.experiment import Experiment
from identification.pnlss.model import PnlssModel

__all__ = ["hardly_seen_states", "linear_start", "reflected", "with_independent_states"]

Float = NDArray[np.float64]

_FIRST_ITERATIONS = 20
"""Of every candidate; the best goes on from there."""
_EDGE = 1.0 - 1e-6
"""Largest magnitude of an eigenvalue after reflection."""
_HARDLY = 2e-3
_DEPENDENT = 1e-12
"""Variance of a combination of states, relative to the largest, below which the inputs do not move it."""


def linear_start(responses: FrequencyResponseMatrix, states: int, *, sample_rate_hz: float) -> StateSpaceFit:
    """Stable model of so many states: subspace with several numbers of block rows, each fitted, the best of them.

    Weights are relative. The covariance over realisations is that of nonlinear distortion, which outputs have in common: where
    it says that two outputs always go together, it weights what a linear model of few states cannot follow by its inverse,
    and resonances of a nonlinear specimen are lost (virtual magnet beam at 2.6 N: misfit 0.94 against 0.08).

    An unstable subspace model has its eigenvalues reflected at the unit circle first. Raises `IdentificationError` where the
    lines are too few or too near to each other for so many states, or no candidate comes of it.
    """
    if states < 1:
        raise IdentificationError(f"states: is {states}, needs at least 1")
    best: StateSpaceFit | None = None
    refused = ""
    for rows in _block_rows(responses, states, sample_rate_hz):
        try:
            begin = reflected(subspace(responses, states, sample_rate_hz=sample_rate_hz, block_rows=rows))
            found = fit_state_space(
                responses, begin, sample_rate_hz=sample_rate_hz, weighting="relative", iterations=_FIRST_ITERATIONS
            )
        except (IdentificationError, np.linalg.LinAlgError) as error:
            refused = str(error)
            continue
        if best is None or found.cost[-1] < best.cost[-1]:
            best = found
    if best is None:
        raise IdentificationError(f"states: {states} cannot be had of these responses ({refused}); ask for fewer")
    return fit_state_space(responses, best.model, sample_rate_hz=sample_rate_hz, weighting="relative")


def _block_rows(responses: FrequencyResponseMatrix, states: int, sample_rate_hz: float) -> list[int]:
    """Numbers of block rows to try, from the fewest that so many states need to the most that the lines tell apart."""
    lines, outputs, inputs = responses.value.shape
    z = np.exp(2j * np.pi * responses.frequency_hz / sample_rate_hz)
    fewest = -(-states // outputs) + 1
    told = telling_rows(z, 4 * states + 2)
    most = min(told, 2 * lines * inputs // (outputs + inputs))
    if most < fewest:
        low, high = responses.frequency_hz[[0, -1]]
        raise IdentificationError(
            f"states: is {states}, but {lines} lines in {low:g} to {high:g} Hz at {sample_rate_hz:g} Hz with {outputs} "
            f"outputs tell {max(most - 1, 0) * outputs} states at most; ask for fewer, excite a wider band or lower the "
            "sample rate"
        )
    wanted = {fewest, states + 1, states + 2, 2 * states, 3 * states, 4 * states}
    return sorted({int(np.clip(rows, fewest, most)) for rows in wanted})


def reflected(model: StateSpace) -> StateSpace:
    """The same with eigenvalues outside the unit circle reflected into it (1 / conj), frequencies unchanged."""
    if spectral_radius(model.a) < 1.0:
        return model
    values, vectors = np.linalg.eig(model.a)
    size = np.abs(values)
    inside = np.where(size < 1.0, values, values / np.maximum(size, 1e-300) * np.minimum(1.0 / size, _EDGE))
    return StateSpace(np.asarray(np.linalg.solve(vectors.T, (vectors * inside).T).T.real), *model[1:])


def with_independent_states(model: PnlssModel, experiments: Sequence[Experiment]) -> PnlssModel:
    """A linear model in states of variance one, uncorrelated under the inputs of the experiments.

    What freedom is left, a rotation, makes the observability Gramian diagonal, largest first: input-balanced for the inputs
    as they are. Powers of such states depend on each other as little as they can.
    """
    states = np.hstack([model.simulate(e.inputs).states[:, e.counted_from :] for e in experiments])
    variance, directions = np.linalg.eigh(states @ states.T / states.shape[1])
    if not variance[-1] > 0.0:
        raise IdentificationError("experiments: their inputs do not move the states of the linear model")
    root = directions * np.sqrt(np.maximum(variance, _DEPENDENT * variance[-1]))  # x = root x'
    gramian = root.T @ _observability(model, experiments) @ root
    root = root @ np.linalg.eigh(0.5 * (gramian + gramian.T))[1][:, ::-1]
    inverse = np.linalg.inv(root)
    return PnlssModel.linear(
        StateSpace(inverse @ model.a @ root, inverse @ model.b, model.c @ root, np.array(model.d)),
        sample_rate_hz=model.sample_rate_hz,
        inputs=model.inputs,
        outputs=model.outputs,
        specimen=model.specimen,
        notes=model.notes,
    )


def hardly_seen_states(model: PnlssModel, experiments: Sequence[Experiment]) -> int:
    """How many of the states (`with_independent_states`) show in outputs with less than 0.002 of what the first does.

    They follow noise or a misfit: states of measured structures beyond the first mode showed with 0.01 and more.
    """
    seen = np.diag(_observability(model, experiments))
    return int(np.count_nonzero(seen < _HARDLY**2 * np.max(seen)))


def _observability(model: PnlssModel, experiments: Sequence[Experiment]) -> Float:
    """Observability Gramian, outputs over their RMS."""
    weight = 1.0 / np.sqrt(np.mean(np.hstack([e.counted_outputs for e in experiments]) ** 2, axis=1))
    seen = (model.c * weight[:, None]).T @ (model.c * weight[:, None])
    return np.asarray(solve_discrete_lyapunov(model.a.T, seen))
