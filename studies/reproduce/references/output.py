"""What a reference study leaves: a table for a person, the same as JSON, its models and a figure."""

from pathlib import Path
from typing import Any

from rig.results.files import save
from rig.text.console import number, print_table
from studies.reproduce.folder import begin, write_json
from studies.reproduce.references.data import DataSet
from studies.reproduce.references.figure import draw_reference
from studies.reproduce.references.result import OURS, Line, StudyResult

RESULTS = "reference.json"


def prepared(folder: Path) -> None:
    """Make the folder; raise `RecordingError` if that fails or it holds other files, before anything is computed."""
    begin(folder, RESULTS, folder)


def summary_of(result: StudyResult, data: DataSet) -> dict[str, Any]:
    """Return everything as a document."""

    def row(line: Line) -> dict[str, Any]:
        values = {column.key: line.values.get(column.key) for column in result.columns}
        return {"method": line.method, **values, "source": line.source, "chosen": line.chosen}

    return {
        "study": data.name,
        "title": result.title,
        "columns": [{"key": column.key, "heading": column.heading} for column in result.columns],
        "ours": [row(line) for line in result.lines],
        "published": [row(line) for line in result.published],
        "notes": list(result.notes),
        "files": {file.name: file.sha256 for file in data.files},
        "source": data.source,
        "citation": data.citation,
        "seconds": result.seconds,
    }


def write_reference(result: StudyResult, data: DataSet, folder: Path) -> None:
    """Write ``reference.json``, ``reference.png`` and the models; raise `RecordingError` if this fails."""
    write_json(folder / RESULTS, summary_of(result, data))
    for name, model in result.models.items():
        save(model, folder / f"{name}.h5")
    draw_reference(result, folder / "reference.png")


def say_reference(result: StudyResult, data: DataSet) -> None:
    """Print the table, the published figures below ours."""
    print(result.title)
    several = bool(result.published)
    rows = []
    for line in (*result.lines, *result.published):
        cells = [number(line.values.get(column.key), column.pattern) for column in result.columns]
        chosen = " (chosen)" if line.chosen else ""
        rows.append((line.method + chosen, *cells, *((line.source,) if several else ())))
    heads = ("", *(column.heading for column in result.columns), *(("source",) if several else ()))
    print_table(heads, rows)
    for note in result.notes:
        print(f"note: {note}")
    print(f"data: {data.citation}; from {data.source}")
    if several:
        print(f"'{OURS}' took {result.seconds:.0f} s")
