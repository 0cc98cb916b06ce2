"""Exciters coupled to a model, and voltages that hold the force: each solution is checked without its equations."""

import numpy as np
import pytest

from identification import Exciter, IdentificationError, frequency_response, harmonic_response, steady_state
from tests.identification.models.pnlss.steady.oscillators import (
    RATE_HZ,
    after_disturbance,
    driven_by_voltage,
    level,
    oscillator,
    saturating_oscillator,
    settled,
    shaker,
)
from tests.refused import refused


@pytest.mark.parametrize("held", ["fundamental", "rms", "voltage"])
def test_a_simulation_under_the_force_moves_so_that_the_exciter_makes_that_force(held: str) -> None:
    model = oscillator(6e8, 1e6)
    hz = RATE_HZ / 132
    found = steady_state(model, hz, **level(1.0, held), exciter=shaker(), harmonics=9, largest_range_use=3.0)
    simulated, remains = settled(model, found, 400)
    assert np.all(remains < 1e-9)
    h = np.arange(1, 10)
    voltage = np.where(h == 1, found.voltage_v[0], 0.0)
    force = shaker().force(voltage, simulated[1:10, 0], h * hz)
    np.testing.assert_allclose(found.force_n[0, 1:], force, atol=1e-6)
    reached = {
        "fundamental": abs(force[0]),
        "rms": np.sqrt(0.5 * np.sum(np.abs(force) ** 2)),
        "voltage": abs(found.voltage_v[0]),
    }
    assert reached[held] == pytest.approx(1.0, abs=1e-6)
    assert found.force_n[0, 0] == 0.0
    assert abs(force[1]) > 1e-3


def test_a_voltage_driven_model_is_the_model_with_its_exciter() -> None:
    inner = oscillator(6e8, 1e6)
    model = driven_by_voltage(inner)
    for held in ("fundamental", "rms"):
        found = harmonic_response(model, 1.0, force=held, harmonics=9, band_hz=(23.0, 28.0), largest_range_use=3.0)  # type: ignore[arg-type]
        force = found.points.force_n
        square = np.abs(force[:, 1]) ** 2 if held == "fundamental" else 0.5 * np.sum(np.abs(force[:, 1:]) ** 2, axis=1)
        np.testing.assert_allclose(square, 1.0, atol=1e-8)
        reaction = -30.0 * found.points.outputs[:, :, 2]
        reaction[:, 1] += 4.0 * found.points.voltage_v
        np.testing.assert_allclose(force, reaction, atol=1e-8)
        assert found.folds.count == 2


@pytest.mark.parametrize("held", ["fundamental", "rms", "voltage"])
def test_an_exciter_beside_a_model_and_one_inside_it_give_the_same_response(held: str) -> None:
    inner = oscillator(6e8, 1e6, rate_hz=12800.0)
    beside = Exciter(
        force_per_volt_n_v=4.0,
        coil_time_constant_s=0.0,
        moving_mass_kg=0.0,
        suspension_damping_n_s_m=30.0,
        suspension_stiffness_n_m=0.0,
        back_emf_damping_n_s_m=0.0,
    )
    both = [
        harmonic_response(model, **level(1.2, held), exciter=exciter, band_hz=(23.0, 28.0), largest_range_use=3.0)
        for model, exciter in ((inner, beside), (driven_by_voltage(inner), None))
    ]
    assert both[0].folds.count == both[1].folds.count == (0 if held == "voltage" else 2)
    np.testing.assert_allclose(both[0].folds.frequency_hz, both[1].folds.frequency_hz, rtol=1e-3)
    one, other = (each.prediction.peak() for each in both)
    assert one.amplitude_m == pytest.approx(other.amplitude_m, rel=5e-3)
    assert one.frequency_hz == pytest.approx(other.frequency_hz, rel=1e-3)
    assert one.phase_lag_deg == pytest.approx(other.phase_lag_deg, abs=2.0)
    for each in both:
        backwards = np.flatnonzero(np.gradient(each.points.frequency_hz) < 0.0)[2:-2]
        assert not each.points.stable[backwards].any()
        assert np.count_nonzero(~each.points.stable) <= backwards.size + 6


def test_constant_voltage_is_the_pure_sine_of_a_voltage_driven_model() -> None:
    model = driven_by_voltage(oscillator(6e8))
    found = frequency_response(model, voltage_v=0.5, band_hz=(23.0, 28.0), largest_range_use=3.0)
    assert found.name == "0.5 V"
    z = np.exp(2j * np.pi * found.frequency_hz[0] / RATE_HZ)
    linear = 0.5 * model.linear_part.response(np.array([z]))[0, :, 0]
    assert found.fundamental_n[0] == pytest.approx(abs(linear[0]), rel=1e-2)
    assert "held: the amplitude of a sine of voltage at the model's input" in found.notes


