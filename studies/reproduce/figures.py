"""Figures of a study: errors by training set, steady responses with the true ones, sweeps."""

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from identification import ErrorTable
from identification.models import SAME_LEVEL
from rig.drawing.areas import broad
from rig.drawing.page import grid, legend_below, page_for
from rig.drawing.steady_curve import BEYOND, UNSTABLE, draw_curve, draw_ends, why_it_ends
from rig.drawing.style import COLOURS, MAIN, MARKERS, REJECTED, SECOND, shade, title
from studies.reproduce.study import Study
from studies.reproduce.sweeps import COUPLED, SweepResult
from studies.reproduce.true_responses import Truth

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SEED = 0
_LINEAR = "linear start"
_MOST_SHOWN, _MOST_OF_UNBOUNDED = 2.5, 1.6  # times the largest recorded value
_HELD = {"pure-sine": "pure sine", "fundamental": "constant fundamental", "voltage": "constant voltage"}
_POINTS: dict[str, Any] = {"textcoords": "offset points"}
_AT_THE_TOP: dict[str, Any] = {"ha": "center", "va": "top"}


def draw_study(study: Study) -> None:
    """Write ``errors.png``, and ``steady.png`` and ``sweeps.png`` if there are such results."""
    _write(study, "errors", _errors, (min(9.0, 3.4 + 2.0 * len(study.table.training_sets)), 4.4))
    if study.steady:
        _write(study, "steady", _steady, (9.0, 7.0))
    if study.sweeps:
        _write(study, "sweeps", _sweeps, (9.0, 2.4 * len(study.options.specimen.sweeps) + 1.4))


def _write(study: Study, name: str, draw: Callable[["Figure", Study], None], size: tuple[float, float]) -> None:
    with page_for(study.options.result(f"{name}.png"), size) as page:
        draw(page, study)


def _errors(page: "Figure", study: Study) -> None:
    """Draw every test of every model, one panel per training set; count unbounded tests at the top.

    Beside the identified models are their linear starts, and with a single training set the other iterates, too. The title
    says which levels the study does not have.
    """
    sets = study.table.training_sets
    first = next(iter(study.tables))
    shown = study.tables if len(sets) == 1 else {first, _LINEAR}
    tables = {name: table for name, table in study.tables.items() if name in shown}
    axes = grid(page, 1, len(sets))[0]
    tests = [
        test for test in (SAME_LEVEL, *study.table.levels) if any(study.table.cell(one, test).runs for one in sets)
    ]
    drawn = [_tests(axis, tables, training_set, tests) for axis, training_set in zip(axes, sets, strict=True)]
    low, high = min(one for one, _ in drawn), max(one for _, one in drawn)
    for axis in axes:
        axis.set(yscale="log", ylim=(0.7 * low, 2.5 * high))
        axis.yaxis.set_major_formatter("{x:g}")
        axis.yaxis.set_minor_formatter(_few_numbers)
    axes[0].set_ylabel(f"error of {study.table.output}, %")
    legend_below(page, *axes)
    models = sum(len({row.model for row in study.table.tests if row.training_set == one}) for one in sets)
    count = f"{models} model{'' if models == 1 else 's'}"
    specimen = study.options.specimen
    missing = len(specimen.levels) - len(study.table.levels)
    few = f"; {missing} of {len(specimen.levels)} levels not recorded (--levels)" if missing > 0 else ""
    title(page, f"{specimen.name}, models {study.options.variant}: tests of {count}{few}")


