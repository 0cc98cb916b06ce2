"""Sweep predictions against direct time integration of mode and exciter, scipy, closed forms; range and bad input."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from identification import (
    Channel,
    ExtrapolationError,
    HalfPeriods,
    IdentificationError,
    Transient,
    demodulate,
    zero_crossings,
)
from identification.exciter_coupling.exciter import Exciter
from identification.models.modal.properties import ModalProperties
from identification.models.modal.sweep_inputs import VoltageSweep
from identification.models.modal.sweep_prediction import SweepPrediction, compare_sweep
from identification.models.modal.sweeps import predict_sweep
from identification.storage import decode, encode
from tests.refused import refused
from vibrolock.arrays import Float

W0, Z0, PHI, CUBIC = 2.0 * np.pi * 24.0, 0.004, 0.9, 3.2e9
EXCITER = Exciter(
    force_per_volt_n_v=3.5,
    coil_time_constant_s=1e-4,
    moving_mass_kg=0.18,
    suspension_damping_n_s_m=12.0,
    suspension_stiffness_n_m=6000.0,
    back_emf_damping_n_s_m=18.7,
    source="rig A",
)
RATE_HZ = 2000.0
CHANNELS = (Channel("force", "force", "N"), Channel("drive", "drive", "m"), Channel("voltage", "monitor", "V"))
SWEEP = VoltageSweep(20.0, 29.0, 4.0, 1.5)


def duffing(largest_q: float = 2e-3, cubic: float = CUBIC, **options: bool) -> ModalProperties:
    """``q'' + 2 Z0 W0 q' + W0^2 q + cubic q^3 = phi F``: ``w^2 = W0^2 + 3/4 cubic q^2``, ``z w = Z0 W0``."""
    q = np.linspace(0.01, 1.0, 80) * largest_q
    w = np.sqrt(W0**2 + 0.75 * cubic * q**2)
    return ModalProperties.from_levels(q, w, Z0 * W0 / w, PHI, **options)


def integrated(swing_rad: float = 0.0) -> Transient:
    """One cubic mode on the exciter (rigid stinger), integrated in time with the coil's force as a state of its own.

    The voltage's own phase swings after the start, by ``swing_rad``.
    """
    e = EXCITER
    mass = 1.0 + PHI**2 * e.moving_mass_kg
    damping = 2.0 * Z0 * W0 + PHI**2 * e.suspension_damping_n_s_m
    stiffness = W0**2 + PHI**2 * e.suspension_stiffness_n_m

    def voltage(t: float) -> float:
        swept = max(t, 0.0)
        phase = 2.0 * math.pi * (SWEEP.start_hz * t + 0.5 * SWEEP.rate_hz_per_s * swept**2)
        return SWEEP.level_v * math.cos(phase + swing_rad * math.sin(2.0 * math.pi * 0.7 * swept))

    def rates(t: float, y: Float) -> list[float]:
        q, v, coil = y
        acceleration = (PHI * coil - damping * v - stiffness * q - CUBIC * q**3) / mass
        drive = e.force_per_volt_n_v * voltage(t) - e.back_emf_damping_n_s_m * PHI * v
        return [v, acceleration, (drive - coil) / e.coil_time_constant_s]

    times = np.arange(-1.0, SWEEP.duration_s, 1.0 / RATE_HZ)
    y = solve_ivp(rates, (-1.0, SWEEP.duration_s), [0.0, 0.0, 0.0], "DOP853", times, rtol=1e-7, atol=1e-9).y
    acceleration = (PHI * y[2] - damping * y[1] - stiffness * y[0] - CUBIC * y[0] ** 3) / mass
    moving = e.moving_mass_kg * PHI * acceleration + e.suspension_damping_n_s_m * PHI * y[1]
    force = y[2] - moving - e.suspension_stiffness_n_m * PHI * y[0]
    rows = np.array([force, PHI * y[0], [voltage(t) for t in times]])
    phase = 2.0 * np.pi * (SWEEP.start_hz * times + 0.5 * SWEEP.rate_hz_per_s * np.clip(times, 0.0, None) ** 2)
    whole = demodulate(phase, rows, CHANNELS, sample_rate_hz=RATE_HZ)
    later = whole.time_s > 1.0
    return replace(
        whole,
        time_s=whole.time_s[later] - 1.0,
        frequency_hz=whole.frequency_hz[later],
        fundamentals=whole.fundamentals[:, later],
    )


@pytest.fixture(scope="module")
def recorded() -> Transient:
    return integrated()


@pytest.mark.slow
def test_the_coupled_prediction_follows_direct_time_integration(recorded: Transient) -> None:
    error = compare_sweep(predict_sweep(duffing(), recorded, exciter=EXCITER), recorded)
    assert abs(error.peak_error) < 2e-3
    assert error.envelope_error < 3e-3
    assert abs(error.peak_frequency_error) < 3e-3
    assert 0.5 < error.range_use < 1.0


