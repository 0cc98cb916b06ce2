"""The kinds of campaigns: for each its plan, how a point is measured, and what of a point is shown."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from rig.campaigns.backbone import BackbonePlan
from rig.campaigns.backbone_points import BACKBONE_COLUMNS, measure_backbone_point
from rig.campaigns.plan import Column, Plan

__all__ = ["KINDS", "Campaign"]


@dataclass(frozen=True)
class Campaign:
    """What makes a kind of campaign."""

    plan: type[Plan]
    """Model of its plans."""
    measure: Callable[..., dict[str, Any]]
    """``(bench, plan, target, rows, settling) -> point``: the result of a recorded point, with its own quality."""
    columns: tuple[Column, ...]
    """What is shown of a point."""


KINDS = {
    "backbone": Campaign(BackbonePlan, measure_backbone_point, BACKBONE_COLUMNS),
}
