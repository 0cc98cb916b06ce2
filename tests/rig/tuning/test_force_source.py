"""A sound rig that looked like a broken one: a force source without a moving mass on an oscillator that hardens by 6 %."""

import math

import pytest

import rig
from identification import nonlinear_mode
from rig.bench import Bench
from rig.tuning import tune

HERTZ, DAMPING, FARTHEST_M = 20.0, 0.003, 0.006
OPTIONS = {
    "structure": {
        "kind": "modal",
        "frequency_hz": [HERTZ],
        "damping_ratio": [DAMPING],
        "shapes": {"drive": [1.0]},
    },
    "elements": [
        {"kind": "cubic", "at": "drive", "stiffness_n_m3": 0.08 * (2.0 * math.pi * HERTZ) ** 2 / FARTHEST_M**2}
    ],
    "exciter": {
        "amplifier": "current",
        "armature_mass_kg": 1e-4,
        "suspension_stiffness_n_m": 0.0,
        "suspension_damping_n_s_m": 0.0,
        "force_factor_n_a": 2.0,
        "resistance_ohm": 1.0,
        "inductance_h": 1e-4,
    },
    "stinger": {"at": "drive", "stiffness_n_m": 1e6, "damping_n_s_m": 5.0},
    "sensors": [
        {"name": "force", "kind": "force", "sensitivity_v_per_unit": 0.1124, "range_v": 5.0, "noise_rms": 0.0005},
        {"name": "drive", "kind": "acceleration", "at": "drive", "sensitivity_v_per_unit": 0.0102, "range_v": 5.0}
        | {"noise_rms": 0.002},
    ],
    "converter": {"sample_rate_hz": 2000.0, "oversampling": 4, "substeps": 8, "anti_alias_hz": 800.0},
}
BENCH = {
    "name": "duffing",
    "sample_rate_hz": 2000.0,
    "output_range_v": 10.0,
    "driver": {"name": "virtual", "options": OPTIONS},
    "specimen": {"name": "oscillator", "linear_frequency_hz": 1.005 * HERTZ, "drive_mode_shape": 1.0},
    "limits": {
        "voltage_v": 9.0,
        "force_n": 20.0,
        "acceleration_m_s2": 400.0,
        "displacement_m": 3.0 * FARTHEST_M,
        "frequency_hz": [8.0, 80.0],
    },
    "channels": [
        {"name": "force", "role": "force", "unit": "N", "sensitivity_v_per_unit": 0.1124, "range_v": 5.0},
        {"name": "drive", "role": "drive", "unit": "m/s^2", "sensitivity_v_per_unit": 0.0102, "range_v": 5.0},
    ],
}


@pytest.mark.slow
def test_a_force_source_on_a_hardening_oscillator_is_tuned_and_its_plan_carried_out(tmp_path):
    bench = Bench.model_validate(BENCH)
    tuned = tune(bench, tmp_path / "test.h5")
    alpha, beta = tuned.plant.exciter(1j * tuned.plant.frequency_rad_s)
    assert abs(complex(alpha) - 0.5) < 0.1
    assert abs(complex(beta)) < 0.001  # V s^2/m, for 0.5 V/N: 2 g
    with rig.run(tuned.plan, bench=bench, seed=1) as run:
        assert run.complete, run.recording.parts[-1].end
        hertz = nonlinear_mode(run.backbone()).modal_frequency_hz
    assert hertz[-1] > 1.02 * hertz[0]
