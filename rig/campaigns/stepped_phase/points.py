"""From the recorded rows of a stepped-phase point to its result."""

import math
from typing import Any

import numpy as np

from identification import Backbone, IdentificationError, nonlinear_mode
from rig.bench import Bench
from rig.campaigns.evaluation.acceptance import level_error, level_objection, settled_objection, settled_quality
from rig.campaigns.evaluation.lost_samples import bridged
from rig.campaigns.evaluation.vibration_quality import PURITY_COLUMNS, of_a_record
from rig.campaigns.evaluation.vibrations import head, not_evaluated, recorded_vibration, within_periods
from rig.campaigns.planning.plan import Column, Target
from rig.campaigns.stepped_phase.plan import SteppedPhasePlan

__all__ = ["STEPPED_PHASE_COLUMNS", "measure_stepped_phase_point"]

STEPPED_PHASE_COLUMNS = (
    Column("phase_lag_deg", "phase lag", "deg", ".2f"),
    Column("frequency_hz", "frequency", "Hz", ".4f", plain=True),
    Column("force_n", "force", "N", ".4f", plain=True),
    Column("force_rms_n", "force RMS", "N", ".4f"),
    Column("amplitude_m", "amplitude", "mm", ".5f", 1e3, plain=True),
    Column("damping_ratio", "damping", "%", ".4f", 100.0, plain=True),
    Column("level_error", "level error", "%", ".2f", 100.0),
    *PURITY_COLUMNS,
)


def measure_stepped_phase_point(
    bench: Bench, plan: SteppedPhasePlan, target: Target, rows: np.ndarray, settling: np.void
) -> dict[str, Any]:
    """The result of a recorded point, with its own quality; ``settling`` is the outcome record of its settle segment.

    The RMS of the force is that of its samples without their mean, whatever harmonics they hold.
    """
    lag_deg = target.phase_lag_deg or 0.0
    rows = rows[within_periods(rows["theta_rad"], plan.record_periods)]
    try:
        vibration = recorded_vibration(bench, rows, plan.harmonics, phase_lag_target_deg=lag_deg + 180.0)
        mode = nonlinear_mode(Backbone((vibration,), bench.specimen.name, bench.specimen.drive_mode_shape))
    except (IdentificationError, ArithmeticError) as error:
        return not_evaluated(plan, target, error, settled=True)
    force_rms_n = float(bridged(rows)[:-1, bench.index_of("force")].std())
    missed = level_error(plan.amplitude_law, target.level, vibration, force_rms_n)
    found = settled_quality(vibration, bench, rows)
    off_level = level_objection(plan.amplitude_law, missed, plan.accepted_level_error)
    reason = settled_objection(plan, bench, vibration, found, off_level)
    damping = float(mode.damping_ratio[0])
    return {
        **head(plan, target),
        "settled": True,
        "accepted": not reason,
        "reason": reason,
        "frequency_hz": vibration.frequency_hz,
        "force_n": vibration.force_n,
        "force_rms_n": force_rms_n,
        "amplitude_m": vibration.amplitude_m,
        "phase_lag_deg": lag_deg - vibration.phase_error_deg,
        "level_error": missed,
        "modal_frequency_hz": float(mode.modal_frequency_hz[0]),
        "damping_ratio": damping if math.isfinite(damping) else None,
        **found,
        **of_a_record(bench, vibration, rows, settling),
    }
