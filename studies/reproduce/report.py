"""Report of a study as text, and its tables as JSON and CSV files."""

import csv
import io
import json

from identification.models import SAME_LEVEL
from rig.errors import RecordingError
from rig.results.predictions.table import CUT
from rig.system.text_files import read_text
from rig.text.column import Column
from rig.text.console import finite, number, print_rows, print_table
from studies.reproduce.folder import write_json
from studies.reproduce.options import Options
from studies.reproduce.study import Study


def write_tables(study: Study) -> None:
    """Write ``table.json`` with everything and ``errors.csv`` with the error tables; raise `RecordingError` if this fails."""
    summary = study.summary()
    write_json(study.options.result("table.json"), finite(summary))
    text = io.StringIO()
    errors = [
        {"variant": variant, **error, "model": error["model"] or "all"}
        for variant, of_all in summary["errors"].items()
        for error in of_all
    ]
    rows = csv.DictWriter(text, list(dict.fromkeys(key for row in errors for key in row)), lineterminator="\n")
    rows.writeheader()
    rows.writerows(errors)
    path = study.options.result("errors.csv")
    try:
        path.write_text(text.getvalue(), encoding="utf-8")
    except OSError as error:
        raise RecordingError(f"{path}: cannot be written: {error.strerror}") from None


def say_study(study: Study) -> None:
    """Print the results for a person."""
    options = study.options
    scatter = f", {100 * options.scatter:g} % scatter from run to run" if options.scatter else ""
    print(f"{options.specimen.name}, models {options.variant}{scatter}")
    print(study.table.text())
    print()
    _say_variants(study)
    _say_times(study)
    if study.steady:
        _say_steady(study)
    if study.sweeps:
        _say_sweeps(study)
    _say_others(options)


def _say_variants(study: Study) -> None:
    """Print the errors of the variants that need no further fit, over all models."""
    print("what else the fits offer, all models:")
    rows = []
    for name, table in study.tables.items():
        for training_set in table.training_sets:
            cells = [table.cell(training_set, test) for test in (SAME_LEVEL, *table.levels)]
            rows.append([name, training_set, *(str(cell) for cell in cells)])
    print_table(["model", "trained at", SAME_LEVEL, *study.table.levels], rows)
    print()


def _say_times(study: Study) -> None:
    print_rows(
        study.models.times(),
        Column("training_set", "trained at"),
        Column("models", "models"),
        Column("seconds_mean", "s a model", pattern=".1f"),
        Column("seconds_most", "at most s", pattern=".1f"),
        Column("iterations_mean", "iterations", pattern=".0f"),
        Column("seconds_per_iteration", "s an iteration", pattern=".3f"),
        Column("chosen_mean", "chosen", pattern=".0f"),
    )
    print()


def _say_steady(study: Study) -> None:
    print("steady peaks of the selected models against the rig's own:")
    rows: list[tuple[str, ...]] = []
    incomplete: list[str] = []
    for one in study.steady:
        row = one.row()
        whole = row["error"] is not None or row["peak_m"] is None
        rows.append(
            (
                row["training_set"],
                one.truth.text,
                row["held"],
                number(row["truth_m"], ".4f", 1e3),
                ("" if whole else ">= ") + number(row["peak_m"], ".4f", 1e3),
                number(row["error"], "+.1f", 100.0),
                number(row.get("frequency_error"), "+.3f", 100.0),
                number(row["range_use"], ".2f"),
                "" if row["complete"] else f"({len(incomplete) + 1})",
            )
        )
        if not row["complete"]:
            incomplete.append(next((note for note in row["notes"] if note.startswith(CUT)), row["notes"][-1]))
    print_table(("trained at", "level", "held", "rig mm", "model mm", "error %", "frequency %", "range use", ""), rows)
    for index, note in enumerate(incomplete, 1):
        print(f"({index}) {note}")
    print()


def _say_sweeps(study: Study) -> None:
    print("sweeps simulated by the selected models, drive channel:")
    rows = [one.row() for one in study.sweeps]
    for row in rows:
        row["lost"] = f"unbounded from {row['unbounded_at_s']:.2f} s on" if row["unbounded"] else ""
    print_rows(
        rows,
        Column("sweep", "sweep"),
        Column("training_set", "trained at"),
        Column("from", "from"),
        Column("peak_measured", "peak", "m/s^2", ".3f"),
        Column("peak_error", "peak error", "%", "+.1f", 100.0),
        Column("rms_error", "RMS error", "%", ".1f", 100.0),
        Column("range_use", "range use", pattern=".2f"),
        Column("lost", ""),
    )
    print()


def _say_others(options: Options) -> None:
    """Print the same errors for other kinds of models of these recordings, if they are in the folder."""
    rows = []
    for path in sorted(options.folder.glob("*/table.json")):
        try:
            found = json.loads(read_text(path, 10_000_000, RecordingError))["errors"]
            found = next(iter(found.values()))
        except (RecordingError, RecursionError, ValueError, KeyError, TypeError, AttributeError, StopIteration):
            continue
        for row in found:
            if row["model"] is None:
                mean, unbounded = number(row["mean"], ".2f", 100.0), f"{row['unbounded_runs']} of {row['runs']}"
                rows.append((path.parent.name, row["training_set"], row["test"], mean, unbounded))
    if len({row[0] for row in rows}) > 1:
        print("all kinds of models in this folder:")
        print_table(("models", "trained at", "tested at", "mean error %", "unbounded"), rows)