def _tests(axis: Any, tables: Mapping[str, ErrorTable], training_set: str, tests: Sequence[str]) -> tuple[float, float]:
    """Draw the tests of one training set; return the smallest and the largest error, %."""
    random = np.random.default_rng(_SEED)
    every = [np.nan]
    for name, table, colour, mark, shift in _beside(tables):
        for column, test in enumerate(tests):
            rows = [row for row in table.tests if (row.training_set, row.test) == (training_set, test)]
            errors = 100.0 * np.array([row.error for row in rows if row.bounded])
            at = column + shift + random.uniform(-0.3, 0.3, errors.size) * (errors.size > 1) / len(tables)
            axis.plot(at, errors, mark, color=colour, alpha=0.6, label=None if column else name)
            if errors.size > 1:
                ends = [column + shift - 0.4 / len(tables), column + shift + 0.4 / len(tables)]
                axis.plot(ends, 2 * [errors.mean()], color=SECOND, zorder=3, label="mean")
            elif errors.size:
                axis.annotate(f"{errors[0]:.3g} %", (column + shift, errors[0]), (0, 6), ha="center", **_POINTS)
            if errors.size < len(rows):
                text = f"{len(rows) - errors.size}/{len(rows)} unbounded"
                axis.text(column + shift, 0.98, text, rotation=90, **_AT_THE_TOP, transform=axis.get_xaxis_transform())
            every += errors.tolist()
    axis.set_xticks(range(len(tests)), tests, rotation=30)
    axis.set(xlim=(-0.6, len(tests) - 0.4), xlabel="tested at")
    axis.set_title(f"trained at {training_set}")
    return float(np.nanmin(every)), float(np.nanmax(every))


def _beside(tables: Mapping[str, ErrorTable]) -> list[tuple[str, ErrorTable, Any, str, float]]:
    """Return name, table, colour, marker and place beside the column's centre of each variant of the models."""
    places = (np.arange(len(tables)) - 0.5 * (len(tables) - 1)) * 0.8 / len(tables)
    looks = [MAIN, *(colour for colour in COLOURS if colour not in (MAIN, SECOND))]
    looks = [REJECTED if name == _LINEAR else colour for name, colour in zip(tables, looks, strict=False)]
    return list(zip(tables, tables.values(), looks, MARKERS, places.tolist(), strict=False))


def _steady(page: "Figure", study: Study) -> None:
    """Draw selected models and the rig: one row per held quantity, one column per force.

    For a pure sine, the rig is shown by its backbone and its peak. A square marks where a curve ends, and the title says why.
    """
    forces = study.options.specimen.forces_n
    rows = list(dict.fromkeys(truth.held for truth in study.truths))
    axes = grid(page, len(rows), len(forces))
    colours = _colours(study)
    reasons: dict[str, None] = {}
    for truth in study.truths:
        axis = axes[rows.index(truth.held)][forces.index(truth.force_n)]
        _rig(axis, truth)
        for one in study.steady:
            if one.truth is truth and one.prediction is not None:
                amplitude = 1e3 * one.prediction.amplitude_m()
                draw_curve(axis, one.prediction, amplitude, colours[one.training_set], f"trained at {one.training_set}")
                draw_ends(axis, one.prediction, amplitude, colours[one.training_set])
                reasons |= dict.fromkeys(why_it_ends(one.prediction))
        near = next(other for other in study.truths if other.force_n == truth.force_n and other.held == "fundamental")
        _around(axis, truth, near if truth.held == "pure-sine" else truth, study.options.specimen.band_hz)
        missing = [one.training_set for one in study.steady if one.truth is truth and one.prediction is None]
        lost = f"; none for {', '.join(missing)}" if missing else ""
        axis.set_title(f"{_HELD[truth.held]}, {truth.text}{lost}")
        axis.set(xlabel="frequency, Hz", ylabel="drive point, mm")
    ends = f"; at the squares a curve ends, because {'; '.join(reasons)}" if reasons else ""
    title(page, f"{study.options.specimen.name}, models {study.options.variant}: steady responses{ends}")
    _explain(page, axes, study, ends=bool(reasons))


def _rig(axis: Any, truth: Truth) -> None:
    from matplotlib import rcParams

    hertz, amplitude_mm = truth.responses.frequency_hz, 1e3 * truth.responses.amplitude_m
    if truth.held == "pure-sine":
        axis.plot(hertz, amplitude_mm, "k--", label="rig: backbone")
        size = 2.0 * rcParams["lines.markersize"]
        axis.plot(truth.frequency_hz, 1e3 * truth.amplitude_m, "k*", ms=size, label="rig: peak")
    else:
        label = f"rig: {_HELD[truth.held]}"
        axis.plot(hertz, amplitude_mm, color=REJECTED, lw=broad(), alpha=0.5, label=label)


