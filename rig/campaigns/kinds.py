"""The kinds of campaigns: for each its plan, how a point is measured, and what of a point is shown."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from rig.campaigns.backbone.plan import BackbonePlan
from rig.campaigns.backbone.points import BACKBONE_COLUMNS, measure_backbone_point
from rig.campaigns.continuous_backbone.plan import ContinuousBackbonePlan
from rig.campaigns.continuous_backbone.points import CONTINUOUS_BACKBONE_COLUMNS, measure_continuous_backbone
from rig.campaigns.multisine.plan import MultisinePlan
from rig.campaigns.multisine.points import MULTISINE_COLUMNS, measure_multisine_point
from rig.campaigns.planning.plan import Column, Plan
from rig.campaigns.response_controlled.plan import ResponseControlledPlan
from rig.campaigns.response_controlled.points import RESPONSE_CONTROLLED_COLUMNS, measure_response_controlled_point
from rig.campaigns.stepped_phase.plan import SteppedPhasePlan
from rig.campaigns.stepped_phase.points import STEPPED_PHASE_COLUMNS, measure_stepped_phase_point
from rig.campaigns.stepped_sine.plan import SteppedSinePlan
from rig.campaigns.stepped_sine.points import STEPPED_SINE_COLUMNS, measure_stepped_sine_point
from rig.campaigns.sweep.plan import SweepPlan
from rig.campaigns.sweep.points import SWEEP_COLUMNS, measure_sweep

__all__ = ["KINDS", "Campaign"]


@dataclass(frozen=True)
class Campaign:
    """What makes a kind of campaign."""

    plan: type[Plan]
    """Model of its plans."""
    measure: Callable[..., Any]
    """``(bench, plan, target, rows, settling) -> point``: the result of a recorded point, with its own quality."""
    columns: tuple[Column, ...]
    """What is shown of a point."""
    in_one_go: bool = False
    """Whether points are measured together: ``(bench, plan, targets, rows, passages, ended) -> points``."""


KINDS = {
    "backbone": Campaign(BackbonePlan, measure_backbone_point, BACKBONE_COLUMNS),
    "stepped-phase": Campaign(SteppedPhasePlan, measure_stepped_phase_point, STEPPED_PHASE_COLUMNS),
    "continuous-backbone": Campaign(
        ContinuousBackbonePlan, measure_continuous_backbone, CONTINUOUS_BACKBONE_COLUMNS, in_one_go=True
    ),
    "response-controlled": Campaign(
        ResponseControlledPlan, measure_response_controlled_point, RESPONSE_CONTROLLED_COLUMNS
    ),
    "stepped-sine": Campaign(SteppedSinePlan, measure_stepped_sine_point, STEPPED_SINE_COLUMNS),
    "sweep": Campaign(SweepPlan, measure_sweep, SWEEP_COLUMNS),
    "multisine": Campaign(MultisinePlan, measure_multisine_point, MULTISINE_COLUMNS),
}
