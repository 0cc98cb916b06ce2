"""View model of a run for page and terminal: its state, numbers, limits and curves, and their form as JSON."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, is_dataclass

import numpy as np
from numpy.typing import NDArray

from controller import LockState
from rig.live.facts import ChannelFacts, Line, RunFacts, number_in, text_in
from rig.live.reader import Frame
from rig.text.json_values import JsonValue
from rig.tick.safety.layout import EndReason, GuardMode
from rig.tick.sequencer.layout import Drive, SegmentKind
from vibrolock.arrays import Complex, Float

SCOPE_PERIODS = 3
"""Periods of the waveform that are shown and analysed; chosen: few enough to see the waveform's shape."""
SCOPE_POINTS = 400
"""Most points of a shown waveform; chosen: about the width of its plot in pixels."""
DIGITS = 6  # of a number on the page; chosen: finer than any plot
HARMONICS = 10
"""Harmonics whose amplitudes are shown; chosen."""
BULKY = {"harmonics", "harmonics_std", "rounding_std"}
"""Keys of a point with a number for every channel and harmonic, which are not shown."""
RECORDS = {SegmentKind.RECORD, SegmentKind.SWEEP, SegmentKind.LEVEL_SWEEP, SegmentKind.RELEASE}
"""Kinds of segments that are evaluated."""
GUARDS = {
    GuardMode.DISARMED: "not armed",
    GuardMode.ARMED: "armed",
    GuardMode.RAMPING: "ramping down",
    GuardMode.OFF: "output at 0 V",
}
UNKNOWN = "output unknown"


@dataclass(frozen=True)
class Share:
    """How much of a limit or range the last rows used."""

    name: str
    """Name of the channel, or ``output``."""
    unit: str
    what: str
    """What is compared: ``limit``, ``range`` or ``displacement``."""
    value: float
    of: float
    """Limit or range, in the same unit."""

    @property
    def share(self) -> float:
        """Value over limit or range."""
        return self.value / self.of


@dataclass(frozen=True)
class Details:
    """Numbers of a run at its last frame; angles in deg, displacements in mm, times as their names say."""

    guard: str
    """State of the output, in words (`GUARDS`, or `UNKNOWN`)."""
    output_off: bool
    """Whether the output is known to be at 0 V."""
    lock: str
    part: int
    time_s: float
    """Time of the part."""
    point: int
    """Number of the present point, from 1; 0 if there is none."""
    finished: int
    points: int
    """Number of points of the plan, of which ``finished`` are over."""
    level: float
    target: float
    """Present level and final one of the segment, in the plan's unit."""
    frequency_hz: float
    phase_error_deg: float
    voltage_v: float
    force_n: float
    acceleration_m_s2: float
    displacement_mm: float
    settled: tuple[int, int] | None
    """Periods within the tolerance, and periods wanted; None if that was not recorded."""
    left_s: float
    """Estimate of the time left."""
    late_us: tuple[float, ...]
    """Response time of the loop: p50, p99, p99.9 and largest; NaN without a clock."""
    overruns: int
    lost: int
    shares: list[Share]
    scope: dict[str, object]
    """Waveforms of the last periods: ``t_ms`` and ``curves``, each with name, unit and values."""
    harmonics: list[dict[str, object]]
    """Spectra of force and drive: name, unit, amplitudes from the first harmonic on, and purity: the fundamental over the root
    sum of squares of all; NaN where nothing vibrates."""
    age_s: float
    """Time since the frame was written."""


@dataclass(frozen=True)
class Shown:
    """State of a run and, once something is driven, its numbers."""

    state: str
    """State in a word or two (`state_of`)."""
    cause: str = ""
    """Why the output comes or came down; empty while it is driven."""
    details: Details | None = None
    """Numbers of the last frame; None before the first."""

    @property
    def output_off(self) -> bool:
        """Whether the output is known to be at 0 V."""
        return self.details is not None and self.details.output_off


def state_of(frame: Frame | None) -> str:
    """Return the state of a run in a word or two.

    One of: starting, not armed, searching, lock lost, locked, settling, recording, driven (without a loop), ramping down,
    tripped, stopped, finished.
    """
    if frame is None:
        return "starting"
    state = frame.state
    guard, reason = GuardMode(int(state["guard"])), EndReason(int(state["reason"]))
    if guard is GuardMode.DISARMED:
        return "not armed"
    if guard is GuardMode.OFF or reason.is_trip:
        if reason.is_trip:
            return "tripped"
        return "finished" if reason is EndReason.COMPLETED else "stopped"
    if guard is GuardMode.RAMPING:
        return "ramping down"
    kind, lock = int(state["kind"]), LockState(int(state["lock"]))
    if kind in RECORDS:
        return "recording"
    if kind == SegmentKind.SETTLE:
        return "settling"
    if int(state["drive"]) != Drive.LOOP:
        return "driven"
    return {LockState.LOCKED: "locked", LockState.LOST: "lock lost"}.get(lock, "searching")


