"""Options shared by several commands."""

import contextlib
import inspect
import logging
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from rig.bench import Bench
    from rig.campaigns.planning.plan import Plan

Json = Annotated[bool, typer.Option("--json", help="Print one JSON document instead of tables.")]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace OUTPUT where it exists.")]
Output = Annotated[Path, typer.Option("-o", "--output", help="File to write.")]


class _Notes(logging.Handler):
    """Prints log records as notes."""

    def emit(self, record: logging.LogRecord) -> None:
        with contextlib.suppress(OSError):  # the reader has closed the stream
            print(f"note: {record.getMessage()}", file=sys.stderr, flush=True)


def say_what_is_imported() -> None:
    """Print a note for each function of the user that a bench names, with the file that it comes from."""
    log = logging.getLogger("simulators.sites.functions")
    log.setLevel(logging.INFO)
    log.handlers = [_Notes()]


def with_parameters(
    call: Callable[..., None], parameters: Sequence[inspect.Parameter], text: str | None
) -> Callable[..., None]:
    """Return a function with the parameters that typer shall read, and a text for its help."""
    parameters = [parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY) for parameter in parameters]
    call.__doc__ = text
    call.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    call.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    return call


def plan_and_bench(plan: str, bench: str | None) -> "tuple[Plan, Bench]":
    """Load a plan, and the bench that it names or another one."""
    from rig.bench import load_bench
    from rig.campaigns.plans import bench_of, load_plan

    loaded = load_plan(plan)
    return loaded, bench_of(loaded, plan) if bench is None else load_bench(bench)


def keep_existing(sources: Sequence[Path], output: Path, overwrite: bool) -> None:
    """Refuse an output that is a folder, lies in no folder or is a source, and an existing file unless ``overwrite``."""
    from rig.errors import RecordingError

    if output.is_dir():
        raise RecordingError(f"{output}: is a folder, the name of a file is expected")
    if not output.parent.is_dir():
        raise RecordingError(f"{output}: there is no folder {output.parent}")
    if output.exists() and any(source.exists() and output.samefile(source) for source in sources):
        raise RecordingError(f"{output}: is the file that is read; choose another name")
    if output.exists() and not overwrite:
        raise RecordingError(f"{output}: exists already; choose another name, or --overwrite")


def show_file(path: Path, json: bool) -> None:
    """Print the contents of a file."""
    from rig.results.files import understood
    from rig.show.summary import summarise
    from rig.show.tables import print_summary
    from rig.text.console import print_json

    summary = summarise(path)
    if json:
        print_json(summary)
    else:
        with understood(path, summary["kind"]):
            print_summary(summary)
