"""Figure of a check: responses, those of the reference if there is one, and a list of findings."""

from pathlib import Path
from textwrap import wrap

import numpy as np
from numpy.typing import NDArray

from rig.check.assessment import Assessment, assess
from rig.check.findings import Finding
from rig.check.reference import on_lines_of
from rig.drawing.areas import is_narrow
from rig.drawing.page import grid, page_for
from rig.drawing.style import COLOURS, MAIN, REJECTED, SECOND, Axes, Figure, title
from rig.recording.reader import Recording
from vibrolock.arrays import Complex, Float

VERDICTS = {"fail": SECOND, "warn": "#7a5c00", "not tested": REJECTED}
"""Colours of the verdicts other than ok, the worst first."""
_LETTER, _LINE = 0.5, 1.3
"""Mean width of a letter and height of a line, relative to the size of the font."""
_LAST_S, _MIN_ROWS = 1.0, 50  # time before the end that is drawn, s, and its least number of rows; chosen


def write_check(found: Assessment, figure: Path) -> None:
    """Draw a check into a file; raise `RecordingError` if it cannot be written."""
    with page_for(figure, (9.0, 6.4)) as page:
        draw_check(page, found)


def draw_recorded_check(page: Figure, recording: Recording) -> None:
    """Assess the recording of a check and draw it on an empty page."""
    draw_check(page, assess(recording))


def draw_check(page: Figure, found: Assessment) -> None:
    """Draw accelerations per force, phase of the velocity, force per volt (dashed: the reference), and a list of faults.

    The velocity of a passive structure's drive point stays within 90 degrees of the force. If the multisine was not played to
    its end, draw instead how near each channel has come to its limit, and the last second.
    """
    cut = "" if found.responses is not None else ": the multisine was not played to its end"
    title(page, f"{found.bench.specimen.name}: check {found.verdict}{cut}")
    if found.responses is None:
        _draw_ending(page, found)
        return
    axes = grid(page, 2, 2)
    _say_findings(axes[1, 1], found, 1, 2)
    _draw_accelerances(axes[0, 0], axes[1, 0], found)
    _draw_force(axes[0, 1], found)


def _draw_ending(page: Figure, found: Assessment) -> None:
    """Draw the readings of a check that ended early, as shares of their limits, and the list of faults."""
    with Recording(found.recording) as recording:
        part = recording.parts[-1]
        rows = part.read(max(0, part.n_rows - round(_LAST_S * found.bench.sample_rate_hz)), part.n_rows)
        largest = [_largest(found, part.read(0, part.n_rows)["inputs"][:, i], i) for i, _ in _limited(found)]
    series = rows.size >= _MIN_ROWS
    axes = grid(page, 2, 2) if series else grid(page, 1, 2)
    bars, said = axes[0, 0], axes[0, 1]
    names = [name for _, name in _limited(found)]
    bars.barh(range(len(names)), [0.0 if np.isnan(share) else share for share in largest], color=MAIN, height=0.6)
    for place, share in enumerate(largest):
        bars.text(0.0, place, "  no number" if np.isnan(share) else f"  {share:.3g} %", va="center")
    bars.axvline(100.0, color=SECOND, ls="--", label="limit: a run stops")
    bars.set_yticks(range(len(names)), names)
    bars.set(xlabel="largest reading over its limit, %", xlim=(0.0, max(110.0, 1.1 * np.nanmax([*largest, 0.0]))))
    bars.legend()
    _say_findings(said, found, len(axes), 2)
    if series:
        _draw_last(axes[1, 0], found, rows)
        axes[1, 1].set_axis_off()


def _limited(found: Assessment) -> list[tuple[int, str]]:
    return [(i, channel.name) for i, channel in enumerate(found.bench.channels) if channel.role != "monitor"]


def _share(found: Assessment, values: Float, index: int) -> Float:
    limits, force = found.bench.limits, found.bench.channels[index].role == "force"
    return np.asarray(100.0 * values / (limits.force_n if force else limits.acceleration_m_s2))


def _largest(found: Assessment, values: Float, index: int) -> float:
    if not values.size or not np.isfinite(values[-1]):
        return float("nan")
    return float(np.nanmax(np.abs(_share(found, values, index))))


def _draw_last(axis: Axes, found: Assessment, rows: NDArray[np.void]) -> None:
    before_s = (np.arange(rows.size) - rows.size + 1) / found.bench.sample_rate_hz
    for colour, (i, name) in zip(COLOURS, _limited(found), strict=False):
        axis.plot(before_s, _share(found, rows["inputs"][:, i], i), color=colour, lw=0.8, label=name)
    axis.set(xlabel="time before the end, s", ylabel="reading over its limit, %")
    axis.legend()


