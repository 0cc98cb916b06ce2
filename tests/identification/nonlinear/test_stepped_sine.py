from dataclasses import replace

import numpy as np
import pytest

from identification import (
    FrequencyResponse,
    IdentificationError,
    NonlinearMode,
    pack_frequency_responses,
    stepped_sine_mode,
    unpack_frequency_responses,
)
from identification.channels import Motion
from identification.frequency_responses import Controlled
from identification.storage import decode, encode
from tests.refused import refused

FREQUENCY_HZ = np.arange(79.0, 81.5, 0.05)
MASS_KG = 1.9


def level(
    f0_hz: float = 80.3,
    zeta: float = 0.004,
    *,
    beta_deg: float = 0.0,
    kind: Motion = "acceleration",
    controlled: Controlled = "response",
    noise: float = 0.0,
    seed: int = 0,
    f_hz: np.ndarray = FREQUENCY_HZ,
) -> FrequencyResponse:
    """One linear mode with the amplitude of its response held at 20 (SI)."""
    omega, omega0 = 2 * np.pi * f_hz, 2 * np.pi * f0_hz
    response = np.full(f_hz.size, 20.0 + 0j)
    displacement = response / (1j * omega) ** {"displacement": 0, "velocity": 1, "acceleration": 2}[kind]
    stiffness = MASS_KG * (omega0**2 - omega**2 + 2j * zeta * omega0 * omega) * np.exp(1j * np.radians(beta_deg))
    force = stiffness * displacement
    rng = np.random.default_rng(seed)
    force = force * (1 + noise * (rng.normal(size=f_hz.size) + 1j * rng.normal(size=f_hz.size)))
    return FrequencyResponse(f_hz, force, response, kind, controlled, 20.0, "20", "beam")


@pytest.mark.parametrize("kind", ["displacement", "velocity", "acceleration"])
@pytest.mark.parametrize("beta_deg", [0.0, 9.0, -20.0])
def test_one_linear_mode_is_returned_exactly(kind: Motion, beta_deg: float) -> None:
    mode = stepped_sine_mode([level(beta_deg=beta_deg, kind=kind)])
    assert mode.modal_frequency_hz[0] == pytest.approx(80.3, rel=1e-9)
    assert mode.damping_ratio[0] == pytest.approx(0.004, rel=1e-7)
    assert mode.phase_lag_deg[0] == pytest.approx(90 + beta_deg, abs=1e-5)
    assert mode.apparent_mass_kg[0] == pytest.approx(MASS_KG, rel=1e-6)
    assert mode.fit_residual[0] < 1e-9


def test_force_and_amplitude_are_those_at_the_modal_frequency() -> None:
    mode = stepped_sine_mode([level(kind="displacement")])
    assert mode.amplitude_m[0] == pytest.approx(20.0)
    assert mode.force_n[0] == pytest.approx(MASS_KG * 2 * 0.004 * (2 * np.pi * 80.3) ** 2 * 20.0, rel=1e-6)
    assert np.isnan(mode.modal_amplitude[0])
    assert mode.source == "stepped sine"


def test_a_turned_modal_constant_says_how_far_phase_resonance_lies_away() -> None:
    fine = np.linspace(80.0, 80.6, 60001)
    turned = level(beta_deg=9.0, f_hz=fine)
    away = abs(float(np.interp(90.0, turned.phase_lag_deg, fine)) / 80.3 - 1.0)
    assert any(f"up to {100.0 * away:.2f} %" in note for note in stepped_sine_mode([level(beta_deg=9.0)]).notes)
    assert not any("turns by" in note for note in stepped_sine_mode([level(beta_deg=1.0)]).notes)


def test_the_interval_of_the_frequency_holds_phase_resonance_where_the_modal_constant_is_turned() -> None:
    fine = np.linspace(80.0, 80.6, 60001)
    turned = level(beta_deg=9.0, f_hz=fine)
    resonance_hz = float(np.interp(90.0, turned.phase_lag_deg, fine))
    low, high = stepped_sine_mode([level(beta_deg=9.0)]).interval("modal_frequency_hz")[0]
    assert low < min(resonance_hz, 80.3)
    assert max(resonance_hz, 80.3) < high


