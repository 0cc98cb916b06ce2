"""Figure of a check: responses, those of the reference if there is one, and a list of findings."""

from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING

import numpy as np

from rig.check.assessment import Assessment, assess
from rig.check.reference import on_lines_of
from rig.drawing.page import page_for
from rig.drawing.style import MAIN, REJECTED, SECOND, say_why_empty, title
from rig.recording.reader import Recording

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["draw_check", "draw_recorded_check", "write_check"]

COLOURS = (MAIN, SECOND, "#4f8f4f", "#8064a2", "#c9a227", "#3aa6a6")
MOST_LINES, WIDTH, LINE_IN = 22, 72, 0.128
VERDICTS = {"fail": SECOND, "warn": "#b07d00", "not tested": "#707070"}
"""Colours of the verdicts other than ok, the worst first."""


def write_check(found: Assessment, figure: Path) -> None:
    """Draw a check into a file; raise `RecordingError` if it cannot be written."""
    with page_for(figure, (9.0, 6.4)) as page:
        draw_check(page, found)


def draw_recorded_check(page: "Figure", recording: Recording) -> None:
    """Assess the recording of a check and draw it on an empty page."""
    draw_check(page, assess(recording))


def draw_check(page: "Figure", found: Assessment) -> None:
    """Draw accelerations per force, phase of the velocity, force per volt (dashed: the reference), and a list of faults.

    The velocity of a passive structure's drive point stays within 90 degrees of the force.
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
    frequency, dead = found.responses.frequency_hz, _dead(found)
    if found.responses.names[found.bench.index_of("force")] in dead:
        for axis in (size, phase):
            say_why_empty(axis, "the force channel is dead")
        return
    moving = [i for i, c in enumerate(found.bench.channels) if c.role in ("drive", "response")]
    for colour, i in zip(COLOURS, moving, strict=False):
        name = found.responses.names[i]
        if name in dead:
            size.plot([], [], color=colour, label=f"{name}: dead")
            continue
        size.semilogy(frequency, np.abs(now[i]), color=colour, label=name)
        phase.plot(frequency, np.degrees(np.angle(now[i] / 1j)), color=colour)
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
    for axis in (size, phase):
        axis.axvline(found.bench.specimen.linear_frequency_hz, color=REJECTED, ls=":", lw=1.0, zorder=0)
    size.plot([], [], color=REJECTED, ls=":", label="expected frequency")
    size.legend(fontsize=8)


def _dead(found: Assessment) -> set[str]:
    """Return the channels that do not follow the excitation."""
    return {finding.channel for finding in found.findings if (finding.name, finding.verdict) == ("life", "fail")}


def _per_force(found: Assessment) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Return the responses to the force, and those of the reference on the same lines, by channel name."""
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
        axis.legend(fontsize=8)
    axis.set(xlabel="frequency, Hz", ylabel="force per volt, N/V")


def _say_findings(axis: "Axes", found: Assessment) -> None:
    """List the findings that are not ok, the worst first, with what to do about them."""
    from matplotlib.transforms import ScaledTranslation

    axis.set_axis_off()
    told = {
        (f.verdict, f.label): f.text for f in reversed(found.findings) if f.verdict != "ok"
    }  # of several findings with the same label, the first counts
    fine = sum(f.verdict == "ok" for f in found.findings)
    lines = [(f"{fine} findings in order", MAIN)]
    for verdict, colour in VERDICTS.items():
        for (graded, label), text in reversed(told.items()):
            if graded == verdict:
                lines += [
                    (line, colour) for line in wrap(f"{verdict}: {label}: {text}", WIDTH, subsequent_indent="    ")
                ]
    if len(lines) > MOST_LINES:
        lines[MOST_LINES - 1 :] = [("… and more: rig show", REJECTED)]
    page = axis.figure
    for place, (line, colour) in enumerate(lines):
        down = ScaledTranslation(0.0, -LINE_IN * place, page.dpi_scale_trans)
        axis.text(-0.1, 1.0, line, va="top", transform=axis.transAxes + down, fontsize=7.5, color=colour)
