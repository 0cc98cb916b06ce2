"""Files of backbones that were measured with other systems."""

from typing import TYPE_CHECKING, Any

import numpy as np

from identification import Backbone
from rig.drawing.style import MAIN, title
from rig.measurements.backbone_table import backbone_from, backbone_parts
from rig.models.files.kind import FileKind
from rig.text.console import number, print_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["MEASURED_BACKBONE"]

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
    """Draw amplitude and force over the frequency."""
    size, force = page.subplots(1, 2)
    size.plot(backbone.frequency_hz, 1e3 * backbone.amplitude_m, "o-", color=MAIN, ms=4)
    size.set(xlabel="frequency, Hz", ylabel="drive point, mm")
    force.plot(backbone.frequency_hz, np.asarray(backbone.force_n), "o-", color=MAIN, ms=4)
    force.set(xlabel="frequency, Hz", ylabel="force, N")
    title(page, f"{backbone.specimen or 'specimen'}: measured backbone")


MEASURED_BACKBONE = FileKind(
    name="measured-backbone",
    holds=Backbone,
    pack=_pack,
    unpack=backbone_from,
    summarise=_summarise,
    say=_say,
    draw="rig.models.files.measured_backbone:draw_backbone",
)
