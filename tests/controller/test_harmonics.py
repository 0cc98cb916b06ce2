"""The harmonics loop against closed forms: estimates, decay of the errors, the step that measures the plant, bounds."""

import cmath
import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from pydantic import ValidationError
from scipy.linalg import expm

from controller.harmonics.periods import left_alone
from controller.harmonics.plant import CLEAR, LARGEST_PROBE, MEAN_PERIODS, MOST_UNSTEADY, WAIT_PERIODS
from controller.harmonics.records import HarmonicStage
from controller.harmonics.settings import HarmonicsSettings, harmonic_ratios
from tests.controller.linear_plant import LARGEST_V, PER_PERIOD, Plant
from tests.refused import refused

ORDERS = np.arange(2, 8)
DISTURBANCE = {1: 0.8 + 0.6j, 2: 0.2j, 3: -0.05, 5: 0.01 + 0.02j}
QUIET = 150  # periods until a filter that starts from 0 no longer counts as noise


def complex_numbers(largest: float):
    return st.builds(cmath.rect, st.floats(0.0, largest), st.floats(-math.pi, math.pi))


def waiting(*args, **keys):
    """A loop whose filter has settled and which has not begun."""
    return Plant(*args, **keys).run(QUIET, steady=False)


# The filter


@settings(max_examples=15)
@given(st.lists(complex_numbers(2.0), min_size=8, max_size=8))
def test_all_harmonics_and_the_mean_are_estimated_at_once(amplitudes):
    plant = waiting(0.0, dict(enumerate(amplitudes)))
    assert plant.stage is HarmonicStage.WAITING
    np.testing.assert_allclose(plant.estimate_n[-1, 1:8], amplitudes[1:], atol=1e-6)
    np.testing.assert_allclose(plant.state["error"][0, 2:8], amplitudes[2:], atol=1e-6)
    assert plant.state["filter"][0, 0].real == pytest.approx(amplitudes[0].real, abs=1e-6)


@pytest.mark.parametrize("corner", [0.05, 0.2, 0.5])
def test_the_estimates_scatter_as_a_first_order_low_pass_lets_noise_through(corner):
    plant = waiting(0.0, noise=0.1, corner=corner).run(3000, steady=False)
    gain = corner * 2 * math.pi / PER_PERIOD
    ends = plant.estimate_n[PER_PERIOD - 1 :: PER_PERIOD, 2:8]
    assert np.mean(np.abs(ends) ** 2) == pytest.approx(2 * gain * 0.1**2 / (1 - 0.5 * 13 * gain), rel=0.1)


# The integral law


def decayed(corner, integral, samples):
    """F_h over its value before the loops were closed: F' = -k C, C' = w (F - C), both 1 at first."""
    k, w = 2 * math.pi * integral, 2 * math.pi * corner
    over_a_sample = expm(np.array([[0.0, -k], [w, -w]]) / PER_PERIOD)
    states = [np.ones(2)]
    for _ in range(samples - 1):
        states.append(over_a_sample @ states[-1])
    return np.array(states)[:, 0]


@settings(max_examples=15)
@given(st.floats(0.02, 0.1), st.floats(0.05, 0.6), complex_numbers(1.0).filter(lambda p: abs(p) > 0.2))
def test_every_error_decays_as_the_closed_form_says_whatever_the_plants_phase(corner, ratio, p):
    integral = ratio * corner
    plant = waiting(p, DISTURBANCE, corner=corner, integral=integral, largest=10.0)
    plant.state["stage"], plant.state["plant"][0, 2:] = HarmonicStage.CONTROLLING, p
    plant.run(80, 2.0, free=False)
    expected = decayed(corner, integral, 80 * PER_PERIOD)
    for order in (2, 3, 5):
        found = plant.force_n[:, order] / DISTURBANCE[order]
        # The filter is a low-pass of first order on average only: its step is not small beside a period.
        np.testing.assert_allclose(found, expected, atol=1.5 * corner)
    np.testing.assert_allclose(plant.force_n[-1, [4, 6, 7]], 0.0, atol=1e-4)


