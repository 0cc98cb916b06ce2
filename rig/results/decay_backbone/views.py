"""Table and figure of a free decay: modal frequency and damping over the amplitude."""

from dataclasses import replace
from typing import Any

from identification import DecayBackbone
from rig.drawing.curves import Curves, View, backbone_curves
from rig.drawing.style import MAIN, SECOND, Figure, engineering, title
from rig.results.kind import Table
from rig.text.column import Column
from rig.text.console import print_rows


def _summarise(found: DecayBackbone) -> dict[str, Any]:
    modes = [
        {
            "reference": mode.reference,
            "start_s": mode.start_s,
            "stop_s": mode.stop_s,
            "floor_m": mode.floor_m,
            "drive_mode_shape": mode.drive_mode_shape,
            "points": mode.table(),
        }
        for mode in found.modes
    ]
    return {"specimen": found.specimen, "modes": modes, "notes": list(found.notes)}


def _say(summary: dict[str, Any]) -> None:
    for mode in summary["modes"]:
        print(
            f"decay of {mode['reference']} from {mode['start_s']:.4g} to {mode['stop_s']:.4g} s, "
            f"noise {1e3 * mode['floor_m']:.3g} mm"
        )
        print_rows(
            mode["points"],
            Column("amplitude_m", "amplitude", "mm", ".5f", 1e3),
            Column("modal_frequency_hz", "modal frequency", "Hz", ".4f"),
            Column("modal_frequency_bound_95_hz", "+-", "", ".4f"),
            Column("damping_ratio", "damping", "%", ".4f", 100.0),
            Column("damping_ratio_bound_95", "+-", "", ".4f", 100.0),
            Column("time_s", "at", "s", ".3f"),
        )


TABLE = Table(_summarise, _say)


_SMALL_CHANGE = 2e-4
"""Least height of the frequency axis over the last frequency, so that rounding does not look like a change; chosen."""


def draw_decay(page: Figure, found: DecayBackbone) -> None:
    """Draw every mode with its 95 % intervals."""
    panels = page.subplots(len(found.modes), 2, squeeze=False)
    for (left, right), mode in zip(panels, found.modes, strict=True):
        amplitude, unit = engineering(mode.amplitude_m)
        for axis, value, bound, colour, name in (
            (left, mode.modal_frequency_hz, mode.modal_frequency_bound_95_hz, MAIN, "modal frequency, Hz"),
            (right, 100.0 * mode.damping_ratio, 100.0 * mode.damping_ratio_bound_95, SECOND, "modal damping ratio, %"),
        ):
            axis.errorbar(amplitude, value, bound, fmt="o-", color=colour, capsize=2)
            axis.set(xlabel=f"displacement amplitude of {mode.reference}, {unit}", ylabel=name, xscale="log")
        right.set_ylim(bottom=0.0)
        low, high = left.get_ylim()
        least = _SMALL_CHANGE * float(mode.modal_frequency_hz[-1])
        if high - low < least:
            left.set_ylim(0.5 * (low + high - least), 0.5 * (low + high + least))
        left.ticklabel_format(axis="y", useOffset=False)
    count = len(found.modes)
    title(page, f"{found.specimen or 'specimen'}: free decay, {count} mode{'' if count == 1 else 's'}, 95 % intervals")


def curves(found: DecayBackbone, view: View) -> Curves:
    """Return modal frequency and damping over the amplitude of the drive point or, without one, of the reference."""
    ends = [float(mode.modal_frequency_hz[-1]) for mode in found.modes]
    drawn = backbone_curves([(None, found.nonlinear_mode(end)) for end in ends], view)
    traces = tuple(
        trace._replace(level=f"{end:.4g} Hz" if len(ends) > 1 else "")
        for trace, end in zip(drawn.traces, ends, strict=True)
    )
    if any(channel.role == "drive" and channel.name == found.modes[0].reference for channel in found.channels):
        return replace(drawn, traces=traces)
    across = drawn.panels[0].x._replace(text=f"displacement amplitude of {found.modes[0].reference}")
    return replace(drawn, traces=traces, panels=tuple(panel._replace(x=across) for panel in drawn.panels))