def _draw_accelerances(size: Axes, phase: Axes, found: Assessment) -> None:
    """Draw accelerations and phase of the velocities per force; per volt if the force channel is dead."""
    if found.responses is None:
        return
    frequency, dead = found.responses.frequency_hz, _dead(found)
    force = found.responses.names[found.bench.index_of("force")]
    now, known = (found.responses.per_volt, {}) if force in dead else _per_force(found)
    moving = [i for i, c in enumerate(found.bench.channels) if c.role in ("drive", "response")]
    for colour, i in zip(COLOURS, moving, strict=False):
        name = found.responses.names[i]
        if name in dead:
            size.plot([], [], color=colour, label=f"{name}: dead")
            continue
        size.semilogy(frequency, np.abs(now[i]), color=colour, label=name)
        phase.plot(frequency, np.degrees(np.angle(now[i] / 1j)), color=colour)
        if name in known:
            size.semilogy(frequency, np.abs(known[name]), "--", color=colour)
            phase.plot(frequency, np.degrees(np.angle(known[name] / 1j)), "--", color=colour)
    unit = "V" if force in dead else "N"
    size.set(xlabel="frequency, Hz", ylabel=f"acceleration, (m/s²)/{unit}")
    phase.set(xlabel="frequency, Hz", ylabel="velocity phase, deg", ylim=(-190, 190), yticks=(-180, -90, 0, 90, 180))
    for axis in (size, phase):
        axis.axvline(found.bench.specimen.linear_frequency_hz, color=REJECTED, ls=":", lw=1.0, zorder=0)
    size.plot([], [], color=REJECTED, ls=":", label="expected frequency")
    if known:
        size.plot([], [], "--", color=REJECTED, label="reference")
    size.legend()


def _dead(found: Assessment) -> set[str]:
    return {finding.channel for finding in found.findings if (finding.name, finding.verdict) == ("life", "fail")}


def _per_force(found: Assessment) -> tuple[Complex, dict[str, Float]]:
    """Return the responses to the force, and those of the reference on the same lines, by channel name."""
    if found.responses is None:
        return np.zeros((0, 0), np.complex128), {}
    force = found.responses.names[found.bench.index_of("force")]
    now = found.responses.per(found.bench.index_of("force"))
    old = found.reference
    if old is None or force not in old.names:
        return now, {}
    lines = on_lines_of(found.responses.frequency_hz, old)
    return now, {name: lines[i] / lines[old.names.index(force)] for i, name in enumerate(old.names)}


def _draw_force(axis: Axes, found: Assessment) -> None:
    if found.responses is None:
        return
    index = found.bench.index_of("force")
    frequency, name = found.responses.frequency_hz, found.responses.names[index]
    label = f"{name}: dead" if name in _dead(found) else "now"
    axis.semilogy(frequency, np.abs(found.responses.per_volt[index]), color=MAIN, label=label)
    if found.reference is not None and name in found.reference.names:
        known = on_lines_of(frequency, found.reference)[found.reference.names.index(name)]
        axis.semilogy(frequency, np.abs(known), "--", color=SECOND, label="reference")
    axis.legend()
    axis.set(xlabel="frequency, Hz", ylabel="force, N/V")


def _say_findings(axis: Axes, found: Assessment, rows: int, columns: int) -> None:
    """List the findings that are not ok, the worst first, with what to do; ``rows`` by ``columns`` panels share the page."""
    from matplotlib import rcParams
    from matplotlib.font_manager import FontProperties
    from matplotlib.transforms import ScaledTranslation

    axis.set_axis_off()
    page = axis.get_figure(root=True)
    assert page is not None
    size_pt = FontProperties(size=rcParams["legend.fontsize"]).get_size_in_points()
    narrow = is_narrow(page)
    width = int(page.get_figwidth() * (0.75 if narrow else 0.85 / columns) * 72.0 / (_LETTER * size_pt))
    height_in = page.get_figheight() / (rows * columns if narrow else rows)
    most = max(5, int(0.75 * height_in * 72.0 / (_LINE * size_pt)))
    fine = sum(f.verdict == "ok" for f in found.findings)
    lines = [(f"{fine} findings in order", MAIN)]
    for verdict, colour in VERDICTS.items():
        for name, channels, text in _told(found, verdict):
            told = f"{verdict}: {name}{' ' if channels else ''}{', '.join(channels)}: {text}"
            lines += [(line, colour) for line in wrap(told, width, subsequent_indent="    ")]
    if len(lines) > most:
        lines[most - 1 :] = [("… and more: rig show", REJECTED)]
    for place, (line, colour) in enumerate(lines):
        down = ScaledTranslation(0.0, -_LINE * size_pt / 72.0 * place, page.dpi_scale_trans)
        written = axis.text(0.0, 1.0, line, va="top", transform=axis.transAxes + down, fontsize=size_pt, color=colour)
        written.set_in_layout(False)


def _told(found: Assessment, verdict: str) -> list[tuple[str, list[str], str]]:
    """Return name, channels and text of the findings of a verdict; channels with the same finding are listed together.

    Of several findings on the same channel with the same name, the first counts.
    """
    first: dict[str, Finding] = {}
    for finding in found.findings:
        if finding.verdict == verdict:
            first.setdefault(finding.label, finding)
    together: dict[tuple[str, str], list[str]] = {}
    for finding in first.values():
        together.setdefault((finding.name, finding.text), []).extend([finding.channel] if finding.channel else [])
    return [(name, channels, text) for (name, text), channels in together.items()]
