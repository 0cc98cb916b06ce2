"""Files of backbones that were measured with other systems."""

from typing import TYPE_CHECKING, Any

from identification import Backbone
from rig.results.kind import Table
from rig.text.console import number, print_table

if TYPE_CHECKING:
    pass

_COLUMNS = ("force_n", "frequency_hz", "amplitude_m", "phase_error_deg")
_PATTERNS = (".4f", ".4f", ".5f", ".2f")
_SCALES = (1.0, 1.0, 1e3, 1.0)
"""Factors from SI units to those of the table."""


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


TABLE = Table(_summarise, _say)
