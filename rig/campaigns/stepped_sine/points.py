"""From the recorded rows of a stepped-sine point to its result."""

from typing import Any

import numpy as np

from identification import IdentificationError
from rig.bench import Bench
from rig.campaigns.evaluation.acceptance import alien_objection, drift_objection, first_of, level_error, level_objection
from rig.campaigns.evaluation.alien_force import alien_force
from rig.campaigns.evaluation.vibration_quality import PURITY_COLUMNS, of_a_record
from rig.campaigns.evaluation.vibrations import head, not_evaluated, recorded_vibration, within_periods
from rig.campaigns.planning.plan import Column, Target
from rig.campaigns.stepped_sine.plan import SteppedSinePlan

__all__ = ["STEPPED_SINE_COLUMNS", "measure_stepped_sine_point"]

TRUSTED_ALIEN_FORCE = 0.1  # what no lock holds is warned of, where plans under a lock accept no more

STEPPED_SINE_COLUMNS = (
    Column("frequency_hz", "frequency", "Hz", ".4f", plain=True),
    Column("force_n", "force", "N", ".4f", plain=True),
    Column("amplitude_m", "amplitude", "mm", ".5f", 1e3, plain=True),
    Column("phase_lag_deg", "phase lag", "deg", ".2f"),
    *PURITY_COLUMNS,
)


def measure_stepped_sine_point(
    bench: Bench, plan: SteppedSinePlan, target: Target, rows: np.ndarray, settling: np.void
) -> dict[str, Any]:
    """The result of a recorded point, with its own quality; ``settling`` is the outcome record of its settle segment."""
    rows = rows[within_periods(rows["theta_rad"], plan.record_periods)]
    try:
        vibration = recorded_vibration(bench, rows, plan.harmonics)
    except (IdentificationError, ArithmeticError) as error:
        return not_evaluated(plan, target, error, settled=True)
    harmonics = np.abs(vibration.harmonics[bench.index_of("force"), 1:])
    force_rms_n = float(np.sqrt(0.5 * np.sum(harmonics**2)))
    missed = level_error(plan.amplitude_law, target.level, vibration, force_rms_n)
    reason = first_of(
        (
            level_objection(plan.amplitude_law, missed, plan.accepted_level_error),
            drift_objection(bench, vibration, plan.accepted_drift),
        )
    )
    alien = alien_force(bench, [rows])
    point = of_a_record(bench, vibration, rows, settling)
    point["warnings"] += filter(None, [alien_objection(alien, TRUSTED_ALIEN_FORCE)])
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
        "alien_force": alien,
        **point,
    }