def cause_of(frame: Frame, facts: RunFacts, lines: Sequence[Line]) -> str:
    """Return why the output comes or came down; empty while it is driven. The run's own words once it has said them."""
    end = _end_of(lines)
    if end is not None:
        return text_in(end, "text")
    reason, channel = EndReason(int(frame.state["reason"])), int(frame.state["channel"])
    if reason is EndReason.NONE:
        return ""
    where = ""
    if 0 <= channel < len(facts.channels):
        unit = facts.channels[channel].unit
        if reason in (EndReason.DISPLACEMENT_LIMIT, EndReason.OVERTRAVEL):
            unit = "m"
        where = f" on channel {facts.channels[channel].name}: {float(frame.state['value']):.4g} {unit}"
    return reason.text + where


def _end_of(lines: Sequence[Line]) -> Line | None:
    """Return the line on the end of the present part, if it has ended."""
    for line in reversed(lines):
        if line["is"] in ("part", "end"):
            return line if line["is"] == "end" else None
    return None


def shown_frame(frame: Frame | None, facts: RunFacts, lines: Sequence[Line]) -> Shown:
    """Return the present state.

    A part that has ended without a last frame, because its driver failed, has tripped or stopped, and its output is unknown.
    Without a frame there is the state alone, with the cause of a run that ended before anything was driven.
    """
    end = _end_of(lines)
    state_at_end = "tripped" if end is not None and end.get("tripped") else "stopped"
    if frame is None:
        if end is None or any(line["is"] == "part" for line in lines):
            return Shown(state_of(None))
        return Shown(state_at_end, text_in(end, "text"))
    guard = GuardMode(int(frame.state["guard"]))
    output_off = guard in (GuardMode.OFF, GuardMode.DISARMED)
    if end is not None and not output_off:
        return Shown(state_at_end, cause_of(frame, facts, lines), _details(frame, facts, UNKNOWN, output_off))
    return Shown(state_of(frame), cause_of(frame, facts, lines), _details(frame, facts, GUARDS[guard], output_off))


def _details(frame: Frame, facts: RunFacts, guard: str, output_off: bool) -> Details:
    state = frame.state
    rows = _last_periods(frame.window)
    fundamentals = fundamentals_of(frame.window)
    good = int(state["good_periods"])
    alike = (
        "part",
        "finished",
        "level",
        "target",
        "frequency_hz",
        "voltage_v",
        "force_n",
        "left_s",
        "overruns",
        "lost",
    )
    return Details(
        **{name: state[name].item() for name in alike},
        guard=guard,
        output_off=output_off,
        lock=LockState(int(state["lock"])).name.lower(),
        time_s=int(state["sample"]) / facts.sample_rate_hz,
        point=int(state["point"]) + 1,
        points=int(state["total"]),
        phase_error_deg=math.degrees(float(state["phase_error_rad"])),
        acceleration_m_s2=float(state["drive_m_s2"]),
        displacement_mm=1e3 * float(state["displacement_m"]),
        settled=None if good < 0 else (good, int(state["settled_periods"])),
        late_us=tuple(state["late_us"].tolist()),
        shares=_shares(state, rows if rows.size else frame.window, facts, fundamentals),
        scope=_scope(rows, facts),
        harmonics=_spectra(fundamentals, facts),
        age_s=frame.age_s,
    )


def shown_json(shown: Shown) -> dict[str, JsonValue]:
    """Return a state as the page takes it: one object without nesting; numbers are left out before the first frame."""
    cause = {"cause": shown.cause} if shown.cause or shown.details else {}
    numbers = {} if shown.details is None else vars(shown.details)
    return {"state": shown.state, **cause, **{name: as_json(value) for name, value in numbers.items()}}


def bins_json(first: int, bins: NDArray[np.void], facts: RunFacts) -> JsonValue:
    """Return bins of the traces as the page takes them.

    ``first`` is the number of the first of them. Each has its end in s, part, lock, and [least, greatest] of each quantity.
    """
    out: dict[str, object] = {"first": first} | {name: bins[name] for name in ("end_s", "part", "lock", "guard")}
    for name in ("frequency_hz", "voltage_v", "level"):
        out[name] = [bins[name][:, 0], bins[name][:, 1]]
    out["phase_error_deg"] = [np.degrees(bins["phase_error_rad"][:, end]) for end in (0, 1)]
    for role in ("force", "drive"):
        inputs = bins["inputs"][:, facts.index(role)]
        out[role] = [inputs[:, 0], inputs[:, 1]]
    return as_json(out)


def shown_line(line: Line, facts: RunFacts) -> dict[str, object]:
    """Return a line without what is too much to be shown; a point instead with standard errors of its fundamentals.

    ``force_std_n`` and ``amplitude_std_m`` are those of the force's and of the drive point's displacement amplitude.
    """
    shown = {key: value for key, value in line.items() if key not in BULKY}
    errors, frequency_hz = line.get("harmonics_std"), number_in(line, "frequency_hz", 0.0)
    if errors and frequency_hz:
        fundamental = np.asarray(errors, float)[:, 1]
        shown["force_std_n"] = float(fundamental[facts.index("force")])
        omega = 2.0 * math.pi * frequency_hz
        shown["amplitude_std_m"] = float(fundamental[facts.index("drive")]) / omega**2
    return shown


