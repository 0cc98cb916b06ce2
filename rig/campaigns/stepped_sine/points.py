"""Points of a stepped-sine test: their contents and their evaluation from recorded rows."""

from dataclasses import dataclass, replace

import numpy as np

from identification import FrequencyResponse
from rig.bench import Bench
from rig.campaigns.campaign import Campaign
from rig.campaigns.evaluation.acceptance import drift_objection, level_error, nonharmonic_objection, with_settling
from rig.campaigns.evaluation.frequency_responses import recorded_frequency_responses
from rig.campaigns.evaluation.nonharmonic_force import nonharmonic_force
from rig.campaigns.evaluation.point import Point, Quality, planned_point
from rig.campaigns.evaluation.rows import Rows
from rig.campaigns.evaluation.vibration_quality import (
    FINE_AMPLITUDE,
    PURITY_COLUMNS,
    damping_bias,
    quality_warnings,
    shared_columns,
    vibration_part,
)
from rig.campaigns.evaluation.vibrations import recorded_vibration, within_periods
from rig.campaigns.planning.plan import Target
from rig.campaigns.stepped_sine.plan import SteppedSinePlan
from rig.text.column import Column

TRUSTED_NONHARMONIC_FORCE = 0.1  # in open loop a larger value warns; plans under a phase lock reject the point

STEPPED_SINE_COLUMNS = (
    *shared_columns("frequency_hz", "force_n"),
    FINE_AMPLITUDE,
    Column("phase_lag_deg", "displacement lag", "deg", ".2f"),
    *PURITY_COLUMNS,
)


@dataclass(frozen=True, kw_only=True)
class SteppedSineResult:
    """Results of a stepped-sine point in addition to those of every point."""

    phase_lag_deg: float
    """Lag of the displacement behind the force, deg."""
    level_error: float | None
    """Relative deviation of the held quantity from its level; None with levels in volts."""


def measure_stepped_sine_point(
    bench: Bench, plan: SteppedSinePlan, target: Target, rows: Rows, settling: np.void
) -> Point[object]:
    """Evaluate a recorded point and its quality."""
    rows = rows[within_periods(rows, plan.record_periods)]
    vibration = recorded_vibration(bench, rows, plan.harmonics)
    harmonics = np.abs(vibration.harmonics[bench.index_of("force"), 1:])
    force_rms_n = float(np.sqrt(0.5 * np.sum(harmonics**2)))
    missed, off_level = level_error(plan.amplitude_law, target.level, vibration, force_rms_n, plan.accepted_level_error)
    reason = off_level or drift_objection(bench, vibration, plan.accepted_drift)
    nonharmonic = nonharmonic_force(bench, [rows])
    point = replace(
        planned_point(plan, target),
        settled=True,
        reason=reason,
        quality=Quality.of(reason),
        warnings=quality_warnings(bench, vibration, rows),
        notes=damping_bias(vibration),
        nonharmonic_force=nonharmonic,
        vibration=vibration_part(vibration, rows),
        result=SteppedSineResult(phase_lag_deg=vibration.phase_lag_deg, level_error=missed),
    )
    objection = nonharmonic_objection(nonharmonic, TRUSTED_NONHARMONIC_FORCE)
    return with_settling(point.warned(objection) if objection else point, settling)


STEPPED_SINE = Campaign(
    plan=SteppedSinePlan,
    result=SteppedSineResult,
    measure=measure_stepped_sine_point,
    columns=STEPPED_SINE_COLUMNS,
    draw="rig.campaigns.stepped_sine.figure:draw",
    measurements={FrequencyResponse: recorded_frequency_responses},
    exchanged=lambda recording: [recorded_frequency_responses(recording)],
    experiments="segments",
)
