"""The contract without pytest: every test once over an installed driver, with what came out."""

import inspect
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NoReturn, get_args

import numpy as np

from rig.bench import Bench
from rig.conformance.contract import BenchContract, DriverContract
from rig.conformance.subject import NotApplicable, Unproven
from rig.conformance.timing import SLOW_TEST
from rig.conformance.without_host import KILLING_TEST, last_output_v
from rig.daq import DAQ
from rig.drivers import make_daq
from rig.drivers.oversampled import at_loop_rate
from rig.drivers.virtual import VirtualDAQ
from rig.errors import DaqError, NotArmed

Outcome = Literal["passed", "failed", "not applicable", "unproven"]
OUTCOMES: tuple[Outcome, ...] = get_args(Outcome)
"""In the order in which they are counted."""


@dataclass(frozen=True)
class Finding:
    """Result of one test of the contract; ``detail`` says why it failed, did not apply, or what would prove it."""

    test: str
    duty: str
    outcome: Outcome
    detail: str = ""


class _OnBench(BenchContract):
    def __init__(self, bench: Bench, output_log: Path | None) -> None:
        self.take(bench)
        self._output_log = output_log

    def witness(self, daq: DAQ | None) -> float | None:
        return super().witness(daq) if self._output_log is None else last_output_v(self._output_log)

    def known_inputs(self, outputs: np.ndarray, block: int) -> np.ndarray | None:
        """Those of a virtual rig of the same bench."""
        if self.bench.driver.name != "virtual":
            return None
        with at_loop_rate(VirtualDAQ(self.bench), self.bench) as known:
            known.start(block)
            return np.vstack([known.exchange(part.copy()) for part in outputs.reshape(-1, block)])

    def skip(self, reason: str) -> NoReturn:
        raise NotApplicable(reason)

    def unproven(self, reason: str) -> NoReturn:
        raise Unproven(reason)


def require_arming(bench: Bench, arm: bool) -> None:
    """Raise `NotArmed` if a physical device is not armed; the device is opened to ask whether it is one.

    What it has latched until then is cleared; what latches from then on stays so, but for what `check_driver` makes latch.
    """
    with make_daq(bench) as daq:
        if not daq.capabilities.virtual and not arm:
            raise NotArmed(
                f"bench {bench.name}: something physical would move by up to {DriverContract.amplitude_v:g} V; "
                "look, then give `arm`"
            )
        daq.clear()


def check_driver(bench: Bench, output_log: Path | None = None) -> Iterator[Finding]:
    """Every test of the contract over the bench's driver, one after the other. Nothing is asked about arming here.

    ``output_log``: where the device is an emulator that writes its outputs down (``rig emulate --log-output``), that file.
    A driver that is too slow for any test is not tested further, for it would take hours. The watchdog that latches because a
    test kills the host is cleared after that test, and what a failure has left latched where the device is virtual.
    """
    contract = _OnBench(bench, output_log)
    names = [name for name, _ in inspect.getmembers(contract, inspect.ismethod) if name.startswith("test_")]
    slow = False
    for name in sorted(names, key=lambda name: name != SLOW_TEST):
        found = _found(contract, name, left_out=slow)
        yield found
        # the watchdog that a test makes latch, or that a test that was not passed has left latched where nothing moves
        if name == KILLING_TEST or found.outcome in ("failed", "unproven"):
            with suppress(DaqError), contract.make() as daq:
                if name == KILLING_TEST or daq.capabilities.virtual:
                    daq.clear()
        slow = slow or (name == SLOW_TEST and found.outcome == "failed")


def unproven(findings: Iterable[Finding]) -> dict[str, list[str]]:
    """The tests that could not be judged, by the reason."""
    out: dict[str, list[str]] = {}
    for finding in findings:
        if finding.outcome == "unproven":
            out.setdefault(finding.detail, []).append(finding.test)
    return out


def _found(contract: DriverContract, name: str, left_out: bool) -> Finding:
    """Finding of one test, or that it was ``left_out``."""
    duty = " ".join((inspect.getdoc(getattr(contract, name)) or "").split())
    outcome: Outcome = "passed"
    detail = ""
    try:
        if left_out:
            raise NotApplicable("the driver is too slow to be tested any further")
        with contract.punctual():
            getattr(contract, name)()
    except Unproven as reason:
        outcome, detail = "unproven", str(reason)
    except NotApplicable as reason:
        outcome, detail = "not applicable", str(reason)
    except Exception as error:  # a driver may fail in any way: that is what is looked for
        outcome, detail = "failed", " ".join(f"{type(error).__name__}: {error}".split())
    return Finding(name.removeprefix("test_").replace("_", " "), duty, outcome, detail)
