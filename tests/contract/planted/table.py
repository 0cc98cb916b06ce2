"""The table of planted faults: what is wrong with a driver, and the test of the kit that names it."""

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

from rig.daq import DAQ

BEGIN, END = "<!-- planted faults -->", "<!-- end of planted faults -->"
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
        return " ".join(inspect.getdoc(self.driver).split()).rstrip(".")


def planted(test: str) -> Callable[[Driver], Driver]:
    """Enter a driver into the table."""

    def enter(driver: Driver) -> Driver:
        PLANTED.append(Planted(driver, test))
        return driver

    return enter


def table() -> str:
    """The table in Markdown, by the test that names the fault."""
    tests = dict.fromkeys(one.test for one in PLANTED)
    lines = ["| planted in a good driver | fails |", "|---|---|"]
    for test in sorted(tests):
        words = "; ".join(one.words[0].lower() + one.words[1:] for one in PLANTED if one.test == test)
        lines.append(f"| {words} | {test.replace('_', ' ')} |")
    return "\n".join(lines)


def written(page: str) -> str:
    """A page with the table between its two marks."""
    before, _, rest = page.partition(f"{BEGIN}\n")
    return f"{before}{BEGIN}\n{table()}\n{END}{rest.partition(END)[2]}"
