"""The chapters on a folder of `rig reproduce`: for each kind of models its errors beside the paper's, peaks, sweeps."""

import json
import shlex
from base64 import b64encode
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rig.errors import RecordingError
from rig.report.document import Block, Chapter, Facts, Picture, Section, Table, Text
from rig.report.facts import table_of_files
from rig.results.files import understood
from rig.system.text_files import read_bytes, read_text
from rig.text.column import Column
from rig.text.console import cells_of, number
from studies.report.paper import SAME_LEVEL, agreement

_OWN_LEVEL = "same level"
_LARGEST_BYTES = 10_000_000
_FIGURES = {
    "errors.png": "Every test of every model; the line is the mean of the bounded ones.",
    "steady.png": "Steady responses of the selected models, and of the rig itself.",
    "sweeps.png": "Sweeps simulated by the selected models, and as recorded.",
}


def study_chapters(folder: Path) -> list[Chapter]:
    """Return a chapter for each kind of models in a folder.

    Raises `RecordingError` if the folder holds no study, or a damaged one.
    """
    if not (folder / "study.json").is_file():
        raise RecordingError(
            f"{folder}: is a folder without study.json; allowed is a file, or a folder of rig reproduce"
        )
    study = _read(folder / "study.json")
    tables = sorted(folder.glob("*/table.json"))
    if not tables:
        raise RecordingError(f"{folder}: holds no results yet; the same rig reproduce again takes it up")
    with understood(folder, "study"):
        return [_chapter(folder, study, path.parent) for path in tables]


def _read(path: Path) -> dict[str, Any]:
    try:
        found = json.loads(read_text(path, _LARGEST_BYTES, RecordingError))
    except (ValueError, RecursionError) as error:
        raise RecordingError(f"{path}: damaged: is not JSON ({error})") from None
    if not isinstance(found, dict):
        raise RecordingError(f"{path}: damaged: holds no table")
    return found


def _chapter(folder: Path, study: Mapping[str, Any], results: Path) -> Chapter:
    table = _read(results / "table.json")
    errors = {name: list(rows) for name, rows in table["errors"].items()}
    own = [row for row in errors[next(iter(errors))] if row["model"] is None and row["test"] == _OWN_LEVEL]
    settings = results / "models.json"
    levels = len(_read(settings)["levels"]) if settings.is_file() else None
    files = [folder / "study.json", *(() if levels is None else (settings,)), results / "table.json"]
    return Chapter(
        f"The paper's campaign on {study['specimen']}: models {results.name}",
        str(results),
        [
            Text(
                "Multisines were recorded on a virtual rig. Polynomial nonlinear state-space models were identified from them, "
                "tested on realisations that they were not trained on, and asked for steady responses and sweeps, which are "
                "held against the rig's own."
            )
        ],
        [
            Section("How it was made", _made(study, table, levels)),
            Section("Errors beside the paper's", _beside_the_paper(str(study["specimen"]), own)),
            Section("Figures", _figures(results)),
            Section("Errors of all models and tests", [_errors(rows, name) for name, rows in errors.items() if rows]),
            Section("Steady peaks", _steady(table["steady"])),
            Section("Sweeps", _sweeps(table["sweeps"])),
            Section("Models that failed", [Text(f"{name}: {why}", "note") for name, why in table["failures"].items()]),
            Section("Files", [table_of_files(files)]),
        ],
    )


def _made(study: Mapping[str, Any], table: Mapping[str, Any], levels: int | None) -> list[Block]:
    """Return the command that makes the same study, its settings, and how long the fits took."""
    counts = [row["models"] for row in table["times"]]
    words = ["rig", "reproduce", str(study["specimen"]), "-o", "FOLDER", "--iterations", str(table["iterations"])]
    words += ["--models", str(max(counts, default=1))]
    for name, plain in (("scatter", 0.0), ("seed", 0), ("saturating", 0), ("input", "force")):
        words += [] if table[name] == plain else [f"--{name}", str(table[name])]
    words += ["--states", str(table["states"]), "--channel", str(table["output"])]
    for name in table.get("beside", ["backbone-fine"] if table.get("with_backbone") else []):
        words += ["--beside", name]
    words += [] if table["realisations"] is None else ["--realisations", str(table["realisations"])]
    words += [] if levels is None else ["--levels", str(levels)]
    for part in ("steady", "sweeps"):
        words += [] if table[part] else ["--without", part]
    fits = _table(
        "Fits",
        table["times"],
        Column("training_set", "trained at"),
        Column("models", "models"),
        Column("seconds_mean", "time a model\ns", pattern=".1f"),
        Column("seconds_most", "longest\ns", pattern=".1f"),
        Column("iterations_mean", "iterations", pattern=".0f"),
        Column("chosen_mean", "iterate chosen", pattern=".0f"),
    )
    facts = [
        ("command", shlex.join(words)),
        ("bench", str(study["bench"]["name"])),
        ("seed", str(study["seed"])),
        ("scatter of modal frequencies", f"{100 * float(study['scatter']):g} %"),
    ]
    return [Facts("", facts), fits]


