"""Write a report: chapters on files, and on what several of them have in common, as one HTML file."""

import shlex
from collections.abc import Sequence
from datetime import datetime
from importlib import resources
from pathlib import Path

from rig.errors import RecordingError
from rig.recording.arrays import kind_of
from rig.report.comparison import comparisons
from rig.report.document import Chapter, Facts, Section, Text, blocks_of, typeset
from rig.report.facts import table_of_files
from rig.report.pictures import Pictures
from rig.report.recordings import recording_chapter
from rig.results.files import understood
from rig.results.kinds import KINDS
from rig.show.summary import summarise
from rig.system.studies import load_study
from rig.system.whole_file import whole_file
from rig.text.console import collected
from vibrolock import __version__


def write_report(sources: Sequence[Path], output: Path, title: str = "") -> None:
    """Write a report on recordings, models and folders of `rig reproduce` into one HTML file, which needs no other file.

    Files appear in the order given, recordings of the same kind first in a comparison. Without a ``title``, the report is named
    after what is in it. Raises `RecordingError` if a file cannot be read or ``output`` cannot be written; it is then as it was.
    """
    doubled = next(
        (one for n, one in enumerate(sources) if one.absolute() in [s.absolute() for s in sources[:n]]), None
    )
    if doubled is not None:
        raise RecordingError(f"{doubled}: is given twice")
    pictures = Pictures()
    files = [source for source in sources if not source.is_dir()]
    chapters = comparisons(files, pictures) if len(files) > 1 else []
    for source in sources:
        if source.is_dir():
            chapters += load_study("report", str(source)).study_chapters(source)
        else:
            chapters.append(_chapter(source, pictures))
    if not title and len(chapters) == 1:
        title = f"Report: {chapters[0].title}"
    elif not title:
        title = f"Report on {sources[0].name}" if len(sources) == 1 else f"Report on {len(sources)} files"
    text = _rendered(title, chapters, sources, output)
    with whole_file(output) as path:
        path.write_text(text, encoding="utf-8")


def _chapter(path: Path, pictures: Pictures) -> Chapter:
    kind = kind_of(path)
    if kind in KINDS:
        return _model_chapter(path, pictures)
    with understood(path, f"recording of kind {kind}"):
        return recording_chapter(path, pictures)


def _model_chapter(path: Path, pictures: Pictures) -> Chapter:
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


def _rendered(title: str, chapters: Sequence[Chapter], sources: Sequence[Path], output: Path) -> str:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("rig.report", "template"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["typeset"] = typeset
    style = (resources.files("rig.report") / "template" / "style.css").read_text(encoding="utf-8")
    command = shlex.join(["rig", "report", *map(str, sources), "-o", str(output)])
    return environment.get_template("report.html").render(
        title=title,
        chapters=chapters,
        style=style,
        made=datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %z"),
        version=__version__,
        command=command,
    )
