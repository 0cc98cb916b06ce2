"""The chapter on a model, a prediction, a rehearsal or an imported measurement."""

from pathlib import Path

from rig.report.document import Chapter, Facts, Section, Text, blocks_of
from rig.report.files import table_of_files
from rig.report.pictures import Pictures
from rig.results.files import understood
from rig.results.kinds import KINDS
from rig.show.summary import summarise
from rig.text.console import collected


def model_chapter(path: Path, pictures: Pictures) -> Chapter:
    """Return all that `rig show` says of a file that is no recording, with its figure; raise `RecordingError` as that does."""
    summary = summarise(path)
    kind = summary["kind"]
    with understood(path, kind), collected() as printed:
        KINDS[kind].say(summary)
    specimen = summary["specimen"] or "an unnamed specimen"
    notes = [Text(note, "note") for note in summary["notes"]]
    return Chapter(
        f"{kind} of {specimen}",
        str(path),
        [],
        [
            Section("Figure", [pictures.of_file(path, f"The {kind}, as rig plot draws it.")]),
            Section("What it is, how well it fits, and where it holds", blocks_of(printed, "Values")),
            Section("Notes", [*notes]),
            Section("File", [Facts("", [("integrity", summary["integrity"])]), table_of_files([path])]),
        ],
    )
