"""The table of planted faults: what is wrong with a driver, and the test of the kit that names it."""

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

from rig.daq import DAQ

Driver = TypeVar("Driver", bound=type[DAQ])

PLANTED: list["Planted"] = []
"""Every planted fault, in the order in which its module has it."""


@dataclass(frozen=True)
class Planted:
    """A driver with one fault, and the name of the test that must fail it, without ``test_``."""

    driver: type[DAQ]
    test: str

    @property
    def words(self) -> str:
        """The fault in words: the docstring of the driver, in one line."""
        return " ".join(inspect.getdoc(self.driver).split())


def planted(test: str) -> Callable[[Driver], Driver]:
    """Enter a driver into the table."""

    def enter(driver: Driver) -> Driver:
        PLANTED.append(Planted(driver, test))
        return driver

    return enter
