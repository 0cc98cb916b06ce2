"""Contents of a file as one JSON-able dictionary: the output of ``rig show``."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from rig.campaigns.evaluation.device_faults import pages_on
from rig.campaigns.evaluation.drift import drift_of
from rig.campaigns.evaluation.point import Point, Spectrum
from rig.campaigns.evaluation.recorded import points_of, recorded_drive_shape
from rig.campaigns.evaluation.skipped import repeats_summary, skipped_summary
from rig.campaigns.evaluation.stored_point import point_from
from rig.campaigns.kinds import KINDS as CAMPAIGNS
from rig.campaigns.plans import plan_from
from rig.campaigns.running.continuation import changed_keys
from rig.check.findings import is_check
from rig.check.report import summary
from rig.recording.arrays import kind_of
from rig.recording.layout import file_integrity
from rig.recording.parts import Part
from rig.recording.reader import Recording
from rig.recording.stored import End, StoredTable
from rig.rehearsal.forecast import compare, read_forecast
from rig.results.files import load, understood
from rig.results.kinds import KINDS
from rig.text.message_pages import page_of
from rig.tick.safety.layout import EndReason

BULKY = {one.name for one in fields(Spectrum)}
"""Fields of a point that a summary omits."""

UNEXPLAINED = {page_of(reason.name) for reason in (EndReason.NONE, EndReason.COMPLETED)}

QUALITY = (
    "settled",
    "accepted",
    "quality",
    "reason",
    "periods",
    "settle_periods",
    "warnings",
    "first_sample",
    "end_sample",
)


def summarise(path: Path) -> dict[str, Any]:
    """Summarise a recording, an imported measurement or a model; raise `RecordingError` if the file is none of these."""
    kind = kind_of(path)
    if kind in KINDS:
        found = load(path)
        with understood(path, kind):
            return {"kind": kind, "integrity": file_integrity(path), **KINDS[kind].summarise(found)}
    with Recording(path) as recording, understood(path, f"recording of kind {kind}"):
        if is_check(recording):
            from rig.check.assessment import assess  # evaluates the recording anew, which few files need

            return {**summary(assess(recording)).model_dump(), "integrity": recording.integrity}
        return summarise_recording(recording)


def summarise_recording(recording: Recording) -> dict[str, Any]:
    """Summarise points with their quality, loop statistics, and the end of each part.

    Points and parts count from 0, as in the file.
    """
    bench = recording.configuration["bench"]
    plan = plan_from(recording.configuration["plan"], "plan of the recording")
    changed = _changes(recording)
    parts = [
        {
            "rows": part.n_rows,
            "bytes_lost": part.dropped_bytes,
            "lost": part.dropped_reason or None,
            "ended": None if part.end is None else part.end["text"],
            "tripped": part.end is not None and part.end["tripped"],
            **{key: (part.end or {}).get(key) for key in ("tripped_at", "likely_cause", "what_to_do")},
            "changed": changed.get(number, []),
            "about": _about(part.information.get("about")),
            "beside_rehearsal": _beside_rehearsal(part),
            "loop": None if part.end is None else part.end["loop"],
            "counters": None if part.end is None else part.end["counters"],
        }
        for number, part in enumerate(recording.parts)
    ]
    points = points_of(recording)
    ends = [part.end for part in recording.parts if part.end is not None]
    return {
        "kind": recording.kind,
        "integrity": recording.integrity,
        "specimen": bench["specimen"]["name"],
        "bench": bench["name"],
        "sensors": _sensors(bench["channels"], recording.started[:10]),
        "started": recording.started,
        "software_version": recording.software_version,
        "seed": recording.seed,
        "complete": recording.complete,
        "points_planned": len(plan.targets()),
        "skipped": skipped_summary(points, len(plan.targets())),
        "drive_mode_shape": _mode_shape(recording, points, plan.kind),
        "points": [_shown(point, plan.kind) for point in recording.latest.values()],
        "measured_again": repeats_summary(points),
        "drift": drift_of(points),
        "messages": _messages(ends, points),
        "former_points": [_shown(point, plan.kind) for point in recording.former.values()],
        "loop": _loop(ends, recording.n_rows, bench["sample_rate_hz"]),
        "counters": {
            name: sum(end["counters"].get(name, 0) for end in ends)
            for name in sorted({n for e in ends for n in e["counters"]})
        },
        "parts": parts,
    }


def _messages(ends: Sequence[Mapping[str, Any]], points: Sequence[Point[object]]) -> list[str]:
    failed = [point for point in points if not point.accepted]
    names = [*(end["reason"] for end in ends[-1:]), *(page for point in failed for page in pages_on(point.reason))]
    names += [str(point.quality) for point in failed]
    return list(dict.fromkeys(page_of(name) for name in names if page_of(name) not in UNEXPLAINED))


def _sensors(channels: Sequence[Mapping[str, Any]], day: str) -> list[dict[str, Any]]:
    keys = ("sensor", "serial_number", "sensitivity", "amplifier_gain", "calibrated", "calibration_due", "certificate")
    return [
        {
            "channel": one["name"],
            **{key: one.get(key) or None for key in keys},
            "overdue": bool(one.get("calibration_due")) and one["calibration_due"] < day,
        }
        for one in channels
        if one.get("serial_number") or one.get("calibrated") or one.get("calibration_due")
    ]


def _about(about: Mapping[str, Any] | None) -> dict[str, Any] | None:
    """Return the facts of a part without the values that a rehearsal foresaw, which `_beside_rehearsal` compares."""
    if about is None or "rehearsal" not in about:
        return None if about is None else dict(about)
    kept = {key: value for key, value in about["rehearsal"].items() if key != "foreseen"}
    return {**about, "rehearsal": kept}


def _beside_rehearsal(part: Part) -> dict[str, Any] | None:
    """Return where the points of a part lie within what its rehearsal foresaw; None without a rehearsal."""
    foreseen = (part.information.get("about") or {}).get("rehearsal", {}).get("foreseen")
    if foreseen is None:
        return None
    return asdict(compare(read_forecast(foreseen), [point_from(table) for table in part.points], part.end))


def _mode_shape(recording: Recording, points: Sequence[Point[object]], kind: str) -> dict[str, Any] | None:
    """Return the mode shape at the drive point that a model takes; None for kinds of campaigns that evaluate no damping.

    ``others`` are the numbers of points that were evaluated with another one, under an earlier plan.
    """
    if all(column.key != "damping_ratio" for column in CAMPAIGNS[kind].columns):
        return None
    shape = recorded_drive_shape(recording, points)
    own = shape.value if shape.measured else None
    others = [one.number for one in points if one.modal is not None and one.modal.drive_mode_shape != own]
    return {**asdict(shape), "text": str(shape), "others": others}


def _changes(recording: Recording) -> dict[int, list[str]]:
    plans = [plan_from(dict(said.plan), "plan of the recording").model_dump() for said in recording.plans]
    pairs = zip(recording.plans[1:], plans, plans[1:], strict=False)
    return {said.part: changed_keys(before, after) for said, before, after in pairs}


def _shown(point: StoredTable, kind: str) -> dict[str, Any]:
    """Return the stored form of a point without its harmonics. Keys that a failed point lacks are None."""
    expected = dict.fromkeys([*(column.key for column in CAMPAIGNS[kind].columns), *QUALITY])
    return {**expected, **{key: value for key, value in point.items() if key not in BULKY}}


def _loop(ends: Sequence[End], rows: int, rate_hz: float) -> dict[str, Any]:
    loops = [end["loop"] for end in ends]
    busy, wall = sum(loop["busy_s"] for loop in loops), sum(loop["wall_s"] for loop in loops)
    samples = sum(loop["samples"] for loop in loops)
    return {
        "samples": max(rows, samples),  # not all rows of a dwell are stored; of a killed part only rows are known
        "sample_rate_hz": rate_hz,
        "overruns": sum(loop["overruns"] for loop in loops),
        "periods": sum(loop["periods"] for loop in loops),
        "wall_s": wall,
        "by_the_clock": any("wake_up_us" in loop for loop in loops),
        "realtime_factor": samples / rate_hz / busy if busy > 0 else None,
        "end_to_end_factor": samples / rate_hz / wall if wall > 0 else None,
    }
