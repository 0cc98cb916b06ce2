"""Operator, specimen and notes of a test: facts recorded with every part of a recording."""

import getpass
import os
from dataclasses import dataclass, fields
from datetime import date

from rig.bench import Bench
from rig.errors import ConfigurationError


@dataclass(frozen=True)
class About:
    """Facts that a person adds to a run.

    Raises `ConfigurationError` for text that cannot be printed in one line.
    """

    operator: str | None = None
    """Who runs the test; if None, ``VIBROLOCK_OPERATOR`` or the user of the operating system."""
    specimen_serial: str = ""
    """Serial number of the specimen."""
    notes: tuple[str, ...] = ()
    """Notes, one line each."""
    purpose: str = ""
    """Purpose of the run: ``check`` or ``tuning``; empty for a separate campaign."""

    def __post_init__(self) -> None:
        texts = [(name, value) for name, value in vars(self).items() if isinstance(value, str)]
        for name, text in [*texts, *(("note", note) for note in self.notes)]:
            if text and not text.isprintable():
                raise ConfigurationError(field=name, value=text, allowed="printable text in one line")

    def facts(self) -> dict[str, str | list[str]]:
        """Return the facts as they are recorded."""
        return {**vars(self), "operator": self.operator or user_name(), "notes": list(self.notes)}

    @classmethod
    def single(cls) -> tuple[str, ...]:
        """Names of the facts that are one value, in the order in which they are shown."""
        return tuple(one.name for one in fields(cls) if one.name not in ("notes", "purpose"))


def user_name() -> str:
    """Return ``VIBROLOCK_OPERATOR``, or the user of the operating system; an empty string if neither is known."""
    given = os.environ.get("VIBROLOCK_OPERATOR", "")
    if given and given.isprintable():
        return given
    try:
        return getpass.getuser()
    except (OSError, KeyError, ImportError):
        return ""


def calibration_remarks(bench: Bench, today: date) -> list[str]:
    """Return one line for each sensor whose calibration is past its due date."""
    return [
        f"channel {channel.name}: calibration was due on {channel.calibration_due}"
        + (f" (sensor {channel.serial_number})" if channel.serial_number else "")
        for channel in bench.channels
        if channel.calibration_due and date.fromisoformat(channel.calibration_due) < today
    ]


def unproven_phase(bench: Bench, *, virtual: bool) -> str:
    """Return why nothing proves the phase of the drive sensor; an empty string if something does, or on a virtual bench."""
    shapes = [channel for channel in bench.channels if channel.role == "response" and channel.mode_shape]
    if virtual or (shapes and bench.specimen.drive_mode_shape is not None):
        return ""
    drive = bench.channels[bench.index_of("drive")].name
    return (
        f"the phase of {drive} cannot be checked: the bench has no response with a mode_shape to compare it with, so a delay "
        "of its conditioner would go unnoticed"
    )
