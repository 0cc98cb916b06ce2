"""The bench under a phase lock: it locks, settles, agrees with itself, trips where it must, and comes down."""

import numpy as np
import pytest

from rig.api import Run
from rig.bench import Bench
from rig.campaigns.evaluation.point import vibration_of
from rig.campaigns.evaluation.stored_point import point_from, value_of
from rig.hil.conftest import backbone_plan
from rig.hil.subject import ArmedRig
from simulators import VirtualRig
from simulators.analysis import phase_resonance_backbone

REPEATS = {"frequency_hz": 1e-3, "damping_ratio": 0.1, "force_n": 0.1}
"""How well a bench is expected to agree with itself, relative."""


def _came_down(run: Run) -> None:
    """The recording ends with 0 V, reached without a jump."""
    part = run.recording.parts[-1]
    output = part.rows("output_v").astype(float)
    assert output[-1] == 0.0
    assert np.abs(np.diff(output)).max() < 0.25 * np.abs(output).max()


def test_every_point_locks_settles_and_is_accepted(backbone_run: Run, armed_rig: ArmedRig) -> None:
    """With no sample lost."""
    points = [point_from(table) for table in backbone_run.recording.points]
    for point in points:
        assert point.accepted, point.reason
        assert point.lost_samples == 0
    armed_rig.notes({name: [value_of(point, name) for point in points] for name in REPEATS})


def test_levels_are_reached(backbone_run: Run) -> None:
    """The amplitude on the output is the level's."""
    for point in map(point_from, backbone_run.recording.points):
        assert vibration_of(point).voltage_v == pytest.approx(point.level, rel=1e-3)


def test_the_output_comes_down_at_the_end(backbone_run: Run) -> None:
    """By a ramp."""
    _came_down(backbone_run)


def test_a_limit_that_is_passed_brings_the_bench_down(backbone_run: Run, armed_rig: ArmedRig, rig_bench: Bench) -> None:
    """A force limit below what the test needs."""
    needed = backbone_run.recording.points[-1]["force_n"]
    limits = rig_bench.limits.model_copy(update={"force_n": 0.7 * needed})
    run = armed_rig.run(backbone_plan(rig_bench), bench=rig_bench.model_copy(update={"limits": limits}))
    end = run.recording.parts[-1].end
    assert end is not None
    assert end["reason"] == "force_limit", end["text"]
    assert end["tripped"]
    _came_down(run)


def test_the_bench_agrees_with_itself(backbone_run: Run, repeated_run: Run, armed_rig: ArmedRig) -> None:
    """Frequency, damping and force of every point, once more."""
    points, repeated = (list(map(point_from, run.recording.points)) for run in (backbone_run, repeated_run))
    for second in repeated:
        assert second.accepted, second.reason
    changes = {}
    for name, tolerance in REPEATS.items():
        before, again = (np.array([value_of(one, name) for one in some], float) for some in (points, repeated))
        assert again == pytest.approx(before, rel=tolerance), name
        changes[f"{name}_change"] = (again / before - 1.0).tolist()
    armed_rig.notes(changes)


def test_a_virtual_rig_is_measured_as_it_is(
    backbone_run: Run, rig_bench: Bench, rig_truth: VirtualRig, armed_rig: ArmedRig
) -> None:
    """Frequencies against harmonic balance of the same rig, at the displacements reached."""
    points = backbone_run.recording.points
    known = phase_resonance_backbone(
        rig_truth, amplitudes_m=[p["amplitude_m"] for p in points], near_hz=rig_bench.specimen.linear_frequency_hz
    )
    true_hz = known.frequency_hz
    measured_hz = np.array([p["frequency_hz"] for p in points])
    armed_rig.notes({"frequency_error": list(measured_hz / true_hz - 1.0)})
    np.testing.assert_allclose(measured_hz, true_hz, rtol=1e-3)
