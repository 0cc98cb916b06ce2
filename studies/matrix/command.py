"""``rig doctor --matrix``: measure every way to run without a rig, and show it beside what others have measured."""

import sys
from pathlib import Path
from typing import Any

from rig.bench import Bench, load_bench
from rig.show.waiting import heard
from rig.text.console import print_json
from studies.matrix.measuring import device_row, matrix_rows
from studies.matrix.rows import read_rows, write_rows
from studies.matrix.table import print_matrix

MATRIX_BENCH = "magnet-beam"
"""Bench whose virtual rig is measured over every wire."""


def compare(
    device: tuple[Bench, dict[str, Any]] | None,
    others: list[Path],
    firmware: list[Path],
    verify: bool,
    output: Path | None,
    json: bool,
) -> None:
    """Measure every way, and show it with what others have measured; ``device``: a bench and what was found of its device."""
    theirs = [row for path in others for row in read_rows(path)]
    rows = [] if device is None else [device_row(*device)]
    for row in matrix_rows(load_bench(MATRIX_BENCH), firmware, verify=verify):
        rows.append(row)
        print(f"measured: {row.way}", file=sys.stderr, flush=True)
        heard()
    if output is not None:
        write_rows(output, rows)
    if json:
        print_json({"row": [row.model_dump(mode="json", exclude_none=True) for row in [*rows, *theirs]]})
    else:
        print_matrix([*rows, *theirs])


def write_device(device: tuple[Bench, dict[str, Any]], output: Path) -> None:
    """Write the row of a bench and of what was found of its device."""
    write_rows(output, [device_row(*device)])