def _explain(page: "Figure", axes: np.ndarray, study: Study, *, ends: bool) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    more: list[Any] = []
    predicted = [one.prediction for one in study.steady if one.prediction is not None]
    if any(not one.stable.all() for one in predicted):
        more.append(Line2D([], [], color=REJECTED, ls=UNSTABLE, label="unstable"))
    if any(one.range_use.max() > BEYOND for one in predicted):
        more.append(Patch(color=REJECTED, alpha=0.25, lw=0, label="beyond the training data"))
    if ends:
        more.append(Line2D([], [], color=REJECTED, marker="s", ls="none", label="the curve ends"))
    legend_below(page, *axes.ravel(), handles=more)


def _sweeps(page: "Figure", study: Study) -> None:
    """Draw one panel per sweep with the envelopes over the frequency of the plan."""
    names = list(dict.fromkeys(one.sweep for one in study.sweeps))
    axes = grid(page, len(names), 1)[:, 0]
    colours = _colours(study)
    for axis, name in zip(axes, names, strict=True):
        shown = [one for one in study.sweeps if one.sweep == name]
        _envelopes(axis, shown, colours)
        lost = [one for one in shown if one.unbounded_at_s is not None]
        gone = ", ".join(f"{one.training_set} at {one.unbounded_at_s:.1f} s" for one in lost)
        axis.set(xlabel="frequency of the plan, Hz", ylabel="drive, m/s²")
        axis.set_title(f"{name}: {f'unbounded: {gone}' if lost else 'all runs bounded'}")
    legend_below(page, *axes)
    title(page, f"{study.options.specimen.name}: sweeps simulated from the measured {study.options.input}")


def _envelopes(axis: Any, shown: Sequence[SweepResult], colours: Mapping[str, Any]) -> None:
    """Draw one recorded sweep and its simulations; an unbounded one ends with a cross."""
    from matplotlib import rcParams

    top, size = float(shown[0].measured.max()), rcParams["lines.markersize"]
    axis.plot(shown[0].frequency_hz, shown[0].measured, color=REJECTED, lw=broad(), alpha=0.5, label="recorded")
    for one in shown:
        coupled = one.given == COUPLED
        label = f"trained at {one.training_set}{', from the voltage' if coupled else ''}"
        simulated = one.simulated.copy()
        if one.unbounded_at_s is not None:
            simulated[one.seconds > one.unbounded_at_s] = np.nan
        colour = colours[one.training_set]
        axis.plot(one.frequency_hz, simulated, ls="--" if coupled else "-", color=colour, label=label)
        left = np.flatnonzero(np.isfinite(simulated) & (simulated <= _MOST_OF_UNBOUNDED * top))
        if one.unbounded_at_s is not None and left.size:
            look = {"color": colour, "mec": "black", "ms": 1.8 * size, "label": "unbounded from here on"}
            axis.plot(one.frequency_hz[left[-1]], simulated[left[-1]], "X", **look)
    bounded = [float(np.max(one.simulated)) for one in shown if one.unbounded_at_s is None]
    highest = max([top, *bounded])
    all_bounded = len(bounded) == len(shown)
    axis.set_ylim(0.0, 1.15 * min(highest, _MOST_SHOWN * top) if all_bounded else _MOST_OF_UNBOUNDED * top)
    if highest > _MOST_SHOWN * top:
        axis.text(0.99, 0.95, "cut off above", ha="right", va="top", transform=axis.transAxes)


def _around(axis: Any, truth: Truth, wide: Truth, band_hz: tuple[float, float]) -> None:
    """Set the axes to the resonance, with the width of the resonance in ``wide`` and some margin, within the band."""
    responses = wide.responses
    near = responses.frequency_hz[responses.amplitude_m > 0.15 * responses.amplitude_m.max()]
    margin = 0.5 * np.ptp(near)
    axis.set_xlim(max(near.min() - margin, band_hz[0]), min(near.max() + margin, band_hz[1]))
    axis.set_ylim(0.0, 1.6e3 * truth.amplitude_m)


def _few_numbers(value: float, _: int) -> str:
    """Label only twos and fives between powers of ten."""
    return f"{value:g}" if f"{value:e}"[0] in "25" else ""


def _colours(study: Study) -> dict[str, Any]:
    sets = study.table.training_sets
    return {name: shade(index, len(sets)) for index, name in enumerate(sets)}
