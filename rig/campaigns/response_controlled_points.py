"""From the recorded rows of a response-controlled point to its result."""

import math
from typing import Any

import numpy as np

from identification import IdentificationError, PeriodicVibration
from rig.bench import Bench
from rig.campaigns.backbone_points import frequency_scatter
from rig.campaigns.evaluate import (
    as_pairs,
    drift_objection,
    head,
    quantisation_warnings,
    recorded_vibration,
    within_periods,
)
from rig.campaigns.plan import Column, Target
from rig.campaigns.response_controlled import ResponseControlledPlan
from rig.campaigns.stepped_sine_points import level_objection

__all__ = ["RESPONSE_CONTROLLED_COLUMNS", "measure_response_controlled_point"]

RESPONSE_CONTROLLED_COLUMNS = (
    Column("asked_phase_lag_deg", "lag asked for", "deg", ".0f"),
    Column("frequency_hz", "frequency", "Hz", ".4f", plain=True),
    Column("force_n", "force", "N", ".4f", plain=True),
    Column("amplitude_m", "amplitude", "mm", ".5f", 1e3, plain=True),
    Column("level_error", "level error", "%", ".2f", 100.0),
    Column("phase_error_deg", "phase error", "deg", ".2f"),
)


def measure_response_controlled_point(
    bench: Bench, plan: ResponseControlledPlan, target: Target, rows: np.ndarray, settling: np.void
) -> dict[str, Any]:
    """The result of a recorded point, with its own quality; ``settling`` is the outcome record of its settle segment."""
    point = head(plan, target)
    rows = rows[within_periods(rows["theta_rad"], plan.record_periods)]
    try:
        wanted = (target.phase_lag_deg or 0.0) + 180.0
        vibration = recorded_vibration(bench, rows, plan.harmonics, phase_lag_target_deg=wanted)
    except (IdentificationError, ArithmeticError) as error:
        return {**point, "settled": True, "accepted": False, "reason": f"cannot be evaluated: {error}"}
    level_error = vibration.amplitude_m / target.level - 1.0
    hunting = frequency_scatter(rows["theta_rad"])
    reason = _objection(plan, bench, vibration, level_error, hunting)
    scatter = rows["phase_error_rad"][np.isfinite(rows["phase_error_rad"])].astype(float)
    return {
        **point,
        "settled": True,
        "accepted": not reason,
        "reason": reason,
        "frequency_hz": vibration.frequency_hz,
        "force_n": vibration.force_n,
        "amplitude_m": vibration.amplitude_m,
        "level_error": level_error,
        "phase_lag_deg": vibration.phase_lag_deg,
        "phase_error_deg": vibration.phase_error_deg,
        "frequency_scatter": hunting,
        "phase_scatter_deg": math.degrees(float(scatter.std())),
        "voltage_v": float(np.abs(rows["command_v"]).mean()),
        "periods": vibration.periods,
        "settle_periods": float(settling["periods"]),
        "amplitude_drift": float(settling["drift"]),
        "harmonics": as_pairs(vibration.harmonics),
        "harmonics_std": None if vibration.harmonics_std is None else vibration.harmonics_std.tolist(),
        "residual_rms": vibration.residual_rms.tolist(),
        "warnings": [*vibration.warnings, *quantisation_warnings(vibration, bench)],
    }


def _objection(
    plan: ResponseControlledPlan, bench: Bench, vibration: PeriodicVibration, level_error: float, hunting: float
) -> str:
    """Why a recorded point is not accepted; empty where it is."""
    if abs(level_error) > plan.accepted_level_error:
        return level_objection("displacement", level_error, plan.accepted_level_error)
    if abs(vibration.phase_error_deg) > plan.accepted_phase_error_deg:
        return f"phase error {vibration.phase_error_deg:.2f} deg, accepted up to {plan.accepted_phase_error_deg:g} deg"
    if hunting > plan.accepted_frequency_scatter:
        return (
            f"the loop hunts: the frequency scatters by {100.0 * hunting:.2f} % from period to period, "
            f"accepted up to {100.0 * plan.accepted_frequency_scatter:g} %"
        )
    return drift_objection(bench, vibration, plan.accepted_drift)
