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
        """Whether only the command that writes the page looks at it, because other cells nearly show it.

        The tests look at every fault with each of its onsets, at every kind of level that it has a loop of its own with, and at
        every onset with each kind of level, but not at all three together: kinds of fault take turns.
        """
        fault, turn = self.fault, KINDS.index((self.fault.part, self.fault.kind))
        middle = fault.onset == "middle"
        if self.device == "emulated":
            if fault.part == "driver":
                return self.levels != "V"
            of_the_device = fault.kind in AT_THE_CONVERTER or (fault.part, fault.kind) in THROUGH_THE_DEVICE
            return self.levels != EMULATED or not (middle and of_the_device)  # the others as in the process
        if "friction" in self.levels:
            return self.levels != ("V, friction", "N, friction")[turn % 2]
        if self.levels == "N linear":  # another law of the force loop; the rest is as with the logarithmic one
            return not (middle and turn % 2 and fault.part in ("force", *BEHIND_THE_OUTPUT))
        if fault.part in ("drive", *BEHIND_THE_OUTPUT):  # what every loop has to do with
            return middle == (self.levels == ("V", "N logarithmic", "m")[turn % 3])
        return (
            self.levels != ("V", "N logarithmic")[(turn + middle) % 2]
        )  # the loop of displacements is as that of volts


EMULATED = "N logarithmic"
BEHIND_THE_OUTPUT = ("amplifier", "structure")
AT_THE_CONVERTER = ("stuck", "over-range")
"""Faults of a sensor that the device's converter makes another of."""
THROUGH_THE_DEVICE = (
    ("force", "x0.1"),
    ("force", "reversed"),
    ("amplifier", "dead"),
    ("amplifier", "held"),
    ("structure", "softer"),
)
"""One of each that raises, loses or turns what the loop holds: the loop that answers is the one of the process."""
KINDS = list(dict.fromkeys((fault.part, fault.kind) for fault in FAULTS))
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
