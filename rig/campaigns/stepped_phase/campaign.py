"""The stepped-phase campaign: its declaration."""

from identification import FrequencyResponse
from rig.campaigns.campaign import Campaign
from rig.campaigns.evaluation.frequency_responses import recorded_frequency_responses
from rig.campaigns.stepped_phase.plan import SteppedPhasePlan
from rig.campaigns.stepped_phase.points import STEPPED_PHASE_COLUMNS, SteppedPhaseResult, measure_stepped_phase_point

__all__ = ["STEPPED_PHASE"]


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
