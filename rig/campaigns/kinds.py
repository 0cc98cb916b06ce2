"""The kinds of campaigns: one line for each, which stands in its own folder."""

from rig.campaigns.backbone.campaign import BACKBONE
from rig.campaigns.continuous_backbone.campaign import CONTINUOUS_BACKBONE
from rig.campaigns.dwell.campaign import DWELL
from rig.campaigns.multisine.campaign import MULTISINE
from rig.campaigns.response_controlled.campaign import RESPONSE_CONTROLLED
from rig.campaigns.stepped_phase.campaign import STEPPED_PHASE
from rig.campaigns.stepped_sine.campaign import STEPPED_SINE
from rig.campaigns.sweep.campaign import SWEEP

__all__ = ["KINDS", "kinds_that_yield"]

KINDS = {
    campaign.kind: campaign
    for campaign in (
        BACKBONE,
        STEPPED_PHASE,
        CONTINUOUS_BACKBONE,
        RESPONSE_CONTROLLED,
        STEPPED_SINE,
        SWEEP,
        MULTISINE,
        DWELL,
    )
}
"""Every kind by its name."""


def kinds_that_yield(measurement: type) -> tuple[str, ...]:
    """Names of the kinds whose recordings yield a type of measurement."""
    return tuple(name for name, campaign in KINDS.items() if measurement in campaign.measurements)