def test_the_interval_of_the_damping_holds_the_truth_where_the_stiffness_changes_with_the_lag() -> None:
    # A joint whose stiffness rises by 2 % of each step in frequency: the slope over the frequency is that of 0.98 masses.
    omega, omega0 = 2 * np.pi * FREQUENCY_HZ, 2 * np.pi * 80.3
    own = omega0 + 0.02 * (omega - omega0)
    force = MASS_KG * (own**2 - omega**2 + 2j * 0.004 * own * omega) * 2e-3
    moving = FrequencyResponse(FREQUENCY_HZ, force, np.full(omega.size, 2e-3 + 0j), "displacement", "response", 2e-3)
    still = level(kind="displacement")
    small = replace(still, response=5e-5 * still.response, force=5e-5 * still.force, level=1e-3)
    mode = stepped_sine_mode([small, moving])
    assert abs(mode.damping_ratio[1] / 0.004 - 1.0) > 0.015
    low, high = mode.interval("damping_ratio").T
    assert np.all((low < 0.004) & (high > 0.004))


def test_a_turned_modal_constant_held_real_shifts_the_frequency() -> None:
    mode = stepped_sine_mode([level(beta_deg=9.0)], complex_constant=False)
    assert 0.02 < 80.3 - mode.modal_frequency_hz[0] < 0.15
    assert mode.fit_residual[0] > 0.02


def test_stated_uncertainty_covers_the_truth_under_proportional_noise() -> None:
    modes = [stepped_sine_mode([level(beta_deg=5.0, noise=0.02, seed=seed)]) for seed in range(200)]
    frequency = [(m.modal_frequency_hz[0] - 80.3) / m.random("modal_frequency_hz")[0] for m in modes]
    damping = [(m.damping_ratio[0] - 0.004) / m.random("damping_ratio")[0] for m in modes]
    covered = np.mean(np.abs([frequency, damping]) < 1.96, axis=1)
    assert np.all((covered > 0.90) & (covered < 0.99)), covered
    assert abs(np.mean(damping)) < 0.4


def at_lags(lags_deg: list[float]) -> np.ndarray:
    """Frequencies of the linear mode of `level` at lags of its displacement."""
    cot = 1.0 / np.tan(np.radians(lags_deg))
    return np.asarray(80.3 * (np.sqrt(1.0 + (0.004 * cot) ** 2) - 0.004 * cot))


@pytest.mark.parametrize("lags_deg", [[32.0, 90.0, 148.0], [27.0, 58.0, 90.0, 122.0, 153.0]])
def test_few_lags_are_enough_and_their_uncertainty_covers_the_truth(lags_deg: list[float]) -> None:
    f_hz = at_lags(lags_deg)
    exact = level(f_hz=f_hz, beta_deg=3.0)
    assert exact.phase_lag_deg == pytest.approx(np.array(lags_deg) + 3.0)
    assert stepped_sine_mode([exact]).damping_ratio[0] == pytest.approx(0.004, rel=1e-7)
    modes = [stepped_sine_mode([level(f_hz=f_hz, beta_deg=3.0, noise=0.01, seed=seed)]) for seed in range(300)]
    frequency = [(m.modal_frequency_hz[0] - 80.3) / m.random("modal_frequency_hz")[0] for m in modes]
    damping = [(m.damping_ratio[0] - 0.004) / m.random("damping_ratio")[0] for m in modes]
    covered = np.mean(np.abs([frequency, damping]) < 1.96, axis=1)
    assert np.all((covered > 0.91) & (covered < 0.98)), covered


def test_a_window_that_was_widened_is_said_and_points_within_it_keep_others_out() -> None:
    lags = [27.0, 58.0, 90.0, 122.0, 153.0]
    mode = stepped_sine_mode([level(f_hz=at_lags(lags)), level()])
    assert any("fewer than 5 points" in note for note in mode.notes)
    assert any("points up to 63 deg away" in note for note in mode.notes)
    spoilt = level(f_hz=at_lags([10.0, 40.0, 60.0, 90.0, 120.0, 140.0]))
    force = spoilt.force.copy()
    force[0] *= 1.5
    spoilt = FrequencyResponse(spoilt.frequency_hz, force, spoilt.response, spoilt.kind, "response", 20.0)
    mode = stepped_sine_mode([spoilt])
    assert mode.damping_ratio[0] == pytest.approx(0.004, rel=1e-7)
    assert len(mode.notes) == 1


