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
    def is_slow(self) -> bool:
        """Whether it is left to the slow tests: what another case nearly shows."""
        virtual, driver = self.device == "virtual", self.fault.part == "driver"
        if self.levels == "V" and driver:
            return False
        if virtual and self.levels == "N logarithmic":
            return self.fault.onset == "start" and self.fault.kind in ("spikes", "hum", "drift")
        if virtual and self.levels == "V":
            return self.fault.onset == "start" and self.fault.kind not in ("reversed", "x0.1", "x10", "dead", "open")
        plain = self.fault.onset == "middle" and self.fault.kind in ("open", "x0.1", "reversed", "x10", "dead")
        return not (plain and (virtual or self.levels == "N logarithmic") and "friction" not in self.levels)


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
