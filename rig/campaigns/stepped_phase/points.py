"""Points of a stepped-phase test: their contents and their evaluation from recorded rows."""

from dataclasses import dataclass, replace

import numpy as np

from identification import FrequencyResponse
from rig.bench import Bench
from rig.campaigns.campaign import Campaign
from rig.campaigns.evaluation.acceptance import level_error, modal_point, with_settling
from rig.campaigns.evaluation.frequency_responses import recorded_frequency_responses
from rig.campaigns.evaluation.lost_samples import rms_of_force
from rig.campaigns.evaluation.point import Point
from rig.campaigns.evaluation.rows import Rows
from rig.campaigns.evaluation.vibration_quality import FINE_AMPLITUDE, PURITY_COLUMNS, shared_columns
from rig.campaigns.evaluation.vibrations import recorded_vibration, within_periods
from rig.campaigns.planning.plan import Target
from rig.campaigns.stepped_phase.plan import SteppedPhasePlan
from rig.text.column import Column

STEPPED_PHASE_COLUMNS = (
    Column("phase_lag_deg", "acceleration lag", "deg", ".2f"),
    *shared_columns("frequency_hz", "force_n"),
    Column("force_rms_n", "force RMS", "N", ".4f"),
    FINE_AMPLITUDE,
    *shared_columns("damping_ratio", "damping_ratio_std", "level_error"),
    *PURITY_COLUMNS,
)


@dataclass(frozen=True, kw_only=True)
class SteppedPhaseResult:
    """Results of a stepped-phase point in addition to those of every point."""

    force_rms_n: float
    """RMS of the force samples without their mean value, all harmonics included, N."""
    phase_lag_deg: float
    """Lag of the drive-point acceleration behind the force, deg."""
    level_error: float | None
    """Relative deviation of the held quantity from its level; None with levels in volts."""


def measure_stepped_phase_point(
    bench: Bench, plan: SteppedPhasePlan, target: Target, rows: Rows, settling: np.void
) -> Point[object]:
    """Evaluate a recorded point and its quality."""
    lag_deg = target.phase_lag_deg or 0.0
    rows = rows[within_periods(rows, plan.record_periods)]
    vibration = recorded_vibration(bench, rows, plan.harmonics, lag_deg + 180.0)
    force_rms_n = rms_of_force(bench, rows)
    missed, off_level = level_error(plan.amplitude_law, target.level, vibration, force_rms_n, plan.accepted_level_error)
    point = modal_point(plan, target, bench, vibration, rows, off_level)
    result = SteppedPhaseResult(
        force_rms_n=force_rms_n, phase_lag_deg=lag_deg - vibration.phase_error_deg, level_error=missed
    )
    return with_settling(replace(point, result=result), settling)


STEPPED_PHASE = Campaign(
    plan=SteppedPhasePlan,
    result=SteppedPhaseResult,
    measure=measure_stepped_phase_point,
    columns=STEPPED_PHASE_COLUMNS,
    draw="rig.campaigns.stepped_phase.figure:draw",
    measurements={FrequencyResponse: recorded_frequency_responses},
    exchanged=lambda recording: [recorded_frequency_responses(recording)],
    experiments="segments",
)
