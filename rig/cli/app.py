"""The command ``rig``. It exits with status 0 only on success. Errors are one line, with a traceback under ``--debug``."""

import io
import os
import sys
from typing import Annotated

import typer

from rig.cli.analyse import app as analyse_app
from rig.cli.calibrate import calibrate_
from rig.cli.check import check_
from rig.cli.compiling import compiling_is_said
from rig.cli.conformance import conformance
from rig.cli.docs import docs
from rig.cli.doctor import doctor
from rig.cli.emulate import emulate
from rig.cli.exchange import export_, import_
from rig.cli.firmware import app as firmware_app
from rig.cli.flags import with_flags
from rig.cli.group import Group, command_of
from rig.cli.identify import app as identify_app
from rig.cli.list import list_
from rig.cli.monitor import monitor
from rig.cli.options import say_what_is_imported
from rig.cli.predict import app as predict_app
from rig.cli.rehearse import rehearse_
from rig.cli.replay import replay_
from rig.cli.report import report_
from rig.cli.run import resume, run
from rig.cli.schema import new, schema
from rig.cli.show import plot_, show
from rig.cli.slow_commands import waiting_for
from rig.cli.stop import stop
from rig.cli.studies import StudyCommand, reproduce_
from rig.cli.tune import tune_
from rig.cli.watch import watch_
from vibrolock.collecting import collect_rarely

STOPPED = 130  # exit status after Ctrl-C: 128 and SIGINT (2), as shells have it

app = typer.Typer(
    cls=Group,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    rich_markup_mode=None,  # the help would load a parser of Markdown and be shown in twice the time
)

app.add_typer(analyse_app, name="analyse")


@app.callback()
def _common(
    debug: Annotated[bool, typer.Option("--debug", help="Show tracebacks; may stand anywhere.")] = False,
) -> None:
    """Phase-locked nonlinear vibration tests on virtual and real rigs, and models from the recordings."""


app.add_typer(identify_app, name="identify")
app.add_typer(predict_app, name="predict")
app.add_typer(firmware_app, name="firmware")
for _command in (list_, new, schema, import_, export_, tune_, emulate, conformance, check_, calibrate_, rehearse_):
    app.command(_command.__name__.rstrip("_"))(_command)
app.command("reproduce", cls=StudyCommand, context_settings={"ignore_unknown_options": True, "allow_extra_args": True})(
    reproduce_
)
for _command in (run, resume, monitor, show, plot_, report_, doctor):
    app.command(_command.__name__.rstrip("_"))(_command)
app.command(context_settings={"ignore_unknown_options": True})(docs)  # an option may be the word
for _command in (watch_, replay_, stop):
    app.command(_command.__name__.rstrip("_"))(_command)


def main() -> None:
    """Run the command and exit: 0 on success, 1 on an error or unfinished run, 2 on wrong use, 130 if interrupted otherwise."""
    collect_rarely()
    arguments = [argument for argument in sys.argv[1:] if argument != "--debug"]
    debug = len(arguments) < len(sys.argv) - 1
    say_what_is_imported()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # also print to a terminal that cannot show µ
    try:
        with waiting_for(arguments), compiling_is_said():
            status = command_of(app)(arguments, prog_name="rig", standalone_mode=False)
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
    from vibrolock.printable import one_line

    print(f"rig: {one_line(line)}", file=sys.stderr)
    return status


def _one_line(error: Exception) -> str:
    """Return the error in one line. For an error from other code, include its type."""
    from rig.errors import DaqError, NotArmed
    from rig.text.message_pages import where_explained
    from vibrolock.errors import StatedError

    if isinstance(error, StatedError):
        page = f" ({where_explained([type(error).__name__])})" if isinstance(error, DaqError | NotArmed) else ""
        return with_flags(error, app, sys.argv[1:]) + page
    if isinstance(error, OSError) and error.filename is not None:
        return f"{os.fsdecode(error.filename)}: cannot be used ({error.strerror})"
    return f"unexpected {type(error).__name__}: {error} (run again with --debug for the details)"
