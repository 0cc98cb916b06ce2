"""Figure of a check: responses beside those of the reference, and what was found."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rig.check.assessment import Assessment
from rig.check.reference import on_lines_of
from rig.errors import RecordingError
from rig.figures.style import MAIN, SECOND, STYLE, say_why_empty, title

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["draw_check", "write_check"]

COLOURS = (MAIN, SECOND, "#4f8f4f", "#8064a2", "#c9a227", "#3aa6a6")
MOST_LINES = 14


def write_check(found: Assessment, figure: Path) -> None:
    """Draw a check into a file; `RecordingError` where it cannot be written."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context(STYLE):
        page = Figure(figsize=(9.0, 6.4), layout="constrained")
        draw_check(page, found)
        try:
            page.savefig(figure)
        except OSError as error:
            raise RecordingError(f"{figure}: cannot be written: {error.strerror}") from None


def draw_check(page: "Figure", found: Assessment) -> None:
    """Accelerations per force, phase of the velocity, force per volt, dashed those of the reference; what is not in order.

    The velocity of a passive structure's drive point keeps within 90 degrees of the force.
    """
    axes = page.subplots(2, 2)
    title(page, f"{found.bench.specimen.name}: check {found.verdict}")
    _say_findings(axes[1, 1], found)
    if found.responses is None:
        for axis in (axes[0, 0], axes[0, 1], axes[1, 0]):
            say_why_empty(axis, "not played to its end")
        return
    _draw_accelerances(axes[0, 0], axes[1, 0], found)
    _draw_force(axes[0, 1], found)


def _draw_accelerances(size: "Axes", phase: "Axes", found: Assessment) -> None:
    now, known = _per_force(found)
    if found.responses is None:
        return
    frequency = found.responses.frequency_hz
    moving = [i for i, c in enumerate(found.bench.channels) if c.role in ("drive", "response")]
    for colour, i in zip(COLOURS, moving, strict=False):
        name = found.responses.names[i]
        size.semilogy(frequency, np.abs(now[i]), color=colour, label=name)
        phase.plot(frequency, np.degrees(np.angle(now[i] / 1j)), color=colour, label=name)
        if name in known:
            size.semilogy(frequency, np.abs(known[name]), "--", color=colour, lw=0.8)
            phase.plot(frequency, np.degrees(np.angle(known[name] / 1j)), "--", color=colour, lw=0.8)
    size.set(xlabel="frequency, Hz", ylabel="acceleration per force, 1/kg")
    phase.set(
        xlabel="frequency, Hz",
        ylabel="phase of velocity per force, deg",
        ylim=(-190, 190),
        yticks=(-180, -90, 0, 90, 180),
    )
    if moving:
        size.legend(fontsize=8)


def _per_force(found: Assessment) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Responses to the force, and by name those of the reference on the same lines."""
    if found.responses is None:
        return np.zeros((0, 0)), {}
    force = found.responses.names[found.bench.index_of("force")]
    now = found.responses.per(found.bench.index_of("force"))
    old = found.reference
    if old is None or force not in old.names:
        return now, {}
    lines = on_lines_of(found.responses.frequency_hz, old)
    return now, {name: lines[i] / lines[old.names.index(force)] for i, name in enumerate(old.names)}


def _draw_force(axis: "Axes", found: Assessment) -> None:
    if found.responses is None:
        return
    index = found.bench.index_of("force")
    frequency, name = found.responses.frequency_hz, found.responses.names[index]
    axis.semilogy(frequency, np.abs(found.responses.per_volt[index]), color=MAIN, label="now")
    if found.reference is not None and name in found.reference.names:
        known = on_lines_of(frequency, found.reference)[found.reference.names.index(name)]
        axis.semilogy(frequency, np.abs(known), "--", color=MAIN, lw=0.8, label="reference")
    axis.set(xlabel="frequency, Hz", ylabel="force per volt, N/V")
    axis.legend(fontsize=8)


def _say_findings(axis: "Axes", found: Assessment) -> None:
    lines = [f"{f.verdict}: {f.label}" for f in found.findings if f.verdict != "ok"]
    more = [f"and {len(lines) - MOST_LINES} more"] if len(lines) > MOST_LINES else []
    axis.text(
        0.0,
        1.0,
        "\n".join([*(lines[:MOST_LINES] or ["all in order"]), *more]),
        va="top",
        transform=axis.transAxes,
        fontsize=8,
    )
    axis.set_axis_off()
