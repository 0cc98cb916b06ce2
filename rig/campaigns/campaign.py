"""Declaration of a kind of campaign: everything that the rest of the program needs to know about it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from rig.campaigns.evaluation.point import Point
from rig.campaigns.planning.plan import Plan
from rig.recording.reader import Recording
from rig.text.column import Column


@dataclass(frozen=True, kw_only=True)
class Campaign:
    """One kind of campaign. It is declared at the end of `points.py` in its own folder and listed in `rig.campaigns.kinds`."""

    plan: type[Plan]
    """Class of its plans."""
    result: type[object]
    """Class of `Point.result`: the results that only points of this kind have."""
    measure: Callable[..., Point[object]] | None = None
    """``(bench, plan, target, rows, settling) -> point``: evaluates the rows of one point, including the quality; ``settling``
    is the outcome record of the segment before. Rows without a result raise `IdentificationError` or `ArithmeticError`."""
    measure_batch: Callable[..., list[Point[object]]] | None = None
    """``(bench, plan, targets, rows, passages, ended) -> points``: evaluates the points that are measured together, in place of
    ``measure``, whose errors it raises."""
    columns: tuple[Column, ...]
    """Columns that tables show of a point."""
    draw: str
    """``module:function`` that draws a recording on an empty page, ``(page, recording)``. It is imported only when a figure is
    drawn."""
    panels: tuple[str, ...] = ()
    """Names of the parts of its figure that may be drawn alone; its function then takes them as ``panels``."""
    figure_in: tuple[float, float] = (9.0, 6.4)
    """Width and height of the page of its figure, inches."""
    watch: Callable[..., tuple[Point[object], str]] | None = None
    """``(plan, points so far, point) -> (point, why to stop)``: completes a new point with the help of the points before it. If
    the text is not empty, the output is ramped down and the run ends."""
    asks_for_damping: bool = False
    """Whether its points are data for damping at phase resonance, so that what falsifies it refuses them."""
    identity: tuple[str, ...] = ()
    """Keys of a plan that define its vibrations. If one of them changes, no recorded point counts for the new plan."""
    fixed: tuple[str, ...] = ()
    """Keys of a plan that must not change when a recording is resumed, because all points must be evaluated in the same way."""
    measurements: Mapping[type, Callable[..., Any]] = field(default_factory=dict)
    """Measurements that a recording yields: the function that reads each of them, by the type of the measurement."""
    exchanged: Callable[[Recording], list[object]] = lambda _: []
    """Returns the objects of a recording that are exported to other programs."""
    experiments: Literal["realisations", "sweeps", "segments"] | None = None
    """How a recording becomes data for nonlinear state-space models: whole realisations of a multisine, whole sweeps, or
    segments of settled points. None if it cannot."""

    @property
    def kind(self) -> str:
        """Name of the kind, as used in plans and files."""
        return str(self.plan.model_fields["kind"].default)
