"""From the recorded rows of a response-controlled point to its result."""

from typing import Any

import numpy as np

from identification import IdentificationError
from rig.bench import Bench
from rig.campaigns.evaluation.acceptance import level_objection, settled_objection, settled_quality
from rig.campaigns.evaluation.vibration_quality import PURITY_COLUMNS, of_a_record
from rig.campaigns.evaluation.vibrations import head, not_evaluated, recorded_vibration, within_periods
from rig.campaigns.planning.plan import Column, Target
from rig.campaigns.response_controlled.plan import ResponseControlledPlan

__all__ = ["RESPONSE_CONTROLLED_COLUMNS", "measure_response_controlled_point"]

RESPONSE_CONTROLLED_COLUMNS = (
    Column("asked_phase_lag_deg", "lag asked for", "deg", ".0f"),
    Column("frequency_hz", "frequency", "Hz", ".4f", plain=True),
    Column("force_n", "force", "N", ".4f", plain=True),
    Column("amplitude_m", "amplitude", "mm", ".5f", 1e3, plain=True),
    Column("level_error", "level error", "%", ".2f", 100.0),
    Column("phase_error_deg", "phase error", "deg", ".2f"),
    *PURITY_COLUMNS,
)


def measure_response_controlled_point(
    bench: Bench, plan: ResponseControlledPlan, target: Target, rows: np.ndarray, settling: np.void
) -> dict[str, Any]:
    """The result of a recorded point, with its own quality; ``settling`` is the outcome record of its settle segment."""
    rows = rows[within_periods(rows["theta_rad"], plan.record_periods)]
    try:
        wanted = (target.phase_lag_deg or 0.0) + 180.0
        vibration = recorded_vibration(bench, rows, plan.harmonics, phase_lag_target_deg=wanted)
    except (IdentificationError, ArithmeticError) as error:
        return not_evaluated(plan, target, error, settled=True)
    missed = vibration.amplitude_m / target.level - 1.0
    found = settled_quality(vibration, bench, rows)
    off_level = level_objection(plan.amplitude_law, missed, plan.accepted_level_error)
    reason = settled_objection(plan, bench, vibration, found, off_level)
    return {
        **head(plan, target),
        "settled": True,
        "accepted": not reason,
        "reason": reason,
        "frequency_hz": vibration.frequency_hz,
        "force_n": vibration.force_n,
        "amplitude_m": vibration.amplitude_m,
        "level_error": missed,
        "phase_lag_deg": vibration.phase_lag_deg,
        **found,
        **of_a_record(bench, vibration, rows, settling),
    }
