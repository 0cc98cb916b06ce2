"""Arming on the terminal: a person reads what is to move, and types the bench's name."""

import sys
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from rig.arming.arming import Arm, ArmingRequest
    from rig.arming.run_facts import About

__all__ = ["ArmNow", "Notes", "Operator", "SpecimenSerial", "about_from", "arm_from", "ask"]

ArmNow = Annotated[bool, typer.Option("--arm", help="Arm a bench that moves, without being asked.")]
Operator = Annotated[str | None, typer.Option(help="Who runs the test, for the record; the user if left out.")]
SpecimenSerial = Annotated[str, typer.Option(help="Serial number of the specimen, for the record.")]
Notes = Annotated[list[str] | None, typer.Option("--note", help="A remark for the record; may be given several times.")]


def about_from(operator: str | None, specimen_serial: str, notes: list[str] | None) -> "About":
    """What a person adds to a run."""
    from rig.arming.run_facts import About

    return About(operator, specimen_serial, tuple(notes or ()))


def arm_from(arm: bool) -> "Arm":
    """A person's word: given as an option, asked for on a terminal, or neither."""
    if arm:
        return True
    on_a_terminal = sys.stdin is not None and sys.stdin.isatty() and sys.stderr is not None and sys.stderr.isatty()
    return ask if on_a_terminal else None


def ask(request: "ArmingRequest") -> bool:
    """Show what is to move, and whether the bench's name was typed."""
    from rig.text.printable import printable

    for line in request.lines():
        print(printable(line), file=sys.stderr)
    print(
        f"{printable(request.what)} will move this rig. Type the bench's name to arm it: ",
        end="",
        file=sys.stderr,
        flush=True,
    )
    return sys.stdin.readline().strip() == request.bench.name
