"""Models simulated with an exciter, against harmonic balance and against a model that has the exciter inside."""

from dataclasses import replace

import numpy as np
import pytest

from identification import (
    Exciter,
    IdentificationError,
    PnlssModel,
    SteadyStates,
    coupled_run,
    harmonic_response,
    steady_state,
)
from identification.exciter_coupling.exciter import VoltagePath
from tests.identification.models.pnlss.steady.oscillators import driven_by_voltage, oscillator, shaker
from tests.refused import refused
from vibrolock.arrays import Float

RATE_HZ, VOLTAGE_V, LOWEST_HZ = 800.0, 0.25, 10.0
PERIODS, HARMONICS = 300, 11
"""Held at each frequency, of which the last fifth is compared, in so many harmonics."""


def light_shaker() -> Exciter:
    """Light and little damped, so that the response to a constant voltage still has folds."""
    return replace(shaker(), suspension_damping_n_s_m=0.4, back_emf_damping_n_s_m=0.4, moving_mass_kg=0.02)


def stairs(model: PnlssModel, frequency_hz: list[float]) -> Float:
    """Fundamentals of the drive point and the force, float[2, n], at frequencies held one after the other."""
    counts = [round(PERIODS * RATE_HZ / hz) for hz in frequency_hz]
    theta = 2 * np.pi / RATE_HZ * np.cumsum(np.repeat(frequency_hz, counts))
    run = coupled_run(model, light_shaker(), VOLTAGE_V * np.cos(theta), lowest_hz=LOWEST_HZ)
    assert run.bounded
    assert run.change < 1e-6
    found = []
    for count, end in zip(counts, np.cumsum(counts), strict=True):
        rows = slice(end - count // 5, end)
        turns = np.arange(HARMONICS + 1)[:, None] * theta[rows]
        basis = np.concatenate([np.cos(turns), np.sin(turns[1:])])
        fitted = np.linalg.lstsq(basis.T, np.array([run.outputs[0, rows], run.force_n[rows]]).T, rcond=None)[0]
        found.append(np.hypot(fitted[1], fitted[HARMONICS + 1]))
    return np.array(found).T


def one_of(points: SteadyStates, k: int) -> SteadyStates:
    arrays = {name: value[k : k + 1] for name, value in vars(points).items() if isinstance(value, np.ndarray)}
    return replace(points, **arrays, loss=points.loss[k : k + 1])


def balanced(model: PnlssModel, curve: SteadyStates, frequency_hz: list[float], upper: int) -> Float:
    """The same by harmonic balance: the first ``upper`` are the larger stable vibrations there, the others the smaller."""
    found, size = [], np.abs(curve.outputs[:, 1, 0])
    for k, hz in enumerate(frequency_hz):
        crossed = np.diff(curve.frequency_hz > hz)
        beside = np.flatnonzero(crossed & curve.stable[1:] & curve.stable[:-1])
        chosen = beside[np.argmax(size[beside]) if k < upper else np.argmin(size[beside])]
        at = steady_state(
            model,
            hz,
            voltage_v=VOLTAGE_V,
            exciter=light_shaker(),
            harmonics=HARMONICS,
            near=one_of(curve, int(chosen)),
            largest_range_use=3.0,
        )
        assert at.stable[0]
        found.append(np.abs([at.outputs[0, 1, 0], at.force_n[0, 1]]))
    return np.array(found).T


def test_a_run_settles_on_the_harmonic_balance_of_the_pair_up_to_its_folds() -> None:
    model = oscillator(6e8, 1e6, rate_hz=RATE_HZ, parametric=200.0)
    curve = harmonic_response(
        model, voltage_v=VOLTAGE_V, exciter=light_shaker(), harmonics=HARMONICS, largest_range_use=3.0
    )
    lower_hz, upper_hz = np.sort(curve.folds.frequency_hz)
    rising = [25.0, 26.0, 27.0, 27.6, 28.0, 28.1, upper_hz - 0.02, upper_hz + 0.05]
    falling = [28.7, 28.3, 27.8, 27.4, lower_hz + 0.02, lower_hz - 0.05, 26.5]
    for frequencies, upper, jump in ((rising, 7, 7), (falling, 0, 5)):
        settled, exact = stairs(model, frequencies), balanced(model, curve.points, frequencies, upper)
        np.testing.assert_allclose(settled, exact, rtol=1e-3)  # the one after the jump has not quite settled
        np.testing.assert_allclose(np.delete(settled, jump, 1), np.delete(exact, jump, 1), rtol=1e-4)
        ratio = settled[0, jump] / settled[0, jump - 1]
        assert max(ratio, 1.0 / ratio) > 1.5


def noise(samples: int) -> Float:
    """Half of it noise below a third of the Nyquist frequency, half zero."""
    lines = np.zeros(samples // 2 + 1, dtype=complex)
    inside = slice(samples // 200, samples // 6)
    lines[inside] = np.exp(2j * np.pi * np.random.default_rng(3).random(lines[inside].size))
    values = np.fft.irfft(lines, samples)
    values /= np.std(values)
    values[samples // 2 :] = 0.0
    return values


def assert_near(found: Float, exact: Float, share: float) -> None:
    size = np.abs(exact).max(axis=1)[:, None]
    np.testing.assert_allclose(found / size, exact / size, atol=share)


def test_any_voltage_makes_the_force_of_a_model_with_the_exciter_inside() -> None:
    """A massless exciter on a velocity is a factor, and what was fitted to a model with it inside is known exactly."""
    inner = oscillator(6e8, 1e6)
    acceleration, velocity, tip = inner.outputs
    model = replace(inner, outputs=(replace(acceleration, role="response"), replace(velocity, role="drive"), tip))
    massless = Exciter(
        force_per_volt_n_v=4.0,
        coil_time_constant_s=0.0,
        moving_mass_kg=0.0,
        suspension_damping_n_s_m=30.0,
        suspension_stiffness_n_m=0.0,
        back_emf_damping_n_s_m=0.0,
    )
    voltage = 0.5 * noise(16000)
    found = coupled_run(model, massless, voltage, lowest_hz=10.0)
    inside = driven_by_voltage(inner).simulate(voltage[None])
    assert_near(np.vstack([found.force_n, found.outputs]), inside.outputs, 1e-3)


def test_the_path_of_the_voltage_delays_it() -> None:
    model, voltage = oscillator(6e8, rate_hz=RATE_HZ), 0.2 * noise(8000)
    late = replace(light_shaker(), path=VoltagePath(delay_s=3.0 / RATE_HZ))
    found = coupled_run(model, late, voltage, lowest_hz=LOWEST_HZ)
    shifted = coupled_run(model, light_shaker(), np.roll(voltage, 3), lowest_hz=LOWEST_HZ)
    assert_near(found.outputs, shifted.outputs, 1e-4)


def test_an_unbounded_run_ends_and_says_where() -> None:
    escaping = oscillator(-6e8, rate_hz=RATE_HZ)
    theta = 2 * np.pi * 24.0 / RATE_HZ * np.arange(8000)
    found = coupled_run(escaping, light_shaker(), 40.0 * np.cos(theta), lowest_hz=LOWEST_HZ)
    assert found.unbounded_at is not None
    assert 0 < found.unbounded_at < 8000
    for values in (found.outputs[0], found.force_n, found.states[0]):
        assert np.isfinite(values[: found.unbounded_at]).all()
        assert np.isnan(values[found.unbounded_at :]).all()
    assert found.range_use == np.inf


def test_range_use_counts_the_force_and_the_states() -> None:
    model = oscillator(6e8, rate_hz=RATE_HZ, largest_m=1e-4)
    found = coupled_run(model, light_shaker(), 0.2 * noise(8000), lowest_hz=LOWEST_HZ)
    assert found.input_use[0] == pytest.approx(np.abs(found.force_n).max() / 10.0)
    np.testing.assert_allclose(found.state_use, np.abs(found.states).max(axis=1) / model.state_range)


def test_what_cannot_be_coupled_is_named() -> None:
    model, voltage = oscillator(rate_hz=RATE_HZ), np.zeros(100)
    with refused(IdentificationError, field="model", allowed="one, which the exciter makes"):
        coupled_run(driven_by_voltage(model), shaker(), voltage)
    with refused(IdentificationError, field="voltage_v", allowed="finite"):
        coupled_run(model, shaker(), [0.0, np.nan])
    with refused(IdentificationError, field="lowest_hz", value=390.0, allowed="well below half of 800 Hz"):
        coupled_run(model, shaker(), voltage, lowest_hz=390.0)
    without = replace(model, outputs=tuple(replace(channel, role="response") for channel in model.outputs))
    with refused(IdentificationError, field="channels", allowed="exactly one"):
        coupled_run(without, shaker(), voltage)
