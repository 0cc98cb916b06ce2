"""Storage, table, figure, curves and exchange of a backbone that was measured with another system."""

from dataclasses import replace
from typing import Any

import numpy as np

from identification import Backbone, IdentificationError, nonlinear_mode
from rig.drawing.curves import Curves, View, backbone_curves
from rig.drawing.page import grid
from rig.drawing.style import MAIN, REJECTED, Figure, engineering, title
from rig.measurements.backbone_table import backbone_from, backbone_parts
from rig.results.kind import Exchange, Storage, Table
from rig.text.column import Column
from rig.text.console import print_rows
from rig.text.contents import Contents


def _pack(backbone: Backbone) -> tuple[dict[str, Any], dict[str, Any]]:
    contents = backbone_parts(backbone)
    return dict(contents.arrays), dict(contents.attributes)


STORAGE = Storage(_pack, backbone_from)


_COLUMNS = (
    Column("force_n", "force", "N", ".4f"),
    Column("frequency_hz", "frequency", "Hz", ".4f"),
    Column("amplitude_m", "amplitude", "mm", ".5f", 1e3),
    Column("phase_error_deg", "phase error", "deg", ".2f"),
)


def _summarise(backbone: Backbone) -> dict[str, Any]:
    points = [{one.key: float(getattr(point, one.key)) for one in _COLUMNS} for point in backbone.points]
    channels = [dict(vars(channel)) for channel in backbone.channels]
    return {"specimen": backbone.specimen, "channels": channels, "points": points, "notes": []}


def _say(summary: dict[str, Any]) -> None:
    print(f"{len(summary['points'])} points")
    print_rows(summary["points"], *_COLUMNS)


TABLE = Table(_summarise, _say)


def draw_backbone(page: Figure, backbone: Backbone) -> None:
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


def curves(backbone: Backbone, view: View) -> Curves:
    """Return modal frequency and damping over the amplitude."""
    return backbone_curves([(backbone, nonlinear_mode(backbone))], view)


def _exchanged(backbone: Backbone) -> Contents:
    """Return the table of a backbone with modal frequency and damping of its settled points, where a mode shape is known."""
    contents = backbone_parts(backbone)
    settled = np.array([point.settled for point in backbone.points])
    if backbone.drive_mode_shape is None or not settled.any():
        return contents
    try:
        mode = nonlinear_mode(backbone.settled(), draws=0)
    except IdentificationError:  # a point that says nothing: the table is then that of what was measured
        return contents
    arrays = dict(contents.arrays)
    for name in ("modal_frequency_hz", "damping_ratio"):
        arrays[name] = np.full(settled.size, np.nan)
        arrays[name][settled] = getattr(mode, name)
    return replace(contents, arrays=arrays, rows={**contents.rows, **dict.fromkeys(arrays, 0)})


EXCHANGE = Exchange("backbone", Backbone, _exchanged, backbone_from)
