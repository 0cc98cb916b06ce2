"""The command ``rig``. Exit status 0 only on success; errors are one line, with a traceback under ``--debug``."""

import io
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rig.cli.analyse import app as analyse_app
from rig.cli.check import check_
from rig.cli.conformance import conformance
from rig.cli.emulate import emulate
from rig.cli.exchange import export_, import_
from rig.cli.flags import with_flags
from rig.cli.identify import identify, predict
from rig.cli.list import list_
from rig.cli.options import Json, Output, say_what_is_imported, show_file
from rig.cli.reproduce import reproduce_
from rig.cli.run_options import of_a_further_part, of_a_recording, shown, with_run_options
from rig.cli.tune import tune_

if TYPE_CHECKING:
    from rig.arming.run_options import RunOptions
    from rig.recording.reader import Recording

__all__ = ["app", "main"]

STOPPED = 130

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

app.add_typer(analyse_app, name="analyse")


@app.callback()
def _common(
    debug: Annotated[bool, typer.Option("--debug", help="Show tracebacks; may stand anywhere.")] = False,
) -> None:
    """Phase-locked nonlinear vibration tests on virtual and real rigs, and models from the recordings."""


app.command("list")(list_)
app.command()(identify)
app.command()(predict)
app.command("import")(import_)
app.command("export")(export_)
app.command("tune")(tune_)
app.command()(emulate)
app.command()(conformance)
app.command("check")(check_)
app.command("reproduce")(reproduce_)


@app.command()
@with_run_options(of_a_recording)
def run(
    *,
    plan: Annotated[str, typer.Argument(help="Shipped plan (magnet-beam/backbone) or TOML file.")],
    output: Output,
    bench: Annotated[str | None, typer.Option(help="Bench to use instead of the plan's: a name or TOML file.")] = None,
    daq: Annotated[str | None, typer.Option(help="Driver to use instead of the bench's.")] = None,
    options: "RunOptions",
    json: Json = False,
) -> None:
    """Carry out a plan and record it."""
    from rig.bench import load_bench
    from rig.campaigns.plans import bench_of, load_plan
    from rig.campaigns.running.runner import carry_out

    loaded = load_plan(plan)
    chosen = load_bench(bench) if bench is not None else bench_of(loaded, plan)
    if daq is not None:
        chosen = chosen.model_copy(update={"driver": chosen.driver.model_copy(update={"name": daq})})
    _carry(loaded.kind, options, lambda watched: carry_out(loaded, chosen, output, watched), json)


@app.command()
@with_run_options(of_a_further_part)
def resume(
    *,
    output: Annotated[Path, typer.Argument(help="Recording of the interrupted run.")],
    plan: Annotated[str | None, typer.Option(help="Changed plan to go on with: a name or TOML file.")] = None,
    retry_tripped: Annotated[
        bool, typer.Option("--retry-tripped", help="Try a level at which the run tripped again.")
    ] = False,
    trust_code: Annotated[
        bool, typer.Option("--trust-code", help="Import the functions that the recording's bench names.")
    ] = False,
    options: "RunOptions",
    json: Json = False,
) -> None:
    """Finish a run that was interrupted, by its plan or a changed one; points that were accepted stay."""
    from rig.campaigns.plans import load_plan
    from rig.campaigns.running.runner import take_up
    from rig.recording.reader import Recording

    with Recording(output) as recording:
        kind = recording.kind
    change = None if plan is None else load_plan(plan)
    _carry(
        kind,
        options,
        lambda watched: take_up(
            output, watched, change=change, source=plan or "", retry_tripped=retry_tripped, trust_code=trust_code
        ),
        json,
    )


