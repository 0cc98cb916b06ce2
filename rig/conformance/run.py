"""The contract without pytest: every test once over an installed driver, with what came out."""

import inspect
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from rig.bench import Bench
from rig.conformance.contract import DriverContract, NotApplicable
from rig.daq import DAQ
from rig.drivers import make_daq
from rig.errors import NotArmed

__all__ = ["Finding", "check_driver", "require_arming"]


@dataclass(frozen=True)
class Finding:
    """What one test of the contract has found; ``detail`` says why it failed or did not apply."""

    test: str
    duty: str
    outcome: Literal["passed", "failed", "not applicable"]
    detail: str = ""


class _OnBench(DriverContract):
    """The contract over the driver of a bench."""

    def __init__(self, bench: Bench) -> None:
        self._bench = bench

    def make(self) -> DAQ:
        return make_daq(self._bench)

    def skip(self, reason: str) -> None:
        raise NotApplicable(reason)


def require_arming(bench: Bench, arm: bool) -> None:
    """Raise `NotArmed` where something physical would move and nobody has said that it may; opens the device to ask it.

    What it has latched until then is cleared; what latches from then on stays so.
    """
    with make_daq(bench) as daq:
        if not daq.capabilities.virtual and not arm:
            raise NotArmed(
                f"bench {bench.name}: something physical would move by up to {DriverContract.amplitude_v:g} V; "
                "look, then give --arm"
            )
        daq.clear()


def check_driver(bench: Bench) -> Iterator[Finding]:
    """Every test of the contract over the bench's driver, one after the other. Nothing is asked about arming here."""
    contract = _OnBench(bench)
    for name, method in inspect.getmembers(contract, inspect.ismethod):
        if not name.startswith("test_"):
            continue
        words = name.removeprefix("test_").replace("_", " ")
        duty = " ".join((inspect.getdoc(method) or "").split())
        try:
            method()
        except NotApplicable as reason:
            yield Finding(words, duty, "not applicable", str(reason))
        except Exception as error:  # a driver may fail in any way: that is what is looked for
            yield Finding(words, duty, "failed", " ".join(f"{type(error).__name__}: {error}".split()))
        else:
            yield Finding(words, duty, "passed")
