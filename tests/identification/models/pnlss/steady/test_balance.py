"""Harmonic balance of the map against finite differences, closed forms and long simulations."""

import numpy as np
import pytest

from identification import IdentificationError, PnlssModel, harmonic_response, steady_state
from identification.harmonic_balance.basis import Basis
from identification.harmonic_balance.drives import Coupled, Drive, HeldOutput, Sine
from identification.models.pnlss.balance import PnlssBalance, samples_for
from tests.identification.models.pnlss.steady.oscillators import (
    RATE_HZ,
    driven_by_voltage,
    oscillator,
    saturating_oscillator,
    settled,
    shaker,
    waveform,
)
from tests.refused import refused

WHOLE = 128, 127, 126, 122
"""Samples per period at which simulations are compared."""


def drives(coefficients: int) -> dict[str, tuple[PnlssModel, Drive]]:
    plain = oscillator(5e7, 1e6, parametric=200.0)
    behind = driven_by_voltage(plain)
    coupled = {
        f"coupled, {held}": (plain, Coupled(shaker(), 2.0, held, 0, 2, 0, 1, coefficients))
        for held in ("fundamental", "rms", "voltage")
    }
    return coupled | {
        "sine": (plain, Sine(2.0, 0, 1)),
        "saturating": (saturating_oscillator(), Sine(2.0, 0, 1)),
        "bounded": (oscillator(5e7, largest_m=1.5e-3).bounded(), Sine(2.0, 0, 1)),
        "held fundamental": (behind, HeldOutput(2.0, "fundamental", 0, 0, 1)),
        "held rms": (behind, HeldOutput(2.0, "rms", 0, 0, 1)),
    }


@pytest.mark.parametrize("name", drives(3))
def test_the_jacobian_agrees_with_finite_differences(name: str) -> None:
    basis = Basis(3, 40)
    model, drive = drives(basis.size)[name]
    balance = PnlssBalance(model, drive, basis)
    rng = np.random.default_rng(1)
    z = np.tile(0.2 * model.state_range, basis.size) * rng.standard_normal(basis.size * 2)
    z = np.concatenate([z, rng.standard_normal(drive.size)])
    at_hz, level = 24.0, 0.8
    _, by_z, by_hz, by_level = balance.evaluated(z, at_hz, level)
    steps = np.concatenate([np.tile(1e-6 * model.state_range, basis.size), np.full(drive.size, 1e-6)])
    for column, step in enumerate(steps):
        nudge = np.where(np.arange(z.size) == column, step, 0.0)
        ends = [balance.evaluated(z + sign * nudge, at_hz, level)[0] for sign in (1, -1)]
        size = np.max(np.abs(by_z[:, column]))
        np.testing.assert_allclose((ends[0] - ends[1]) / (2 * step), by_z[:, column], atol=1e-6 * size)
    for step, exact, ends in (
        (1e-3, by_hz, [balance.evaluated(z, at_hz + d, level)[0] for d in (1e-3, -1e-3)]),
        (1e-3, by_level, [balance.evaluated(z, at_hz, level + d)[0] for d in (1e-3, -1e-3)]),
    ):
        found = (ends[0] - ends[1]) / (2 * step)
        np.testing.assert_allclose(found, exact, atol=1e-6 * np.max(np.abs(exact)))


def test_a_linear_model_answers_with_its_frequency_response() -> None:
    model = oscillator(0.0)
    found = harmonic_response(model, 0.7, force="pure-sine", band_hz=(20.0, 30.0), largest_range_use=3.0)
    z = np.exp(2j * np.pi * found.points.frequency_hz / RATE_HZ)
    exact = 0.7 * model.linear_part.response(z)[:, :, 0]
    np.testing.assert_allclose(found.points.outputs[:, 1], exact, rtol=1e-11)
    assert np.abs(found.points.outputs[:, [0, 2, 3]]).max() < 1e-13 * np.abs(exact).max()
    poles = np.linalg.eigvals(model.a)
    for each in found.points.multipliers:
        np.testing.assert_allclose(np.sort_complex(each), np.sort_complex(poles), rtol=1e-12)
    assert found.points.stable.all()
    assert not found.folds.count


@pytest.mark.parametrize("samples", WHOLE)
def test_a_settled_simulation_has_the_harmonics_of_the_balance(samples: int) -> None:
    model = oscillator(5e7, 1e6, parametric=200.0)
    found = steady_state(model, RATE_HZ / samples, 1.0, force="pure-sine", harmonics=9, largest_range_use=3.0)
    simulated, remains = settled(model, found, 400, waveform(found.states[0], np.zeros(1))[:, 0])
    assert np.all(remains < 1e-7)
    size = np.abs(simulated).max(axis=0)
    np.testing.assert_allclose(found.outputs[0] / size, simulated[:10] / size, atol=1e-6)
    assert np.abs(simulated[0, 2]) > 1e-3 * np.abs(simulated[1, 2])  # the spring gives way to one side


def test_from_rest_a_simulation_settles_on_the_vibration_that_rising_force_leads_to() -> None:
    model = oscillator(5e7)
    found = steady_state(model, RATE_HZ / 122, 1.0, force="pure-sine", largest_range_use=3.0)
    simulated, remains = settled(model, found, 600)
    assert np.all(remains < 1e-9)
    np.testing.assert_allclose(found.outputs[0, 1], simulated[1], rtol=1e-6)


@pytest.mark.parametrize("samples", WHOLE[::2])
def test_saturating_features_go_through_the_same_balance(samples: int) -> None:
    model = saturating_oscillator()
    found = steady_state(model, RATE_HZ / samples, 1.5, force="pure-sine", harmonics=11, largest_range_use=3.0)
    simulated, remains = settled(model, found, 400)
    assert np.all(remains < 1e-9)
    size = np.abs(simulated).max(axis=0)
    np.testing.assert_allclose(found.outputs[0] / size, simulated[:12] / size, atol=1e-5)
    assert np.abs(simulated[2, 0]) > 1e-3 * size[0]  # biased: there are even harmonics to be found


def test_samples_suffice_for_the_products_of_harmonics() -> None:
    model = oscillator(5e7, 3e5)
    few, many = (
        steady_state(model, 25.3, 2.0, force="pure-sine", harmonics=5, samples=n, largest_range_use=3.0)
        for n in (samples_for(model, 5), 400)
    )
    np.testing.assert_allclose(few.states, many.states, atol=1e-12 * np.abs(many.states).max())
    fewer = steady_state(model, 25.3, 2.0, force="pure-sine", harmonics=5, samples=12, largest_range_use=3.0)
    assert np.abs(fewer.states - many.states).max() > 1e-9 * np.abs(many.states).max()


def test_harmonics_beyond_half_the_sample_rate_are_left_out() -> None:
    model = oscillator(5e7, rate_hz=200.0)
    found = harmonic_response(model, 0.1, force="pure-sine", band_hz=(20.0, 28.0), largest_range_use=3.0)
    assert found.points.states.shape[1] == 4
    assert "3 harmonics, for which the model's 200 Hz has room at 28 Hz" in found.notes
    with refused(IdentificationError, "hz-is-not-below-half-the", field="frequency_hz"):
        steady_state(model, 120.0, 0.1, force="pure-sine", largest_range_use=3.0)
