"""Registry of the kinds of campaigns: one line for each kind. A kind is imported when a plan or a recording of it is used.

Each kind is declared in its own folder, which the contract "Campaigns" in ``pyproject.toml`` names as well.
"""

from collections.abc import Mapping

from rig.campaigns.campaign import Campaign
from vibrolock.on_use import Registry

KINDS: Mapping[str, Campaign] = Registry(
    {
        "backbone": "rig.campaigns.backbone.points:BACKBONE",
        "stepped-phase": "rig.campaigns.stepped_phase.points:STEPPED_PHASE",
        "continuous-backbone": "rig.campaigns.continuous_backbone.points:CONTINUOUS_BACKBONE",
        "response-controlled": "rig.campaigns.response_controlled.points:RESPONSE_CONTROLLED",
        "stepped-sine": "rig.campaigns.stepped_sine.points:STEPPED_SINE",
        "sweep": "rig.campaigns.sweep.points:SWEEP",
        "multisine": "rig.campaigns.multisine.points:MULTISINE",
        "dwell": "rig.campaigns.dwell.points:DWELL",
        "decay": "rig.campaigns.decay.points:DECAY",
    }
)
"""All kinds by name."""


def kinds_that_yield(measurement: type) -> tuple[str, ...]:
    """Return the names of the kinds whose recordings yield a given type of measurement."""
    return tuple(name for name, campaign in KINDS.items() if measurement in campaign.measurements)
