"""Which fault meets which levels on which device, and which of these cases every run of the tests looks at."""

from typing import NamedTuple

from tests.reliability.faults.table import FAULTS, Fault

__all__ = ["CASES", "Case"]


class Case(NamedTuple):
    """One cell of the matrix."""

    fault: Fault
    levels: str
    device: str

    @property
    def name(self) -> str:
        """As in the tests' names."""
        return f"{self.fault.name}, {self.levels}, {self.device}"

    @property
    def is_left_to_the_command(self) -> bool:
        """Whether only the command that writes the page looks at it, because another cell nearly shows it."""
        if self.device == "virtual":
            return self.levels in ("N linear", "m") and self.fault.part in ("response", "driver")  # as in volts
        return (
            self.levels != "V"
            if self.fault.part == "driver"
            else self.levels != EMULATED or self.fault.onset == "start"
        )


EMULATED = "N logarithmic"
FRICTION = (
    "stuck",
    "open",
    "x0.1",
    "x10",
    "reversed",
    "dead",
    "clipped",
    "softer",
    "softening",
    "raises",
    "loses-some",
)


def _levels(fault: Fault, device: str) -> tuple[str, ...]:
    every = ("V", "N logarithmic", "N linear", "m")
    friction = ("V, friction", "N, friction")
    return (*every, *friction) if device == "virtual" and fault.kind in FRICTION and fault.onset == "middle" else every


CASES: tuple[Case, ...] = tuple(
    Case(fault, levels, device) for fault in FAULTS for device in fault.devices for levels in _levels(fault, device)
)
"""All of them: faults of the friction beam on the virtual device alone, in the middle of a run."""
