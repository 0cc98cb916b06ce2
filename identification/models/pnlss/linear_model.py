"""Initial linear model of a nonlinear fit: identified from experiments, or given and checked.

The identification takes four steps: responses, subspace, weighted fit over frequency, states of variance one.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy

from identification.errors import IdentificationError
from identification.experiments.experiment import Experiment, excited_band, same_channels
from identification.linear.auto_regression import regressed_responses
from identification.linear.response_matrix import FrequencyResponseMatrix
from identification.linear.state_space_fit import StateSpaceFit, fit_state_space, spectral_radius
from identification.linear.subspace import StateSpace, subspace, telling_rows
from identification.models.pnlss.best_linear import best_linear_responses
from identification.models.pnlss.model import PnlssModel
from vibrolock.arrays import Float

_FIRST_ITERATIONS = 20
"""Number of iterations for every candidate; the fit continues with the best."""
_EDGE = 1.0 - 1e-6
"""Largest magnitude of an eigenvalue after reflection."""
_HARDLY = 2e-3  # contribution of a state that hardly counts, over the largest; chosen: true modes had 0.01 and more
_DEPENDENT = 1e-12
"""Relative variance of a combination of states below which the inputs do not excite it."""


def linear_start(responses: FrequencyResponseMatrix, states: int, *, sample_rate_hz: float) -> StateSpaceFit:
    """Fit a stable model with this number of states: the best of several fits that start from different subspace models.

    The subspace models differ in their number of block rows. Weights are relative. The covariance over realisations is not
    used, because it comes from nonlinear distortion that is common to all outputs. Its inverse puts most weight on
    combinations of outputs with little scatter, which a linear model of few states cannot represent, and the fit misses
    resonances of a nonlinear specimen (virtual magnet beam at 2.6 N: residual 0.94 instead of 0.08).

    The eigenvalues of an unstable subspace model are reflected at the unit circle first. Raises `IdentificationError` if
    there are too few lines, or lines too close together, for this number of states, or if no candidate is found.
    """
    IdentificationError.unless_at_least("states", states, 1)
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
        raise IdentificationError(
            f"{states} cannot be identified from these responses ({refused})", field="states", hint="ask for fewer"
        )
    return fit_state_space(responses, best.model, sample_rate_hz=sample_rate_hz, weighting="relative")


def _block_rows(responses: FrequencyResponseMatrix, states: int, sample_rate_hz: float) -> list[int]:
    lines, outputs, inputs = responses.value.shape
    z = np.exp(2j * np.pi * responses.frequency_hz / sample_rate_hz)
    fewest = -(-states // outputs) + 1
    told = telling_rows(z, 4 * states + 2)
    most = min(told, 2 * lines * inputs // (outputs + inputs))
    if most < fewest:
        low, high = responses.frequency_hz[[0, -1]]
        raise IdentificationError(
            f"{lines} lines in {low:g} to {high:g} Hz at {sample_rate_hz:g} Hz with {outputs} outputs tell "
            f"{max(most - 1, 0) * outputs} states at most; ask for fewer, excite a wider band or lower the "
            "sample rate",
            field="states",
            value=states,
        )
    wanted = {fewest, states + 1, states + 2, 2 * states, 3 * states, 4 * states}
    return sorted({int(np.clip(rows, fewest, most)) for rows in wanted})


def reflected(model: StateSpace) -> StateSpace:
    """Return the model with eigenvalues outside the unit circle reflected into it (1 / conj), frequencies unchanged."""
    if spectral_radius(model.a) < 1.0:
        return model
    values, vectors = np.linalg.eig(model.a)
    size = np.abs(values)
    inside = np.where(size < 1.0, values, values / np.maximum(size, 1e-300) * np.minimum(1.0 / size, _EDGE))
    return StateSpace(np.asarray(np.linalg.solve(vectors.T, (vectors * inside).T).T.real), *model[1:])


def with_independent_states(model: PnlssModel, experiments: Sequence[Experiment]) -> PnlssModel:
    """Transform a linear model to states of variance one that are uncorrelated under the inputs of the experiments.

    The remaining rotation makes the observability Gramian diagonal, largest first: the model is input-balanced for the actual
    inputs. Powers of such states are as independent as possible.
    """
    states = np.hstack([model.simulate(e.inputs).states[:, e.counted_from :] for e in experiments])
    variance, directions = np.linalg.eigh(states @ states.T / states.shape[1])
    if not variance[-1] > 0.0:
        raise IdentificationError("their inputs do not move the states of the linear model", field="experiments")
    root = directions * np.sqrt(np.maximum(variance, _DEPENDENT * variance[-1]))  # x = root x'
    gramian = root.T @ _observability(model, experiments) @ root
    root = root @ np.linalg.eigh(0.5 * (gramian + gramian.T))[1][:, ::-1]
    inverse = np.linalg.inv(root)
    return replace(model, a=inverse @ model.a @ root, b=inverse @ model.b, c=model.c @ root)


def _observability(model: PnlssModel, experiments: Sequence[Experiment]) -> Float:
    """Observability Gramian, with outputs scaled by their RMS."""
    weight = 1.0 / np.sqrt(np.mean(np.hstack([e.counted_outputs for e in experiments]) ** 2, axis=1))
    seen = (model.c * weight[:, None]).T @ (model.c * weight[:, None])
    return np.asarray(scipy.linalg.solve_discrete_lyapunov(model.a.T, seen))


def linear_pnlss(
    experiments: Sequence[Experiment],
    *,
    states: int,
    linear: StateSpace | PnlssModel | None = None,
    band_hz: tuple[float, float] | None = None,
) -> PnlssModel:
    """Return the initial linear model of a fit, with notes on its accuracy.

    Constant inputs are not part of the best linear approximation; the fit over time identifies their effect. Raised errors are
    those of `identify_pnlss`.

    Parameters
    ----------
    experiments
        The experiments that a fit would be trained with.
    states
        Number of states.
    linear
        A linear model to begin with, in place of one from the best linear approximation.
    band_hz
        Lowest and highest frequency that counts, Hz.
    """
    same_channels(experiments)
    first = experiments[0]
    if linear is not None:
        return _given(linear, first, states)
    varying = varying_inputs(experiments)
    moved = [
        replace(e, inputs=e.inputs[varying], input_channels=tuple(e.input_channels[i] for i in varying))
        for e in experiments
    ]
    if any(e.period_samples for e in moved):
        responses = best_linear_responses(moved, band_hz=band_hz)
    else:
        responses = _without_periods(moved, band_hz)
    found = linear_start(responses, states, sample_rate_hz=first.sample_rate_hz)
    low, high = responses.frequency_hz[[0, -1]]
    note = (
        f"linear start: misfit {100 * found.error.max():.2g} % of the responses at {responses.frequency_hz.size} lines in "
        f"{low:g} to {high:g} Hz, {found.weighting} weights"
    )
    model = PnlssModel.linear(
        found.model,
        sample_rate_hz=first.sample_rate_hz,
        inputs=moved[0].input_channels,
        outputs=first.output_channels,
        specimen=first.specimen,
        notes=(*responses.notes, note),
    )
    model = with_independent_states(model, moved)
    seen = np.diag(_observability(model, moved))
    hardly = int(np.count_nonzero(seen < _HARDLY**2 * np.max(seen)))
    more = (
        f"states: {hardly} of {states} hardly affect the outputs of the linear model; {states - hardly} may be enough"
    )
    m = len(first.input_channels)
    b, d = np.zeros((states, m)), np.zeros((len(first.output_channels), m))
    b[:, varying], d[:, varying] = model.b, model.d
    return PnlssModel.linear(
        StateSpace(np.array(model.a), b, np.array(model.c), d),
        sample_rate_hz=model.sample_rate_hz,
        inputs=first.input_channels,
        outputs=model.outputs,
        specimen=model.specimen,
        notes=(*model.notes, more) if hardly else model.notes,
    )


def _without_periods(experiments: Sequence[Experiment], band_hz: tuple[float, float] | None) -> FrequencyResponseMatrix:
    first = experiments[0]
    return regressed_responses(
        [(e.inputs[:, e.counted_from :], e.counted_outputs) for e in experiments],
        sample_rate_hz=first.sample_rate_hz,
        inputs=first.input_channels,
        outputs=first.output_channels,
        band_hz=band_hz or excited_band(experiments),
        weights=[e.weight for e in experiments],
        specimen=first.specimen,
    )


def varying_inputs(experiments: Sequence[Experiment]) -> list[int]:
    """Return the indices of the inputs that are not constant; all if all are constant, which a later check refuses."""
    low, high = (f([f(e.inputs, axis=1) for e in experiments], axis=0) for f in (np.min, np.max))
    return [int(i) for i in np.flatnonzero(low < high)] or list(range(low.size))


def _given(linear: StateSpace | PnlssModel, first: Experiment, states: int) -> PnlssModel:
    matrices = linear.linear_part if isinstance(linear, PnlssModel) else linear
    n, m, outputs = states, len(first.input_channels), len(first.output_channels)
    for name, part, shape in zip("abcd", matrices, ((n, n), (n, m), (outputs, n), (outputs, m)), strict=True):
        if np.shape(part) != shape:
            raise IdentificationError(f"{name} has shape {np.shape(part)}", field="linear", allowed=f"{shape}")
    if isinstance(linear, PnlssModel) and abs(linear.sample_rate_hz / first.sample_rate_hz - 1.0) > 1e-9:
        raise IdentificationError(
            f"is of {linear.sample_rate_hz:g} Hz, the experiments of {first.sample_rate_hz:g} Hz", field="linear"
        )
    if (radius := spectral_radius(matrices.a)) >= 1.0:
        raise IdentificationError(
            f"has an eigenvalue of magnitude {radius:.6g}", field="linear", allowed="below 1 (stable)"
        )
    return PnlssModel.linear(
        matrices,
        sample_rate_hz=first.sample_rate_hz,
        inputs=first.input_channels,
        outputs=first.output_channels,
        specimen=first.specimen,
        notes=linear.notes if isinstance(linear, PnlssModel) else (),
    )