def as_json(value: object) -> JsonValue:
    """Return a value as JSON can hold it: lists for arrays, None for what is not finite, numbers of `DIGITS`."""
    if isinstance(value, np.ndarray):
        return _list(value)
    if isinstance(value, Share):
        return as_json({**vars(value), "share": value.share})
    if is_dataclass(value):
        value = vars(value)
    if isinstance(value, Mapping):
        return {str(key): as_json(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [as_json(one) for one in value]
    if isinstance(value, float):
        return float(f"{value:.{DIGITS}g}") if math.isfinite(value) else None
    if value is None or isinstance(value, str | int):
        return value
    raise TypeError(f"{type(value).__name__} is not a JSON value")


def _list(values: Float) -> list[JsonValue]:
    """Return an array as a list, rounded to `DIGITS` of its largest value; None for what is not finite."""
    if values.dtype.kind != "f":
        return list(values.tolist())
    known = np.isfinite(values)
    largest = float(np.max(np.abs(values), initial=0.0, where=known))
    decimals = DIGITS - 1 - math.floor(math.log10(largest)) if largest > 0.0 else 0
    rounded = np.round(values.astype(float), decimals).tolist()
    return list(rounded if known.all() else [one if math.isfinite(one) else None for one in rounded])


def _last_periods(window: NDArray[np.void]) -> NDArray[np.void]:
    """Return the rows of the last `SCOPE_PERIODS` whole periods, or of fewer."""
    theta = window["theta_rad"].astype(float)
    begins = np.flatnonzero(np.diff(theta) < -math.pi) + 1
    if begins.size < 2:
        return window[:0]
    return window[begins[max(begins.size - 1 - SCOPE_PERIODS, 0)] : begins[-1]]


def fundamentals_of(window: NDArray[np.void]) -> Complex:
    """Return mean and harmonics of every channel over the last periods: complex[n_channels, H + 1], or [0, H + 1] for none.

    By least squares on the recorded phase of the oscillator.
    """
    rows = _last_periods(window)
    inputs = rows["inputs"].astype(float)
    good = np.isfinite(inputs).all(axis=1)
    if good.sum() < 4 * HARMONICS:
        return np.zeros((0, HARMONICS + 1), complex)
    angles = rows["theta_rad"][good].astype(float)[:, None] * np.arange(1, HARMONICS + 1)
    base = np.hstack([np.ones((angles.shape[0], 1)), np.cos(angles), np.sin(angles)])
    found = np.linalg.solve(base.T @ base, base.T @ inputs[good]).T  # well posed over whole periods
    cos, sin = found[:, 1 : HARMONICS + 1], found[:, HARMONICS + 1 :]
    return np.asarray(np.hstack([found[:, :1].astype(complex), cos - 1j * sin]))


def _shares(state: np.void, rows: NDArray[np.void], facts: RunFacts, fundamentals: Complex) -> list[Share]:
    inputs = np.abs(rows["inputs"]).astype(float)
    largest = np.fmax.reduce(inputs, axis=0) if inputs.size else np.full(len(facts.channels), math.nan)
    omega = 2.0 * math.pi * float(state["frequency_hz"])
    out = [Share("output", "V", "limit", float(state["voltage_v"]), facts.limits.voltage_v)]
    for index, channel in enumerate(facts.channels):
        value = float(largest[index])
        out.append(Share(channel.name, channel.unit, "range", value, channel.range))
        if channel.limit is not None:
            out.append(Share(channel.name, channel.unit, "limit", value, channel.limit))
        if channel.role in ("drive", "response") and fundamentals.size and omega > 0.0:
            travel_mm = 1e3 * float(abs(fundamentals[index, 1])) / omega**2
            out.append(Share(channel.name, "mm", "displacement", travel_mm, 1e3 * facts.limits.displacement_m))
    return out


def _force_and_drive(facts: RunFacts) -> list[tuple[int, ChannelFacts]]:
    return [(at, facts.channels[at]) for at in (facts.index("force"), facts.index("drive"))]


def _scope(rows: NDArray[np.void], facts: RunFacts) -> dict[str, object]:
    stride = max(1, -(-rows.size // SCOPE_POINTS))
    rows = rows[::stride]
    curves = [{"name": "output", "unit": "V", "values": rows["output_v"]}]
    for at, channel in _force_and_drive(facts):
        curves.append({"name": channel.name, "unit": channel.unit, "values": rows["inputs"][:, at]})
    return {"t_ms": np.arange(rows.size, dtype=float) * (1e3 * stride / facts.sample_rate_hz), "curves": curves}


def _spectra(fundamentals: Complex, facts: RunFacts) -> list[dict[str, object]]:
    out: list[dict[str, object]] = []
    for at, channel in _force_and_drive(facts):
        amplitudes = np.abs(fundamentals[at, 1:]) if fundamentals.size else np.zeros(0)
        whole = float(np.linalg.norm(amplitudes))
        purity = float(amplitudes[0]) / whole if whole > 0.0 else math.nan
        out.append({"name": channel.name, "unit": channel.unit, "amplitudes": amplitudes, "purity": purity})
    return out
