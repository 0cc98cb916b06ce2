"""The linear rig is found in responses that come from the simulators, which share no code with the fit."""

import numpy as np
import pytest

from rig.rehearsal.linear.fit import posterior
from rig.rehearsal.linear.model import LinearRig, Prior, Responses
from rig.rehearsal.linear.parameters import POSSIBLE
from rig.rehearsal.linear.slopes import slopes
from simulators import VirtualRig
from simulators.analysis import frequency_response
from tests.rig.rehearsal.known import EXCITER, MODE, RATIOS

RATE_HZ = 5000.0
TRUE = {
    "frequency_hz": 24.0,
    "damping_ratio": 0.006,
    "drive_shape": 0.8,
    "force_per_volt_n_v": 4.0,
    "moving_mass_kg": 0.25,
    "exciter_damping_n_s_m": 24.0,
    "suspension_stiffness_n_m": 8000.0,
}
START = {**MODE, **EXCITER}


def rig_of(values, beside=()):
    """A virtual rig with one mode, two far ones and others ``beside`` (frequency, damping, shape)."""
    modes = sorted(
        [(values["frequency_hz"], values["damping_ratio"], values["drive_shape"]), (300.0, 0.005, 1.2), *beside]
    )
    half, per_volt = 0.5 * values["exciter_damping_n_s_m"], values["force_per_volt_n_v"]
    resistance = half / per_volt**2
    return VirtualRig.model_validate(
        {
            "structure": {
                "kind": "modal",
                "frequency_hz": [mode[0] for mode in modes],
                "damping_ratio": [mode[1] for mode in modes],
                "shapes": {
                    "drive": [mode[2] for mode in modes],
                    "tip": [1.5 * mode[2] if mode[0] == values["frequency_hz"] else -mode[2] for mode in modes],
                },
            },
            "exciter": {
                "armature_mass_kg": values["moving_mass_kg"],
                "suspension_stiffness_n_m": values["suspension_stiffness_n_m"],
                "suspension_damping_n_s_m": half,
                "force_factor_n_a": half / per_volt,
                "resistance_ohm": resistance,
                "inductance_h": 1e-4 * resistance,
            },
            "stinger": {"at": "drive", "stiffness_n_m": 5e6, "damping_n_s_m": 10.0},
            "sensors": [
                {"name": "force", "kind": "force", "sensitivity_v_per_unit": 0.1, "range_v": 5.0},
                *(
                    {"name": name, "kind": "acceleration", "at": name, "sensitivity_v_per_unit": 0.01, "range_v": 5.0}
                    for name in ("drive", "tip")
                ),
            ],
        }
    )


def responses_of(rig, lines, noise, seed=0, coupling_hz=0.3):
    """What a multisine would measure: held output, AC-coupled inputs, white noise relative to each response's RMS."""
    found = frequency_response(rig, lines)
    s = 2j * np.pi * lines
    moved = [s**2 * found.displacement_m_per_v[at] for at in ("drive", "tip")]
    value = np.stack([found.force_n_per_v, *moved], axis=1)
    value = value * (np.sinc(lines / RATE_HZ) * s / (s + 2 * np.pi * coupling_hz))[:, None]
    std = noise * np.sqrt(np.mean(np.abs(value) ** 2, axis=0))
    normal = np.random.default_rng(seed).standard_normal((2, *value.shape)) / np.sqrt(2.0)
    return Responses(lines, value + std * (normal[0] + 1j * normal[1]), np.broadcast_to(std, value.shape), RATE_HZ)


LINES = np.linspace(12.0, 52.0, 300)


def test_parameters_are_recovered_within_their_standard_errors():
    found = posterior(("tip",), START, {}, responses_of(rig_of(TRUE), LINES, 0.001))
    rig = found.rig()
    for name, value in TRUE.items():
        assert abs(np.log(rig.values[name] / value)) < 4.0 * found.std(name) + 2e-3, name
    assert rig.values["ratio tip"] == pytest.approx(1.5, rel=5e-3)
    assert found.std("frequency_hz") < 1e-4 < found.std("moving_mass_kg") < 0.5


@pytest.mark.slow
def test_stated_intervals_cover_the_truth_over_many_noises():
    inside = {"frequency_hz": 0, "damping_ratio": 0, "drive_shape": 0, "moving_mass_kg": 0}
    rig, n = rig_of(TRUE), 16
    for seed in range(n):
        found = posterior(("tip",), START, {}, responses_of(rig, LINES[::3], 0.02, seed))
        for name in inside:
            inside[name] += abs(np.log(found.rig().values[name] / TRUE[name])) < 2.0 * found.std(name)
    assert all(count >= 0.75 * n for count in inside.values()), inside


@pytest.mark.slow
def test_what_a_narrow_band_does_not_determine_stays_as_wide_as_before():
    narrow = posterior(("tip",), START, {}, responses_of(rig_of(TRUE), np.linspace(23.0, 25.0, 200), 0.001))
    wide = posterior(("tip",), START, {}, responses_of(rig_of(TRUE), LINES, 0.001))
    assert narrow.std("moving_mass_kg") > 2.0 * wide.std("moving_mass_kg")
    assert narrow.determined < wide.determined
    drawn = [narrow.draw(np.random.default_rng(seed)) for seed in range(60)]
    masses, stiffnesses = (
        np.log([rig.values[name] for rig in drawn]) for name in ("moving_mass_kg", "suspension_stiffness_n_m")
    )
    assert np.std(masses) == pytest.approx(narrow.std("moving_mass_kg"), rel=0.5)
    assert np.corrcoef(masses, stiffnesses)[0, 1] > 0.5  # k - m w^2 is determined, m and k are not


