"""Summaries as a person reads them: one line on how a run ended, tables of recordings, models and measurements."""

from typing import Any

from rig.campaigns.kinds import KINDS
from rig.console import number, print_table

__all__ = ["print_summary", "say_how_it_ended"]


def say_how_it_ended(summary: dict[str, Any]) -> None:
    """How a run ended, what it made, how fast it was, and what was counted on the way."""
    loop = summary["loop"]
    accepted = sum(point["accepted"] for point in summary["points"])
    factor = loop["realtime_factor"]
    pace = f", {factor:.0f} times real time in the loop" if factor else ""
    ended = summary["parts"][-1]["ended"] if summary["parts"] else "nothing recorded"
    print(f"{ended}: {accepted} of {summary['points_planned']} points accepted, {loop['samples']} samples{pace}")
    if not summary["complete"]:
        print("what was accepted is kept; `rig resume` measures the rest")
    for name, count in summary["counters"].items():
        if count:
            print(f"warning: {name.replace('_', ' ')}: {count} samples")


def print_summary(summary: dict[str, Any]) -> None:
    """What `rig.summary.summarise` found in a file."""
    if "responses" in summary:
        print(f"{summary['kind']}: {len(summary['responses'])} levels")
        print_table(
            ("level", "samples", "from Hz", "to Hz"),
            [
                (r["label"], str(r["samples"]), number(r["lowest_hz"], ".2f"), number(r["highest_hz"], ".2f"))
                for r in summary["responses"]
            ],
        )
        return
    print(f"{summary['kind']} of {summary['specimen'] or 'an unnamed specimen'}")
    if "loop" not in summary:
        _print_mode(summary)
        return
    loop = summary["loop"]
    print(f"bench {summary['bench']}, started {summary['started']}, seed {summary['seed']}")
    columns = KINDS[summary["kind"]].columns
    print_table(
        ("level", "", *(f"{column.heading} {column.unit}" for column in columns), "settled", "quality"),
        [
            (
                f"{p['level']:.4g}",
                p["level_unit"],
                *(number(p[column.key], column.pattern, column.scale) for column in columns),
                {True: "yes", False: "no", None: "-"}[p["settled"]],
                "ok" if p["accepted"] else p["reason"],
            )
            for p in summary["points"]
        ],
    )
    for p in summary["points"]:
        for warning in p["warnings"] or ():
            print(f"warning: point {p['number']}: {warning}")
    line = f"loop: {loop['samples']} samples at {loop['sample_rate_hz']:g} Hz"
    if loop["realtime_factor"] is not None:
        factor = f"{loop['realtime_factor']:.0f} times real time"
        line += f", {loop['periods']} periods, {loop['overruns']} overruns, {factor}"
    print(line)
    for index, part in enumerate(summary["parts"]):
        print(f"part {index}: {part['rows']} rows, {part['ended'] or 'cut short'}")


def _print_mode(summary: dict[str, Any]) -> None:
    print_table(
        ("force N", "amplitude mm", "modal frequency Hz", "+-", "damping %", "+-", "all harmonics %", "phase lag deg"),
        [
            (
                number(p["force_n"], ".4f"),
                number(p["amplitude_m"], ".5f", 1e3),
                number(p["modal_frequency_hz"], ".4f"),
                number(p["modal_frequency_std_hz"], ".4f", 1.96),
                number(p["damping_ratio"], ".4f", 100.0),
                number(p["damping_ratio_std"], ".4f", 196.0),
                number(p["damping_ratio_total_power"], ".4f", 100.0),
                number(p["phase_lag_deg"], ".2f"),
            )
            for p in summary["points"]
        ],
    )
    print(f"frequency, last point over first: {100.0 * summary['frequency_shift']:+.2f} %")
    for note in summary["notes"]:
        print(f"note: {note}")
