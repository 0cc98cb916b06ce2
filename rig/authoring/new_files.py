"""New files to begin with: bench, plan, bench with a virtual rig, sensors, driver; each with its schema for the editor."""

import json
import os
import shutil
from importlib import resources
from pathlib import Path

from rig.authoring.commented import commented
from rig.authoring.draft7 import Schema
from rig.authoring.schemas import schema_of
from rig.bench.configuration import Table, read_toml
from rig.errors import ConfigurationError, RecordingError
from rig.system.whole_file import whole_file

BENCH_OF_DRIVER = "box-bench.toml"


def schema_text(schema: Schema) -> str:
    """Return a schema as the text of its file."""
    return json.dumps(schema, indent=2, ensure_ascii=False) + "\n"


def new_file(
    what: str,
    output: Path,
    *,
    kind: str = "backbone",
    bench: str | None = None,
    schema_file: Path | None = None,
    table: Table | None = None,
    overwrite: bool = False,
) -> Path:
    """Write a new ``"bench"``, ``"plan"``, ``"rig"`` or ``"sensors"`` and its schema; return the path of the schema's file.

    A plan is of a ``kind`` and for a ``bench``; its numbers are those of the shipped plan of that kind, for this bench where
    there is one. A ``"rig"`` is a bench with a virtual rig of all parts. ``table`` replaces what a file begins with. The schema
    is written beside the file, or to ``schema_file``.

    Raises `ConfigurationError` for another kind, `rig.errors.RecordingError` if a file exists and ``overwrite`` is false.
    """
    name = {"plan": kind, "sensors": "sensors"}.get(what, "bench")
    named = {} if what == "sensors" else {"name": output.stem}
    begun = _plan(kind, bench) if what == "plan" else {**(table or start(what)), **named}
    schema = schema_of(name)
    beside = schema_file or output.with_name(f"{name}.schema.json")
    text = f"#:schema {_reference(beside, output)}\n{commented(begun, schema)}"
    written({output: text, beside: schema_text(schema)}, overwrite)
    return beside


def new_driver(output: Path, overwrite: bool = False) -> None:
    """Copy the driver template, a package with its tests, to a new folder; its bench has a schema beside it.

    Raises `rig.errors.RecordingError` if the folder exists and ``overwrite`` is false.
    """
    if output.exists() and not overwrite:
        raise _exists(output)
    unwanted = shutil.ignore_patterns("__pycache__", "*.pyc", ".*")
    # The template stands in docs in the source and inside the package in a wheel.
    inside = Path(str(resources.files("rig.authoring"))) / "driver-template"
    template = inside if inside.is_dir() else Path(__file__).parents[2] / "docs" / "driver-template"
    shutil.copytree(template, output, dirs_exist_ok=overwrite, ignore=unwanted)
    bench, schema = output / BENCH_OF_DRIVER, output / "bench.schema.json"
    text = f"#:schema {_reference(schema, bench)}\n{bench.read_text(encoding='utf-8')}"
    written({bench: text, schema: schema_text(schema_of("bench"))}, overwrite=True)


def written(files: dict[Path, str], overwrite: bool) -> None:
    """Write texts to files: all, or none if one exists with another content and ``overwrite`` is false."""
    for path, text in files.items():
        if path.is_dir() or not path.parent.is_dir():
            raise RecordingError(f"{path}: cannot be written, it is a folder or lies in none")
        if path.exists() and not overwrite and path.read_bytes() != text.encode():
            raise _exists(path)
    for path, text in files.items():
        with whole_file(path) as part:
            part.write_text(text, encoding="utf-8")


def _exists(path: Path) -> RecordingError:
    return RecordingError(f"{path}: exists already; choose another name, or --overwrite")


def _reference(schema: Path, file: Path) -> str:
    relative = Path(os.path.relpath(schema.resolve(), file.resolve().parent)).as_posix()
    return relative if relative.startswith(".") else f"./{relative}"


def start(name: str) -> Table:
    """Return what a new file begins with: ``bench``, ``rig`` or ``sensors``."""
    return read_toml(Path(str(resources.files("rig.authoring"))) / "starts" / f"{name}.toml")


def _plan(kind: str, bench: str | None) -> Table:
    """Return the table of the shipped plan of a kind, if possible for the bench, else with the bench replaced."""
    from rig.bench.configuration import shipped_names
    from rig.campaigns.kinds import KINDS

    ConfigurationError.unless_one_of("kind", kind, KINDS)
    folder = Path(str(resources.files("rig.campaigns"))) / "shipped"
    tables = [(name, read_toml(folder / f"{name}.toml")) for name in shipped_names(folder)]
    found = [(name, table) for name, table in tables if table["kind"] == kind]
    # The bench's own before another's, magnet-beam's before another's, the plan named after its kind before others.
    name, table = min(found, key=lambda one: (one[1]["bench"] != bench, "magnet-beam/" not in one[0], len(one[0])))
    told = (
        "" if bench in (None, table["bench"]) else f"; its numbers are for the bench {table['bench']}, to be replaced"
    )
    return {**table, "bench": bench or table["bench"], "description": f"begun from the shipped plan {name}{told}"}
