"""Discrete-time oscillators made by hand, and their simulation over whole periods."""

from math import comb
from typing import Any

import numpy as np
from scipy.linalg import expm

from identification import Channel, Exciter, Features, PnlssModel, SteadyStates
from vibrolock.arrays import Complex, Float

HZ, DAMPING, RATE_HZ = 25.0, 0.01, 3200.0
FORCE, VOLTAGE = Channel("force", "force", "N"), Channel("voltage", "monitor", "V")
ACCELERATION, VELOCITY = Channel("acc", "drive", "m/s2"), Channel("vel", "response", "m/s")
DISPLACEMENT = Channel("tip", "response", "m")


def level(value: float, held: str) -> dict[str, Any]:
    """Keywords that hold a level of the force, or of the voltage."""
    return {"voltage_v": value} if held == "voltage" else {"force_n": value, "force": held}


def oscillator(
    cubic: float = 5e7,
    quadratic: float = 0.0,
    *,
    hz: float = HZ,
    damping: float = DAMPING,
    rate_hz: float = RATE_HZ,
    largest_m: float = 0.01,
    parametric: float = 0.0,
) -> PnlssModel:
    """``x'' + 2 z w x' + w^2 x + q x^2 + c x^3 + p u x = u`` (1 kg), force and restoring force held for a sample.

    The nonlinear force is that at the middle of the sample, x + v T/2, to which its monomials are expanded.
    """
    w, step = 2 * np.pi * hz, 1.0 / rate_hz
    block = np.array([[0.0, 1.0, 0.0], [-(w**2), -2 * damping * w, 1.0], [0.0, 0.0, 0.0]])
    after = expm(block * step)
    exponents, now, middle = [], [], []
    for degree, factor in ((2, quadratic), (3, cubic)):
        for power in range(degree + 1):
            exponents.append([degree - power, power, 0])
            middle.append(-factor * comb(degree, power) * (0.5 * step) ** power)
            now.append(-factor if power == 0 else 0.0)
    exponents.append([1, 0, 1])
    now.append(-parametric)
    middle.append(-parametric)
    features = Features(variables=3, exponents=np.array(exponents))
    outputs = np.array([[-(w**2), -2 * damping * w], [0.0, 1.0], [1.0, 0.0]])
    return PnlssModel(
        a=after[:2, :2],
        b=after[:2, 2:],
        c=outputs,
        d=np.array([[1.0], [0.0], [0.0]]),
        e=after[:2, 2:] @ np.array([middle]),
        f=np.array([now, [0.0] * len(now), [0.0] * len(now)]),
        state_features=features,
        output_features=features,
        sample_rate_hz=rate_hz,
        inputs=(FORCE,),
        outputs=(ACCELERATION, VELOCITY, DISPLACEMENT),
        state_range=np.array([largest_m, w * largest_m]),
        input_range=np.array([10.0]),
    )


def saturating_oscillator(largest_m: float = 0.01) -> PnlssModel:
    """The linear oscillator with a spring that saturates, as hysteretic joints do, biased to one side."""
    linear = oscillator(0.0, largest_m=largest_m)
    features = Features.saturating([[400.0, 0.5, 0.0, 0.2]])
    springs = np.array([[-20.0]])
    return PnlssModel(
        **{name: getattr(linear, name) for name in ("a", "b", "c", "d", "sample_rate_hz", "inputs", "outputs")},
        e=linear.b @ springs,
        f=np.array([[-20.0], [0.0], [0.0]]),
        state_features=features,
        output_features=features,
        state_range=linear.state_range,
        input_range=linear.input_range,
    )


def driven_by_voltage(model: PnlssModel, newton_per_volt: float = 4.0, backwards: float = 30.0) -> PnlssModel:
    """The same behind a massless exciter, ``F = g V - b v``: the voltage drives, the force is the first output."""
    back = np.array([[0.0, -backwards]])
    force = np.hstack([back, np.zeros((1, 0))])
    return PnlssModel(
        a=model.a + model.b @ force,
        b=newton_per_volt * model.b,
        c=np.vstack([force, model.c + model.d @ force]),
        d=newton_per_volt * np.vstack([[[1.0]], model.d]),
        e=model.e,
        f=np.vstack([np.zeros((1, model.f.shape[1])), model.f]),
        state_features=model.state_features,
        output_features=model.output_features,
        sample_rate_hz=model.sample_rate_hz,
        inputs=(VOLTAGE,),
        outputs=(Channel("force", "force", "N"), *model.outputs),
        state_range=model.state_range,
        input_range=np.array([5.0]),
    )


def shaker() -> Exciter:
    """An exciter on a stinger, about a tenth of the oscillator's mass."""
    return Exciter(
        force_per_volt_n_v=4.0,
        coil_time_constant_s=3e-4,
        moving_mass_kg=0.1,
        suspension_damping_n_s_m=6.0,
        suspension_stiffness_n_m=4000.0,
        back_emf_damping_n_s_m=10.0,
        stinger_compliance_m_n=1e-6,
    )


def waveform(harmonics: Complex, phase_rad: Float) -> Float:
    """float[k, n]: ``Re sum Y_h exp(i h theta)`` of complex[H + 1, k]."""
    turns = np.exp(1j * np.arange(len(harmonics))[:, None] * phase_rad)
    return np.asarray(np.real(harmonics.T @ turns))


def phases(state: SteadyStates, point: int, count: int, rate_hz: float = RATE_HZ) -> Float:
    """float[count]: phase of the vibration at each sample."""
    return 2 * np.pi * state.frequency_hz[point] / rate_hz * np.arange(count)


def settled(model: PnlssModel, state: SteadyStates, periods: int, start: Float | None = None) -> tuple[Complex, Float]:
    """Outputs' harmonics in the last period of a long simulation under a state's inputs, and what remains to settle.

    A period must hold a whole number of samples.
    """
    samples = model.sample_rate_hz / state.frequency_hz[0]
    count = round(samples)
    assert abs(samples - count) < 1e-9
    inputs = waveform(state.inputs[0], phases(state, 0, periods * count, model.sample_rate_hz))
    run = model.simulate(inputs, initial_state=start)
    assert run.bounded
    last, before = run.outputs[:, -count:], run.outputs[:, -2 * count : -count]
    harmonics = 2.0 * np.fft.rfft(last, axis=1).T / count
    harmonics[0] *= 0.5
    return harmonics, np.max(np.abs(last - before), axis=1) / np.max(np.abs(last), axis=1)


def after_disturbance(model: PnlssModel, state: SteadyStates, point: int, periods: int, share: float = 1e-5) -> Float:
    """float[periods]: how far a simulation, begun so far beside a steady state, is from it in each period, over the start."""
    samples = model.sample_rate_hz / state.frequency_hz[point]
    theta = phases(state, point, int(periods * samples) + 1, model.sample_rate_hz)
    steady = waveform(state.states[point], theta)
    size = np.max(np.abs(steady), axis=1)
    beside = steady[:, 0] + share * size * np.array([1.0, 0.7])
    run = model.simulate(waveform(state.inputs[point], theta), initial_state=beside)
    away = np.max(np.abs(run.states - steady) / size[:, None], axis=0) / share
    return np.array([np.max(part) for part in np.array_split(away, periods)])