def _carry(kind: str, options: "RunOptions", start: "Callable[[RunOptions], Recording]", json: bool) -> None:
    """Run, show the points as they come and how it ended; exit status 1 where the plan was not completed."""
    from rig.campaigns.kinds import KINDS
    from rig.recording.reader import Recording
    from rig.show.summary import summarise_recording
    from rig.show.tables import say_how_it_ended
    from rig.system.stop_signals import Interrupted, Terminated, ignore_from_now_on
    from rig.text.console import print_json

    with shown(options, KINDS[kind].columns) as watched:
        try:
            result = start(watched)
        except (Interrupted, Terminated) as signal:
            if signal.recorded is None:
                raise
            result = Recording(signal.recorded)  # the signal came when the recording was already complete
    ignore_from_now_on()
    with result:
        summary = summarise_recording(result)
        complete, path = result.complete, result.path
    if json:
        print_json(summary)
    else:
        say_how_it_ended(summary, path)
    if not complete:
        raise typer.Exit(1)


@app.command()
def show(
    file: Annotated[Path, typer.Argument(help="Recording, model or imported measurement.")], json: Json = False
) -> None:
    """What is in a file: points, quality, statistics of the loop."""
    show_file(file, json)


@app.command("plot")
def plot_(
    file: Annotated[Path, typer.Argument(help="Recording, model or imported measurement.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="Figure to write: .png, .pdf or .svg.")],
    lateness: Annotated[bool, typer.Option("--lateness", help="How punctual the loop of a recording was.")] = False,
) -> None:
    """Draw what is in a file."""
    from rig.show.figure import plot

    plot(file, output, lateness=lateness)


@app.command()
def doctor(
    daq: Annotated[
        str | None, typer.Option(help="Bench whose device to look at: a name or TOML file. It is given 0 V only.")
    ] = None,
    json: Json = False,
) -> None:
    """What this machine can promise: clock, privileges, disk, drivers; with --daq, what a bench's device answers."""
    from rig.bench import load_bench
    from rig.loop.doctor import examine, examine_bench
    from rig.text.console import print_json
    from rig.text.printable import printable_strings

    facts = examine(Path.cwd()) if daq is None else examine_bench(load_bench(daq))
    if json:
        print_json(facts)
    else:
        for name, value in printable_strings(facts).items():
            text = ", ".join(f"{k} {v}" for k, v in value.items()) if isinstance(value, dict) else value
            text = "; ".join(value) or "none" if isinstance(value, list) else text
            print(f"{name.replace('_', ' '):22} {text}")
    if facts.get("failure"):
        raise typer.Exit(1)


def main() -> None:
    """Entry point of the command: 0 on success, 1 on an error or unfinished run, 2 on wrong use, 130 if stopped elsewhere."""
    arguments = [argument for argument in sys.argv[1:] if argument != "--debug"]
    debug = len(arguments) < len(sys.argv) - 1
    say_what_is_imported()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # also print to a terminal that cannot show µ
    try:
        status = app(arguments, prog_name="rig", standalone_mode=False)
        if status == STOPPED:  # typer turns Ctrl-C into this status without a message
            _complain("interrupted", STOPPED)
    except (KeyboardInterrupt, typer.Abort):
        status = _complain("interrupted", STOPPED)
    except SystemExit as error:
        if (name := getattr(error, "signal", None)) is None:
            raise
        status = _complain(f"ended by {name}", int(error.code or 0))
    except BrokenPipeError:  # the reader of the output has closed it
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        status = 1
    except Exception as error:
        if debug:
            raise
        wrong_use = getattr(error, "format_message", None)  # an error of typer
        if wrong_use is not None and not wrong_use():
            status = 2  # a bare `rig` has shown its help
        elif wrong_use is not None:
            status = _complain(f"{wrong_use()} (see rig --help)", 2)
        else:
            status = _complain(_one_line(error), 1)
    sys.exit(status or 0)


def _complain(line: str, status: int) -> int:
    from rig.text.printable import one_line

    print(f"rig: {one_line(line)}", file=sys.stderr)
    return status


def _one_line(error: Exception) -> str:
    """The error in one line; an error of other code is named with its type."""
    from identification.errors import IdentificationError
    from rig.errors import RigError

    text = str(error)
    if isinstance(error, RigError | IdentificationError):
        return with_flags(text, app)
    if isinstance(error, OSError) and error.filename is not None:
        return f"{os.fsdecode(error.filename)}: cannot be used ({error.strerror})"
    return f"unexpected {type(error).__name__}: {text} (run again with --debug for the details)"
