"""What tells a good record from a bad one at a held lag, the same for every campaign that settles and records."""

import numpy as np

from identification import PeriodicVibration
from rig.bench import Bench
from rig.campaigns.evaluation.alien_force import alien_force
from rig.campaigns.evaluation.objections import (
    alien_objection,
    drift_objection,
    first_of,
    hunting_objection,
    phase_objection,
)
from rig.campaigns.evaluation.quality import lag_scatter_deg
from rig.campaigns.evaluation.vibrations import frequency_scatter
from rig.campaigns.planning.locked import SettledPlan

__all__ = ["settled_objection", "settled_quality"]


def settled_quality(vibration: PeriodicVibration, bench: Bench, rows: np.ndarray) -> dict[str, float]:
    """Phase error of the fundamental, scatter of frequency and lag, alien part of the force."""
    return {
        "phase_error_deg": vibration.phase_error_deg,
        "frequency_scatter": frequency_scatter(rows["theta_rad"]),
        "phase_scatter_deg": lag_scatter_deg(rows),
        "alien_force": alien_force(bench, [rows]),
    }


def settled_objection(
    plan: SettledPlan, bench: Bench, vibration: PeriodicVibration, quality: dict[str, float], level: str = ""
) -> str:
    """Why a recorded point is not accepted, ``level`` the objection to what was held; empty where it is."""
    return first_of(
        (
            phase_objection(quality["phase_error_deg"], plan.accepted_phase_error_deg),
            level,
            alien_objection(quality["alien_force"], plan.accepted_alien_force),
            hunting_objection(quality["frequency_scatter"], plan.accepted_frequency_scatter),
            drift_objection(bench, vibration, plan.accepted_drift),
        )
    )