def test_a_slow_loop_decays_exactly_as_the_closed_form_says():
    plant = waiting(0.3 - 0.4j, DISTURBANCE, corner=0.02, integral=0.004)
    plant.run(500, steady=False)
    plant.state["stage"], plant.state["plant"][0, 2:] = HarmonicStage.CONTROLLING, 0.3 - 0.4j
    plant.run(100, 2.0, free=False)
    expected = decayed(0.02, 0.004, 100 * PER_PERIOD)
    for order in (2, 3, 5):
        np.testing.assert_allclose(plant.force_n[:, order] / DISTURBANCE[order], expected, atol=0.02)


# Prescribed harmonics


@settings(max_examples=15)
@given(complex_numbers(1.5).filter(lambda f: abs(f) > 0.1), st.floats(0.0, 1.0), st.floats(-360.0, 360.0))
def test_a_prescribed_harmonic_turns_with_the_fundamental(fundamental, ratio, phase_deg):
    plant = waiting(0.5j, {1: fundamental, 2: 0.1}, wanted={3: (ratio, phase_deg)}, largest=10.0)
    plant.controlling().run(120, free=False)
    wanted = ratio * abs(fundamental) * cmath.exp(1j * (3 * cmath.phase(fundamental) + math.radians(phase_deg)))
    assert plant.force_n[-1, 3] == pytest.approx(wanted, abs=1e-4)
    np.testing.assert_allclose(plant.force_n[-1, [2, 4, 5, 6, 7]], 0.0, atol=1e-4)


@pytest.mark.parametrize(("phase_deg", "sign"), [(0.0, 1.0), (180.0, -1.0), (360.0, 1.0)])
def test_at_phase_0_a_peak_of_the_harmonic_coincides_with_a_peak_of_the_fundamental(phase_deg, sign):
    plant = waiting(0.5j, {1: 2.0 * cmath.exp(0.7j)}, wanted={2: (0.2, phase_deg)}).controlling().run(100, free=False)
    theta = np.linspace(-math.pi, math.pi, 10_001)
    one, two = (np.real(plant.force_n[-1, h] * np.exp(1j * h * theta)) for h in (1, 2))
    peak = np.argmax(one)
    assert two[peak] == pytest.approx(sign * 0.2 * 2.0, abs=1e-3)


def test_harmonics_that_are_prescribed_later_replace_those_before():
    plant = waiting(1.0, wanted={2: (0.5, 0.0)}).controlling().run(100, free=False)
    assert plant.force_n[-1, 2] == pytest.approx(0.5, abs=1e-4)
    plant.want({4: (0.2, 90.0)})
    plant.run(100, free=False)
    assert plant.force_n[-1, 4] == pytest.approx(0.2j, abs=1e-4)
    assert abs(plant.force_n[-1, 2]) < 1e-4
    plant.want({})
    plant.run(100, free=False)
    assert np.abs(plant.force_n[-1, 2:8]).max() < 1e-4


# The step that measures the plant


@settings(max_examples=15)
@given(st.lists(complex_numbers(2.0).filter(lambda p: abs(p) > 0.05), min_size=6, max_size=6))
def test_without_noise_the_step_measures_every_plant_up_to_what_the_filter_has_not_settled(values):
    plants = dict(zip(ORDERS.tolist(), values, strict=True))
    plant = waiting(plants, DISTURBANCE).controlling()
    left = math.exp(-2 * math.pi * 0.2 * WAIT_PERIODS)
    # What the filter has not settled of one harmonic shows in the others too.
    np.testing.assert_allclose(plant.state["plant"][0, 2:8], values, atol=3.0 * left * max(map(abs, values)))
    assert left_alone(plant.parameters[0], plant.state[0]) == 0


def test_the_step_is_taken_back_and_lasts_no_longer_than_it_is_averaged():
    plant = waiting(1.0, DISTURBANCE)
    plant.run(2 * (WAIT_PERIODS + MEAN_PERIODS))
    stepped = plant.stages == HarmonicStage.PROBING
    # The period in whose end a stage changes counts for the next stage.
    assert stepped.sum() == (WAIT_PERIODS + MEAN_PERIODS) * PER_PERIOD
    probe = np.full(6, 0.004)
    np.testing.assert_allclose(np.abs(plant.volts[stepped, 2:8]), np.broadcast_to(probe, (stepped.sum(), 6)), rtol=1e-9)
    plant.run(1)
    assert plant.stage is HarmonicStage.CONTROLLING