def _table(caption: str, rows: Sequence[Mapping[str, Any]], *columns: Column) -> Table:
    return Table(caption, [column.title for column in columns], [cells_of(row, columns) for row in rows])


def _beside_the_paper(specimen: str, own: Sequence[Mapping[str, Any]]) -> list[Block]:
    paper = SAME_LEVEL.get(specimen, {})
    rows = [
        (
            row["training_set"],
            str(row["models"]),
            _error(row),
            str(paper.get(row["training_set"], "-")),
            agreement(row, paper.get(row["training_set"])),
        )
        for row in own
    ]
    headings = ("trained at", "models", "here", "paper", "agreement")
    caption = "Relative error at the level of the training: mean and, in brackets, standard deviation over the models"
    return [
        Table(caption, headings, rows),
        Text(
            "The paper's numbers are of one accelerometer of a real rig; those here are of a virtual one, which is the same in "
            "every run unless there is scatter.",
            "note",
        ),
    ]


def _error(row: Mapping[str, Any]) -> str:
    text = f"{number(row['mean'], '.2f', 100.0)} %" if row["mean"] is not None else ""
    if row["standard_deviation"] is not None:
        text += f" ({number(row['standard_deviation'], '.2f', 100.0)} %)"
    if row["unbounded_runs"]:
        text = "; ".join(filter(None, (f"unbounded {row['unbounded_runs']} of {row['runs']}", text)))
    return text or "-"


def _errors(rows: Sequence[Mapping[str, Any]], name: str) -> Table:
    """Return the error table of a variant: one row for each test, one column for each training set."""
    of_all = [row for row in rows if row["model"] is None]
    sets = list(dict.fromkeys(row["training_set"] for row in of_all))
    cells = {(row["test"], row["training_set"]): _error(row) for row in of_all}
    tests = list(dict.fromkeys(row["test"] for row in of_all))
    body = [(test, *(cells.get((test, trained), "") for trained in sets)) for test in tests]
    return Table(f"Relative errors: {name}", ("tested at", *(f"trained at\n{one}" for one in sets)), body)


def _steady(rows: Sequence[Mapping[str, Any]]) -> list[Block]:
    if not rows:
        return []
    body = []
    for row in rows:
        force = "-" if row["force_n"] is None else f"{row['force_n']:g} N"
        body.append({"frequency_error": None, **row, "force": force})
    peaks = _table(
        "Peaks of the selected models against the rig's own",
        body,
        Column("training_set", "trained at"),
        Column("force", "force"),
        Column("held", "held"),
        Column("truth_m", "rig\nmm", "", ".4f", 1e3),
        Column("peak_m", "model\nmm", "", ".4f", 1e3),
        Column("error", "error\n%", "", "+.1f", 100.0),
        Column("frequency_error", "frequency\n%", "", "+.3f", 100.0),
        Column("range_use", "range use", "", ".2f"),
    )
    lost = [
        f"trained at {row['training_set']}, {row['held']}: {row['notes'][-1]}" for row in rows if not row["complete"]
    ]
    return [peaks, *(Text(one, "note") for one in lost)]


def _sweeps(rows: Sequence[Mapping[str, Any]]) -> list[Block]:
    if not rows:
        return []
    body = [
        (
            row["sweep"],
            row["training_set"],
            row["from"],
            number(row["peak_measured"], ".3f"),
            "unbounded" if row["unbounded"] else number(row["peak_error"], "+.1f", 100.0),
            number(row["rms_error"], ".1f", 100.0),
            number(row["range_use"], ".2f"),
        )
        for row in rows
    ]
    headings = ("sweep", "trained at", "from", "peak\nm/s^2", "peak error\n%", "RMS error\n%", "range use")
    return [Table("Sweeps simulated by the selected models", headings, body)]


def _figures(results: Path) -> list[Block]:
    found: list[Block] = []
    for name, caption in _FIGURES.items():
        if (results / name).is_file():
            picture = b64encode(read_bytes(results / name, _LARGEST_BYTES, RecordingError)).decode()
            found.append(Picture(caption, source=f"data:image/png;base64,{picture}"))
    return found
