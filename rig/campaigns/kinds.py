"""Registry of the kinds of campaigns: one line for each kind. A kind is imported when a plan or a recording of it is used.

Each kind is declared in its own folder, which the contract "Campaigns" in ``pyproject.toml`` names as well.
"""

from collections.abc import Iterator, Mapping
from pkgutil import resolve_name

from rig.campaigns.campaign import Campaign

__all__ = ["KINDS", "kinds_that_yield"]

_DECLARED = {
    "backbone": "backbone.points:BACKBONE",
    "stepped-phase": "stepped_phase.points:STEPPED_PHASE",
    "continuous-backbone": "continuous_backbone.points:CONTINUOUS_BACKBONE",
    "response-controlled": "response_controlled.points:RESPONSE_CONTROLLED",
    "stepped-sine": "stepped_sine.points:STEPPED_SINE",
    "sweep": "sweep.points:SWEEP",
    "multisine": "multisine.points:MULTISINE",
    "dwell": "dwell.points:DWELL",
    "decay": "decay.points:DECAY",
}
"""Where each kind is declared."""


class _Kinds(Mapping[str, Campaign]):
    """The kinds by name, each imported when it is asked for."""

    def __getitem__(self, name: str) -> Campaign:
        kind: Campaign = resolve_name(f"rig.campaigns.{_DECLARED[name]}")
        return kind

    def __iter__(self) -> Iterator[str]:
        return iter(_DECLARED)

    def __len__(self) -> int:
        return len(_DECLARED)

    def __contains__(self, name: object) -> bool:
        return name in _DECLARED


KINDS: Mapping[str, Campaign] = _Kinds()
"""All kinds by name."""


def kinds_that_yield(measurement: type) -> tuple[str, ...]:
    """Return the names of the kinds whose recordings yield a given type of measurement."""
    return tuple(name for name, campaign in KINDS.items() if measurement in campaign.measurements)