def test_the_step_of_all_harmonics_has_a_low_crest():
    plant = waiting(1.0).run(3 + MEAN_PERIODS)
    assert plant.stage is HarmonicStage.PROBING
    theta = np.linspace(0, 2 * math.pi, 1000)
    step = np.real(plant.volts[-1, 2:8] @ np.exp(1j * np.outer(ORDERS, theta)))
    assert np.abs(step).max() < 0.65 * 6 * 0.004


def test_in_noise_the_plant_is_right_within_the_scatter_of_the_averages():
    sigma, gain = 2e-3, 0.2 * 2 * math.pi / PER_PERIOD
    keep = math.exp(-2 * math.pi * 0.2)  # correlation of the filter from period to period
    share = sum(keep ** abs(i - k) for i in range(MEAN_PERIODS) for k in range(MEAN_PERIODS)) / MEAN_PERIODS**2
    expected = math.sqrt(2 * share * 2 * gain) * sigma / 0.004
    plants = [waiting(1.0, noise=sigma, seed=seed).controlling() for seed in range(40)]
    once = [p.state["plant"][0, 2:8] for p in plants if p.state["probe"][0, 2] == 0.004]
    assert len(once) > 25
    errors = np.array([plant.state["plant"][0, 2:8] - 1.0 for plant in plants])
    small = errors[[plant.state["probe"][0, 2:8].max() < 0.005 for plant in plants]]
    assert math.sqrt(np.mean(np.abs(small) ** 2)) == pytest.approx(expected, rel=0.15)


def test_a_quiet_harmonic_gets_larger_steps_and_is_left_alone_where_the_largest_shows_nothing():
    plant = waiting({2: 1.0, 3: 0.03, 4: 1e-4}, {1: 1.0, 2: 0.1}, noise=1e-3, highest=4).controlling()
    probe = plant.state["probe"][0, 2:5]
    assert probe[0] == 0.004
    assert probe[1] == pytest.approx(0.036)
    assert probe[2] <= LARGEST_PROBE
    assert left_alone(plant.parameters[0], plant.state[0]) == 1 << 4
    assert plant.state["plant"][0, 3] == pytest.approx(0.03, rel=0.5)
    plant.run(200, free=False)
    assert abs(plant.volts[-1, 4]) < 1e-15
    assert abs(plant.force_n[-1, 2]) < 2e-3


def test_what_was_left_alone_is_tried_again_at_a_clearly_higher_output():
    plant = waiting({2: 1.0, 3: 0.008}, noise=1e-3, highest=3).controlling()
    assert left_alone(plant.parameters[0], plant.state[0]) == 1 << 3
    plant.run(50, 1.4)
    assert plant.stage is HarmonicStage.CONTROLLING
    plant.run(1, 4.0, free=False)
    assert plant.stage is HarmonicStage.CONTROLLING  # never while a point is recorded
    plant.run(1, 4.0)
    assert plant.stage is HarmonicStage.WAITING
    plant.run(100, 4.0)
    assert plant.stage is HarmonicStage.CONTROLLING
    assert left_alone(plant.parameters[0], plant.state[0]) == 0


def test_an_unsteady_vibration_ends_the_step_and_takes_it_back():
    plant = waiting(1.0).run(1)
    plant.run(MOST_UNSTEADY, steady=False)
    assert plant.stage is HarmonicStage.PROBING  # noise alone may say so for a while
    plant.run(1, steady=False)
    assert plant.stage is HarmonicStage.WAITING
    plant.run(1, steady=False)
    assert np.abs(plant.volts[-1, 2:8]).max() < 1e-15
    assert plant.state["miss"][0] == math.inf


# Plants that are known beforehand, harmonics that the plan leaves alone


