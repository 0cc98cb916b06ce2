"""A recording as it was while it was made: what was to be seen of the run, at any time of it."""

import math
import threading
import time
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from rig.bench import Bench
from rig.bench.configuration import validated
from rig.campaigns.plans import plan_from
from rig.campaigns.running.watched import watched_facts
from rig.errors import RecordingError
from rig.live.facts import Line
from rig.live.layout import BINS, FRAME, bin_dtype, window_rows
from rig.live.reader import Frame, LiveRun
from rig.monitor.recorded_part import PlanOfPart, RecordedPart
from rig.monitor.shown import fundamentals_of
from rig.recording.reader import Recording
from rig.system.closing import Closing
from rig.tick.safety.layout import EndReason, GuardMode
from vibrolock.errors import InputError

FASTEST = 1000.0
"""Largest speed of a replay, times the clock; chosen."""
STRETCH = 100
"""Bins that are made at once and kept: ten seconds."""
MEAN_S = 0.1
"""Time over which the phase error is averaged, s; chosen: about as long as the rows between two frames of a run."""


@dataclass(frozen=True)
class ReplayState:
    """Where a replay stands."""

    time_s: float
    duration_s: float
    playing: bool
    speed: float
    """How many times as fast as the clock."""


class Replay(Closing):
    """A recording of any kind as a run under way (`rig.live.reader.LiveRun`), with all its parts one after the other.

    It plays from the beginning, ``speed`` times as fast as the clock; with ``at_end`` it stands at the end. Rows are read when
    they are shown. What was not recorded is NaN: lateness, periods settled, and levels in newtons or metres while they are
    ramped. The time left is what the run then took. Other threads may steer it; one may read it.

    Raises:
        RecordingError, ConfigurationError: the file cannot be read, or is no recording; the speed is not allowed.
    """

    def __init__(self, path: Path, speed: float = 1.0, at_end: bool = False) -> None:
        self._recording = Recording(path)
        try:
            self.speed = _checked(speed)
            self._prepare(path)
        except BaseException:
            self._recording.close()
            raise
        self.generation = 0
        """Number of jumps so far: after each, lines and bins begin anew."""
        self._lock = threading.Lock()
        self._connected = True
        self._at_s = self.duration_s if at_end else 0.0
        self._since_s: float | None = None if at_end else time.monotonic()
        self._stretches: dict[tuple[int, int], NDArray[np.void]] = {}

    def _prepare(self, path: Path) -> None:
        recording = self._recording
        bench = validated(Bench, recording.configuration["bench"], f"{path.name}: bench")
        plan = plan_from(recording.configuration["plan"], f"{path.name}: plan")
        about = recording.parts[0].information.get("about") or {} if recording.parts else {}
        facts = watched_facts(plan, bench, path, about, recording.started)
        self.facts = replace(facts, version=recording.software_version, process=0)
        self._rate = bench.sample_rate_hz
        self._bin_dtype = bin_dtype(len(bench.channels))
        self._parts = [
            RecordedPart(part, number + 1, bench, _plan_of(recording, number))
            for number, part in enumerate(recording.parts)
        ]
        self._begins = np.concatenate([[0], np.cumsum([part.n_samples for part in self._parts])]).astype(int)
        self._first_bins = np.concatenate([[0], np.cumsum([part.n_bins for part in self._parts])]).astype(int)
        self.duration_s = float(self._begins[-1]) / self._rate
        told = [line for part in self._parts for line in self._lines_of(part)]
        told.sort(key=lambda line: line[0])  # stable: what belongs to the same sample stays in its order
        self._times = [sample for sample, _ in told]
        self._told = [line for _, line in told]
        roles = [channel.role for channel in bench.channels]
        self._force, self._drive = roles.index("force"), roles.index("drive")

    @property
    def time_s(self) -> float:
        """Time of the recording that is shown, s: that of all parts before, and of the present one."""
        with self._lock:
            return self._now_s()

    @property
    def playing(self) -> bool:
        """Whether time goes on."""
        with self._lock:
            return self._since_s is not None and self._now_s() < self.duration_s

    @property
    def connected(self) -> bool:
        """Whether the recording is open."""
        return self._connected

    @property
    def player(self) -> Self:
        """The replay is its own controls."""
        return self

    def replay_state(self) -> ReplayState:
        """Return where the replay stands."""
        return ReplayState(self.time_s, self.duration_s, self.playing, self.speed)

    def pause(self) -> None:
        """Let time stand."""
        with self._lock:
            self._at_s, self._since_s = self._now_s(), None

    def play(self) -> None:
        """Let time go on; at the end, begin again."""
        if self.time_s >= self.duration_s:
            self.seek(0.0)
        with self._lock:
            self._at_s, self._since_s = self._now_s(), time.monotonic()

    def seek(self, time_s: float) -> None:
        """Jump to a time, or to the nearest that was recorded."""
        with self._lock:
            self._at_s = min(max(time_s, 0.0), self.duration_s)
            self._since_s = None if self._since_s is None else time.monotonic()
            self.generation += 1

    def set_speed(self, speed: float) -> None:
        """Go on ``speed`` times as fast as the clock; RecordingError if that is not allowed."""
        _checked(speed)
        with self._lock:
            self._at_s, self._since_s = self._now_s(), None if self._since_s is None else time.monotonic()
            self.speed = speed

    def control(self, action: str, value: float) -> None:
        """Do what is asked on a page: ``pause``, ``play``, ``seek`` to a time in s, ``speed``; ValueError for anything else."""
        if not math.isfinite(value):
            raise ValueError(f"{action} {value}: a number is expected")
        if action == "speed":
            try:
                self.set_speed(value)
            except RecordingError as error:
                raise ValueError(str(error)) from error
        elif action == "seek":
            self.seek(value)
        elif action in ("pause", "play"):
            (self.pause if action == "pause" else self.play)()
        else:
            raise InputError("pause, play, seek or speed is expected", field=f"{action!r}")

    def request_stop(self, cause: str) -> None:
        """Refuse by `RecordingError`: nothing moves."""
        raise RecordingError("a recording is replayed: there is nothing to stop")

    def frame(self) -> Frame | None:
        """Return the state at the present time, from the rows up to it; None before the first row."""
        part, samples = self._place()
        rows = 0 if part is None else part.rows_until(samples)
        if part is None or rows == 0:
            return None
        first = max(part.unbroken_from(rows - 1), rows - window_rows(part.rows(0, 0).dtype))
        window = part.rows(first, rows)
        state = self._state(part, samples, window)
        if window.size == 1:  # one row of several is stored here: no waveform, and nothing to say of its largest values
            window = window[:0]
        state["window"] = window.size
        return Frame(state, window, 0.0)

    def bins(self, first: int) -> tuple[int, NDArray[np.void]]:
        """Return the bins up to the present time from number ``first`` on, of which the last `BINS` are kept."""
        part, samples = self._place()
        if part is None:
            return 0, np.zeros(0, self._bin_dtype)
        count = int(self._first_bins[part.number - 1]) + min(part.n_bins, samples // part.bin_samples)
        first = max(first, count - BINS, 0)
        out = [np.zeros(0, self._bin_dtype)]
        for one in self._parts:
            begin = int(self._first_bins[one.number - 1])
            lowest, end = max(first - begin, 0), min(count - begin, one.n_bins)
            for stretch in range(lowest // STRETCH, -(-end // STRETCH)):
                offset = stretch * STRETCH
                found = self._stretch(one, stretch)
                out.append(found[max(lowest - offset, 0) : end - offset])
        return first, np.concatenate(out)

    def lines(self, first: int) -> Sequence[Line]:
        """Return what was told up to the present time, from number ``first`` on."""
        return self._told[first : bisect_right(self._times, self._samples_over())]

    def close(self) -> None:
        """Close the file."""
        self._connected = False
        self._recording.close()

    def _now_s(self) -> float:
        gone_s = 0.0 if self._since_s is None else self.speed * (time.monotonic() - self._since_s)
        return min(self._at_s + gone_s, self.duration_s)

    def _samples_over(self) -> int:
        return min(round(self.time_s * self._rate), int(self._begins[-1]))

    def _place(self) -> tuple[RecordedPart | None, int]:
        """Return the part that is shown, None before the first sample, and how many samples of it are over."""
        over = self._samples_over()
        if over == 0:
            return None, 0
        at = int(np.searchsorted(self._begins, over, side="left")) - 1
        return self._parts[at], over - int(self._begins[at])

    def _stretch(self, part: RecordedPart, number: int) -> NDArray[np.void]:
        key = part.number, number
        if key not in self._stretches:
            first = number * STRETCH
            self._stretches[key] = part.bins(first, min(first + STRETCH, part.n_bins))
        return self._stretches[key]

    def _lines_of(self, part: RecordedPart) -> list[tuple[int, Line]]:
        """Return what was told of a part, each with the number of samples of the recording after which it is told."""
        begin, told = int(self._begins[part.number - 1]), part.part
        lines: list[tuple[int, Line]] = [(begin + 1, {**told.information, "is": "part"})]
        events = [(begin + int(event.get("sample", 0)), {**event, "is": "event"}) for event in told.events]
        points = [
            (begin + sample, {**point, "is": "point"})
            for sample, point in zip(part.end_of_points(), told.points, strict=True)
        ]
        lines += sorted([*events, *points], key=lambda line: line[0])
        if told.end is not None:
            lines.append((begin + part.n_samples, {**told.end, "is": "end"}))
        return [(max(begin + 1, min(sample, begin + part.n_samples)), line) for sample, line in lines]

    def _state(self, part: RecordedPart, samples: int, window: NDArray[np.void]) -> np.void:
        last = window[-1]
        state: np.void = np.zeros(1, FRAME)[0]
        for name in ("value", "target", "late_us", "force_n", "drive_m_s2", "displacement_m", "phase_error_rad"):
            state[name] = np.nan
        guard, end = GuardMode(int(last["guard"])), part.part.end
        state["sample"], state["part"], state["channel"], state["good_periods"] = samples, part.number, -1, -1
        state["lock"], state["guard"] = last["lock"], guard
        if end is not None and guard in (GuardMode.RAMPING, GuardMode.OFF):
            state["reason"] = EndReason.__members__.get(str(end.get("reason", "")).upper(), EndReason.NONE)
        segment = part.segment(last)
        state["segment"] = -1 if segment is None else last["segment"]
        for name in ("kind", "drive", "point"):
            state[name] = -1 if segment is None else segment[name]
        if segment is None:  # a loop, if there was a phase error to control
            state["drive"] = 0 if np.isfinite(window["phase_error_rad"]).any() or last["lock"] else 1
        else:
            state["target"] = segment["level"]
        state["level"], state["frequency_hz"] = part.level(last), last["frequency_hz"]
        state["voltage_v"] = abs(last["command_v"])
        errors = window["phase_error_rad"][-max(1, round(MEAN_S * self._rate)) :]
        if np.isfinite(errors).any():
            state["phase_error_rad"] = np.nanmean(errors)
        bands = fundamentals_of(window)
        if bands.size and last["frequency_hz"] > 0.0:
            state["force_n"] = abs(bands[self._force, 1])
            state["drive_m_s2"] = abs(bands[self._drive, 1])
            state["displacement_m"] = state["drive_m_s2"] / (2.0 * np.pi * last["frequency_hz"]) ** 2
        told = {line["number"] for line in self.lines(0) if line["is"] == "point"}
        state["finished"], state["total"] = len(told), self.facts.points
        state["left_s"] = self.duration_s - self.time_s
        if end is not None and samples >= part.n_samples:
            state["overruns"] = (end.get("loop") or {}).get("overruns", 0)
        return state


def _checked(speed: float) -> float:
    if not 0.0 < speed <= FASTEST:
        raise RecordingError(field="speed", value=speed, allowed=f"above 0, up to {FASTEST:g}")
    return speed


View = LiveRun | Replay
"""A run as it is watched: one that is under way, or a recording that is replayed."""


def _plan_of(recording: Recording, number: int) -> PlanOfPart:
    """Return the plan in force in a part, and which of its points that part may have left out.

    A further part leaves out what was accepted before; further attempts of the same run also what was given up.
    """
    said = [one for one in recording.plans if one.part <= number][-1]
    plan = plan_from(dict(said.plan), f"{recording.path.name}: plan")
    numbers = tuple(range(len(plan.targets())) if said.numbers is None else said.numbers)
    before = [point for part in recording.parts[:number] for point in part.points]
    accepted = {int(point["number"]) for point in before if point["accepted"]}
    here = {int(point["number"]) for point in recording.parts[number].points}
    resumed = frozenset(place for place, one in enumerate(numbers) if one in accepted)
    again = frozenset(place for place, one in enumerate(numbers) if one not in here)
    return PlanOfPart(plan, numbers, tuple(dict.fromkeys((resumed, again))))
