"""Images of the held output: points carry the error that the driver knows of, and are refused where it is large."""

from dataclasses import replace

import numpy as np
import pytest

from identification import Backbone, nonlinear_mode
from rig.bench import load_bench
from rig.campaigns.evaluation.images import with_images
from rig.campaigns.evaluation.point import Lock, Quality
from rig.campaigns.evaluation.vibrations import channels_of, vibration_from
from rig.daq import Image
from tests.rig.campaigns.made_points import made_modal, made_point, made_vibration

BENCH = load_bench("magnet-beam")
FORCE, DRIVE = BENCH.index_of("force"), BENCH.index_of("drive")
HZ, FORCE_N, SHAPE, DAMPING = 24.0, 2.0, 0.8, 0.004
OMEGA = 2.0 * np.pi * HZ
STD_N = 1e-6


def point_with(error_n=0j, lag_deg=90.0):
    """A point whose force has an error relative to that at phase resonance; its true damping is `DAMPING`."""
    moved_m = FORCE_N * SHAPE**2 / (2.0 * DAMPING * OMEGA**2)
    force = FORCE_N / np.tan(np.radians(lag_deg)) + 1j * FORCE_N + 1j * error_n
    harmonics = np.zeros((len(BENCH.channels), 4), complex)
    harmonics[FORCE, 1], harmonics[DRIVE, 1] = force, -(OMEGA**2) * moved_m
    vibration = made_vibration(harmonics, HZ, std=np.full(harmonics.shape, STD_N), force_n=abs(force))
    damping = DAMPING * force.imag / FORCE_N
    modal = replace(made_modal(HZ, damping), damping_ratio_std=1e-7, modal_frequency_std_hz=1e-6)
    return made_point(vibration=vibration, modal=modal, lock=Lock(phase_error_deg=0.0), warnings=())


def images(error_n):
    return (Image(HZ + 0.5, error_n.real, error_n.imag), Image(10.0 * HZ, 9.0, 9.0))  # the point is at 1 V


def mode_of(point):
    measured = vibration_from(point, channels_of(BENCH))
    return nonlinear_mode(Backbone((measured,), drive_mode_shape=SHAPE))


@pytest.mark.parametrize("lag_deg", [70.0, 90.0, 120.0])
@pytest.mark.parametrize("error_n", [0.05 + 0j, -0.08 + 0.03j, 0.1 - 0.5j])
def test_the_standard_errors_of_a_point_are_the_error_of_its_damping_and_frequency(error_n, lag_deg):
    point = with_images(BENCH, point_with(error_n, lag_deg), images(error_n), damping=True)
    modal, shift = point.modal, DAMPING * abs(error_n.imag) / FORCE_N
    assert modal.damping_ratio_std == pytest.approx(abs(modal.damping_ratio - DAMPING), rel=1e-3)
    assert modal.modal_frequency_std_hz == pytest.approx(max(HZ * shift, 1e-6), rel=1e-3)
    assert point.quality.accepted


def test_a_mode_that_is_identified_from_the_point_has_the_error_in_its_interval():
    error_n = 0.08 - 0.03j
    alone = mode_of(point_with(error_n))
    found = mode_of(with_images(BENCH, point_with(error_n), images(error_n), damping=True))
    assert not alone.interval("damping_ratio")[0, 0] < DAMPING < alone.interval("damping_ratio")[0, 1]
    assert found.systematic("damping_ratio")[0] == pytest.approx(0.04 * DAMPING, rel=0.1)
    assert found.systematic("modal_frequency_hz")[0] == pytest.approx(0.015 * DAMPING * HZ, rel=0.1)
    low, high = found.interval("damping_ratio")[0]
    assert low < DAMPING < high


@pytest.mark.parametrize(
    ("share", "damping", "quality", "warnings", "notes"),
    [
        (0.009, True, Quality.GOOD, 0, 0),
        (0.011, True, Quality.GOOD, 1, 0),
        (-0.099, True, Quality.GOOD, 1, 0),
        (0.11, True, Quality.REJECTED, 0, 0),
        (-0.11, True, Quality.REJECTED, 0, 0),
        (0.11, False, Quality.GOOD, 0, 1),
    ],
)
def test_a_point_is_warned_above_one_percent_of_the_damping_and_refused_above_ten(
    share, damping, quality, warnings, notes
):
    point = with_images(BENCH, point_with(), images(share * FORCE_N + 0j), damping=damping)
    assert (point.quality, len(point.warnings), len(point.notes)) == (quality, warnings, notes)
    said = point.reason or "".join((*point.warnings, *point.notes))
    assert bool(said) is (abs(share) > 0.01)
    assert not said or f"{100.0 * share:.3g} % of the damping" in said
    assert "anti-alias filter" in point.reason or quality is Quality.GOOD


def test_a_point_that_was_refused_before_keeps_its_reason():
    point = with_images(BENCH, point_with().refused("it hunts"), images(0.5 + 0j), damping=True)
    assert point.reason == "it hunts"


def test_points_without_modal_properties_and_without_known_images_are_left_as_they_are():
    for point, known in ((point_with(), ()), (replace(point_with(), modal=None), images(1.0 + 0j))):
        assert with_images(BENCH, point, known, damping=True) is point
