"""Steady response to a constant voltage, up and down: the force drops at resonance, as in a slow uncontrolled sweep."""

from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np

from rig.analysis.backbone import neglected_force
from rig.analysis.balance import Balance
from rig.analysis.levels import checked_points, highest_resonance
from rig.analysis.study import Study, length_unit
from rig.analysis.subject import Subject, positive
from rig.drawing.page import grid, legend_below
from rig.drawing.style import MAIN, REJECTED, SECOND, Figure
from rig.errors import ConfigurationError
from rig.text.column import Column
from rig.text.console import print_rows
from simulators.analysis import NotConvergedError, PeriodicResponses
from vibrolock.arrays import Float

_DEFAULT_LEVEL = 0.5  # default voltage over that at which the bench may be driven in resonance; chosen
_SPAN = (0.7, 1.3)  # default range over the frequency of the mode under test; chosen
LineStyle = str | tuple[int, tuple[int, int]]
"""Style of a line, as Matplotlib takes it."""
_DASHED: LineStyle = (0, (4, 2))
"""Dashes of the falling direction."""
_DENSE_WIDTHS = 12.0
"""Half width of the dense part of the frequency grid, which holds half of the points, in half-widths of the resonance."""
_SAME = 1e-3  # difference of two amplitudes over the largest, up to which the directions agree; chosen


@dataclass(frozen=True)
class ForceExtremes:
    """Force at the lowest frequency, its extremes with their frequencies, and their ratios to it."""

    at_first_n: float
    lowest_n: float
    lowest_hz: float
    lowest_share: float
    highest_n: float
    highest_hz: float
    highest_share: float

    @classmethod
    def of(cls, branch: PeriodicResponses) -> "ForceExtremes":
        """Return the extremes along a branch."""
        low, high, hz = int(np.argmin(branch.force_n)), int(np.argmax(branch.force_n)), branch.frequency_hz
        first, lowest, highest = (float(branch.force_n[at]) for at in (0, low, high))
        return cls(first, lowest, float(hz[low]), lowest / first, highest, float(hz[high]), highest / first)


@dataclass(frozen=True, eq=False, kw_only=True)
class Forced(Study):
    """Steady vibrations at one voltage, followed up and down in frequency."""

    voltage_v: float
    """Amplitude of the voltage, V."""
    up: PeriodicResponses
    """Vibrations for rising frequency [n]."""
    down: PeriodicResponses
    """Vibrations for falling frequency [n], sorted by rising frequency."""

    @property
    def title(self) -> str:
        """Title of the analysis."""
        return f"steady response to {self.voltage_v:.4g} V"

    @property
    def differ_hz(self) -> Float:
        """Frequencies at which the two directions differ; empty if they never do, or if a direction is incomplete."""
        if not self.complete:
            return np.zeros(0)
        apart = np.abs(self.up.amplitude_m - self.down.amplitude_m) > _SAME * np.max(self.up.amplitude_m)
        return np.asarray(self.up.frequency_hz[apart])

    def numbers(self) -> dict[str, object]:
        """Return both directions, drop-out and overshoot."""
        return {
            "voltage_v": self.voltage_v,
            "up": self.up,
            "down": self.down,
            "force": {"up": ForceExtremes.of(self.up), "down": ForceExtremes.of(self.down)},
            "directions_differ_hz": self.differ_hz,
        }

    def print_tables(self) -> None:
        """Print drop-out and overshoot of the force, and the frequencies at which the directions differ."""
        rows = []
        for name, one in (("up", self.up), ("down", self.down)):
            extremes = ForceExtremes.of(one)
            rows.append({"direction": name, **vars(extremes), "largest_m": np.max(one.amplitude_m)})
        print_rows(
            rows,
            Column("direction", "direction"),
            Column("at_first_n", f"force at {self.up.frequency_hz[0]:.4g} Hz, N", pattern=".4f"),
            Column("lowest_n", "lowest N", pattern=".4f"),
            Column("lowest_hz", "at Hz", pattern=".4f"),
            Column("lowest_share", "% of the first", pattern=".2f", scale=100.0),
            Column("highest_share", "highest over first", pattern=".3f"),
            Column("highest_hz", "at Hz", pattern=".4f"),
            Column("largest_m", "largest mm", pattern=".5f", scale=1e3),
        )
        if not self.complete:
            return
        if self.differ_hz.size:
            print(f"up and down differ from {self.differ_hz[0]:.4f} to {self.differ_hz[-1]:.4f} Hz")
        else:
            print("up and down agree everywhere")

    def draw_on(self, page: Figure) -> None:
        """Draw force, response and lag over frequency; the falling direction is drawn only if it differs."""
        down = self.down if self.differ_hz.size or not self.complete else None
        force, response, lag = grid(page, 3, 1, sharex=True, height_ratios=(2.0, 2.0, 1.4))[:, 0]
        scale, unit = length_unit(float(np.max(self.up.amplitude_m)))
        label = "frequency rising" if down is not None else "either direction"
        branches: list[tuple[PeriodicResponses, LineStyle, str, str]] = [(self.up, "-", MAIN, label)]
        if down is not None:
            branches.append((down, _DASHED, SECOND, "frequency falling"))
        for branch, style, colour, label in branches:
            force.plot(branch.frequency_hz, branch.force_n, ls=style, color=colour, label=label)
            response.plot(branch.frequency_hz, scale * branch.amplitude_m, ls=style, color=colour)
            lag.plot(branch.frequency_hz, branch.phase_lag_deg, ls=style, color=colour)
        force.set_ylabel("force, N")
        response.set_ylabel(f"displacement, {unit}")
        for axis in (force, response):
            axis.set_ylim(bottom=0.0)
        lag.axhline(-90.0, color=REJECTED, lw=0.8)
        lag.set(xlabel="frequency, Hz", ylabel="accel. lag, deg", yticks=(-180, -90, 0), ylim=(-190, 10))
        legend_below(page, force)


