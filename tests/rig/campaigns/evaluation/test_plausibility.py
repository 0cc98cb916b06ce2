"""Which vibrations fit the mode shapes of the bench and the points before, by vibrations made by hand."""

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from rig.campaigns.evaluation.channel_misfit import REFUSED, WARNED
from rig.campaigns.evaluation.plausibility import with_plausibility
from rig.campaigns.planning.plant import PlantFacts
from rig.campaigns.plans import load_plan
from tests.controller.tuning.rigs import plant_of
from tests.rig.campaigns.made_points import made_point, made_vibration
from tests.rig.rigs import bench_with

BACKBONE = load_plan("magnet-beam/backbone")
STEPPED = load_plan("magnet-beam/stepped-sine-up")
HZ, DRIVE_SHAPE = 24.37, 0.908466


def bench(*shapes):
    """The magnet beam with these mode shapes of its two responses."""
    channels = [channel.model_dump() for channel in bench_with().channels]
    for channel, shape in zip(channels[2:], shapes, strict=True):
        channel["mode_shape"] = shape
    return bench_with({"channels": channels})


def point(*shapes, level=1.0, resistance=1.0, lag_deg=90.0, hz=HZ, std=0.0, drive=1.0):
    """A point in which the responses move like ``shapes``; a drive of 1 m/s^2 unless its sensor reads another part of it."""
    velocity = 1.0 / (2j * math.pi * hz)
    force = (
        resistance * velocity * np.exp(1j * math.radians(90.0 - lag_deg)) / max(math.sin(math.radians(lag_deg)), 1e-3)
    )
    harmonics = np.zeros((4, 3), complex)
    harmonics[:, 1] = [force, drive, *(shape / DRIVE_SHAPE for shape in shapes)]
    vibration = made_vibration(harmonics, hz, std=np.full((4, 3), std))
    return made_point(level, warnings=(), vibration=vibration)


def judged(one, *before, plan=BACKBONE, known=(1.010938, 1.444326)):
    return with_plausibility(bench(*known), plan, one, before)


@given(st.floats(0.7, 1.4), st.floats(0.7, 1.4), st.floats(30.0, 150.0))
def test_a_shape_that_has_changed_as_nonlinear_modes_do_is_good_at_any_lag(beside, tip, lag_deg):
    found = judged(point(1.010938 * beside, 1.444326 * tip, lag_deg=lag_deg))
    assert found.accepted
    assert all("seem swapped" in line for line in found.warnings)  # a few such shapes are those of exchanged cables
    assert found.misfit < WARNED or found.warnings


@pytest.mark.parametrize(
    ("tip", "accepted", "warned"), [(1.444, True, False), (0.6, True, True), (0.0, False, False), (8.0, False, False)]
)
def test_a_channel_is_warned_of_and_then_refused_as_it_leaves_its_mode_shape(tip, accepted, warned):
    found = judged(point(1.010938, tip))
    assert found.accepted is accepted
    assert bool(found.warnings) is warned
    assert ("acc_magnet" in found.reason + "".join(found.warnings)) is (tip != 1.444)


def test_the_reason_names_what_was_seen_what_was_expected_and_where_to_look():
    assert judged(point(1.010938, 0.0144)).reason == (
        "channel acc_magnet has 0.0159 times the size of the drive channel, expected 1.59 by the mode shapes, "
        "refused from a factor 4: look at sensor, cable and sensitivity_v_per_unit of acc_magnet"
    )


@given(st.floats(-0.1, 0.1))
def test_a_channel_at_a_node_is_judged_by_its_distance_from_the_other_shapes(tip):
    assert judged(point(1.010938, tip), known=(1.010938, 0.0)).accepted
    assert judged(point(1.010938, tip), known=(1.010938, 0.0)).misfit < WARNED


def test_without_mode_shapes_and_points_before_nothing_is_said():
    one = point(0.01, 9.0)
    assert judged(one, known=(None, None)) is one


def test_a_reversed_channel_is_refused_whatever_its_size():
    found = judged(point(1.010938, -1.444326))
    assert "moves the other way" in found.reason
    assert "polarity" in found.reason


def test_a_drive_channel_that_reads_a_tenth_is_named_although_all_others_seem_off():
    found = judged(point(1.010938, 1.444326, drive=0.1))
    assert found.reason.startswith("channel drive: all others (acc_drive, acc_magnet) are 10 times as large")


@pytest.mark.parametrize(
    ("times", "level", "accepted"),
    [(1.9, 1.0, True), (0.1, 1.0, False), (0.1, 9.0, False), (4.0, 4.0, True), (9.0, 1.0, False)],
)
def test_force_over_velocity_may_change_with_the_root_of_the_level(times, level, accepted):
    found = judged(point(1.010938, 1.444326, level=level, resistance=times), point(1.010938, 1.444326))
    assert found.accepted is accepted
    assert ("force over velocity" in found.reason) is not accepted


