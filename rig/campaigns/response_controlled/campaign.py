"""The response-controlled campaign: its declaration."""

from identification import FrequencyResponse
from rig.campaigns.campaign import Campaign
from rig.campaigns.evaluation.frequency_responses import recorded_frequency_responses
from rig.campaigns.response_controlled.plan import ResponseControlledPlan
from rig.campaigns.response_controlled.points import (
    RESPONSE_CONTROLLED_COLUMNS,
    ResponseControlledResult,
    measure_response_controlled_point,
)

__all__ = ["RESPONSE_CONTROLLED"]


RESPONSE_CONTROLLED = Campaign(
    plan=ResponseControlledPlan,
    result=ResponseControlledResult,
    measure=measure_response_controlled_point,
    columns=RESPONSE_CONTROLLED_COLUMNS,
    draw="rig.campaigns.response_controlled.figure:draw",
    measurements={FrequencyResponse: recorded_frequency_responses},
    exchanged=lambda recording: [recorded_frequency_responses(recording)],
    experiments="segments",
)
