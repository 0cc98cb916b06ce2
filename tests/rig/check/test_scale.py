"""The scale that a check keeps for later runs, against the linear frequency responses of the virtual rigs."""

import numpy as np
import pytest

from rig.arming.checked_scale import CheckedScale
from rig.arming.run_options import RunOptions
from rig.check.assessment import checked_scale
from rig.check.responses import Mode, Responses, scale_of
from rig.check.run import check
from rig.errors import RecordingError
from simulators import VirtualRig
from simulators.analysis import frequency_response
from tests.recorded import recorded
from tests.refused import refused
from tests.rig.rigs import bench_with

BLOCK = {"block": 50}


@pytest.mark.parametrize(("name", "within"), [("magnet-beam", 0.1), ("friction-beam", 0.2)])
def test_a_check_measures_what_the_linear_rig_gives_at_resonance(name, within, tmp_path):
    """Of the friction beam, the joint adds some damping at the level of a check."""
    scale = check(bench_with(BLOCK, name), tmp_path / "check.h5", RunOptions(seed=3)).scale
    rig = VirtualRig.shipped(name)
    mode = rig.linear_modes.nearest(scale.frequency_hz)
    damping = float(rig.linear_modes.damping_ratio[mode])
    assert scale.damping_ratio == pytest.approx(damping, rel=within)
    assert scale.acceleration_per_newton == pytest.approx(
        rig.linear_modes.drive_shape[mode] ** 2 / (2.0 * damping), rel=within
    )
    found = frequency_response(rig, np.array([rig.linear_modes.frequency_hz[mode]]))
    omega = 2.0 * np.pi * found.frequency_hz[0]
    per_volt = omega**2 * abs(found.displacement_m_per_v["drive"][0])
    assert scale.acceleration_per_volt == pytest.approx(per_volt, rel=0.05)


def test_a_check_without_a_mode_keeps_no_scale():
    bench = bench_with()
    lines = np.linspace(10.0, 40.0, 61)
    flat = Responses(
        tuple(channel.name for channel in bench.channels),
        lines,
        np.ones((len(bench.channels), lines.size), complex),
        np.ones(len(bench.channels)),
        np.zeros(len(bench.channels)),
    )
    assert scale_of(bench, flat, None) is None
    undamped = Mode(24.0, 0.0, np.ones(3, complex), 0.0)
    assert scale_of(bench, flat, undamped) is None


def test_a_recorded_check_is_read_for_its_bench_alone(tmp_path):
    path = tmp_path / "check.h5"
    found = check(bench_with(BLOCK), path, RunOptions(seed=3))
    assert checked_scale(path, bench_with(BLOCK)) == found.scale
    with refused(RecordingError, "is-check-of-other-channels-than"):
        checked_scale(path, bench_with(BLOCK, "friction-beam"))
    with refused(RecordingError, "is-not-the-recording-of-check"):
        checked_scale(recorded("magnet-beam/backbone-short"), bench_with(BLOCK))


@pytest.mark.parametrize("wrong", [0.0, -1.0, float("nan"), float("inf"), "1"])
def test_a_scale_is_of_numbers_above_0(wrong):
    with refused(ValueError, field="acceleration_per_volt", allowed="above 0"):
        CheckedScale(
            at="", frequency_hz=24.0, damping_ratio=0.004, acceleration_per_newton=1.0, acceleration_per_volt=wrong
        )