def test_a_loop_that_is_not_locked_ends_the_step_at_once():
    plant = waiting(1.0).run(3 + MEAN_PERIODS)
    assert plant.stage is HarmonicStage.PROBING
    plant.run(1, steady=False, locked=False)
    assert plant.stage is HarmonicStage.WAITING


def test_known_plants_are_controlled_as_soon_as_the_loop_is_locked_without_a_step():
    known = dict.fromkeys(range(2, 8), (0.3, -0.4))
    plant = waiting(0.3 - 0.4j, DISTURBANCE, force_per_v=known).run(1, steady=False)
    assert plant.stage is HarmonicStage.CONTROLLING
    plant.run(100, steady=False)
    assert np.abs(plant.force_n[-1, 2:8]).max() < 1e-4
    unlocked = Plant(0.3 - 0.4j, DISTURBANCE, force_per_v=known).run(50, locked=False, steady=False)
    assert unlocked.stage is HarmonicStage.WAITING
    assert not unlocked.volts.any()


def test_where_some_plants_are_known_only_the_others_are_measured():
    table = {"highest": 3, "force_per_v": {3: (0.001, 0.0)}}  # a step shows nothing of it in this noise
    plant = waiting({2: 1.0, 3: 0.001}, {1: 1.0, 2: 0.1, 3: 5e-4}, noise=1e-3, largest=10.0, **table)
    assert plant.stage is HarmonicStage.WAITING  # not steady
    plant.controlling()
    assert left_alone(plant.parameters[0], plant.state[0]) == 0
    assert plant.state["plant"][0, 3] == 0.001
    assert plant.state["plant"][0, 2] == pytest.approx(1.0, abs=0.1)
    plant.run(200, free=False)
    assert abs(plant.force_n[-PER_PERIOD:, 3].mean()) < 2.5e-4


def test_harmonics_that_the_plan_leaves_alone_stay_as_they_are_and_are_no_surprise():
    plant = waiting(0.5, DISTURBANCE, left_alone=(3, 5)).controlling().run(100, free=False)
    assert plant.force_n[-1, 3] == pytest.approx(DISTURBANCE[3], abs=1e-9)
    assert plant.force_n[-1, 5] == pytest.approx(DISTURBANCE[5], abs=1e-9)
    assert abs(plant.force_n[-1, 2]) < 1e-4
    assert left_alone(plant.parameters[0], plant.state[0]) == 0
    assert plant.state["miss"][0] < 1.0


# A plant that is wrong


@pytest.mark.parametrize("known", [False, True], ids=["changed", "known wrongly"])
@pytest.mark.parametrize("turn_deg", [120.0, -120.0, 180.0])
def test_a_wrong_plant_makes_errors_grow_and_is_measured_again(turn_deg, known):
    turned = cmath.rect(0.5, math.radians(turn_deg))
    table = {"force_per_v": dict.fromkeys(range(2, 8), (0.5, 0.0))} if known else {}
    plant = waiting(turned if known else 0.5, {1: 1.0, 2: 0.02, 3: -0.02}, **table).controlling()
    plant.run(0 if known else 60)
    plant.plant[2:] = turned
    plant.disturbance[2] += 0.02
    plant.run(100)
    assert plant.state["probes"][0] >= 1
    plant.run(200)
    assert plant.stage is HarmonicStage.CONTROLLING
    assert plant.state["plant"][0, 2] == pytest.approx(turned, rel=0.1)
    assert np.abs(plant.force_n[-1, 2:8]).max() < 0.002
    assert plant.state["miss"][0] <= 1.0


def test_no_plant_is_measured_again_while_a_point_is_recorded():
    plant = waiting(0.5, {1: 1.0, 2: 0.02}).controlling().run(60)
    plant.plant[2:] = cmath.rect(0.5, math.radians(120.0))
    plant.disturbance[2] += 0.02
    plant.run(100, free=False)
    assert plant.stage is HarmonicStage.CONTROLLING
    assert plant.state["miss"][0] > 1.0


def test_after_a_few_times_it_is_not_measured_again():
    plant = waiting(0.5, {1: 1.0, 2: 0.5}, largest=0.01).controlling()
    plant.run(3000)  # the bound holds the harmonic back: no step helps
    assert plant.state["probes"][0] <= 4
    assert plant.stage is HarmonicStage.CONTROLLING


