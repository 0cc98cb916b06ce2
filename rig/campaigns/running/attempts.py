"""Attempts at points: records that the sequencer has refused, points worth another attempt, and what was measured before."""

import math
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from rig.campaigns.evaluation.device_faults import DeviceFaults, why_disturbed
from rig.campaigns.evaluation.point import Attempt, Point, Quality, RowRange
from rig.campaigns.running.stored_rows import StoredRows
from rig.tick.sequencer.layout import RING, Drive, Outcome
from rig.tick.tick import Tick


class RefusedRecord(NamedTuple):
    """A record that was refused by the sequencer and is measured again."""

    number: int
    """Number of its point in the plan."""
    sample: int
    """Sample at which it was refused."""
    attempt: Attempt
    """What is kept of it."""


class RefusedRecords:
    """Reads the ring in which the sequencer keeps the records that it has refused."""

    def __init__(self) -> None:
        self._seen = 0

    def take(self, tick: Tick, stored: StoredRows) -> list[RefusedRecord]:
        """Return the records that were refused since the last call."""
        progress, segments = tick.arrays.progress[0], tick.arrays.segments
        count = int(progress["n_refused"])
        fresh = range(max(self._seen, count - RING), count)
        self._seen = count
        out = []
        for index in fresh:
            entry = progress["refused"][index % RING]
            segment = segments[int(entry["segment"])]
            attempt = _attempt(entry, stored, tick.bench.sample_rate_hz, int(segment["drive"]) == Drive.WAVEFORM)
            out.append(RefusedRecord(int(segment["point"]), int(entry["end_sample"]), attempt))
        return out


def _attempt(entry: np.void, stored: StoredRows, sample_rate_hz: float, plays: bool) -> Attempt:
    """Return what is kept of a refused record; ``plays``: a waveform, which has no single frequency and force."""
    first, end = int(entry["first_sample"]), int(entry["end_sample"])
    kept = stored.row_range(first, end)
    disturbed = int(entry["outcome"]) == Outcome.DISTURBED
    force_n = float(entry["force_n"])
    return Attempt(
        reason=_reason(entry, plays),
        quality=Quality.DISTURBED if disturbed else Quality.REJECTED,
        rows=None if kept is None else RowRange(first_sample=kept[0], end_sample=kept[1]),
        frequency_hz=None if plays or end == first else float(entry["periods"]) / (end - first) * sample_rate_hz,
        force_n=None if plays or not math.isfinite(force_n) else force_n,
    )


def _reason(entry: np.void, plays: bool) -> str:
    faults = DeviceFaults.of(entry)
    if int(entry["outcome"]) != Outcome.DISTURBED:
        return faults.text(final=False)
    error_deg, drift = math.degrees(float(entry["mean_error_rad"])), 100.0 * float(entry["drift"])
    course = f" (averaged phase error {error_deg:.2f} deg, amplitude drift {drift:.3g} %)" if not plays else ""
    return why_disturbed(faults, course, final=False)


def attempt_at(point: Point[object]) -> Attempt:
    """Return what is kept of a refused point if it is measured again."""
    vibration = point.vibration
    return Attempt(
        reason=point.reason,
        quality=point.quality,
        rows=point.rows,
        part=point.part,
        frequency_hz=None if vibration is None else vibration.frequency_hz,
        force_n=None if vibration is None else vibration.force_n,
    )


def after_attempts(point: Point[object], before: tuple[Attempt, ...]) -> Point[object]:
    """Return a point with the attempts before it. A point that is refused says how often it was measured."""
    if not before:
        return point
    reason = point.reason if point.accepted else f"{point.reason}; refused in {1 + len(before)} attempts"
    return replace(point, refused_before=before, reason=reason)


@dataclass(frozen=True)
class MeasuredBefore:
    """Results of earlier parts of the recording that concern the plan."""

    done: frozenset[int] = frozenset()
    """Numbers in the plan of the points that were accepted."""
    numbers: Sequence[int] | None = None
    """Number in the recording of every point of the plan; None if it equals the number in the plan."""
    points: tuple[Point[object], ...] = ()
    """All points of the recording so far."""
    given_up: frozenset[int] = frozenset()
    """Numbers in the plan of the points that were not accepted and are not measured again."""
    attempts: Mapping[int, tuple[Attempt, ...]] = field(default_factory=dict)
    """Refused attempts of the same run at points that are measured again, by their number in the plan."""


def measured_before_repeat(
    numbers: Sequence[int],
    known: tuple[Point[object], ...],
    again: Set[int],
    attempts: Mapping[int, tuple[Attempt, ...]],
) -> MeasuredBefore:
    """Return what was measured before the points ``again`` of a plan are measured again in the same run.

    ``numbers`` are the numbers in the recording of the plan's points, ``known`` all points of the recording, ``attempts`` the
    refused attempts before the last results. All other points count as given up unless they were accepted.
    """
    last = {point.number: point for point in known}
    accepted = {point.number for point in known if point.accepted}
    done = frozenset(place for place, number in enumerate(numbers) if number in accepted)
    given_up = frozenset(range(len(numbers))) - done - again
    tried = (place for place in again if numbers[place] in last)
    refused = {place: (*attempts.get(place, ()), attempt_at(last[numbers[place]])) for place in tried}
    return MeasuredBefore(done, numbers, known, given_up, refused)
