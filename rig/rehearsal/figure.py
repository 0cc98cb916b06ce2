"""The figure of a rehearsal: the points of every draw, how it ends, margins, accuracy, and what matters."""

import numpy as np

from rig.drawing.axes import ticks_at_1_2_5
from rig.drawing.page import grid
from rig.drawing.style import MAIN, REJECTED, SECOND, Axes, Figure, say_why_empty, title
from rig.rehearsal.rehearsal import Rehearsal
from rig.rehearsal.verdict import Verdict, verdict_of

MAX_LIMITS, MAX_INFLUENCES = 4, 5
"""Limits and influences that are drawn, the closest and strongest; chosen: as many as a panel holds."""
ACCEPTED, FAILED, MISSING = MAIN, SECOND, "0.8"  # colours of points that are accepted, refused and not begun


def draw_rehearsal(page: Figure, rehearsal: Rehearsal) -> None:
    """Draw six panels on an empty page."""
    verdict = verdict_of(rehearsal)
    axes = grid(page, 2, 3)
    facts = rehearsal.facts
    _draw_backbones(axes[0, 0], axes[0, 1], rehearsal)
    _draw_points(axes[0, 2], verdict)
    _draw_margins(axes[1, 0], verdict)
    _draw_times(axes[1, 1], rehearsal)
    _draw_influences(axes[1, 2], verdict)
    well, trips = verdict.ends_well, verdict.trips
    title(
        page,
        f"{facts.specimen}: {facts.plan_kind} rehearsed on {len(rehearsal.draws)} twins; ends well "
        f"{100.0 * well.value:.0f} % ({100.0 * well.interval[0]:.0f} to {100.0 * well.interval[1]:.0f}), trips "
        f"{100.0 * trips.value:.1f} % ({100.0 * trips.interval[0]:.1f} to {100.0 * trips.interval[1]:.1f})",
    )


def _draw_backbones(frequency: Axes, damping: Axes, rehearsal: Rehearsal) -> None:
    for draw in rehearsal.draws:
        points = [p for p in draw.trial.points if p.accepted and np.isfinite(p.modal_frequency_hz)]
        if not points:
            continue
        amplitude = np.array([1e3 * p.amplitude_m for p in points])
        colour = MAIN if draw.trial.completed else REJECTED if not draw.trial.tripped else SECOND
        for axis, y in (
            (frequency, [p.modal_frequency_hz for p in points]),
            (damping, [100.0 * p.damping_ratio for p in points]),
        ):
            axis.semilogx(amplitude, y, "-", lw=0.7, alpha=0.45, color=colour)
    if not frequency.get_lines():
        for axis in (frequency, damping):
            say_why_empty(axis, "no accepted point has modal properties")
        return
    for colour, label in ((MAIN, "ends well"), (REJECTED, "points missing"), (SECOND, "trips")):
        frequency.plot([], [], color=colour, label=label)
    for axis in (frequency, damping):
        ticks_at_1_2_5(axis)
    frequency.legend()
    frequency.set(xlabel="displacement, mm", ylabel="modal frequency, Hz")
    damping.set(xlabel="displacement, mm", ylabel="modal damping, %")


def _draw_points(axis: Axes, verdict: Verdict) -> None:
    if not verdict.points:
        say_why_empty(axis, "no point was begun")
        return
    x = np.array([point.number + 1 for point in verdict.points])
    n = np.array([point.accepted.of for point in verdict.points])
    accepted = np.array([point.accepted.count for point in verdict.points]) / n
    missing = np.array([point.qualities.get("not begun", 0) for point in verdict.points]) / n
    axis.bar(x, 100.0 * accepted, color=ACCEPTED, label="accepted")
    axis.bar(x, 100.0 * (1.0 - accepted - missing), bottom=100.0 * accepted, color=FAILED, label="refused")
    axis.bar(x, 100.0 * missing, bottom=100.0 * (1.0 - missing), color=MISSING, label="not begun")
    axis.set(xlabel="point of the plan", ylabel="draws, %", ylim=(0.0, 101.0))
    axis.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), borderaxespad=0.2)


def _draw_margins(axis: Axes, verdict: Verdict) -> None:
    shown, count = list(verdict.margins.items())[:MAX_LIMITS][::-1], len(verdict.margins)
    if not shown:
        say_why_empty(axis, "nothing moved")
        return
    for row, (_, quantiles) in enumerate(shown):
        axis.hlines(row, 100.0 * quantiles.low, 100.0 * quantiles.high, color=MAIN, lw=4.0)
        axis.plot(100.0 * quantiles.middle, row, "o", color="w", mec=MAIN)
        axis.plot(100.0 * quantiles.largest, row, "|", color=SECOND, mew=2.0)
    axis.axvline(100.0, color=SECOND, lw=0.8, ls="--")
    axis.set_yticks(range(len(shown)), [name.replace(" ", "\n", 1) for name, _ in shown])
    axis.set(xlabel="largest value over its limit, %", xlim=(0.0, None))
    axis.plot([], [], color=MAIN, lw=4.0, label="5 to 95 %")
    axis.plot([], [], "o", color="w", mec=MAIN, label="median")
    axis.plot([], [], "|", color=SECOND, mew=2.0, label="largest")
    axis.set_ylim(-0.6, len(shown) - 0.4)
    axis.legend(
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        ncols=3,
        handlelength=1.0,
        columnspacing=0.8,
        borderaxespad=0.2,
        title=f"the closest {MAX_LIMITS} of {count} limits" if count > MAX_LIMITS else "",
        alignment="left",
    )


def _draw_times(axis: Axes, rehearsal: Rehearsal) -> None:
    trials = [draw.trial for draw in rehearsal.draws if draw.trial.computed]
    times = np.array([trial.duration_s for trial in trials])
    done = np.array([trial.completed for trial in trials])
    edges = np.linspace(0.0, max(float(times.max()), 1e-9) * 1.001, 25).tolist()
    axis.hist([times[done], times[~done]], edges, stacked=True, color=[MAIN, SECOND], label=["ends well", "does not"])
    axis.set(xlabel="test time, s", ylabel="draws")
    axis.legend()


def _draw_influences(axis: Axes, verdict: Verdict) -> None:
    shown = verdict.influences[:MAX_INFLUENCES][::-1]
    if not shown:
        axis.set_axis_off()
        say_why_empty(axis, "no unknown matters\nmore than by chance")
        return
    axis.barh(range(len(shown)), [one.correlation for one in shown], color=MAIN)
    axis.set_yticks(range(len(shown)), [f"{one.unknown}\nfor {one.outcome}" for one in shown])
    axis.axvline(0.0, color="k", lw=0.6)
    axis.set(xlabel="rank correlation", xlim=(-1.0, 1.0))
