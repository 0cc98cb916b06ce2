"""Points of a response-controlled test: their contents and their evaluation from recorded rows."""

import math
from dataclasses import dataclass, replace

import numpy as np

from identification import Backbone, FrequencyResponse, IdentificationError
from rig.bench import Bench
from rig.campaigns.campaign import Campaign
from rig.campaigns.evaluation.acceptance import level_error, modal_point, settled_point, with_settling
from rig.campaigns.evaluation.frequency_responses import recorded_frequency_responses
from rig.campaigns.evaluation.point import Point
from rig.campaigns.evaluation.recorded import backbone_of, points_of
from rig.campaigns.evaluation.rows import Rows
from rig.campaigns.evaluation.vibration_quality import FINE_AMPLITUDE, PURITY_COLUMNS, shared_columns
from rig.campaigns.evaluation.vibrations import recorded_vibration, within_periods
from rig.campaigns.planning.plan import Target
from rig.campaigns.response_controlled.plan import ResponseControlledPlan
from rig.recording.reader import Recording
from rig.text.column import Column

RESONANCE_DEG = -90.0
"""Lag of the acceleration behind the force at phase resonance."""
NEAR_RESONANCE_DEG = 15.0
"""Distance from it up to which a point's modal properties are those of its level; chosen: as far as `nonlinear_mode` corrects
for the phase without a note."""

RESPONSE_CONTROLLED_COLUMNS = (
    Column("asked_phase_lag_deg", "lag asked for", "deg", ".0f"),
    *shared_columns("frequency_hz", "force_n"),
    FINE_AMPLITUDE,
    *shared_columns("level_error", "phase_error_deg"),
    *PURITY_COLUMNS,
)


@dataclass(frozen=True, kw_only=True)
class ResponseControlledResult:
    """Results of a point of a response-controlled test, in addition to those of every point."""

    phase_lag_deg: float
    """Lag of the displacement behind the force, deg."""
    level_error: float
    """Relative deviation of the displacement from its level."""


def measure_response_controlled_point(
    bench: Bench, plan: ResponseControlledPlan, target: Target, rows: Rows, settling: np.void
) -> Point[object]:
    """Evaluate a recorded point and its quality."""
    rows = rows[within_periods(rows, plan.record_periods)]
    vibration = recorded_vibration(bench, rows, plan.harmonics, (target.phase_lag_deg or 0.0) + 180.0)
    missed, off_level = level_error(plan.amplitude_law, target.level, vibration, math.nan, plan.accepted_level_error)
    judged = modal_point if _away_deg(target.phase_lag_deg) <= NEAR_RESONANCE_DEG else settled_point
    point = judged(plan, target, bench, vibration, rows, off_level)
    result = ResponseControlledResult(phase_lag_deg=vibration.phase_lag_deg, level_error=missed or 0.0)
    return with_settling(replace(point, result=result), settling)


def _away_deg(lag_deg: float | None) -> float:
    return math.inf if lag_deg is None else abs(lag_deg - RESONANCE_DEG)


def recorded_resonances(recording: Recording) -> Backbone:
    """Return the accepted point nearest to phase resonance of every level and pass as a backbone, in the order of the plan.

    These are settled vibrations at phase resonance as those of a backbone test. Raises `IdentificationError` if no accepted
    point is near enough.
    """
    nearest: dict[tuple[float, str, int], Point[object]] = {}
    for point in points_of(recording):
        away = _away_deg(point.asked_phase_lag_deg)
        if not point.accepted or away > NEAR_RESONANCE_DEG:
            continue
        key = point.level, point.direction, point.repeat
        if key not in nearest or away < _away_deg(nearest[key].asked_phase_lag_deg):
            nearest[key] = point
    IdentificationError.raise_if(
        not nearest, f"none was accepted within {NEAR_RESONANCE_DEG:g} deg of phase resonance", field="points"
    )
    return backbone_of(recording, list(nearest.values()))


RESPONSE_CONTROLLED = Campaign(
    plan=ResponseControlledPlan,
    result=ResponseControlledResult,
    measure=measure_response_controlled_point,
    columns=RESPONSE_CONTROLLED_COLUMNS,
    draw="rig.campaigns.response_controlled.figure:draw",
    figure_in=(11.0, 7.0),
    measurements={FrequencyResponse: recorded_frequency_responses, Backbone: recorded_resonances},
    exchanged=lambda recording: [recorded_frequency_responses(recording)],
    experiments="segments",
)
