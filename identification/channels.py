"""Channels of a measurement: what each one measures and in which unit."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

from identification.errors import IdentificationError

__all__ = ["MOTION_ORDER", "MOTION_UNIT", "Channel", "Motion", "Role", "find_name", "find_role"]

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
}


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
        SI unit: ``N`` for a force; ``m``, ``m/s`` or ``m/s2`` for a motion.
    """

    name: str
    role: Role
    unit: str

    def __post_init__(self) -> None:
        if not self.name:
            raise IdentificationError("channel name: is empty")
        if self.role not in get_args(Role):
            raise IdentificationError(
                f"channel '{self.name}': role is '{self.role}', allowed are {', '.join(get_args(Role))}"
            )
        if self.role == "force" and self.unit != "N":
            raise IdentificationError(f"channel '{self.name}': unit is '{self.unit}', a force is given in N")
        if self.role in ("drive", "response") and self.unit not in _MOTION_OF_UNIT:
            raise IdentificationError(f"channel '{self.name}': unit is '{self.unit}', a motion is in m, m/s or m/s2")

    @property
    def motion(self) -> Motion:
        """Kind of motion that a drive or response channel measures."""
        if self.role not in ("drive", "response"):
            raise IdentificationError(f"channel '{self.name}': role {self.role} measures no motion")
        return _MOTION_OF_UNIT[self.unit]


def find_role(channels: Sequence[Channel], role: Role) -> int:
    """Return the index of the only channel with ``role``; raise `IdentificationError` if there is none or more than one."""
    found = [index for index, channel in enumerate(channels) if channel.role == role]
    if len(found) != 1:
        names = ", ".join(f"{channel.name} ({channel.role})" for channel in channels) or "none"
        raise IdentificationError(
            f"channels: {len(found)} have the role '{role}', needs exactly one; channels: {names}"
        )
    return found[0]


def find_name(channels: Sequence[Channel], name: str) -> int:
    """Return the index of the channel called ``name``; raise `IdentificationError` if there is none."""
    for index, channel in enumerate(channels):
        if channel.name == name:
            return index
    raise IdentificationError(f"no channel '{name}'; channels: {', '.join(c.name for c in channels)}")