@pytest.mark.slow
def test_a_voltage_whose_phase_moves_is_followed_too() -> None:
    swinging = integrated(swing_rad=0.8)
    error = compare_sweep(predict_sweep(duffing(), swinging, exciter=EXCITER), swinging)
    assert abs(error.peak_error) < 3e-3
    assert error.envelope_error < 4e-3


def test_the_predicted_force_drops_as_the_integrated_one(recorded: Transient) -> None:
    prediction = predict_sweep(duffing(), recorded, exciter=EXCITER)
    predicted = np.abs(prediction.smoothed(prediction.force, recorded.window_periods))
    measured = np.abs(recorded.force)
    difference = np.interp(recorded.time_s, prediction.time_s, predicted) - measured
    inside = slice(100, -100)
    assert measured.min() < 0.2 * measured[0]
    assert np.sqrt(np.mean(difference[inside] ** 2)) < 0.005 * measured.max()


def test_a_designed_sweep_is_the_recorded_one(recorded: Transient) -> None:
    designed = predict_sweep(duffing(), SWEEP, exciter=EXCITER)
    error = compare_sweep(designed, recorded)
    assert abs(error.peak_error) < 2e-3
    assert error.envelope_error < 3e-3
    assert designed.notes[0] == "holds for the exciter of rig A alone"


def test_the_imposed_force_reproduces_the_sweep_and_a_frequency_error_does_not(recorded: Transient) -> None:
    """The founding paper's finding: sensitive to errors of the modal frequency, which the coupled prediction is not."""
    right, wrong = duffing(4e-3), duffing(4e-3)
    wrong = ModalProperties.from_levels(
        wrong.modal_amplitude, 1.005 * wrong.omega_rad_s, wrong.damping, PHI, largest_range_use=np.inf
    )
    assert abs(compare_sweep(predict_sweep(right, recorded), recorded).peak_error) < 0.03
    imposed = compare_sweep(predict_sweep(wrong, recorded), recorded)
    coupled = compare_sweep(predict_sweep(wrong, recorded, exciter=EXCITER), recorded)
    assert abs(coupled.peak_error) < 0.01
    assert imposed.envelope_error > 10.0 * coupled.envelope_error


def test_a_constant_force_gives_the_linear_steady_state() -> None:
    """Force of constant magnitude by half periods at a constant frequency: ``|q| = phi F / |D|``."""
    time_s = np.arange(0.0, 2.0, 0.02)
    force = HalfPeriods(time_s, np.full(time_s.size, 25.0), np.full(time_s.size, 0.3))
    w = 2.0 * np.pi * 25.0
    steady = PHI * 0.3 / abs(W0**2 - w**2 + 2j * Z0 * W0 * w)
    prediction = predict_sweep(duffing(cubic=0.0), force)
    np.testing.assert_allclose(np.abs(prediction.modal_amplitude), steady, rtol=1e-4)
    np.testing.assert_allclose(np.abs(prediction.drive_m_s2[5:-5]), PHI * steady * w**2, rtol=1e-3)


def test_compiled_steps_agree_with_scipy() -> None:
    """The slow flow of an imposed force, written down once more and integrated by DOP853."""
    rate, level = 6.0, 0.5
    times = np.arange(0.0, 2.0, 1.0 / 600.0)
    amplitude = level * np.exp(0.4j * np.sin(5.0 * times))
    sweep = Transient(CHANNELS[:1], times, 20.0 + rate * times, amplitude[None], 2)

    def flow(t: float, y: Float) -> Float:
        q = complex(*y)
        s = 2j * np.pi * (20.0 + rate * t)
        squared = W0**2 + 0.75 * CUBIC * abs(q) ** 2
        f = level * np.exp(0.4j * np.sin(5.0 * t))
        change = f * 2j * np.cos(5.0 * t)
        d0, d1 = squared + 2.0 * Z0 * W0 * s + s**2, 2.0 * Z0 * W0 + 2.0 * s
        slope = d1 - d0 / d1
        value = (PHI * (f - change / slope) - d0 * q) / slope
        return np.array([value.real, value.imag])

    prediction = predict_sweep(duffing(4e-3), sweep)
    start = prediction.modal_amplitude[0]
    span = (prediction.time_s[0], prediction.time_s[-1])
    y = solve_ivp(flow, span, [start.real, start.imag], "DOP853", prediction.time_s, rtol=1e-10, atol=1e-14).y
    np.testing.assert_allclose(
        prediction.modal_amplitude, y[0] + 1j * y[1], atol=1e-3 * np.max(np.abs(y)), err_msg="Runge-Kutta"
    )


