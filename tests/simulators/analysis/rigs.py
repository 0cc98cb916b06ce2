"""Rigs that the analyses are tried on: a single mode with any site on it, and a beam with every kind of site."""

from typing import Any

from simulators.virtual_rig import VirtualRig
from tests.simulators.references import ideal

FREQUENCY_HZ = 40.0
DAMPING_RATIO = 0.004
SHAPE = 1.3


def one_mode(**changes: Any) -> VirtualRig:
    """One mode on the exciter of the shipped rigs, with no site unless given."""
    table = ideal().model_dump(exclude={"specimen", "structure", "elements", "friction", "sensors"})
    table["structure"] = {
        "kind": "modal",
        "frequency_hz": [FREQUENCY_HZ],
        "damping_ratio": [DAMPING_RATIO],
        "shapes": {"drive": [SHAPE]},
    }
    force = {"name": "force", "kind": "force"}
    drive = {"name": "drive", "kind": "acceleration", "at": "drive"}
    ideal_sensor = {"sensitivity_v_per_unit": 1.0, "range_v": 1e9, "high_pass_hz": 0.0}
    table["sensors"] = [force | ideal_sensor, drive | ideal_sensor]
    return VirtualRig.model_validate(table | changes)


def every_site() -> VirtualRig:
    """The magnet beam with its joint and, besides, a cubic spring and a stop between two points."""
    rig = ideal()
    cubic = {"kind": "cubic", "at": "tip", "stiffness_n_m3": 2e6, "quadratic_n_m2": 1e3}
    stop = {"kind": "clearance", "at": "tip", "to": "magnet", "gap_m": 1e-4, "contact_stiffness_n_m": 100.0}
    return ideal(elements=[*rig.model_dump()["elements"], cubic, stop])
