"""Small nonlinear state-space systems and experiments with them."""

from dataclasses import replace

import numpy as np

from identification import Channel, Experiment, Features, PnlssModel, StateSpace
from vibrolock.arrays import Float


def channels(kind: str, count: int) -> tuple[Channel, ...]:
    return tuple(Channel(f"{kind}{index + 1}", "monitor", "V") for index in range(count))


def linear_system(states: int, inputs: int, outputs: int, seed: int = 0) -> PnlssModel:
    """Oscillators with 5 % damping, far from each other, seen and driven through random matrices."""
    rng = np.random.default_rng(seed)
    a = np.zeros((states, states))
    for first in range(0, states - 1, 2):
        pole = np.exp((-0.05 + 1j) * (0.3 + 0.25 * first))
        a[first : first + 2, first : first + 2] = [[pole.real, pole.imag], [-pole.imag, pole.real]]
    if states % 2:
        a[-1, -1] = 0.6
    matrices = StateSpace(
        a,
        0.3 * rng.normal(size=(states, inputs)),
        rng.normal(size=(outputs, states)),
        0.1 * rng.normal(size=(outputs, inputs)),
    )
    return PnlssModel.linear(
        matrices, sample_rate_hz=100.0, inputs=channels("u", inputs), outputs=channels("y", outputs), specimen="bench"
    )


def nonlinear_system(
    states: int,
    inputs: int,
    outputs: int,
    *,
    degrees: tuple[int, ...] = (2, 3),
    saturating: int = 0,
    seed: int = 0,
    function: str = "tanh",
) -> PnlssModel:
    """The same with polynomials in states and outputs, and functions of weighted sums in both, saturating or others."""
    rng = np.random.default_rng(seed + 100)
    monomials = Features.monomials(states, inputs, degrees)
    width = states + inputs + 1
    names = (function,) * saturating
    phi, chi = (replace(monomials, weights=rng.normal(size=(saturating, width)), functions=names) for _ in range(2))
    model = linear_system(states, inputs, outputs, seed).with_features(phi, chi)
    return replace(model, e=0.004 * rng.normal(size=model.e.shape), f=0.05 * rng.normal(size=model.f.shape))


def experiment(
    system: PnlssModel,
    samples: int,
    *,
    seed: int = 1,
    noise: float = 0.0,
    level: float = 0.5,
    begin: Float | None = None,
) -> Experiment:
    """A run of the system under noise, from rest or an initial state that is to be estimated; noise over the RMS of outputs."""
    rng = np.random.default_rng(seed)
    inputs = level * rng.normal(size=(len(system.inputs), samples))
    run = system.simulate(inputs, initial_state=begin)
    assert run.bounded
    scale = np.sqrt(np.mean(run.outputs**2, axis=1, keepdims=True))
    return Experiment(
        inputs=inputs,
        outputs=run.outputs + noise * scale * rng.normal(size=run.outputs.shape),
        sample_rate_hz=system.sample_rate_hz,
        input_channels=system.inputs,
        output_channels=system.outputs,
        initial_state="zero" if begin is None else "estimated",
        name=f"noise {seed}",
    )


def periodic_experiment(system: PnlssModel, period: int, *, seed: int = 1, level: float = 0.5) -> Experiment:
    """Two periods of a periodic run after two that let transients decay."""
    rng = np.random.default_rng(seed)
    inputs = np.tile(level * rng.normal(size=(len(system.inputs), period)), 4)
    return Experiment(
        inputs=inputs,
        outputs=system.simulate(inputs).outputs,
        sample_rate_hz=system.sample_rate_hz,
        input_channels=system.inputs,
        output_channels=system.outputs,
        counted_from=2 * period,
        period_samples=period,
        name=f"periodic {seed}",
    )


def disturbed(system: PnlssModel, share: float = 0.02, seed: int = 5) -> PnlssModel:
    """The linear part a little off, without nonlinear coefficients: a start."""
    rng = np.random.default_rng(seed)
    off = {
        name: getattr(system, name) * (1.0 + share * rng.normal(size=getattr(system, name).shape)) for name in "abcd"
    }
    return replace(system, **off, e=0.0 * system.e, f=0.0 * system.f)