def test_zero_crossings_and_demodulation_agree_on_a_pure_force() -> None:
    """A long sweep off resonance, where the force is one clean tone."""
    t = np.arange(0.0, 3.0, 1.0 / RATE_HZ)
    phase = 2.0 * np.pi * (27.0 * t + 0.5 * t**2)
    force = 0.4 * np.cos(phase)
    fundamentals = demodulate(phase, force[None], CHANNELS[:1], sample_rate_hz=RATE_HZ)
    crossings = zero_crossings(force, sample_rate_hz=RATE_HZ)
    one, other = (np.abs(predict_sweep(duffing(), source).modal_amplitude) for source in (fundamentals, crossings))
    assert abs(one[-1] / other[-1] - 1.0) < 0.01


def test_a_force_by_zero_crossings_is_compared_by_its_displacement(recorded: Transient) -> None:
    """One rogue half period: frequency and phase jump, which an acceleration would multiply and a displacement does not."""
    time_s = np.arange(0.0, 2.0, 0.02)
    clean = HalfPeriods(time_s, 20.0 + 4.0 * time_s, np.full(time_s.size, 2.0))
    jumping = clean.frequency_hz.copy()
    jumping[60] = 60.0
    for force in (clean, HalfPeriods(time_s, jumping, clean.magnitude)):
        prediction = predict_sweep(duffing(4e-3), force)
        error = compare_sweep(prediction, recorded)
        largest = np.max(np.abs(recorded.fundamentals[1]))
        assert error.peak_error == pytest.approx(prediction.peak()[0] / largest - 1.0)
        at_s = prediction.time_s[np.argmax(np.abs(prediction.drive_m))]
        assert prediction.peak(recorded)[1] == pytest.approx(20.0 + 4.0 * at_s, abs=1e-3)


def test_beyond_twice_the_identified_amplitude_nothing_is_predicted_unless_allowed(recorded: Transient) -> None:
    with refused(ExtrapolationError, "exceeds-times-the-largest-identified"):
        predict_sweep(duffing(5e-4), recorded, exciter=EXCITER)
    allowed = predict_sweep(duffing(5e-4, largest_range_use=np.inf), recorded, exciter=EXCITER)
    assert allowed.range_use > 2.0
    assert any("largest modal amplitude" in note for note in allowed.notes)


def test_an_unbounded_response_ends_and_says_where() -> None:
    """A mode that is driven at its own frequency, with hardly any damping, from a range a million times smaller."""
    q = np.array([1e-9, 2e-9])
    mode = ModalProperties.from_levels(q, [W0, W0], [1e-3, 1e-3], PHI, largest_range_use=np.inf)
    time_s = np.arange(0.0, 4.0, 0.02)
    prediction = predict_sweep(
        mode, HalfPeriods(time_s, np.linspace(20.0, 28.0, time_s.size), np.full(time_s.size, 1.0))
    )
    assert prediction.time_s[-1] < 4.0
    assert any("unbounded" in note for note in prediction.notes)


def test_a_comparison_tells_a_scaled_copy_by_its_scale(recorded: Transient) -> None:
    prediction = predict_sweep(duffing(), recorded, exciter=EXCITER)
    base = compare_sweep(prediction, recorded)
    scaled = compare_sweep(replace(prediction, drive_m=1.05 * prediction.drive_m), recorded)
    assert (1.0 + scaled.peak_error) / (1.0 + base.peak_error) == pytest.approx(1.05)


def test_bad_input_is_named(recorded: Transient) -> None:
    with refused(IdentificationError, "give-exciter", field="sweep"):
        predict_sweep(duffing(), SWEEP)
    with refused(IdentificationError, "half-periods", field="sweep"):
        predict_sweep(duffing(), zero_crossings(np.sin(np.arange(100.0)), sample_rate_hz=50.0), exciter=EXCITER)
    with refused(IdentificationError, "no-channel-volts"):
        predict_sweep(duffing(), recorded, exciter=EXCITER, voltage="volts")
    with refused(IdentificationError, field="stop_hz", value=20.0):
        VoltageSweep(20.0, 20.0, 1.0, 1.0)
    with refused(IdentificationError, field="rate_hz_per_s"):
        VoltageSweep(20.0, 30.0, -1.0, 1.0)
    far = predict_sweep(duffing(), recorded, exciter=EXCITER)
    with refused(IdentificationError, "lasts-from", field="sweep"):
        compare_sweep(replace(far, time_s=far.time_s + 100.0), recorded)


def test_a_prediction_survives_its_arrays(recorded: Transient) -> None:
    prediction = predict_sweep(duffing(), recorded, exciter=EXCITER)
    arrays, attributes = encode(prediction)
    again = decode(SweepPrediction, arrays, attributes)
    np.testing.assert_array_equal(again.force, prediction.force)
    assert (again.notes, again.origin, again.range_use) == (prediction.notes, prediction.origin, prediction.range_use)
    with refused(IdentificationError, "drive-3", where="sweep prediction"):
        decode(SweepPrediction, {k: v for k, v in arrays.items() if k != "drive_m_s2"}, attributes)
