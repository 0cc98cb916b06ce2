"""The chapter on a recording: its facts, its plan, its figure, every point, what was refused and why, its loop."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rig.campaigns.evaluation.point import Point, point_name
from rig.check.findings import is_check
from rig.recording.reader import Recording
from rig.report.document import Block, Chapter, Section, Table, Text, blocks_of
from rig.report.facts import (
    bench_section,
    endings,
    files_and_versions,
    files_of,
    plan_section,
    safety_section,
    subject_section,
    table_of_files,
)
from rig.report.pictures import Pictures
from rig.show.loop_table import print_loop
from rig.show.point_table import attempts_refused, point_rows, points_from, shown_columns
from rig.show.summary import summarise_recording
from rig.show.tables import loop_line, print_findings, print_rehearsal
from rig.text.console import collected, number
from rig.text.levels import level_text


def recording_chapter(path: Path, pictures: Pictures) -> Chapter:
    """Return all that a report says of a recording; raise `RecordingError` if it cannot be read."""
    with Recording(path) as recording:
        if is_check(recording):
            return _check(recording, pictures)
        summary = summarise_recording(recording)
        points = points_from(recording.kind, summary["points"])
        accepted = sum(point.accepted for point in points)
        lead = [
            Text(
                f"{accepted} of {summary['points_planned']} points accepted. How it ended: {'; '.join(endings(recording))}.",
                "good" if recording.complete and accepted == summary["points_planned"] else "bad",
            )
        ]
        caption = f"The {recording.kind} test, as rig plot draws it."
        return Chapter(
            f"{recording.kind} of {summary['specimen'] or 'an unnamed specimen'}",
            str(path),
            [*lead, *_advice(summary["parts"])],
            [
                subject_section(recording),
                Section("Figure", [pictures.of_file(path, caption)]),
                Section("Points", _points(recording.kind, points, summary)),
                Section("What was refused, and why", _refused(points, summary)),
                bench_section(recording),
                safety_section(recording),
                Section("Rehearsal", _rehearsal(summary["parts"])),
                plan_section(recording),
                Section("How the loop kept its time", _loop(path, summary, pictures)),
                files_and_versions(recording, table_of_files(files_of(path))),
            ],
        )


def point_table(kind: str, points: Sequence[Point[object]], caption: str) -> Table:
    """Return the table of points that `rig show` prints; where all levels have one unit, it stands in the heading."""
    columns = shown_columns(kind, points)
    rows = point_rows(points, columns)
    units = {row[2] for row in rows}
    headings = ["point", "level", "", *(f"{one.heading}\n{one.unit}" for one in columns), "settled", "quality"]
    if len(units) == 1:
        headings[1:3] = [f"level\n{units.pop()}"]
        rows = [(*row[:2], *row[3:]) for row in rows]
    return Table(caption, headings, rows, frozenset(i for i, point in enumerate(points) if not point.accepted))


def _points(kind: str, points: Sequence[Point[object]], summary: Mapping[str, Any]) -> list[Block]:
    if not points:
        return [Text("No point was measured.", "note")]
    table = point_table(kind, points, "Every point of the plan, by its last measurement")
    blocks: list[Block] = [table]
    if any("+-" in heading for heading in table.headings):
        blocks.append(Text("± is the 95 % interval of the value on its left: 1.96 standard errors.", "note"))
    with collected() as printed:
        print_findings({**summary, "skipped": "", "measured_again": ""})
    blocks += blocks_of(printed, "")
    repeats = [point_name(point.number) for point in points if point.repeats_first]
    blocks += [Text(f"{name} repeats the first, for the drift.", "note") for name in repeats]
    former = points_from(kind, summary["former_points"])
    if former:
        blocks.append(point_table(kind, former, "No longer asked for by the plan, and not used"))
    return blocks


def _refused(points: Sequence[Point[object]], summary: Mapping[str, Any]) -> list[Block]:
    blocks: list[Block] = [Text(line) for line in (summary["skipped"], summary["measured_again"]) if line]
    refused = [point for point in points if not point.accepted]
    if refused:
        rows = [
            (point_name(p.number), level_text(p.level, p.level_unit), str(p.quality), p.reason or str(p.quality))
            for p in refused
        ]
        blocks.append(Table("Points that are not used", ("point", "level", "quality", "why"), rows))
    blocks += [Text(line, "note") for point in points for line in attempts_refused(point)]
    if not blocks:
        blocks.append(Text("No point was refused, and none was measured twice."))
    warned = [(point_name(point.number), text) for point in points for text in point.warnings or ()]
    if warned:
        blocks.append(Table("Warnings on points", ("point", "warning"), warned))
    return blocks


def _advice(parts: Sequence[Mapping[str, Any]]) -> list[Block]:
    return [
        Text(f"{name}: {part[key]}", "bad")
        for part in parts
        if part.get("likely_cause")
        for key, name in (("likely_cause", "Likely cause"), ("what_to_do", "What to do"))
    ]


def _rehearsal(parts: Sequence[Mapping[str, Any]]) -> list[Block]:
    with collected() as printed:
        for part in parts:
            print_rehearsal((part["about"] or {}).get("rehearsal"), part.get("beside_rehearsal"))
    return blocks_of(printed, "")


def _loop(path: Path, summary: Mapping[str, Any], pictures: Pictures) -> list[Block]:
    blocks: list[Block] = [Text(loop_line(summary["loop"]))]
    rows = [
        (
            str(n),
            str(part["rows"]),
            part["ended"] or "cut short",
            number((part["loop"] or {}).get("overruns"), ".0f"),
            ", ".join(f"{name.replace('_', ' ')} {count}" for name, count in (part["counters"] or {}).items() if count)
            or "none",
            ", ".join(part["changed"]) or "-",
        )
        for n, part in enumerate(summary["parts"], 1)
    ]
    headings = ("part", "rows", "how it ended", "overruns", "what was counted, samples", "changed in the plan")
    blocks.append(Table("Parts of the recording", headings, rows))
    blocks += [
        Text(f"part {n}: not readable: {p['lost']}", "bad") for n, p in enumerate(summary["parts"], 1) if p["lost"]
    ]
    for n, part in enumerate(summary["parts"], 1):
        with collected() as printed:
            print_loop(part["loop"] or {}, part["counters"] or {})
        blocks += blocks_of(printed, f"Part {n}: times of a block")
    if summary["loop"]["by_the_clock"]:
        blocks.append(pictures.of_file(path, "Times of the loop's blocks.", lateness=True))
    else:
        blocks.append(Text("No clock paced this loop: it ran as fast as the computer could.", "note"))
    return blocks


def _check(recording: Recording, pictures: Pictures) -> Chapter:
    from rig.check.assessment import assess  # it needs scipy

    found = assess(recording)
    tests = found.findings
    marked = frozenset(i for i, one in enumerate(tests) if one.verdict == "fail")
    findings = Table(
        "Every test of the check",
        ("what", "channel", "verdict", "value", "unit", "allowed"),
        [(f.name, f.channel, f.verdict, number(f.value, ".4g"), f.unit, f.allowed) for f in tests],
        marked,
    )
    advice: list[Block] = [
        Text(f"{one.verdict}: {one.label}: {one.text}", "note") for one in tests if one.text and one.verdict != "ok"
    ]
    return Chapter(
        f"check of {found.bench.specimen.name or 'an unnamed specimen'}",
        str(recording.path),
        [Text(f"Verdict: {found.verdict}.", "bad" if found.failed else "good")],
        [
            subject_section(recording),
            Section("Findings", [findings, *advice]),
            Section("Figure", [pictures.of_file(recording.path, "The check.")]),
            bench_section(recording),
            safety_section(recording),
            plan_section(recording),
            files_and_versions(recording, table_of_files(files_of(recording.path))),
        ],
    )