# Bounds


def test_a_harmonic_stays_within_its_bound_and_leaves_it_without_windup():
    plant = waiting(0.5, {1: 1.0, 2: 0.5j}, largest=0.2).controlling().run(300, free=False)
    assert abs(plant.volts[-1, 2]) == pytest.approx(0.2, abs=1e-12)
    assert np.abs(plant.volts[:, 2]).max() <= 0.2 + 1e-12
    plant.disturbance[2] = 0.0
    plant.run(40, free=False)
    left = np.abs(plant.volts[:, 2])
    # The filter passes from 0.4 N to -0.1 N within 1.3 periods; from then on the harmonic decays.
    np.testing.assert_array_less(left[4 * PER_PERIOD :], 0.2 * decayed(0.2, 0.04, left.size - 4 * PER_PERIOD) + 0.01)
    assert left[-1] < 1e-3


@settings(max_examples=15)
@given(
    st.lists(complex_numbers(1.0), min_size=6, max_size=6),
    complex_numbers(1.0),
    st.floats(0.01, 5.0),
    st.floats(0.0, 5.0),
)
def test_the_whole_output_never_exceeds_the_voltage_limit(errors, p, first_v, then_v):
    plant = waiting(1.0, dict(zip(ORDERS.tolist(), errors, strict=True)), probe=0.2, largest=10.0)
    plant.run(60, first_v)
    plant.plant[2:] = p  # also with another plant than was measured
    for amplitude in (first_v, np.linspace(first_v, then_v, 20 * PER_PERIOD), then_v, np.full(PER_PERIOD, LARGEST_V)):
        plant.run(20 if not isinstance(amplitude, np.ndarray) else amplitude.size // PER_PERIOD, amplitude)
        assert np.abs(plant.output_v).max() <= LARGEST_V * (1 + 1e-12)
        assert np.isfinite(plant.volts).all()
    assert np.abs(plant.volts[-1]).max() == 0.0  # the fundamental has all of it


def test_harmonics_give_way_to_the_fundamental_and_come_back_without_windup():
    plant = waiting(0.5, {1: 1.0, 2: 0.5, 3: 0.3j}, largest=10.0).controlling().run(100, free=False)
    plant.run(200, 4.9, free=False)
    assert plant.state["bounded"][0] == 1
    assert np.abs(plant.volts[-1, 2:8]).sum() <= 0.1 + 1e-12
    plant.run(40, free=False)
    assert plant.state["bounded"][0] == 0
    assert np.abs(plant.force_n[-1, 2:8]).max() < 2e-3


@settings(max_examples=15)
@given(st.floats(1e-6, 1e-3))
def test_no_harmonic_changes_faster_than_the_bench_allows_the_output(step_v):
    plant = waiting(0.01, {1: 1.0, 2: 0.5, 3: 0.2j}, step_v=step_v, largest=10.0).controlling().run(30, free=False)
    change = np.abs(np.diff(plant.volts[:, 2:8], axis=0))
    assert change.max() <= step_v * (1 + 1e-9)
    assert change.max() > 0.5 * step_v or step_v > 1e-4


# The end of a run


@pytest.mark.parametrize("periods", [0, 3, 10, 60], ids=["waiting", "listening", "probing", "controlling"])
def test_the_harmonics_come_down_with_the_fundamental_from_every_stage(periods):
    stages = {0: "WAITING", 3: "LISTENING", 10: "PROBING", 60: "CONTROLLING"}
    plant = waiting(0.5, {1: 1.0, 2: 0.2j, 7: 0.1}).run(max(periods, 1), steady=periods > 0)
    assert plant.stage.name == stages[periods]
    before = plant.volts[-1].copy()
    down = np.linspace(1.0, 0.0, 10 * PER_PERIOD + 1)[1:]
    plant.run(10, down, running=False, acts=False, locked=False, steady=False)
    theta = 2 * math.pi * np.arange(down.size) / PER_PERIOD
    taken_back = plant.volts[-1]
    whole = np.cos(theta) + np.real(np.exp(1j * np.outer(theta, np.arange(13))) @ before)
    first = slice(0, PER_PERIOD - 1)  # up to the end of the first period the harmonics are those of the stage
    np.testing.assert_allclose(plant.output_v[first], (down * whole)[first], atol=1e-9)
    late = np.cos(theta) + np.real(np.exp(1j * np.outer(theta, np.arange(13))) @ taken_back)
    np.testing.assert_allclose(plant.output_v[PER_PERIOD:], (down * late)[PER_PERIOD:], atol=1e-9)
    plant.run(1, 0.0, running=False, acts=False)
    assert not plant.output_v.any()


def test_after_a_drop_to_0_v_nothing_comes_out():
    plant = waiting(0.5, {1: 1.0, 2: 0.2j}).controlling().run(60)
    plant.run(5, 0.0, running=False, acts=False)
    assert not plant.output_v.any()
    never = Plant(0.5).run(2, 0.0, running=False, acts=False)  # a run that ends before it began
    assert not never.output_v.any()


# A lost lock


def test_while_the_lock_is_lost_the_harmonics_are_kept_and_not_integrated():
    plant = waiting(0.5, {1: 1.0, 2: 0.2j}).controlling().run(80)
    kept = plant.volts[-1].copy()
    plant.disturbance[2] = 0.3
    plant.run(50, acts=False, locked=False, steady=False)
    np.testing.assert_array_equal(plant.volts, np.broadcast_to(kept, plant.volts.shape))
    plant.run(100, free=False)
    assert abs(plant.force_n[-1, 2]) < 1e-4


# Settings


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"highest": 1}, {"field": "highest"}),
        ({"highest": 13}, {"field": "highest"}),
        ({"corner": 0.0}, {"field": "corner"}),
        ({"corner": 0.6}, {"field": "corner"}),
        ({"integral": 0.0}, {"field": "integral", "value": 0.0}),
        ({"wanted": {1: (0.5, 0.0)}}, {"field": "wanted", "allowed": "2 to 7, the loop's highest"}),
        ({"wanted": {8: (0.5, 0.0)}}, {"field": "wanted", "allowed": "2 to 7, the loop's highest"}),
        ({"wanted": {2: (-0.5, 0.0)}}, {"field": "wanted", "allowed": "a ratio from 0 to 10 and a phase"}),
        ({"wanted": {2: (11.0, 0.0)}}, {"field": "wanted", "allowed": "a ratio from 0 to 10 and a phase"}),
        ({"wanted": {2: (math.nan, 0.0)}}, {"field": "wanted", "allowed": "a ratio from 0 to 10 and a phase"}),
        ({"wanted": {2: (0.5, math.inf)}}, {"field": "wanted", "allowed": "a ratio from 0 to 10 and a phase"}),
        ({"left_alone": (8,)}, {"field": "left_alone", "allowed": "2 to 7, the loop's highest"}),
        ({"left_alone": (2,), "wanted": {2: (0.5, 0.0)}}, {"field": "left_alone", "allowed": "one of them"}),
        ({"force_per_v": {9: (1.0, 0.0)}}, {"field": "force_per_v", "allowed": "2 to 7, the loop's highest"}),
        ({"force_per_v": {2: (0.0, 0.0)}}, {"field": "force_per_v", "allowed": "finite numbers, not both 0"}),
        ({"force_per_v": {2: (math.inf, 0.0)}}, {"field": "force_per_v", "allowed": "finite numbers, not both 0"}),
        ({"channel": "acc_drive"}, {"field": "channel", "value": "acc_drive"}),
        ({"order": 3}, {"field": "order", "value": 3}),
    ],
)
def test_a_value_that_is_not_allowed_is_named(changes, named):
    with refused(ValidationError, **named):
        HarmonicsSettings.model_validate(changes)


