"""Channels of a measurement: what each one measures and in which unit."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Literal, get_args

from identification.errors import IdentificationError

Role = Literal["force", "drive", "response", "monitor"]
Motion = Literal["displacement", "velocity", "acceleration"]

MOTION_ORDER: dict[Motion, int] = {"displacement": 0, "velocity": 1, "acceleration": 2}
"""How many times the displacement has been differentiated with respect to time."""

MOTION_UNIT: dict[Motion, str] = {"displacement": "m", "velocity": "m/s", "acceleration": "m/s2"}

_MOTION_OF_UNIT: dict[str, Motion] = {
    "m": "displacement",
    "m/s": "velocity",
    "m/s2": "acceleration",
    "m/s^2": "acceleration",
    "m/s²": "acceleration",
    "V": "displacement",
    "1": "displacement",
}
_FORCE_UNITS = ("N", "V", "1")


@dataclass(frozen=True)
class Channel:
    """One measured quantity.

    Parameters
    ----------
    name
        Name of the channel, unique within a measurement.
    role
        ``force`` (at the drive point), ``drive`` (motion at the drive point), ``response`` (motion elsewhere) or ``monitor``
        (recorded for display only, in any unit).
    unit
        SI unit: ``N`` for a force; ``m``, ``m/s`` or ``m/s2`` for a motion. ``V`` or ``1`` where there is no better one, such
        as in an electric circuit or in normalised data; a motion in these counts as a displacement.
    """

    name: str
    role: Role
    unit: str

    def __post_init__(self) -> None:
        if not self.name:
            raise IdentificationError("channel name: is empty")
        if self.role not in get_args(Role):
            raise IdentificationError(
                where=f"channel '{self.name}'", field="role", value=self.role, allowed=get_args(Role)
            )
        refused = partial(IdentificationError, where=f"channel '{self.name}'", field="unit", value=self.unit)
        if self.role == "force" and self.unit not in _FORCE_UNITS:
            raise refused("a force is given in N (V or 1 if there is no better unit)")
        if self.role in ("drive", "response") and self.unit not in _MOTION_OF_UNIT:
            raise refused("a motion is in m, m/s or m/s2 (V or 1 if there is no better unit)")

    @property
    def motion(self) -> Motion:
        """Kind of motion that a drive or response channel measures; a displacement in V or 1."""
        if self.role not in ("drive", "response"):
            raise IdentificationError(f"channel '{self.name}': role {self.role} measures no motion")
        return _MOTION_OF_UNIT[self.unit]


def find_role(channels: Sequence[Channel], role: Role) -> int:
    """Return the index of the only channel with ``role``; raise `IdentificationError` if there is none or more than one."""
    found = [index for index, channel in enumerate(channels) if channel.role == role]
    if len(found) != 1:
        names = ", ".join(f"{channel.name} ({channel.role})" for channel in channels) or "none"
        reason = f"{len(found)} have the role '{role}'"
        raise IdentificationError(reason, field="channels", allowed="exactly one", hint=f"channels: {names}")
    return found[0]


def find_name(channels: Sequence[Channel], name: str) -> int:
    """Return the index of the channel called ``name``; raise `IdentificationError` if there is none."""
    for index, channel in enumerate(channels):
        if channel.name == name:
            return index
    raise IdentificationError(f"no channel '{name}'; channels: {', '.join(c.name for c in channels)}")


def in_newtons(channels: Sequence[Channel], what: str) -> None:
    """Raise `IdentificationError` if a force is in another unit than N, or a motion in V or 1; ``what`` needs SI."""
    for channel in channels:
        if (channel.role == "force" and channel.unit != "N") or (
            channel.role in ("drive", "response") and channel.unit in ("V", "1")
        ):
            reason = f"{what} needs a force in N and motions in m, m/s or m/s2"
            raise IdentificationError(reason, where=f"channel '{channel.name}'", field="unit", value=channel.unit)


def chosen_rows(
    channels: Sequence[Channel], inputs: Sequence[str], outputs: Sequence[str] | None
) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Return the rows of the inputs and of the outputs of a model.

    Channels are chosen by name, or by role if none has that name. With ``outputs`` None: all motions, and the force unless it
    is an input. Raises `IdentificationError` for an unknown name, for an empty choice, and for a channel that is both.
    """
    into = _rows(channels, "inputs", inputs)
    if outputs is not None:
        out = _rows(channels, "outputs", outputs)
    else:
        motions = [row for row, channel in enumerate(channels) if channel.role in ("drive", "response")]
        forces = [row for row, channel in enumerate(channels) if channel.role == "force" and row not in into]
        out = tuple(row for row in (*forces, *motions) if row not in into)
        if not out:
            names = ", ".join(f"{channel.name} ({channel.role})" for channel in channels)
            reason = "no channel is a motion, name them"
            raise IdentificationError(reason, field="outputs", hint=f"channels are {names}")
    if both := [channels[row].name for row in out if row in into]:
        raise IdentificationError(f"{both[0]} is an input already", field="outputs")
    return into, out


def _rows(channels: Sequence[Channel], what: str, wanted: Sequence[str]) -> tuple[int, ...]:
    found: list[int] = []
    for name in (wanted,) if isinstance(wanted, str) else wanted:
        rows = [row for row, channel in enumerate(channels) if channel.name == name]
        rows = rows or [row for row, channel in enumerate(channels) if channel.role == name]
        if not rows:
            names = ", ".join(channel.name for channel in channels)
            raise IdentificationError(f"there is no channel {name}", field=what, hint=f"channels are {names}")
        found += [row for row in rows if row not in found]
    IdentificationError.raise_if(not found, "none given", field=what, allowed="one channel at least")
    return tuple(found)
