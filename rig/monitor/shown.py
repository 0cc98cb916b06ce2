"""What is to be seen of a run, in words, numbers and curves: plain data, from which page and terminal view are drawn."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from controller import LockState
from rig.live.reader import Frame
from rig.tick.safety.layout import TEXT, EndReason, GuardMode
from rig.tick.sequencer.layout import Drive, SegmentKind

SCOPE_PERIODS = 3
SCOPE_POINTS = 400
HARMONICS = 10
BULKY = {"harmonics", "harmonics_std", "rounding_std"}  # numbers for every channel and harmonic
RECORDS = {SegmentKind.RECORD, SegmentKind.SWEEP, SegmentKind.LEVEL_SWEEP, SegmentKind.RELEASE}
GUARDS = {
    GuardMode.DISARMED: "not armed",
    GuardMode.ARMED: "armed",
    GuardMode.RAMPING: "ramping down",
    GuardMode.OFF: "output at 0 V",
}
UNKNOWN = "output unknown"


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


def cause_of(frame: Frame, facts: Mapping[str, Any], lines: Sequence[Mapping[str, Any]]) -> str:
    """Return why the output comes or came down; empty while it is driven. The run's own words once it has said them."""
    end = _end_of(lines)
    if end is not None:
        return str(end.get("text", ""))
    reason, channel = EndReason(int(frame.state["reason"])), int(frame.state["channel"])
    if reason is EndReason.NONE:
        return ""
    where = ""
    if 0 <= channel < len(facts["channels"]):
        unit = facts["channels"][channel]["unit"]
        if reason in (EndReason.DISPLACEMENT_LIMIT, EndReason.OVERTRAVEL):
            unit = "m"
        where = f" on channel {facts['channels'][channel]['name']}: {float(frame.state['value']):.4g} {unit}"
    return TEXT[reason] + where


def _end_of(lines: Sequence[Mapping[str, Any]]) -> Mapping[str, Any] | None:
    """Return what was told of the end of the present part, if it has ended."""
    for line in reversed(lines):
        if line["is"] in ("part", "end"):
            return line if line["is"] == "end" else None
    return None


def _state_at_the_end(end: Mapping[str, Any]) -> str:
    return "tripped" if end.get("tripped") else "stopped"