def test_ratios_are_complex_with_the_phase_in_degrees():
    found = harmonic_ratios({2: (0.5, 90.0), 12: (1.0, 180.0)})
    assert found[2] == pytest.approx(0.5j)
    assert found[12] == pytest.approx(-1.0)
    assert np.count_nonzero(found) == 2


@pytest.mark.parametrize(
    ("changes", "highest_hz", "lead", "named"),
    [
        ({"highest": 12}, 200.0, 1.0, {"says": "allowed-is-up-to", "field": "harmonics.highest", "value": 12}),
        ({"corner": 0.5}, 60.0, 1.0, {"says": "allowed-up-to", "field": "harmonics.corner", "value": 0.5}),
        (
            {},
            24.0,
            1000.0,
            {"says": "its-phase-margin-with-samples-from", "field": "harmonics.integral", "value": 0.04},
        ),
    ],
)
def test_what_the_highest_frequency_or_the_delay_does_not_allow_is_refused(changes, highest_hz, lead, named):
    rate = 5000.0 if lead > 1.0 or "highest" in changes else 2000.0
    if "corner" in changes:
        rate = 60.0 * 2 * math.pi * 15 * 0.3525
    with refused(ValueError, **named):
        HarmonicsSettings.model_validate(changes).check_frequency(rate, highest_hz, lead)


