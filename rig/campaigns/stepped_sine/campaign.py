"""The stepped-sine campaign: its declaration."""

from identification import FrequencyResponse
from rig.campaigns.campaign import Campaign
from rig.campaigns.evaluation.frequency_responses import recorded_frequency_responses
from rig.campaigns.stepped_sine.plan import SteppedSinePlan
from rig.campaigns.stepped_sine.points import STEPPED_SINE_COLUMNS, SteppedSineResult, measure_stepped_sine_point

__all__ = ["STEPPED_SINE"]


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
