"""Table, curves and exchange of a nonlinear mode."""

from functools import partial
from typing import Any

import numpy as np

from identification import NonlinearMode
from identification.common import QUANTITIES, decode, encode
from rig.drawing.curves import Curves, View, backbone_curves
from rig.results.kind import Exchange, Table
from rig.text.column import Column
from rig.text.console import print_rows
from rig.text.contents import Contents, Labels, array_unit


def _summarise(mode: NonlinearMode) -> dict[str, Any]:
    return {
        "specimen": mode.specimen,
        "source": mode.source,
        "frequency_shift": mode.frequency_shift,
        "drive_mode_shape": mode.drive_mode_shape,
        "drive_mode_shape_std": mode.drive_mode_shape_std,
        "drive_mode_shape_source": mode.drive_mode_shape_source,
        "points": mode.table(),
        "notes": list(mode.notes),
    }


def _say(summary: dict[str, Any]) -> None:
    print_rows(
        summary["points"],
        Column("force_n", "force", "N", ".4f"),
        Column("amplitude_m", "amplitude", "mm", ".5f", 1e3),
        Column("modal_frequency_hz", "modal frequency", "Hz", ".4f"),
        Column("modal_frequency_bound_95_hz", "+-", "", ".4f"),
        Column("damping_ratio", "damping", "%", ".4f", 100.0),
        Column("damping_ratio_bound_95", "+-", "", ".4f", 100.0),
        Column("damping_ratio_total_power", "all harmonics", "%", ".4f", 100.0),
        Column("phase_lag_deg", "displacement lag", "deg", ".2f"),
    )
    print(f"frequency, last point over first: {100.0 * summary['frequency_shift']:+.2f} %")
    if summary["drive_mode_shape"] is not None:
        std, source = summary["drive_mode_shape_std"], summary["drive_mode_shape_source"]
        bound = "" if std is None else f" +- {1.96 * std:.2g}"
        print(
            f"mode shape at the drive point: {summary['drive_mode_shape']:.5g}{bound} kg^-1/2"
            + (f", {source}" if source else "")
        )


TABLE = Table(_summarise, _say)


def curves(mode: NonlinearMode, view: View) -> Curves:
    """Return modal frequency and damping over the amplitude."""
    return backbone_curves([(None, mode)], view)


def _nonlinear_mode(mode: NonlinearMode) -> Contents:
    arrays, attributes = encode(mode)
    size = len(mode.force_n)
    rows = {name: 0 for name, array in arrays.items() if array.ndim and array.shape[0] == size}
    units = np.array([array_unit(name) for name in QUANTITIES])
    further = {"systematic_std": units, "random_std": units, "interval_95": units[:, None]}
    labels: dict[str, Labels] = dict.fromkeys(("systematic_std", "random_std"), (QUANTITIES,))
    labels |= {"interval_95": (QUANTITIES, ("low", "high"))}
    return Contents("nonlinear-mode", mode.specimen, arrays, attributes, rows, further, labels)


EXCHANGE = Exchange("nonlinear-mode", NonlinearMode, _nonlinear_mode, partial(decode, NonlinearMode))