def forced(
    subject: Subject,
    *,
    voltage_v: float | None = None,
    from_hz: float | None = None,
    to_hz: float | None = None,
    points: int = 401,
    harmonics: int = 15,
) -> Forced:
    """Compute the steady response to a constant voltage for rising and falling frequency.

    Half of the points lie around resonance. By default the voltage is half of that at which the bench may be driven in
    resonance, and the frequencies are from 0.7 to 1.3 times that of the mode under test.
    """
    balance = Balance(subject, harmonics)
    if voltage_v is None:
        path, last = highest_resonance(balance)
        voltage_v = float(f"{_DEFAULT_LEVEL * path.voltage_v[last]:.2g}")
    voltage = positive("voltage_v", voltage_v)
    low = positive("from_hz", _SPAN[0] * subject.frequency_hz if from_hz is None else from_hz)
    high = positive("to_hz", _SPAN[1] * subject.frequency_hz if to_hz is None else to_hz)
    if low >= high:
        raise ConfigurationError(field="from_hz", value=low, allowed=f"less than `to_hz` = {high:g}")
    grid = _grid(low, high, checked_points(points, 4), _resonance(balance, voltage))
    up, up_ends = _followed(balance, voltage, grid)
    down, down_ends = _followed(balance, voltage, grid[::-1])
    up, down, notes = _completed(up, _points(down, slice(None, None, -1)), up_ends, down_ends)
    violations = dict.fromkeys(line for branch in (up, down) for line in subject.limit_violations(branch))
    return Forced(
        subject=subject,
        notes=(*notes, *violations, neglected_force(up)),
        complete=not (up_ends and down_ends),
        voltage_v=voltage,
        up=up,
        down=down,
    )


def _followed(balance: Balance, voltage_v: float, grid: Float) -> tuple[PeriodicResponses, str]:
    """Follow the vibrations in the order of the grid until none is found; also return why none is found."""
    try:
        return balance.forced(voltage_v, grid), ""
    except NotConvergedError as failure:
        if failure.found is None:
            raise ConfigurationError(f"{voltage_v:g} V: {failure}") from failure
        return failure.found, str(failure)


def _completed(
    up: PeriodicResponses, down: PeriodicResponses, up_ends: str, down_ends: str
) -> tuple[PeriodicResponses, PeriodicResponses, list[str]]:
    """Complete each direction by the other: at the end of its branch a sweep jumps to the other branch."""
    n_up, n_down = up.frequency_hz.size, down.frequency_hz.size
    jump = "the branch of {} frequency ends at {:.4f} Hz; beyond, the vibration of the other direction is taken"
    if up_ends and down_ends:
        both = (("rising", up.frequency_hz[-1], up_ends), ("falling", down.frequency_hz[0], down_ends))
        return up, down, [f"{name} frequency ends at {ends_hz:.4f} Hz: {why}" for name, ends_hz, why in both]
    if up_ends:
        joined = _map_columns(np.concatenate, up, _points(down, slice(n_up, None)))
        return joined, down, [jump.format("rising", up.frequency_hz[-1])]
    if down_ends:
        joined = _map_columns(np.concatenate, _points(up, slice(0, n_up - n_down)), down)
        return up, joined, [jump.format("falling", down.frequency_hz[0])]
    return up, down, []


def _resonance(balance: Balance, voltage_v: float) -> tuple[float, float, float]:
    """Return the linear frequency, the frequency at phase resonance at this voltage, and the half-width there, Hz."""
    subject = balance.subject
    try:
        path = balance.backbone(voltages_v=voltage_v * np.array([0.05, 0.3, 1.0]))
        resonance_hz, damping = float(path.frequency_hz[-1]), float(path.damping_ratio[-1])
    except NotConvergedError:
        resonance_hz, damping = subject.frequency_hz, float(subject.rig.linear_modes.damping_ratio[subject.mode])
    return subject.frequency_hz, resonance_hz, damping * resonance_hz


def _grid(low: float, high: float, points: int, resonance: tuple[float, float, float]) -> Float:
    """Return frequencies from low to high: half evenly spaced, half around the linear and the nonlinear resonance."""
    linear_hz, resonance_hz, width_hz = resonance
    first = min(linear_hz, resonance_hz) - _DENSE_WIDTHS * width_hz
    last = max(linear_hz, resonance_hz) + _DENSE_WIDTHS * width_hz
    first, last = max(low, first), min(high, last)
    dense = np.linspace(first, last, points // 2 if first < last else 0)
    return np.unique(np.concatenate([np.linspace(low, high, points - dense.size), dense]))


def _points(branch: PeriodicResponses, rows: "slice[int | None, int | None, int | None]") -> PeriodicResponses:
    return _map_columns(lambda column: column[0][rows], branch)


def _map_columns(make: Callable[[list[Float]], Float], *branches: PeriodicResponses) -> PeriodicResponses:
    """Build responses, computing each column from the same columns of the given branches."""
    columns = {field.name: getattr(branches[0], field.name) for field in fields(PeriodicResponses)}
    for name, first in columns.items():
        values = [getattr(branch, name) for branch in branches]
        if isinstance(first, dict):
            columns[name] = {key: make([value[key] for value in values]) for key in first}
        elif first is not None:
            columns[name] = make(values)
    return PeriodicResponses(**columns)
