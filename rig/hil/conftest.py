"""The runs that the closed-loop tests share: voltages are parts of what the bench allows, frequencies come from its facts."""

import pytest

from rig.api import Run
from rig.bench import Bench
from rig.campaigns.backbone.plan import BackbonePlan
from rig.hil.subject import ArmedRig

LEVELS = (0.04, 0.08)  # of the largest voltage: small, and well above noise


def backbone_plan(bench: Bench) -> BackbonePlan:
    """Two points of a backbone, up to 10 % about the frequency that the bench states."""
    centre_hz = bench.specimen.linear_frequency_hz
    return BackbonePlan.model_validate(
        {
            "bench": bench.name,
            "levels_v": [part * bench.limits.voltage_v for part in LEVELS],
            "record_periods": 30,
            "controller": {
                "detector": "two-phase",
                "low_pass_rad_s": 0.26 * centre_hz,
                "k1": 2.0,
                "k2": 0.26 * centre_hz,
                "centre_frequency_hz": centre_hz,
                "frequency_window_hz": [0.9 * centre_hz, 1.1 * centre_hz],
            },
        }
    )


@pytest.fixture(scope="session")
def backbone_run(armed_rig: ArmedRig, rig_bench: Bench) -> Run:
    """A short backbone."""
    return armed_rig.run(backbone_plan(rig_bench))


@pytest.fixture(scope="session")
def repeated_run(backbone_run: Run, armed_rig: ArmedRig, rig_bench: Bench) -> Run:
    """The same once more, with other noise where it is drawn."""
    return armed_rig.run(backbone_plan(rig_bench), seed=1)