def test_draws_fit_the_responses_within_their_noise():
    responses = responses_of(rig_of(TRUE), LINES, 0.01)
    found = posterior(("tip",), START, {}, responses)
    best = np.abs((found.rig().responses(LINES, RATE_HZ) - responses.value) / responses.std)
    for seed in range(10):
        drawn = found.draw(np.random.default_rng(seed)).responses(LINES, RATE_HZ)
        assert np.mean(np.abs((drawn - responses.value) / responses.std) ** 2) < 2.0 * np.mean(best**2)


def test_a_mode_beside_is_found():
    found = posterior(("tip",), START, {}, responses_of(rig_of(TRUE, [(31.0, 0.005, 0.4)]), LINES, 0.005))
    rig = found.rig()
    assert rig.values["frequency_hz 2"] == pytest.approx(31.0, rel=2e-3)
    assert rig.values["drive_shape 2"] == pytest.approx(0.4, rel=0.05)
    assert rig.values["frequency_hz"] == pytest.approx(24.0, rel=1e-3)


def test_without_responses_the_priors_are_all_there_is():
    priors = {name: Prior(value, 0.03) for name, value in {**MODE, **EXCITER}.items()}
    found = posterior(tuple(RATIOS), START, priors, None)
    assert found.std("moving_mass_kg") == pytest.approx(0.03)
    assert found.rig().values["moving_mass_kg"] == pytest.approx(EXCITER["moving_mass_kg"])
    assert found.determined == 0.0


def test_the_model_is_that_of_the_simulators():
    values = {**TRUE, "coil_time_constant_s": 1e-4, "stinger_stiffness_n_m": 5e6, "delay_s": 0.0, "coupling_hz": 0.3}
    values |= {"ratio tip": 1.5}
    for name, (hertz, ratio, shape, tip) in {"high": (300.0, 0.005, 1.2, -1.0)}.items():
        values |= {f"frequency_hz {name}": hertz, f"damping_ratio {name}": ratio}
        values |= {f"drive_shape {name}": shape, f"ratio tip {name}": tip}
    model = LinearRig(values, ("tip",)).responses(LINES, RATE_HZ)
    exact = responses_of(rig_of(TRUE), LINES, 0.0).value
    assert np.max(np.abs(model / exact - 1.0)) < 2e-3  # the stinger's damping is left out of the model


def test_a_fit_never_leaves_what_a_rig_can_be(monkeypatch):
    seen = []
    computed = LinearRig.responses

    def noted(rig, *arguments):
        seen.append({name: value for name, value in rig.values.items() if not name.startswith(("ratio", "delay"))})
        return computed(rig, *arguments)

    monkeypatch.setattr(LinearRig, "responses", noted)
    right = responses_of(rig_of(TRUE), LINES[::10], 1e-3)
    reversed_force = right.value * np.array([-1.0, 1.0, 1.0])  # no rig answers so: the fit goes astray
    posterior(("tip",), START, {}, Responses(right.frequency_hz, reversed_force, 1e-5 * np.abs(right.value), RATE_HZ))
    for name in seen[0]:
        values = [one[name] for one in seen]
        assert min(values) > 0.0, name
        assert max(values) < np.exp(2.0 * POSSIBLE) * (1.0 + 1e-9) * min(values), name


def test_slopes_are_those_of_central_differences():
    found = posterior(("tip",), START, {}, None)
    at = found.mean + 0.1 * np.random.default_rng(1).standard_normal(found.mean.size)
    exact = slopes(found.rig(at), LINES[::20], RATE_HZ)
    assert set(exact) == set(found.names)
    for k, name in enumerate(found.names):
        step = (1e-5 if found.positive[k] else 1e-7) * np.eye(at.size)[k]
        ends = [found.rig(at + sign * step).responses(LINES[::20], RATE_HZ) for sign in (1.0, -1.0)]
        difference = (ends[0] - ends[1]) / (2.0 * step[k])
        allowed = 1e-6 * np.max(np.abs(difference)) + 1e-10 * np.max(np.abs(ends))  # truncation and rounding
        np.testing.assert_allclose(exact[name], difference, rtol=0.0, atol=allowed, err_msg=name)


def test_no_coil_integrates_what_an_ac_coupling_differentiates():
    """With a coil of half a second and a coupling above the band the responses are the same, but not the force below it."""
    heavy = {"force_per_volt_n_v": 244.0, "moving_mass_kg": 29.0, "exciter_damping_n_s_m": 6000.0}
    true = {**TRUE, "frequency_hz": 40.7, "drive_shape": 0.381, "suspension_stiffness_n_m": 6.6e5, **heavy}
    measured = responses_of(rig_of(true, beside=((275.0, 0.001, 1.75),)), np.linspace(16.0, 102.0, 300), 0.01)
    found = posterior(["tip"], {name: true[name] for name in MODE}, {}, measured)
    generator = np.random.default_rng(0)
    for rig in (found.rig(), *(found.draw(generator) for _ in range(5))):
        assert rig.of("force_per_volt_n_v") == pytest.approx(244.0, rel=0.05)
        assert rig.of("coil_time_constant_s") <= 0.01
        assert rig.of("coupling_hz") <= 1.01 * 40.7
