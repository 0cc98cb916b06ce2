"""What a kind of campaign declares: all that the rest of the program asks of it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from rig.campaigns.evaluation.point import Point
from rig.campaigns.planning.plan import Column, Plan
from rig.recording.reader import Recording

__all__ = ["Campaign"]


@dataclass(frozen=True, kw_only=True)
class Campaign:
    """One kind of campaign: the end of `points.py` in its own folder, and one line in `rig.campaigns.kinds`."""

    plan: type[Plan]
    """Model of its plans."""
    result: type
    """What its points hold beside what all points have: class of `Point.result`."""
    measure: Callable[..., Any]
    """``(bench, plan, target, rows, settling) -> point``: the result of a recorded point, with its own quality."""
    columns: tuple[Column, ...]
    """What is shown of a point."""
    draw: str
    """``module:function`` that draws a recording on an empty page, ``(page, recording)``; loaded when a figure is wanted."""
    in_one_go: bool = False
    """Whether points are measured together: ``(bench, plan, targets, rows, passages, ended) -> points``."""
    watch: Callable[[Any, Sequence[Point[Any]], Point[Any]], tuple[Point[Any], str]] | None = None
    """``(plan, points so far, point) -> (point, why to stop)``: completes a new point by those before it. If the text is not
    empty, the output is ramped down and the run ends."""
    identity: tuple[str, ...] = ()
    """Keys of a plan that make all its points other vibrations where they are changed."""
    fixed: tuple[str, ...] = ()
    """Keys of a plan that must not change when a recording is resumed, because all points must be evaluated alike."""
    measurements: Mapping[type, Callable[[Recording], Any]] = field(default_factory=dict)
    """What a recording yields, by the type of the measurement."""
    exchanged: Callable[[Recording], list[Any]] = lambda _: []
    """The objects of a recording that are written for other programs."""
    experiments: Literal["realisations", "sweeps", "segments"] | None = None
    """How a recording becomes data for nonlinear state-space models: whole realisations of a multisine, whole sweeps, segments
    of settled points; None where it does not."""

    @property
    def kind(self) -> str:
        """Name of the kind, as plans and files have it."""
        return str(self.plan.model_fields["kind"].default)
