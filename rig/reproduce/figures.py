"""Figures of a study: errors by training set, steady responses with the true ones, sweeps."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from identification.pnlss.error_table import SAME_LEVEL
from rig.drawing.page import page_for
from rig.drawing.style import MAIN, REJECTED, SECOND, title
from rig.reproduce.steady import Steady
from rig.reproduce.study import Study
from rig.reproduce.sweeps import COUPLED
from rig.reproduce.true_responses import Truth

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["draw_study"]

_SEED = 0


def draw_study(study: Study) -> None:
    """Write ``errors.png``, and ``steady.png`` and ``sweeps.png`` if there are such results."""
    _write(study, "errors", _errors, (9.0, 3.8))
    if study.steady:
        _write(study, "steady", _steady, (9.0, 6.4))
    if study.sweeps:
        _write(study, "sweeps", _sweeps, (9.0, 2.4 * len(study.options.specimen.sweeps) + 0.6))


def _write(study: Study, name: str, draw: Callable[["Figure", Study], None], size: tuple[float, float]) -> None:
    with page_for(study.options.result(f"{name}.png"), size) as page:
        draw(page, study)


def _errors(page: "Figure", study: Study) -> None:
    """Draw every test as a dot: one panel per training set, one column per test level; count unbounded tests at the top."""
    table = study.table
    axes = page.subplots(1, len(table.training_sets), sharey=True, squeeze=False)[0]
    random = np.random.default_rng(_SEED)
    for axis, training_set in zip(axes, table.training_sets, strict=True):
        tests = [test for test in (SAME_LEVEL, *table.levels) if table.cell(training_set, test).runs]
        for column, test in enumerate(tests):
            rows = [row for row in table.tests if (row.training_set, row.test) == (training_set, test)]
            errors = np.array([row.error for row in rows if row.bounded])
            axis.plot(column + random.uniform(-0.25, 0.25, errors.size), 100 * errors, ".", color=MAIN, ms=4, alpha=0.6)
            if errors.size:
                axis.plot([column - 0.3, column + 0.3], 2 * [100 * errors.mean()], color=SECOND)
            if errors.size < len(rows):
                text = f"{len(rows) - errors.size} of {len(rows)}\nunbounded"
                axis.text(column, 0.99, text, transform=axis.get_xaxis_transform(), ha="center", va="top", fontsize=7)
        axis.set_xticks(range(len(tests)), tests, rotation=30)
        axis.set_xlim(-0.6, len(tests) - 0.4)
        axis.set_title(f"trained at {training_set}", fontsize=9)
        axis.set_yscale("log")
        axis.yaxis.set_major_formatter("{x:g}")
        axis.yaxis.set_minor_formatter(_few_numbers)
        axis.tick_params(axis="y", which="minor", labelsize=7)
    axes[0].set_ylabel(f"relative error of {table.output}, %")
    title(page, f"{study.options.specimen.name}, models {study.options.variant}: tests of all models")


def _steady(page: "Figure", study: Study) -> None:
    """Draw selected models and the rig: one row per held quantity, one column per force.

    For a pure sine, the rig is shown by its backbone and its peak.
    """
    forces = study.options.specimen.forces_n
    rows = list(dict.fromkeys(truth.held for truth in study.truths))
    axes = page.subplots(len(rows), len(forces), squeeze=False)
    colours = _colours(study)
    for truth in study.truths:
        axis = axes[rows.index(truth.held)][forces.index(truth.force_n)]
        responses = truth.responses
        if truth.held == "pure-sine":
            axis.plot(
                responses.frequency_hz, 1e3 * responses.amplitude_m, color=REJECTED, lw=2.0, label="rig, backbone"
            )
            axis.plot(truth.frequency_hz, 1e3 * truth.amplitude_m, "k+", ms=10, label="rig, peak")
        else:
            axis.plot(responses.frequency_hz, 1e3 * responses.amplitude_m, color=REJECTED, lw=3.0, label="rig")
        for one in study.steady:
            if one.truth is truth and one.prediction is not None:
                _curve(axis, one, colours[one.training_set])
        near = next(other for other in study.truths if other.force_n == truth.force_n and other.held == "fundamental")
        _around(axis, truth, near if truth.held == "pure-sine" else truth, study.options.specimen.band_hz)
        axis.set_title(f"{truth.held}, {truth.text}", fontsize=9)
    for axis in axes[-1]:
        axis.set_xlabel("frequency, Hz")
    for row in axes:
        row[0].set_ylabel("drive point, mm")
        row[0].legend(fontsize=7)
    title(page, f"{study.options.specimen.name}, models {study.options.variant}: steady responses")


def _curve(axis: Any, one: Steady, colour: Any) -> None:
    """Draw each branch separately, because nothing is known between branches."""
    assert one.prediction is not None
    amplitude = 1e3 * one.prediction.amplitude_m()
    for branch in np.unique(one.prediction.branch):
        on = one.prediction.branch == branch
        label = None if branch else one.training_set
        axis.plot(one.prediction.frequency_hz[on], amplitude[on], color=colour, lw=1.0, label=label)


def _sweeps(page: "Figure", study: Study) -> None:
    """Draw one panel per sweep with the envelopes over the frequency of the plan."""
    names = list(dict.fromkeys(one.sweep for one in study.sweeps))
    axes = page.subplots(len(names), 1, squeeze=False)[:, 0]
    colours = _colours(study)
    for axis, name in zip(axes, names, strict=True):
        shown = [one for one in study.sweeps if one.sweep == name]
        top = float(shown[0].measured.max())
        axis.plot(shown[0].frequency_hz, shown[0].measured, color=REJECTED, lw=2.4, label="recorded")
        for one in shown:
            coupled = one.given == COUPLED
            unbounded = "" if one.unbounded_at_s is None else ", unbounded"
            label = f"{one.training_set}{', from the voltage' if coupled else ''}{unbounded}"
            line = ":" if coupled else "-"
            axis.plot(one.frequency_hz, one.simulated, line, color=colours[one.training_set], lw=1.0, label=label)
        highest = max((float(np.max(one.simulated)) for one in shown if one.unbounded_at_s is None), default=0.0)
        beyond = any(one.unbounded_at_s is not None for one in shown) or highest > 2.4 * top
        axis.set_ylim(0.0, 2.5 * top if beyond else 1.35 * max(top, highest))
        axis.set(ylabel="acceleration, m/s²", title=name)
        axis.legend(fontsize=6, ncols=3, loc="upper right")
    axes[-1].set_xlabel("frequency of the plan, Hz")
    title(page, f"{study.options.specimen.name}: sweeps simulated from the measured {study.options.input}")


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
    from matplotlib import colormaps

    sets = study.table.training_sets
    return {name: colormaps["viridis"](0.9 * index / max(1, len(sets) - 1)) for index, name in enumerate(sets)}
