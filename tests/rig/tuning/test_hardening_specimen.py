"""A tuned plan on a beam with a spring at its tip that hardens it by several per cent, driven by a light exciter."""

import math

import numpy as np
import pytest

import rig
from identification import nonlinear_mode
from rig.bench import Bench
from rig.rehearsal import forces
from rig.tick.sequencer.layout import SegmentKind
from rig.tuning import tune
from simulators import VirtualRig
from simulators.analysis import phase_resonance_backbone

SENSORS = {"force": 0.1124, "drive": 0.0102, "tip": 0.0102}
OPTIONS = {
    "structure": {
        "kind": "beam",
        "boundary": "clamped-free",
        "length_m": 0.3,
        "width_m": 0.02,
        "thickness_m": 0.002,
        "youngs_modulus_pa": 210e9,
        "density_kg_m3": 7850.0,
        "damping_ratio": [0.003, 0.002, 0.002],
        "points_m": {"drive": 0.12, "tip": 0.3},
    },
    "elements": [{"kind": "cubic", "at": "tip", "stiffness_n_m3": 4.6e6}],
    "exciter": {
        "armature_mass_kg": 0.02,
        "suspension_stiffness_n_m": 300.0,
        "suspension_damping_n_s_m": 0.3,
        "force_factor_n_a": 2.0,
        "resistance_ohm": 3.0,
        "inductance_h": 2e-4,
    },
    "stinger": {"at": "drive", "stiffness_n_m": 1e6, "damping_n_s_m": 2.0},
    "sensors": [
        {"name": name, "kind": "force" if name == "force" else "acceleration", "sensitivity_v_per_unit": sensitivity}
        | {"range_v": 5.0, "noise_rms": 0.0005 if name == "force" else 0.002}
        | ({} if name == "force" else {"at": name})
        for name, sensitivity in SENSORS.items()
    ],
    "converter": {"sample_rate_hz": 2000.0, "oversampling": 4, "substeps": 8, "anti_alias_hz": 800.0},
}
OWN = VirtualRig.model_validate(OPTIONS)
STIFFNESS = float((2.0 * math.pi * OWN.linear_modes.frequency_hz[0] / OWN.linear_modes.at(OWN.shape("tip"))[0]) ** 2)
"""Modal stiffness of the first mode at the tip, N/m."""


@pytest.fixture(scope="module")
def bench():
    modes = OWN.linear_modes
    return Bench.model_validate(
        {
            "name": "tip-beam",
            "sample_rate_hz": 2000.0,
            "driver": {"name": "virtual", "options": OPTIONS},
            "specimen": {
                "name": "beam with a spring at its tip",
                "linear_frequency_hz": 1.01 * float(modes.frequency_hz[0]),
                "drive_mode_shape": float(modes.drive_shape[0]),
            },
            "limits": {
                "voltage_v": 5.0,
                "force_n": 5.0,
                "acceleration_m_s2": 300.0,
                "displacement_m": 0.012,
                "frequency_hz": [8.0, 80.0],
            },
            "channels": [
                {"name": name, "role": {"force": "force", "drive": "drive"}.get(name, "response")}
                | {"unit": "N" if name == "force" else "m/s^2", "sensitivity_v_per_unit": sensitivity, "range_v": 5.0}
                for name, sensitivity in SENSORS.items()
            ],
        }
    )


@pytest.fixture(scope="module")
def plan(bench, tmp_path_factory):
    return tune(bench, tmp_path_factory.mktemp("tuning") / "test.h5").plan


def errors_in_ramps(part, segments):
    """Largest mean phase error of a period, deg, in each ramp from one point to the next, and the periods of all of them."""
    segment, theta = part.rows("segment"), part.rows("theta_rad")
    period = np.concatenate([[0], np.cumsum(np.diff(theta) < -math.pi)])
    error = np.degrees(np.nan_to_num(part.rows("phase_error_rad")))
    mean = np.bincount(period, error) / np.bincount(period)
    in_segment = segment[np.searchsorted(period, np.arange(len(mean)))]
    ramps = [k for k, each in enumerate(segments) if each.kind == SegmentKind.RAMP and each.point > 0]
    return [float(np.abs(mean[in_segment == k]).max()) for k in ramps], int(np.isin(in_segment, ramps).sum())


