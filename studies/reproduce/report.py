"""Report of a study as text, and its tables as JSON and CSV files."""

import csv
import io
import json

from identification.models import SAME_LEVEL
from rig.errors import RecordingError
from rig.results.predictions.table import CUT
from rig.system.text_files import read_text
from rig.text.console import finite, number, print_table
from studies.reproduce.folder import write_json
from studies.reproduce.options import Options
from studies.reproduce.study import Study

_ERROR_COLUMNS = (
    "variant",
    "training_set",
    "test",
    "model",
    "mean",
    "standard_deviation",
    "largest",
    "models",
    "runs",
    "unbounded_runs",
    "unbounded_models",
    "range_use",
)


def write_tables(study: Study) -> None:
    """Write ``table.json`` with everything and ``errors.csv`` with the error tables; raise `RecordingError` if this fails."""
    summary = study.summary()
    write_json(study.options.result("table.json"), finite(summary))
    text = io.StringIO()
    rows = csv.DictWriter(text, _ERROR_COLUMNS, lineterminator="\n")
    rows.writeheader()
    for variant, errors in summary["errors"].items():
        for error in errors:
            rows.writerow({"variant": variant, **error, "model": error["model"] or "all"})
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
    print_table(
        ("trained at", "models", "s a model", "at most s", "iterations", "s an iteration", "chosen"),
        [
            (
                row["training_set"],
                str(row["models"]),
                number(row["seconds_mean"], ".1f"),
                number(row["seconds_most"], ".1f"),
                number(row["iterations_mean"], ".0f"),
                number(row["seconds_per_iteration"], ".3f"),
                number(row["chosen_mean"], ".0f"),
            )
            for row in study.models.times()
        ],
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
    rows = []
    for row in (one.row() for one in study.sweeps):
        rows.append(
            (
                row["sweep"],
                row["training_set"],
                row["from"],
                number(row["peak_measured"], ".3f"),
                number(row["peak_error"], "+.1f", 100.0),
                number(row["rms_error"], ".1f", 100.0),
                number(row["range_use"], ".2f"),
                f"unbounded from {row['unbounded_at_s']:.2f} s on" if row["unbounded"] else "",
            )
        )
    print_table(("sweep", "trained at", "from", "peak m/s^2", "peak error %", "RMS error %", "range use", ""), rows)
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
                rows.append(
                    (
                        path.parent.name,
                        row["training_set"],
                        row["test"],
                        number(row["mean"], ".2f", 100.0),
                        f"{row['unbounded_runs']} of {row['runs']}",
                    )
                )
    if len({row[0] for row in rows}) > 1:
        print("all kinds of models in this folder:")
        print_table(("models", "trained at", "tested at", "mean error %", "unbounded"), rows)
