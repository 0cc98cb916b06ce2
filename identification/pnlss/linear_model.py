"""The linear model that a nonlinear one begins with: from experiments, or given and checked."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identification.errors import IdentificationError
from identification.linear.state_space_fit import spectral_radius
from identification.linear.subspace import StateSpace
from identification.pnlss.best_linear import best_linear_responses
from identification.pnlss.experiment import Experiment
from identification.pnlss.experiment_groups import same_channels
from identification.pnlss.linear_start import hardly_seen_states, linear_start, with_independent_states
from identification.pnlss.model import PnlssModel

__all__ = ["linear_pnlss", "varying_inputs"]


def linear_pnlss(
    experiments: Sequence[Experiment],
    *,
    states: int,
    linear: StateSpace | PnlssModel | None = None,
    band_hz: tuple[float, float] | None = None,
) -> PnlssModel:
    """The linear model that a fit begins from, with notes on how near it comes.

    Inputs that are constant take no part in the best linear approximation; the fit over time finds what they do. Parameters and
    errors are those of `identify_pnlss`.
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
    responses = best_linear_responses(moved, band_hz=band_hz)
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
    hardly = hardly_seen_states(model, moved)
    more = f"states: {hardly} of {states} hardly move the outputs of the linear model; {states - hardly} may do"
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


def varying_inputs(experiments: Sequence[Experiment]) -> list[int]:
    """Numbers of the inputs that are not constant; all if none is, for what is wrong then is said elsewhere."""
    low, high = (f([f(e.inputs, axis=1) for e in experiments], axis=0) for f in (np.min, np.max))
    return [int(i) for i in np.flatnonzero(low < high)] or list(range(low.size))


def _given(linear: StateSpace | PnlssModel, first: Experiment, states: int) -> PnlssModel:
    """A linear model from outside, checked."""
    matrices = linear.linear_part if isinstance(linear, PnlssModel) else linear
    n, m, outputs = states, len(first.input_channels), len(first.output_channels)
    for name, part, shape in zip("abcd", matrices, ((n, n), (n, m), (outputs, n), (outputs, m)), strict=True):
        if np.shape(part) != shape:
            raise IdentificationError(f"linear: {name} has shape {np.shape(part)}, needs {shape}")
    if isinstance(linear, PnlssModel) and abs(linear.sample_rate_hz / first.sample_rate_hz - 1.0) > 1e-9:
        raise IdentificationError(
            f"linear: is of {linear.sample_rate_hz:g} Hz, the experiments of {first.sample_rate_hz:g} Hz"
        )
    if (radius := spectral_radius(matrices.a)) >= 1.0:
        raise IdentificationError(f"linear: has an eigenvalue of magnitude {radius:.6g}, allowed is below 1 (stable)")
    return PnlssModel.linear(
        matrices,
        sample_rate_hz=first.sample_rate_hz,
        inputs=first.input_channels,
        outputs=first.output_channels,
        specimen=first.specimen,
        notes=linear.notes if isinstance(linear, PnlssModel) else (),
    )
