from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from identification import (
    Channel,
    ExtrapolationError,
    FrequencyResponse,
    IdentificationError,
    LinearModes,
    ModalProperties,
    NonlinearMode,
    compare,
    frequency_response,
    recorded_force_response,
    response_band,
    steady_predictions,
)
from tests.identification.models.modal.modes import F0_HZ, SHAPE, ZETA, duffing, mode_with
from tests.refused import refused

W0 = 2 * np.pi * F0_HZ
Q = np.linspace(0.5e-3, 12e-3, 12)
HARDENING = 900.0


def stiffness(q: NDArray[np.float64], frequency_hz: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Dynamic stiffness of the Duffing oscillator of `duffing`, written down anew."""
    w, omega = W0 * np.sqrt(1 + HARDENING * q**2), 2 * np.pi * frequency_hz
    return np.asarray(w**2 - omega**2 + 2j * omega * w * ZETA)


def test_a_linear_mode_gives_its_receptance() -> None:
    found = frequency_response(mode_with(Q), 0.5)
    omega = 2 * np.pi * found.frequency_hz
    expected = 0.5 * SHAPE**2 / (W0**2 - omega**2 + 2j * ZETA * W0 * omega)
    np.testing.assert_allclose(found.motion_m(), expected, rtol=1e-9)
    np.testing.assert_allclose(found.acceleration_m_s2(), -(omega**2) * expected, rtol=1e-9)
    assert found.stable.all()
    assert not found.fold_frequency_hz.size
    peak = found.peak()
    assert peak.amplitude_m == pytest.approx(0.5 * SHAPE**2 / (2 * ZETA * np.sqrt(1 - ZETA**2) * W0**2), rel=1e-9)
    assert peak.frequency_hz == pytest.approx(F0_HZ * np.sqrt(1 - 2 * ZETA**2), rel=1e-7)


def test_every_point_of_a_duffing_response_solves_its_equation() -> None:
    found = frequency_response(duffing(np.linspace(0.2e-3, 12e-3, 400)), 1.0)
    force = np.abs(stiffness(found.modal_amplitude, found.frequency_hz)) * found.modal_amplitude / SHAPE
    np.testing.assert_allclose(force, 1.0, rtol=2e-4)
    lag = np.degrees(np.angle(stiffness(found.modal_amplitude, found.frequency_hz)))
    np.testing.assert_allclose(found.phase_lag_deg(), lag, atol=0.05)


def duffing_roots(force_n: float, frequency_hz: float) -> NDArray[np.float64]:
    """Steady amplitudes where z w is taken as constant at its value for small q; the cubic in q^2."""
    omega = 2 * np.pi * frequency_hz
    a, b = W0**2 - omega**2, HARDENING * W0**2
    # |a + b s + 2 i W w z|^2 s = (phi F)^2 with w^2 = W0^2 (1 + hardening s), s = q^2
    c = 4 * omega**2 * ZETA**2 * W0**2
    roots = np.roots([b**2, 2 * a * b + c * HARDENING, a**2 + c, -((SHAPE * force_n) ** 2)])
    return np.sort(np.sqrt(roots[(np.abs(roots.imag) < 1e-12) & (roots.real > 0)].real))


def test_folds_part_one_state_from_three_and_the_middle_one_is_unstable() -> None:
    found = frequency_response(duffing(np.linspace(0.2e-3, 12e-3, 400)), 1.0, points=2001)
    upper, lower = found.fold_frequency_hz
    assert lower < upper
    for frequency, count in ((lower - 1e-3, 1), (lower + 1e-3, 3), (upper - 1e-3, 3), (upper + 1e-3, 1)):
        assert duffing_roots(1.0, frequency).size == count
    middle = 0.5 * (lower + upper)
    roots = duffing_roots(1.0, middle)
    crossings = np.flatnonzero(np.diff(found.frequency_hz > middle))
    np.testing.assert_allclose(np.sort(found.modal_amplitude[crossings]), roots, rtol=0.02)
    order = np.argsort(found.modal_amplitude[crossings])
    assert found.stable[crossings][order].tolist() == [True, False, True]
    unstable = np.flatnonzero(~found.stable)
    assert np.all(np.diff(unstable) == 1)
    assert np.all(np.diff(found.frequency_hz[unstable]) < 0.0), "between the folds frequency falls along the curve"


def test_stability_is_what_the_integrated_slow_flow_does() -> None:
    found = frequency_response(duffing(Q), 1.0)
    picked = [
        int(np.flatnonzero(found.stable)[20]),
        int(np.flatnonzero(~found.stable)[15]),
        int(found.modal_amplitude.argmax()),
    ]

    properties = ModalProperties.of(duffing(Q), largest_range_use=np.inf)
    for point in picked:
        omega, q = 2 * np.pi * found.frequency_hz[point], found.modal_amplitude[point]
        w, z = properties.frequency_rad_s(q), properties.damping_ratio(q)
        drive = (w**2 - omega**2 + 2j * omega * w * z) * q

        def rate(_: float, state: NDArray[np.float64], omega: float = omega, drive: complex = drive) -> list[float]:
            amplitude = complex(*state)
            w, z = properties.frequency_rad_s(abs(amplitude)), properties.damping_ratio(abs(amplitude))
            change = (drive - (w**2 - omega**2 + 2j * omega * w * z) * amplitude) / (2 * (1j * omega + z * w))
            return [change.real, change.imag]

        end = solve_ivp(rate, (0.0, 15.0), [q * 1.001, 0.0], rtol=1e-8, atol=1e-12).y[:, -1]
        stays = abs(complex(*end) - q) < 1e-3 * q
        assert stays == found.stable[point]


def detached_mode() -> NonlinearMode:
    q = np.linspace(0.5e-3, 12e-3, 47)
    damping = 0.004 + 0.02 * np.exp(-(((q - 4e-3) / 1.2e-3) ** 2)) + 0.6 * np.maximum(q - 9e-3, 0.0)
    return mode_with(q, F0_HZ * np.sqrt(1 + 30.0 * q**2), damping)


def test_detached_branches_are_found_and_nothing_else_solves_the_equation() -> None:

    mode = detached_mode()
    found = frequency_response(mode, 1.4, points=2001)
    assert set(found.branch) == {0, 1}
    assert any("1 detached branch" in note for note in found.notes)
    properties = ModalProperties.of(mode)
    grid = np.geomspace(1e-5, 20e-3, 200_001)
    w, z = properties.frequency_rad_s(grid), properties.damping_ratio(grid)
    for frequency in (23.9, 24.0, 24.03, 24.06, 24.2):
        omega = 2 * np.pi * frequency
        surplus = np.abs(w**2 - omega**2 + 2j * omega * w * z) * grid - SHAPE * 1.4
        expected = grid[np.flatnonzero(np.diff(surplus > 0.0))]
        same = found.branch[1:] == found.branch[:-1]
        crossing = np.flatnonzero(
            ((found.frequency_hz[1:] > frequency) != (found.frequency_hz[:-1] > frequency)) & same
        )
        np.testing.assert_allclose(np.sort(found.modal_amplitude[crossing]), expected, rtol=0.02)
    isola = found.branch == 1
    assert found.stable[isola].any()
    assert not found.stable[isola].all()
    assert found.peak().modal_amplitude < found.modal_amplitude[isola].min()


def test_what_constant_force_means_makes_the_difference() -> None:
    force = mode_with(Q).force_harmonics.copy()
    force[:, 2] = 0.75 * force[:, 1]
    mode = mode_with(Q, force_harmonics=force, damping_ratio_total_power=np.full(Q.size, 0.9 * ZETA))
    fundamental = frequency_response(mode, 0.5)
    rms = frequency_response(mode, 0.5 * np.sqrt(1 + 0.75**2) / np.sqrt(2), force="rms")
    np.testing.assert_allclose(rms.amplitude_m(), fundamental.amplitude_m(), rtol=1e-9)
    np.testing.assert_allclose(rms.fundamental_n, 0.5, rtol=1e-12)
    sine = frequency_response(mode, 0.5, force="pure-sine")
    assert sine.peak().amplitude_m == pytest.approx(fundamental.peak().amplitude_m / 0.9, rel=1e-5)
    assert (fundamental.notes, sine.notes) == ((), ())
    assert "off resonance" in rms.notes[0]
    assert (fundamental.name, rms.name[-4:], sine.name) == ("0.5 N", " RMS", "0.5 N pure sine")


def linear_modes() -> LinearModes:
    channels = (Channel("tip", "response", "m/s2"), Channel("here", "drive", "m/s2"))
    unknown = np.full(2, np.nan)
    return LinearModes(
        channels=channels,
        frequency_hz=np.array([F0_HZ, 60.0]),
        frequency_std_hz=unknown,
        damping_ratio=np.array([ZETA, 0.01]),
        damping_ratio_std=unknown,
        shapes=np.array([[3.0, -2.0], [SHAPE, 0.8]]),
        shapes_std=np.full((2, 2), np.nan),
        phase_collinearity=unknown,
        lower=np.array([0.01, 0.02]),
        upper=np.array([1e-6, 2e-6]),
        lowest_hz=5.0,
        highest_hz=100.0,
    )


def test_with_linear_modes_a_linear_mode_gives_the_whole_receptance_at_every_channel() -> None:
    found = frequency_response(mode_with(Q), 0.5, linear_modes=linear_modes())
    assert found.channels == ("here", "tip")
    for name in found.channels:
        expected = 0.5 * linear_modes().receptance(found.frequency_hz, name)
        np.testing.assert_allclose(found.motion_m(name), expected, rtol=1e-9)
    alone = frequency_response(mode_with(Q), 0.5, linear_modes=linear_modes(), residuals=False)
    np.testing.assert_allclose(alone.motion_m("tip") / alone.motion_m(), 3.0 / SHAPE, rtol=1e-12)
    with refused(IdentificationError, "no-channel-top-was-predicted-there"):
        found.motion_m("top")


def test_a_recorded_force_that_varies_gives_each_point_its_own_response() -> None:
    frequency = np.arange(23.5, 24.8, 0.02)
    force = 0.5 * (1 + 0.2 * np.sin(5 * frequency)) * np.exp(0.3j)
    reference = FrequencyResponse(frequency, force, np.ones(frequency.size, complex), "displacement", "force", 0.5)
    found = recorded_force_response(mode_with(Q), reference)
    omega = 2 * np.pi * frequency
    expected = np.abs(force) * SHAPE**2 / (W0**2 - omega**2 + 2j * ZETA * W0 * omega)
    np.testing.assert_allclose(found.motion_m(), expected, rtol=1e-9)


@pytest.mark.parametrize("up", [True, False])
def test_a_stepped_test_with_recorded_force_jumps_at_the_fold_that_its_direction_meets(up: bool) -> None:
    mode = duffing(Q)
    upper, lower = frequency_response(mode, 1.0).fold_frequency_hz
    frequency = np.arange(23.5, 25.5, 0.005)[:: 1 if up else -1]
    ones = np.ones(frequency.size, complex)
    found = recorded_force_response(mode, FrequencyResponse(frequency, ones, ones, "displacement", "force", 1.0))
    jump = int(np.argmax(np.abs(np.diff(found.modal_amplitude))))
    assert frequency[jump] == pytest.approx(upper if up else lower, abs=0.01)


@pytest.mark.slow
def test_a_test_at_constant_voltage_holds_states_that_are_unstable_under_its_force() -> None:
    """All states of a response at constant force, as if each had been held: no other rule could tell three of them apart."""
    mode = duffing(Q)
    truth = frequency_response(mode, 1.0)
    assert not truth.stable.all()
    held = FrequencyResponse(
        truth.frequency_hz, np.ones(truth.stable.size, complex), truth.motion_m(), "displacement", "voltage", 1.0
    )
    found = recorded_force_response(mode, held)
    # next to a fold two states have nearly the same lag, and the force of either is nearly that of the fold
    np.testing.assert_allclose(found.modal_amplitude, truth.modal_amplitude, rtol=0.05)
    assert (
        np.count_nonzero(np.abs(found.modal_amplitude / truth.modal_amplitude - 1.0) > 1e-6) < 0.02 * truth.stable.size
    )
    assert np.count_nonzero(found.stable != truth.stable) < 0.02 * truth.stable.size
    assert any("unstable under constant force" in note for note in found.notes)
    error = compare(found, held).error
    assert abs(error.peak_error) < 1e-6
    assert error.envelope_error < 1e-3
    by_force = recorded_force_response(mode, replace(held, controlled="force"))
    assert compare(by_force, held).error.envelope_error > 0.05


def test_extrapolation_is_flagged_and_refused() -> None:
    mode = duffing(Q)
    top = float(mode.force_n[-1])
    assert frequency_response(mode, 0.9 * top).notes == ()
    flagged = frequency_response(mode, 1.8 * top)
    assert flagged.range_use.max() > 1.25
    assert any("extrapolated" in note for note in flagged.notes)
    with refused(ExtrapolationError, "drives-the-mode-beyond-times-the", field="force_n"):
        frequency_response(mode, 5.0 * top)
    allowed = frequency_response(mode, 5.0 * top, largest_range_use=np.inf)
    assert "not to be trusted" in allowed.notes[0]
    assert any("below the lowest level" in note for note in frequency_response(mode, 0.5 * mode.force_n[0]).notes)


def test_several_forces_in_one_call() -> None:
    found = steady_predictions(duffing(Q), [0.2, 0.5, 1.0])
    assert [item.force_n for item in found] == [0.2, 0.5, 1.0]
    assert np.all(np.diff([item.peak().amplitude_m for item in found]) > 0.0)


def test_the_band_of_one_level_is_the_first_order_propagation() -> None:
    mode = replace(mode_with(2e-3), damping_ratio_std=np.array([1e-4]), modal_frequency_std_hz=np.array([0.003]))
    band = response_band(mode, 0.3, draws=200, seed=3)
    peak = frequency_response(mode, 0.3).peak()
    assert band.peak_amplitude_std_m / peak.amplitude_m == pytest.approx(1e-4 / ZETA, rel=0.15)
    assert band.peak_frequency_std_hz == pytest.approx(0.003, rel=0.15)
    inside = (
        np.interp(90.0, band.phase_lag_deg, band.amplitude_m[0]),
        np.interp(90.0, band.phase_lag_deg, band.amplitude_m[1]),
    )
    assert inside[1] - inside[0] == pytest.approx(2 * 1.96 * 1e-4 / ZETA * peak.amplitude_m, rel=0.2)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"force_n": 0.0}, {"field": "force_n", "allowed": "finite and above zero"}),
        ({"force": "peak"}, {"field": "force", "value": "peak", "allowed": "fundamental, rms, pure-sine"}),
        ({"points": 5}, {"field": "points", "value": 5, "allowed": "20 and above"}),
        ({"lowest_share": 1.0}, {"field": "lowest_share", "value": 1.0, "allowed": "between 0 and 1"}),
    ],
)
def test_bad_input_is_named(arguments: dict[str, object], message: str) -> None:
    with refused(IdentificationError, **message):
        frequency_response(duffing(Q), **({"force_n": 1.0} | arguments))  # type: ignore[arg-type]


def test_rms_and_bands_need_what_they_are_made_of() -> None:
    bare = mode_with(Q, force_harmonics=mode_with(Q).force_harmonics[:, :2])
    with refused(IdentificationError, "rms-needs-mode-with-recorded-force", field="force"):
        frequency_response(bare, 0.5, force="rms")
    with refused(IdentificationError, "unknown-at-some-level", field="damping_ratio_std"):
        response_band(replace(mode_with(Q), damping_ratio_std=np.full(Q.size, np.nan)), 0.5)
    with refused(IdentificationError, field="draws", value=5, allowed="20 and above"):
        response_band(mode_with(Q), 0.5, draws=5)


def test_branches_that_only_a_softening_extrapolation_has_are_left_out() -> None:
    """``w^2`` linear in ``q^2`` falls to its floor far beyond the levels: what closes there is no branch of the structure."""
    q = np.linspace(1e-3, 12e-3, 12)
    mode = mode_with(q, F0_HZ * np.sqrt(1.0 - 900.0 * q**2), ZETA)
    found = frequency_response(mode, 0.5 * float(mode.force_n[-1]), largest_range_use=np.inf)
    assert set(found.branch) == {0}
    assert found.range_use.max() < 1.0
    assert any("extrapolation alone" in note for note in found.notes)