def test_points_that_were_warned_of_are_no_measure_of_others():
    none = (None, None)
    good, off = point(1.0, 1.4), judged(point(1.0, 0.5), point(1.0, 1.4), known=none)
    assert off.accepted
    assert off.misfit > WARNED
    assert judged(point(1.0, 0.5), good, off, off, off, known=none).misfit == pytest.approx(off.misfit)


def test_a_signal_within_its_noise_is_not_judged():
    assert judged(point(1.010938, 0.0, std=1.0)).misfit < WARNED


@pytest.mark.parametrize(("hz", "misfit"), [(24.3, REFUSED), (23.0, WARNED), (30.0, 1.0)])
def test_in_open_loop_less_is_said_of_a_dead_channel_the_further_from_the_mode(hz, misfit):
    found = judged(point(1.010938, 0.0, lag_deg=1.0 if hz < 24.3 else 179.0, hz=hz), plan=STEPPED)
    assert (found.misfit or 1.0) >= misfit
    assert hz < 30.0 or found.misfit is None


def late(*turns_deg, level=1.0, std=0.0):
    """A point whose responses stand this much ahead of the drive channel."""
    shapes = (1.010938, 1.444326)
    turned = [shape * np.exp(1j * math.radians(turn)) for shape, turn in zip(shapes, turns_deg, strict=True)]
    return point(*turned, level=level, std=std)


@pytest.mark.parametrize(
    ("turn_deg", "accepted", "warned"),
    [(0.0, True, False), (4.9, True, False), (7.0, True, True), (-7.0, True, True), (44.0, True, True)],
)
def test_a_drive_sensor_that_is_late_is_warned_of_from_5_deg(turn_deg, accepted, warned):
    found = judged(late(turn_deg, turn_deg))
    assert found.accepted is accepted
    assert bool(found.warnings) is warned
    assert all(": all others (" in line and "deg" in line for line in found.warnings)


@pytest.mark.parametrize("turn_deg", [46.0, -46.0, 88.0, 134.0])
def test_a_drive_sensor_that_is_late_is_refused_from_45_deg(turn_deg):
    found = judged(late(turn_deg, turn_deg))
    assert not found.accepted
    assert f"{abs(turn_deg):.3g} deg {'ahead of' if turn_deg > 0 else 'behind'} it" in found.reason
    assert "refused from 45 deg" in found.reason


def test_a_turn_that_the_modal_test_has_measured_is_expected():
    plant = {**plant_of("magnet-beam").to_dict(), "response_ratios": {"acc_drive": 1.1, "acc_magnet": 1.6}}
    plan = BACKBONE.model_copy(update={"plant": PlantFacts(**plant, response_turns_deg={"acc_magnet": 30.0})})
    assert not judged(late(0.0, 30.0), plan=plan).warnings
    assert judged(late(0.0, 0.0), plan=plan).warnings
    assert judged(late(0.0, 30.0)).warnings


def test_a_single_response_that_is_late_is_named():
    found = judged(late(0.0, 60.0))
    assert not found.accepted
    assert found.reason == (
        "channel acc_magnet is 60 deg ahead of the drive channel, expected 0 by the mode shapes, refused from 45 deg: "
        "look at what delays or advances one of the two sensors (conditioner, filter, skew_samples)"
    )


def test_a_phase_that_changes_during_the_run_is_seen_without_mode_shapes():
    before = [late(0.0, 0.0, level=level) for level in (0.5, 0.7)]
    assert judged(late(10.0, 10.0), *before, known=(None, None)).warnings
    assert not judged(late(60.0, 60.0), *before, known=(None, None)).accepted


def test_three_standard_errors_of_the_phase_are_allowed():
    std = math.radians(2.0) * 1.11  # of the smaller ratio
    assert not judged(late(10.0, 0.0, std=std)).warnings
    assert judged(late(12.0, 0.0, std=std)).warnings


def test_two_cables_that_are_exchanged_are_warned_of():
    right = (1.0, 1.010938 / DRIVE_SHAPE, 1.444326 / DRIVE_SHAPE)
    drive, beside, tip = right[1], right[0], right[2]  # what the inputs read: the first two are exchanged
    exchanged = judged(point(beside * DRIVE_SHAPE, tip * DRIVE_SHAPE, drive=drive))
    assert exchanged.accepted
    assert any("seem swapped" in line and "acc_drive" in line for line in exchanged.warnings)


@given(st.floats(0.93, 1.07), st.floats(0.93, 1.07))
def test_shapes_that_differ_a_little_are_not_called_swapped(beside, tip):
    assert not judged(point(1.010938 * beside, 1.444326 * tip)).warnings