def shown_frame(frame: Frame | None, facts: Mapping[str, Any], lines: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the present state as plain data; angles in deg, displacements in mm, times as their names say.

    ``shares``: for every channel how much of its range and of its limit the last rows used, and the same of output voltage and
    displacement, each 0 to 1 or above. ``scope``: the last periods of output, force and drive. ``harmonics``: their amplitudes
    from the first on, and the part of the fundamental. A part that has ended without a last frame, because its driver failed,
    has tripped or stopped, and its output is unknown. Without a frame there is the state alone, with the cause of a run that
    ended before anything was driven.
    """
    if frame is None:
        end = _end_of(lines)
        refused = end is not None and all(line["is"] != "part" for line in lines)  # it ended before it began
        return {"state": _state_at_the_end(end), "cause": end["text"]} if end and refused else {"state": state_of(None)}
    state, window = frame.state, frame.window
    guard, end = GuardMode(int(state["guard"])), _end_of(lines)
    off = guard in (GuardMode.OFF, GuardMode.DISARMED)
    omega = 2.0 * math.pi * float(state["frequency_hz"])
    bands = fundamentals_of(window, facts)
    return {
        "state": _state_at_the_end(end) if end is not None and not off else state_of(frame),
        "cause": cause_of(frame, facts, lines),
        "guard": UNKNOWN if end is not None and not off else GUARDS[guard],
        "output_off": off,
        "lock": LockState(int(state["lock"])).name.lower(),
        "age_s": frame.age_s,
        "part": int(state["part"]),
        "time_s": int(state["sample"]) / facts["sample_rate_hz"],
        "point": int(state["point"]) + 1,
        "finished": int(state["finished"]),
        "points": int(state["total"]),
        "level": float(state["level"]),
        "target": float(state["target"]),
        "frequency_hz": float(state["frequency_hz"]),
        "phase_error_deg": math.degrees(float(state["phase_error_rad"])),
        "voltage_v": float(state["voltage_v"]),
        "force_n": float(state["force_n"]),
        "acceleration_m_s2": float(state["drive_m_s2"]),
        "displacement_mm": 1e3 * float(state["displacement_m"]),
        "settled": _settled(state),
        "left_s": float(state["left_s"]),
        "late_us": [float(value) for value in state["late_us"]],
        "overruns": int(state["overruns"]),
        "lost": int(state["lost"]),
        "shares": _shares(state, window, facts, bands[:, 1] if bands.size else None, omega),
        "scope": _scope(window, facts),
        "harmonics": _harmonics(bands, facts),
    }


def _settled(state: np.void) -> list[int] | None:
    """Return how many periods of how many were within the tolerance; None where that was not recorded."""
    good = int(state["good_periods"])
    return None if good < 0 else [good, int(state["settled_periods"])]


def shown_bins(bins: np.ndarray, facts: Mapping[str, Any]) -> dict[str, Any]:
    """Return bins of the traces as plain data: their ends in s, part, lock, and [least, greatest] lists of each quantity."""
    out: dict[str, Any] = {name: bins[name] for name in ("end_s", "part", "lock", "guard")}
    for name, factor in (("frequency_hz", 1.0), ("voltage_v", 1.0), ("level", 1.0)):
        out[name] = [factor * bins[name][:, 0], factor * bins[name][:, 1]]
    out["phase_error_deg"] = [np.degrees(bins["phase_error_rad"][:, end]) for end in (0, 1)]
    for role in ("force", "drive"):
        at = _index(facts, role)
        out[role] = [bins["inputs"][:, at, 0], bins["inputs"][:, at, 1]]
    return out


def shown_line(line: Mapping[str, Any], facts: Mapping[str, Any]) -> dict[str, Any]:
    """Return a line without what is too much to be shown; a point instead with standard errors of its fundamentals.

    ``force_std_n`` and ``amplitude_std_m`` are those of the force's and of the drive point's displacement amplitude.
    """
    shown = {key: value for key, value in line.items() if key not in BULKY}
    errors, frequency = line.get("harmonics_std"), line.get("frequency_hz")
    if errors and frequency:
        shown["force_std_n"] = errors[_index(facts, "force")][1]
        shown["amplitude_std_m"] = errors[_index(facts, "drive")][1] / (2.0 * math.pi * frequency) ** 2
    return shown


def as_json(value: Any, digits: int = 6) -> Any:
    """Return a value as JSON can hold it: lists for arrays, None for what is not finite, numbers of so many digits."""
    if isinstance(value, np.ndarray):
        return _list(value, digits)
    if isinstance(value, Mapping):
        return {key: as_json(one, digits) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [as_json(one, digits) for one in value]
    if isinstance(value, float):
        return float(f"{value:.{digits}g}") if math.isfinite(value) else None
    return value


def _list(values: np.ndarray, digits: int) -> list[Any]:
    """Return an array as a list, rounded to so many digits of its largest value; None for what is not finite."""
    if values.dtype.kind != "f":
        return list(values.tolist())
    known = np.isfinite(values)
    largest = float(np.max(np.abs(values), initial=0.0, where=known))
    decimals = digits - 1 - math.floor(math.log10(largest)) if largest > 0.0 else 0
    rounded = np.round(values.astype(float), decimals).tolist()
    return list(rounded if known.all() else [one if math.isfinite(one) else None for one in rounded])


def _index(facts: Mapping[str, Any], role: str) -> int:
    return [channel["role"] for channel in facts["channels"]].index(role)


def _last_periods(window: np.ndarray, periods: int) -> np.ndarray:
    """Return the rows of the last ``periods`` whole periods, or of fewer."""
    theta = window["theta_rad"].astype(float)
    begins = np.flatnonzero(np.diff(theta) < -math.pi) + 1
    if begins.size < 2:
        return window[:0]
    return window[begins[max(begins.size - 1 - periods, 0)] : begins[-1]]


def fundamentals_of(window: np.ndarray, facts: Mapping[str, Any]) -> np.ndarray:
    """Return mean and harmonics of every channel over the last periods: complex[n_channels, H + 1], or [0, H + 1] for none.

    By least squares on the recorded phase of the oscillator.
    """
    rows = _last_periods(window, SCOPE_PERIODS)
    inputs = rows["inputs"].astype(float)
    good = np.isfinite(inputs).all(axis=1)
    if good.sum() < 4 * HARMONICS:
        return np.zeros((0, HARMONICS + 1), complex)
    angles = rows["theta_rad"][good].astype(float)[:, None] * np.arange(1, HARMONICS + 1)
    base = np.hstack([np.ones((angles.shape[0], 1)), np.cos(angles), np.sin(angles)])
    found = np.linalg.solve(base.T @ base, base.T @ inputs[good]).T  # well posed over whole periods
    cos, sin = found[:, 1 : HARMONICS + 1], found[:, HARMONICS + 1 :]
    return np.asarray(np.hstack([found[:, :1].astype(complex), cos - 1j * sin]))


def _shares(
    state: np.void, window: np.ndarray, facts: Mapping[str, Any], fundamentals: np.ndarray | None, omega: float
) -> list[dict[str, Any]]:
    """Return what the last rows used of every limit and range: name, unit, value, what it may be, and their ratio."""
    rows = _last_periods(window, SCOPE_PERIODS)
    inputs = np.abs((rows if rows.size else window)["inputs"]).astype(float)
    largest = np.fmax.reduce(inputs, axis=0) if inputs.size else np.full(len(facts["channels"]), math.nan)
    limits = facts["limits"]
    out = [_share("output", "V", "limit", float(state["voltage_v"]), limits["voltage_v"])]
    for index, channel in enumerate(facts["channels"]):
        value = float(largest[index])
        out.append(_share(channel["name"], channel["unit"], "range", value, channel["range"]))
        if channel["limit"] is not None:
            out.append(_share(channel["name"], channel["unit"], "limit", value, channel["limit"]))
        if channel["role"] in ("drive", "response") and fundamentals is not None and omega > 0.0:
            travel_mm = 1e3 * abs(fundamentals[index]) / omega**2
            out.append(_share(channel["name"], "mm", "displacement", travel_mm, 1e3 * limits["displacement_m"]))
    return out


def _share(name: str, unit: str, what: str, value: float, of: float) -> dict[str, Any]:
    return {"name": name, "unit": unit, "what": what, "value": value, "of": of, "share": value / of}


def _scope(window: np.ndarray, facts: Mapping[str, Any]) -> dict[str, Any]:
    rows = _last_periods(window, SCOPE_PERIODS)
    stride = max(1, -(-rows.size // SCOPE_POINTS))
    rows = rows[::stride]
    step_ms = 1e3 * stride / facts["sample_rate_hz"]
    curves = [{"name": "output", "unit": "V", "values": rows["output_v"]}]
    for role in ("force", "drive"):
        at = _index(facts, role)
        channel = facts["channels"][at]
        curves.append({"name": channel["name"], "unit": channel["unit"], "values": rows["inputs"][:, at]})
    return {"t_ms": np.arange(rows.size) * step_ms, "curves": curves}


def _harmonics(bands: np.ndarray, facts: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return amplitudes from the first harmonic on, and the fundamental's part of their root sum of squares."""
    out = []
    for role in ("force", "drive"):
        at = _index(facts, role)
        channel = facts["channels"][at]
        sizes = np.abs(bands[at, 1:]) if bands.size else np.zeros(0)
        whole = float(np.linalg.norm(sizes)) if sizes.size else 0.0
        purity = float(sizes[0]) / whole if whole > 0.0 else math.nan
        out.append({"name": channel["name"], "unit": channel["unit"], "amplitudes": sizes, "purity": purity})
    return out
