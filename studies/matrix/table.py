"""Rows of the matrix as a table of text."""

from collections.abc import Sequence

from rig.text.console import number, print_table
from studies.matrix.rows import Row

HEADINGS = (
    *("way", "rate Hz", "reached Hz", "highest Hz", "block", "queue", "latency ms", "late p99.9 ms", "latest ms"),
    *("held", "lost", "step mV", "watchdog s", "0 V after s", "suite", "on"),
)
LEGEND = (
    "late: how late blocks came; held, lost: blocks with held outputs, and lost, of those exchanged; step: the smallest",
    "between two readings, of the coarsest channel; 0 V after: after the last output, seen, or (r) as the device reports",
    "its watchdog; suite: duties kept/failed/not applicable",
)


def print_matrix(rows: Sequence[Row]) -> None:
    """Print rows as a table, then where and when they were measured, what failed, and duties that were not kept."""
    places = list(dict.fromkeys(_place(row) for row in rows))
    print_table(HEADINGS, [[*_cells(row), f"[{1 + places.index(_place(row))}]"] for row in rows])
    print()
    for line in LEGEND:
        print(line)
    for index, place in enumerate(places, start=1):
        print(f"[{index}] {place}")
    for row in rows:
        for text in (row.failure, *(row.verified.failures if row.verified else ())):
            if text:
                print(f"{row.way}: {text}")


def _place(row: Row) -> str:
    """Return where, when and with what a row was measured."""
    verified = f", suite {row.verified.utc[:10]}" if row.verified else ""
    return f"{row.machine}; vibrolock {row.version}; bench {row.bench}; {row.utc[:10]}{verified}"


def _cells(row: Row) -> list[str]:
    def whole(count: int | None, of: int | None = None) -> str:
        return "-" if count is None else f"{count}" if not of or not count else f"{count} of {of}"

    suite = row.verified
    return [
        row.way,
        number(row.sample_rate_hz, "g"),
        number(row.reached_hz, ".0f"),
        number(row.largest_rate_hz, "g"),
        whole(row.block),
        whole(row.queue_blocks),
        number(row.latency_ms, ".2f"),
        number(row.late_p99_9_ms, ".2f"),
        number(row.late_largest_ms, ".2f"),
        whole(row.held_blocks, row.blocks),
        whole(row.lost_blocks, row.blocks),
        number(max(row.resolution_mv.values(), default=None), ".3g"),
        number(row.watchdog_s, "g"),
        _to_0v(row),
        "not run" if suite is None else f"{suite.passed}/{suite.failed}/{suite.not_applicable}",
    ]


def _to_0v(row: Row) -> str:
    if row.to_0v_s is not None:
        return f"{row.to_0v_s:.3f}"
    if row.to_0v == "reported":
        return f"{number(row.watchdog_s, 'g')} (r)"
    return "at once" if row.to_0v else "-"
