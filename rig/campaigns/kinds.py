"""Registry of the kinds of campaigns: one line for each kind. Each kind is declared in its own folder.

The contract "Campaigns" in ``pyproject.toml`` also names the folders.
"""

from rig.campaigns.backbone.points import BACKBONE
from rig.campaigns.continuous_backbone.points import CONTINUOUS_BACKBONE
from rig.campaigns.decay.points import DECAY
from rig.campaigns.dwell.points import DWELL
from rig.campaigns.multisine.points import MULTISINE
from rig.campaigns.response_controlled.points import RESPONSE_CONTROLLED
from rig.campaigns.stepped_phase.points import STEPPED_PHASE
from rig.campaigns.stepped_sine.points import STEPPED_SINE
from rig.campaigns.sweep.points import SWEEP

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
        DECAY,
    )
}
"""All kinds by name."""


def kinds_that_yield(measurement: type) -> tuple[str, ...]:
    """Return the names of the kinds whose recordings yield a given type of measurement."""
    return tuple(name for name, campaign in KINDS.items() if measurement in campaign.measurements)
