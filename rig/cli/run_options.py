"""Options shared by ``rig run``, ``resume``, ``check`` and ``tune``, and the question before a bench is armed."""

import inspect
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Annotated

import typer

from rig.cli.monitor_process import monitor_process
from rig.cli.options import Overwrite, with_parameters

if TYPE_CHECKING:
    from rig.arming.arming import Arm, ArmingRequest
    from rig.arming.run_options import RunOptions
    from rig.bench import Bench
    from rig.text.column import Column

Seed = Annotated[int, typer.Option(help="Seed of a virtual rig's noise.", min=0)]
SeedOfTheRest = Annotated[int | None, typer.Option(help="Seed of a virtual rig's noise in the rest.", min=0)]
Realtime = Annotated[bool, typer.Option("--realtime", help="Hold a virtual rig back to the wall clock.")]
ArmNow = Annotated[bool, typer.Option("--arm", help="Arm a bench that moves, without being asked.")]
Operator = Annotated[str | None, typer.Option(help="Who runs the test, for the record; the user if left out.")]
SpecimenSerial = Annotated[str, typer.Option(help="Serial number of the specimen, for the record.")]
Monitor = Annotated[bool, typer.Option("--monitor", help="Show the run on a page in the browser, with a stop button.")]
Notes = Annotated[list[str] | None, typer.Option("--note", help="A remark for the record; may be given several times.")]


def of_a_recording(
    seed: Seed = 0,
    realtime: Realtime = False,
    arm: ArmNow = False,
    operator: Operator = None,
    specimen_serial: SpecimenSerial = "",
    note: Notes = None,
    overwrite: Overwrite = False,
) -> "RunOptions":
    """Return the options of a command that begins a recording."""
    options = of_a_further_part(seed, realtime, arm, operator, specimen_serial, note)
    return replace(options, overwrite=overwrite)


def of_a_further_part(
    seed: SeedOfTheRest = None,
    realtime: Realtime = False,
    arm: ArmNow = False,
    operator: Operator = None,
    specimen_serial: SpecimenSerial = "",
    note: Notes = None,
) -> "RunOptions":
    """Return the options of a command that adds a part to a recording."""
    from rig.arming.run_facts import About
    from rig.arming.run_options import RunOptions

    about = About(operator, specimen_serial, tuple(note or ()))
    return RunOptions(seed=seed, realtime=realtime, arm=_arm_from(arm), about=about)


def with_options(
    build: Callable[..., object], *, later: bool = False, monitored: bool = False
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Replace the parameter ``options`` of a command by those of ``build``; the command receives the result of ``build``.

    With ``later`` it receives a function that returns that result; if ``monitored``, ``--monitor`` shows a page beside it.
    """

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        shared = inspect.signature(build).parameters
        added = [*([_MONITOR] if monitored else []), *shared.values()]
        parameters: list[inspect.Parameter] = []
        for parameter in inspect.signature(command).parameters.values():
            parameters += added if parameter.name == "options" else [parameter]

        def call(*, monitor: bool = False, **given: object) -> None:
            built = partial(build, **{name: given.pop(name) for name in shared})
            options = built if later else built()
            with monitor_process(monitor):
                command(**given, options=options)

        call.__name__ = command.__name__
        return with_parameters(call, parameters, command.__doc__)

    return decorate


_MONITOR = inspect.Parameter("monitor", inspect.Parameter.KEYWORD_ONLY, default=False, annotation=Monitor)


@contextmanager
def shown(options: "RunOptions", columns: "Sequence[Column]") -> "Iterator[RunOptions]":
    """Add a display of the run's points to the options; ``columns`` are those of its kind of campaign.

    On a terminal, say first how to watch and stop the run from another.
    """
    from rig.show.progress import RunProgress

    if sys.stderr is not None and sys.stderr.isatty():
        print("in another terminal, `rig watch` shows this run and `rig stop` ramps it down", file=sys.stderr)
    progress = RunProgress(columns)
    try:
        yield replace(options, progress=progress)
    finally:
        progress.close()


def by_the_clock(bench: "Bench", options: "RunOptions") -> bool:
    """Whether a run waits for the wall clock: on every rig but a virtual one that is not held back."""
    return bench.driver.name != "virtual" or options.realtime


def _arm_from(arm: bool) -> "Arm":
    """Return True if the switch was given; otherwise a function that asks on the terminal, or None without a terminal."""
    if arm:
        return True
    return ask if on_a_terminal() else None


def on_a_terminal() -> bool:
    """Return whether a person can be asked: input and messages are those of a terminal."""
    return sys.stdin is not None and sys.stdin.isatty() and sys.stderr is not None and sys.stderr.isatty()


def ask(request: "ArmingRequest") -> bool:
    """Show what is going to move; return whether the bench's name was typed."""
    from rig.show.waiting import silence
    from vibrolock.printable import printable

    with silence():
        for line in request.lines():
            print(printable(line), file=sys.stderr)
        print(
            f"{printable(request.what)} will move this rig. Type the bench's name to arm it: ",
            end="",
            file=sys.stderr,
            flush=True,
        )
        return sys.stdin.readline().strip() == request.bench.name