@pytest.mark.slow
def test_every_point_of_a_hardening_beam_is_accepted_and_on_the_curve_of_harmonic_balance(bench, plan):
    with rig.run(plan, bench=bench, seed=1) as run:
        assert run.complete, run.recording.parts[-1].end
        mode = nonlinear_mode(run.backbone())
    truth = phase_resonance_backbone(OWN, amplitudes_m=plan.levels_m)
    assert truth.frequency_shift > 0.04  # or it would show nothing
    assert mode.modal_frequency_hz == pytest.approx(truth.modal_frequency_hz, rel=5e-4)
    assert mode.damping_ratio == pytest.approx(truth.damping_ratio, rel=0.03)  # the lowest level has few bits
    assert np.all(np.diff(mode.modal_frequency_hz) > 0.0)


@pytest.mark.slow
def test_ramps_keep_the_phase_because_the_frequency_follows_the_points_before(bench, plan):
    found = []
    for follows in (True, False):
        controller = plan.controller.model_copy(update={"frequency_feed_forward": follows})
        with rig.run(plan.model_copy(update={"controller": controller}), bench=bench, seed=1) as run:
            assert run.complete
            found.append(errors_in_ramps(run.recording.parts[-1], plan.segments(bench.sample_rate_hz)))
    (errors, periods), (without, waiting) = found
    assert plan.controller.frequency_feed_forward
    assert max(errors) < 10.0
    assert max(without[1:]) > 2.0 * max(errors[1:])  # from the second ramp on there are points before
    assert periods < waiting


@pytest.fixture(scope="module")
def steep(bench, tmp_path_factory):
    """The beam with a spring of seventh order and a heavier exciter, steeper at the top than any gains bear, and its plan."""
    options = OPTIONS | {
        "exciter": OPTIONS["exciter"] | {"armature_mass_kg": 0.05},
        "elements": [
            {"kind": "user", "at": "tip", "of": "deflection", "function": f"{forces.__name__}:odd_polynomial"}
            | {"parameters": [0.0, 0.0, 0.3 * STIFFNESS / (35.0 / 64.0 * 0.004**6)]}
        ],
    }
    steep = bench.model_copy(update={"driver": bench.driver.model_copy(update={"options": options})})
    return steep, tune(steep, tmp_path_factory.mktemp("steep") / "test.h5").plan


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_a_backbone_steeper_than_the_gains_bear_ends_in_order_below_its_top(steep, seed):
    bench, plan = steep
    with rig.run(plan, bench=bench, seed=seed) as run:
        end, points = run.recording.parts[-1].end, run.recording.points
        mode = nonlinear_mode(run.backbone())
    assert (end["reason"], end["tripped"]) == ("completed", False)
    assert [point["quality"] for point in points if not point["accepted"]] == ["too-steep"]
    assert "too-steep" in end["skipped"]
    slopes = np.diff(np.log(mode.modal_frequency_hz)) / np.diff(np.log(mode.amplitude_m))
    assert np.all(slopes < plan.controller.steepest_backbone[1])
    assert slopes[-1] > 0.2 * plan.controller.steepest_backbone[1]  # no level that holds is left out for nothing


@pytest.mark.slow
def test_without_the_bound_the_same_run_goes_where_it_cannot_be_held(steep):
    bench, plan = steep
    unbounded = plan.controller.model_copy(update={"steepest_backbone": None})
    with rig.run(plan.model_copy(update={"controller": unbounded}), bench=bench, seed=1) as run:
        qualities = [point["quality"] for point in run.recording.points]
        assert run.recording.parts[-1].end["tripped"] or "lost-lock" in qualities
