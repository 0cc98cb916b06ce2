"""Print summaries for a person: how a run ended, tables of recordings, models and measurements."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rig.arming.run_facts import About, user_name
from rig.campaigns.evaluation.point import Point, point_name
from rig.check import report as check_report
from rig.daq import CONTINUED
from rig.recording.integrity import VERIFIED
from rig.results.kinds import KINDS
from rig.show.loop_table import print_loop
from rig.show.point_table import attempts_refused, point_rows, points_from, shown_columns
from rig.show.point_warnings import notes_together, warnings_together, what_warnings_mean
from rig.text.console import number, print_table
from rig.text.disorder import LATE_BLOCKS, LATE_FRAMES, OUT_OF_ORDER_FRAMES, REORDERED_BLOCKS, disorder_text
from rig.text.message_pages import where_explained
from vibrolock.printable import printable, printable_strings

_OWN_UNITS = (
    *("frames", "blocks", "lines", "bytes", "errors"),
    *("answers", "retries", "interruptions", "versions", "malformed", "resynchronised"),
)
"""Ends of the names of counters that do not count samples."""


def say_how_it_ended(summary: dict[str, Any], path: Path, pure_plan: str = "") -> None:
    """Print how a run ended, its results, its speed, and its warnings; ``pure_plan``: how a force without harmonics is made."""
    summary = printable_strings(summary)
    path = Path(printable(str(path)))
    loop = summary["loop"]
    accepted = sum(point["accepted"] for point in summary["points"])
    pace = f", {_pace(loop)} in the loop" if loop["realtime_factor"] and not loop["by_the_clock"] else ""
    ended = summary["parts"][-1]["ended"] if summary["parts"] else "nothing recorded"
    print(f"{ended}: {accepted} of {summary['points_planned']} points accepted, {loop['samples']} samples{pace}")
    for line in (summary["skipped"], summary["measured_again"]):
        if line:
            print(line)
    points = points_from(summary["kind"], summary["points"])
    print_warnings(points)
    last = summary["parts"][-1] if summary["parts"] else {"tripped": False}
    _print_advice(last)
    _print_where_explained(summary)
    if last["tripped"] and not summary["complete"]:
        print(
            f"what was accepted is kept; then `rig resume {path} --plan PLAN.toml` continues with a changed plan, "
            f"`rig resume {path} --retry-tripped` by the same"
        )
    elif not summary["complete"]:
        print(
            f"what was accepted is kept; `rig resume {path}` measures the rest, with --plan PLAN.toml by a changed plan"
        )
    for line in _counted(summary["counters"]):
        print(line)
    if meaning := what_warnings_mean(points, pure_plan):
        print(f"note: {meaning}")


def _counted(counters: Mapping[str, int]) -> list[str]:
    order = (OUT_OF_ORDER_FRAMES, REORDERED_BLOCKS, LATE_FRAMES, LATE_BLOCKS)
    out = []
    for name, count in counters.items():
        if count and name == CONTINUED:
            out.append(f"note: outputs came too late in {count} samples; the device went on with the vibration")
        elif count and name not in order:
            unit = "" if name.endswith(_OWN_UNITS) else " samples"
            out.append(f"warning: {name.replace('_', ' ')}: {count}{unit}")
    disorder = disorder_text(counters)
    return [*out, f"warning: {disorder}"] if disorder else out


def _pace(loop: Mapping[str, Any]) -> str:
    """Return how fast the loop was; one that a clock paces is neither quick nor slow."""
    return "by the clock" if loop["by_the_clock"] else f"{loop['realtime_factor']:.0f} times real time"


def loop_line(loop: Mapping[str, Any]) -> str:
    """Return samples, periods, overruns and speed of the loop of a recording in one line."""
    line = f"{loop['samples']} samples at {loop['sample_rate_hz']:g} Hz"
    if loop["realtime_factor"] is not None:
        line += f", {loop['periods']} periods, {loop['overruns']} overruns, {_pace(loop)}"
    return line


def print_findings(summary: Mapping[str, Any]) -> None:
    """Print what concerns all points of a recording: skipped and repeated ones, drift, the mode shape of the damping."""
    for line in (summary["skipped"], summary["measured_again"]):
        if line:
            print(line)
    _print_drift(summary["drift"])
    _print_mode_shape(summary["drive_mode_shape"])
    _print_where_explained(summary)


def print_summary(summary: dict[str, Any]) -> None:
    """Print the summary of a file, as returned by `rig.show.summary.summarise`."""
    summary = printable_strings(summary)
    if summary["integrity"] != VERIFIED:
        print(summary["integrity"])
    if summary["kind"] == "check":
        check_report.print_summary(check_report.CheckSummary.model_validate(summary))
        return
    print(f"{summary['kind']} of {summary['specimen'] or 'an unnamed specimen'}")
    if summary["kind"] in KINDS:
        KINDS[summary["kind"]].say(summary)
        for note in summary["notes"]:
            print(f"note: {note}")
        return
    print(f"bench {summary['bench']}, started {summary['started']}, seed {summary['seed']}")
    print_points(summary["kind"], summary["points"])
    print_findings(summary)
    if summary["former_points"]:
        print(f"no longer asked for by the plan, and not used: {len(summary['former_points'])}")
        print_points(summary["kind"], summary["former_points"])
    for sensor in summary["sensors"]:
        print(f"sensor of {sensor['channel']}: {_sensor_line(sensor)}")
    print(f"loop: {loop_line(summary['loop'])}")
    for number_shown, part in enumerate(summary["parts"], 1):
        changed = f"; changed in the plan: {', '.join(part['changed'])}" if part["changed"] else ""
        print(f"part {number_shown}: {part['rows']} rows, {part['ended'] or 'cut short'}{changed}")
        if part["lost"]:
            print(f"  not readable: {part['lost']}")
        _print_advice(part)
        _print_about(part["about"] or {})
        print_rehearsal((part["about"] or {}).get("rehearsal"), part.get("beside_rehearsal"))
        print_loop(part["loop"] or {}, part["counters"] or {})


def _sensor_line(sensor: Mapping[str, Any]) -> str:
    told = {"serial_number": "no.", "calibrated": "calibrated", "calibration_due": "due", "certificate": "certificate"}
    facts = {key: value for key, value in sensor.items() if value and key not in ("channel", "overdue")}
    line = ", ".join(f"{told.get(key, '')} {value}".lstrip() for key, value in facts.items())
    return line + (" (overdue)" if sensor["overdue"] else "")


def _print_advice(part: Mapping[str, Any]) -> None:
    if part.get("likely_cause"):
        print(f"  likely cause: {part['likely_cause']}\n  what to do: {part['what_to_do']}")


def _print_where_explained(summary: Mapping[str, Any]) -> None:
    if pages := where_explained(summary["messages"]):
        print(f"  {pages}")


def _print_drift(drift: dict[str, Any] | None) -> None:
    if drift is None:
        return
    told = [
        f"{name} {number(drift[name], pattern, 100.0)} %"
        for name, pattern in (("frequency", "+.4f"), ("damping", "+.2f"), ("amplitude", "+.2f"))
    ]
    print(f"drift from the first point to the same again ({point_name(drift['again'])}): {', '.join(told)}")


def _print_mode_shape(shape: dict[str, Any] | None) -> None:
    if shape is None:
        return
    print(shape["text"])
    if shape["others"]:
        print(
            f"evaluated with the value of an earlier plan: {', '.join(map(point_name, shape['others']))}; a model takes the "
            "above for all points"
        )


def _print_about(about: dict[str, Any]) -> None:
    """Print operator, specimen and device of a part if anything was noted or a physical rig has moved."""
    armed = about.get("armed", {})
    said = [name for name in (*About.single(), "notes", "remarks") if name != "operator"]
    told = any(about.get(name) for name in said)
    if not told and armed.get("how", "virtual") == "virtual" and about.get("operator") == user_name():
        return
    for name in About.single():
        if about.get(name):
            print(f"  {name.replace('_', ' ')}: {about[name]}")
    if armed.get("how", "virtual") != "virtual":
        print(f"  armed: {armed['how']}, {armed['by']}, {armed['at']}")
    if about.get("device"):
        print(f"  device: {', '.join(f'{key} {value}' for key, value in about['device'].items())}")
    for line in [*armed.get("cautions", ()), *about.get("remarks", ()), *about.get("notes", ())]:
        print(f"  {line}")


def print_rehearsal(rehearsal: Mapping[str, Any] | None, beside: Mapping[str, Any] | None) -> None:
    """Print what a rehearsal had promised, who overrode what, and where the run left what was foreseen."""
    if not rehearsal:
        return
    if "digest" in rehearsal:
        print(
            f"  rehearsed: ends well {100.0 * rehearsal['ends_well']:.3g} %, trips {100.0 * rehearsal['trips']:.3g} % (up to "
            f"{100.0 * rehearsal['trips_at_most']:.2g} %) of {rehearsal['draws']} draws; {rehearsal['file']}, digest "
            f"{rehearsal['digest']}"
        )
    if overridden := rehearsal.get("overridden"):
        print(f"  overridden by {overridden['by']}: {overridden['why']} (against it: {overridden['against']})")
    for finding in (beside or {}).get("findings", ()):
        print(f"  FINDING {finding}")
    if beside is not None and not beside["findings"]:
        print("  the run lies within the forecast")


def print_points(kind: str, tables: Sequence[Mapping[str, Any]]) -> None:
    """Print a table of points, then their warnings. Points are counted from 1."""
    points = points_from(kind, tables)
    columns = shown_columns(kind, points)
    remarks = [point.reason or ("the first again" if point.repeats_first else "") for point in points]
    headings = ("point", "level", "", *(f"{column.heading} {column.unit}" for column in columns), "settled", "quality")
    rows = point_rows(points, columns)
    if any(remarks):
        headings = (*headings, "remark")
        rows = [(*row, remark) for row, remark in zip(rows, remarks, strict=True)]
    print_table(headings, rows)
    for point in points:
        for line in attempts_refused(point):
            print(f"note: {line}")
    print_warnings(points)


def print_warnings(points: Sequence[Point[object]]) -> None:
    """Print the warnings and notes on points, those that many points have once."""
    for line in warnings_together(points):
        print(f"warning: {line}")
    for line in notes_together(points):
        print(f"note: {line}")