@settings(max_examples=15)
@given(st.floats(0.05, 0.5), st.floats(0.01, 0.2), st.floats(0.0, 3.0))
def test_the_phase_margin_is_that_of_the_open_loop_where_its_gain_is_1(corner, integral, delay_rad):
    margin = HarmonicsSettings(corner=corner, integral=integral).phase_margin_deg(delay_rad)
    x = np.geomspace(1e-3, 1.0, 200_001)
    loop = integral * corner / (1j * x * (1j * x + corner))
    at = np.argmin(np.abs(np.abs(loop) - 1.0))
    expected = 180.0 + math.degrees(np.angle(loop[at])) - math.degrees(x[at] * delay_rad)
    assert margin == pytest.approx(expected, abs=0.05)


def test_the_step_too_keeps_the_bound_of_its_change_from_sample_to_sample():
    plant = waiting(0.5, {1: 1.0, 2: 0.3j})
    plant.parameters["step_v"] = 2e-5
    plant.run(2 * (WAIT_PERIODS + MEAN_PERIODS))
    changes = np.abs(np.diff(plant.volts[:, 2:8], axis=0))
    assert plant.stage is HarmonicStage.CONTROLLING
    assert 1.9e-5 < changes.max() <= 2e-5 * (1.0 + 1e-9)
    np.testing.assert_allclose(plant.state["plant"][0, 2:8], 0.5, rtol=0.02)


def test_a_harmonic_left_alone_by_the_plan_gets_no_step():
    plant = waiting(0.5, {1: 1.0, 2: 0.3j}, left_alone=(3,)).run(100)
    assert plant.stage is HarmonicStage.CONTROLLING
    assert not plant.volts[:, 3].any()


def test_the_step_counts_as_clear_by_the_scatter_from_period_to_period():
    # The change under the step beside the scatter, above and below the factor, without any chance.
    for factor, clear in ((1.3, True), (0.7, False)):
        plant = waiting(1.0, highest=2).run(1 + MEAN_PERIODS)
        assert plant.stage is HarmonicStage.PROBING
        plant.state["probe"][0, 2] = 0.036
        plant.state["aim"][0, 2] *= 9.0
        plant.state["scatter_square"][0, 2] = (0.036 / CLEAR / factor) ** 2
        plant.run(WAIT_PERIODS + MEAN_PERIODS)
        assert plant.stage is HarmonicStage.CONTROLLING
        assert (left_alone(plant.parameters[0], plant.state[0]) == 0) is clear


@pytest.mark.parametrize("left_v", [0.0, 0.002])
def test_no_plant_is_learned_from_a_step_that_the_voltage_limit_holds_back(left_v):
    plant = waiting(0.5, {1: 1.0, 2: 0.3}).run(100, LARGEST_V - left_v)
    assert plant.stage is not HarmonicStage.CONTROLLING
    assert plant.state["miss"][0] == math.inf
    assert not plant.state["plant"][0].any()
    plant.run(100, 2.0)
    assert plant.stage is HarmonicStage.CONTROLLING
    np.testing.assert_allclose(plant.state["plant"][0, 2:8], 0.5, rtol=0.01)
