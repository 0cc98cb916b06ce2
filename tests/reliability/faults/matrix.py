"""Which fault meets which levels on which device, and which of these cases every run of the tests looks at."""

from typing import NamedTuple

from tests.reliability.faults.table import FAULTS, Fault


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
        fault, middle = self.fault, self.fault.onset == "middle"
        if self.device == "virtual":
            if self.levels == "N linear":  # another law of the force loop; the rest is as with the logarithmic one
                return not (middle and fault.part in ("force", *BEHIND_THE_OUTPUT))
            return self.levels == "m" and fault.part not in ("drive", *BEHIND_THE_OUTPUT)  # the others as in volts
        if fault.part == "driver":
            return self.levels != "V"
        of_the_device = fault.part in ("force", *BEHIND_THE_OUTPUT) or fault.kind in AT_THE_CONVERTER
        return self.levels != EMULATED or not (middle and of_the_device)  # the others as in the process


EMULATED = "N logarithmic"
BEHIND_THE_OUTPUT = ("amplifier", "structure")
AT_THE_CONVERTER = ("stuck", "over-range")
"""Faults of a sensor that the device's converter makes another of."""
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