def test_a_held_force_is_unstable_where_frequency_turns_back_though_a_constant_voltage_is_not() -> None:
    model = driven_by_voltage(oscillator(6e8), backwards=60.0)
    found = harmonic_response(model, 1.2, force="fundamental", band_hz=(23.0, 29.0), largest_range_use=3.0)
    backwards = np.gradient(found.points.frequency_hz) < 0.0
    inner = np.flatnonzero(backwards)[2:-2]
    assert not found.points.stable[inner].any()
    assert set(np.array(found.points.loss)[inner]) == {"fold"}
    point = int(inner[inner.size // 2])
    multipliers = np.abs(found.points.multipliers[point])
    away = after_disturbance(model, found.points, point, 60)
    assert (away[50] < away[10]) == (multipliers.max() < 1.0)  # under the voltage as it is
    at = found.points.frequency_hz[point]
    for k, expected in ((point, False), (5, True)):
        near = _point(found, k)
        again = steady_state(model, near.frequency_hz[0], 1.2, force="fundamental", near=near, largest_range_use=3.0)
        np.testing.assert_allclose(again.states, near.states, atol=1e-9 * np.abs(near.states).max())
        assert bool(again.stable[0]) is expected
    assert steady_state(model, at, 1.2, force="fundamental", largest_range_use=3.0).stable[
        0
    ]  # that which rest leads to


def _point(found, k):  # type: ignore[no-untyped-def]
    from dataclasses import replace

    p = found.points
    names = (
        "frequency_hz",
        "states",
        "inputs",
        "outputs",
        "voltage_v",
        "multipliers",
        "stable",
        "state_use",
        "input_use",
    )
    return replace(p, **{name: getattr(p, name)[k : k + 1] for name in names}, loss=p.loss[k : k + 1])


def test_saturating_features_couple_to_an_exciter_too() -> None:
    model = saturating_oscillator()
    found = steady_state(
        model, RATE_HZ / 127, 1.0, force="fundamental", exciter=shaker(), harmonics=11, largest_range_use=3.0
    )
    simulated, _ = settled(model, found, 400)
    np.testing.assert_allclose(found.outputs[0, :, 0], simulated[:12, 0], atol=1e-5 * np.abs(simulated).max())
    h = np.arange(1, 12)
    np.testing.assert_allclose(
        found.force_n[0, 1:],
        shaker().force(np.where(h == 1, found.voltage_v[0], 0.0), found.outputs[0, 1:, 0], h * RATE_HZ / 127),
        atol=1e-9,
    )


def test_what_does_not_go_together_is_refused() -> None:
    force, voltage = oscillator(), driven_by_voltage(oscillator())
    with refused(IdentificationError, "fundamental-of-model-driven-by-force", field="force"):
        frequency_response(force, 1.0, force="fundamental", largest_range_use=3.0)
    with refused(
        IdentificationError, "makes-harmonics-of-the-force-leave", field="exciter", hint="leave it out for 'pure-sine'"
    ):
        frequency_response(force, 1.0, force="pure-sine", exciter=shaker(), largest_range_use=3.0)
    with refused(IdentificationError, "is-inside-a-model-that-is", field="exciter", hint="leave it out"):
        frequency_response(voltage, 1.0, force="fundamental", exciter=shaker(), largest_range_use=3.0)
    with refused(IdentificationError, "answers-fundamental-rms-or-voltage", field="force"):
        frequency_response(voltage, 1.0, force="pure-sine", largest_range_use=3.0)
    with refused(IdentificationError, field="force", value="loud", allowed="fundamental, rms, pure-sine, voltage"):
        frequency_response(force, 1.0, force="loud", largest_range_use=3.0)  # type: ignore[arg-type]
    with refused(IdentificationError, field="force_n", value=-1.0, allowed="finite and above zero"):
        frequency_response(force, -1.0, force="pure-sine", largest_range_use=3.0)
    with refused(IdentificationError, field="band_hz", allowed="rising between 0 and 1600 Hz"):
        frequency_response(force, 1.0, force="pure-sine", band_hz=(30.0, 20.0), largest_range_use=3.0)
    with refused(IdentificationError, field="samples", value=10, allowed="at least 15 for 7 harmonics"):
        frequency_response(force, 1.0, force="pure-sine", samples=10, largest_range_use=3.0)