def test_a_level_that_no_mode_fits_does_not_take_the_others_with_it() -> None:
    poor = level(f_hz=np.array([80.25, 80.35]))
    mode = stepped_sine_mode([poor, level(80.1)])
    assert mode.modal_frequency_hz == pytest.approx([80.1])
    assert any(note.startswith("left out: level '20': points at 2 frequencies") for note in mode.notes)
    with refused(IdentificationError, "no-other-of-levels-fits-either"):
        stepped_sine_mode([poor, poor])


def test_points_where_the_controller_lost_its_level_are_left_out() -> None:
    good = level()
    response, force = good.response.copy(), good.force.copy()
    response[:20] *= 0.9
    force[:20] *= 0.5
    broken = FrequencyResponse(FREQUENCY_HZ, force, response, "acceleration", "response", 20.0)
    assert stepped_sine_mode([broken]).damping_ratio[0] == pytest.approx(0.004, rel=1e-6)


def test_levels_that_are_not_response_controlled_are_left_out_and_said_so() -> None:
    mode = stepped_sine_mode([level(controlled="force"), level()])
    assert mode.modal_frequency_hz.size == 1
    assert "1 of 2 levels left out: not response-controlled" in mode.notes
    with refused(IdentificationError, "none-is-response-controlled-force-given", field="responses"):
        stepped_sine_mode([level(controlled="force")])


def test_what_cannot_be_fitted_is_named() -> None:
    with refused(IdentificationError, "points-at-frequencies-of-points"):
        stepped_sine_mode([level(f_hz=np.array([80.25, 80.35, 80.35]))])
    with refused(IdentificationError, field="phase_window_deg", value=120.0, allowed="above 0 to 90"):
        stepped_sine_mode([level()], phase_window_deg=120.0)
    good = level()
    backwards = FrequencyResponse(
        FREQUENCY_HZ, np.conj(good.force), np.conj(good.response), "displacement", "response", 20.0, "mirrored"
    )
    with refused(IdentificationError, "no-damped-resonance-fits"):
        stepped_sine_mode([backwards])


def test_a_stepped_sine_mode_survives_being_stored() -> None:
    mode = stepped_sine_mode([level(), level(80.1, 0.005)])
    again = decode(NonlinearMode, *encode(mode))
    np.testing.assert_array_equal(again.damping_ratio, mode.damping_ratio)
    assert again.notes == mode.notes


def test_frequency_responses_survive_being_packed() -> None:
    levels = [level(), level(f_hz=FREQUENCY_HZ[:7], controlled="force", kind="velocity")]
    again = unpack_frequency_responses(*pack_frequency_responses(levels))
    for one, other in zip(levels, again, strict=True):
        np.testing.assert_array_equal(one.force, other.force)
        np.testing.assert_array_equal(one.frequency_hz, other.frequency_hz)
        assert (one.kind, one.controlled, one.level, one.label) == (
            other.kind,
            other.controlled,
            other.level,
            other.label,
        )
    arrays, _ = pack_frequency_responses(levels)
    with refused(IdentificationError, "levels-is-missing"):
        unpack_frequency_responses(arrays, {})


@pytest.mark.parametrize(
    ("force", "kind", "message"),
    [
        ([1.0, np.nan], "acceleration", {"says": "value-at", "field": "force"}),
        ([1.0], "acceleration", {"says": "values-for-frequencies", "field": "force"}),
        ([1.0, 0.0], "acceleration", {"says": "value-at-is-must-not-be", "field": "force"}),
        ([1.0, 1.0], "jerk", {"field": "kind", "value": "jerk", "allowed": "displacement, velocity, acceleration"}),
    ],
)
def test_unusable_responses_are_refused_by_name(force: list[float], kind: Motion, message: str) -> None:
    with refused(IdentificationError, **message):
        FrequencyResponse(np.array([79.0, 80.0]), np.array(force), np.ones(2, complex), kind, "response", 20.0)
