"""Files of backbones that were measured with other systems."""

from typing import TYPE_CHECKING, Any

import numpy as np

from identification import Backbone
from rig.drawing.page import grid
from rig.drawing.style import MAIN, REJECTED, engineering, title
from rig.measurements.backbone_table import backbone_from, backbone_parts
from rig.results.kind import FileKind
from rig.text.console import number, print_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_COLUMNS = ("force_n", "frequency_hz", "amplitude_m", "phase_error_deg")
_PATTERNS = (".4f", ".4f", ".5f", ".2f")
_SCALES = (1.0, 1.0, 1e3, 1.0)


def _pack(backbone: Backbone) -> tuple[dict[str, Any], dict[str, Any]]:
    contents = backbone_parts(backbone)
    return dict(contents.arrays), dict(contents.attributes)


def _summarise(backbone: Backbone) -> dict[str, Any]:
    points = [{name: float(getattr(point, name)) for name in _COLUMNS} for point in backbone.points]
    channels = [dict(vars(channel)) for channel in backbone.channels]
    return {"specimen": backbone.specimen, "channels": channels, "points": points, "notes": []}


def _say(summary: dict[str, Any]) -> None:
    print(f"{len(summary['points'])} points")
    rows = [
        [number(p[name], pattern, scale) for name, pattern, scale in zip(_COLUMNS, _PATTERNS, _SCALES, strict=True)]
        for p in summary["points"]
    ]
    print_table(("force N", "frequency Hz", "amplitude mm", "phase error deg"), rows)


def draw_backbone(page: "Figure", backbone: Backbone) -> None:
    """Draw amplitude and force over the frequency, amplitude over the force, and the phase error."""
    axes = grid(page, 2, 2)
    amplitude, unit = engineering(np.asarray(backbone.amplitude_m))
    frequency, force = backbone.frequency_hz, np.asarray(backbone.force_n)
    error = [point.phase_error_deg for point in backbone.points]
    for axis, x, y, labels in (
        (axes[0, 0], frequency, amplitude, ("frequency, Hz", f"displacement, {unit}")),
        (axes[0, 1], frequency, force, ("frequency, Hz", "force, N")),
        (axes[1, 0], force, amplitude, ("force, N", f"displacement, {unit}")),
        (axes[1, 1], amplitude, error, (f"displacement, {unit}", "phase error, deg")),
    ):
        axis.plot(x, y, "o-", color=MAIN)
        axis.set(xlabel=labels[0], ylabel=labels[1])
    axes[1, 1].axhline(0.0, color=REJECTED, lw=0.8)
    largest = 1.1 * max(1.0, float(np.nanmax(np.abs([*error, 0.0]))))
    axes[1, 1].set_ylim(-largest, largest)
    title(page, f"{backbone.specimen or 'specimen'}: measured backbone")


MEASURED_BACKBONE = FileKind(
    name="measured-backbone",
    holds=Backbone,
    pack=_pack,
    unpack=backbone_from,
    summarise=_summarise,
    say=_say,
    draw="rig.results.measured_backbone.kind:draw_backbone",
)
