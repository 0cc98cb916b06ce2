"""The contract without pytest: every test once over an installed driver, with what came out."""

import inspect
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

import numpy as np

from rig.bench import Bench
from rig.conformance.answers import with_loopback
from rig.conformance.contract import DriverContract
from rig.conformance.subject import NotApplicable, Unproven
from rig.conformance.timing import SLOW_TEST
from rig.conformance.without_host import KILLING_TEST, last_output_v
from rig.daq import DAQ
from rig.drivers import make_daq
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


class _OnBench(DriverContract):
    """The contract over the driver of a bench."""

    def __init__(self, bench: Bench, output_log: Path | None) -> None:
        self._bench, self._output_log = bench, output_log

    def make(self) -> DAQ:
        return make_daq(self._bench)

    def make_loopback(self) -> DAQ | None:
        bench = with_loopback(self._bench)
        return None if bench is None else make_daq(bench)

    def bench_for_another_process(self) -> Bench:
        return self._bench

    def witness(self, daq: DAQ | None) -> float | None:
        return super().witness(daq) if self._output_log is None else last_output_v(self._output_log)

    def known_inputs(self, outputs: np.ndarray, block: int) -> np.ndarray | None:
        """Those of a virtual rig of the same bench."""
        if self._bench.driver.name != "virtual":
            return None
        with VirtualDAQ(self._bench) as known:
            known.start(block)
            return np.vstack([known.exchange(part.copy()) for part in outputs.reshape(-1, block)])

    def skip(self, reason: str) -> None:
        raise NotApplicable(reason)

    def unproven(self, reason: str) -> None:
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
        found = _found(contract, name) if not slow else _left_out(contract, name)
        yield found
        _clear_after(found, name, contract)
        slow = slow or (name == SLOW_TEST and found.outcome == "failed")


def unproven(findings: Iterable[Finding]) -> dict[str, list[str]]:
    """The tests that could not be judged, by the reason."""
    out: dict[str, list[str]] = {}
    for finding in findings:
        if finding.outcome == "unproven":
            out.setdefault(finding.detail, []).append(finding.test)
    return out


def _clear_after(found: Finding, name: str, contract: DriverContract) -> None:
    """Clear the watchdog that a test makes latch, or that a test that was not passed has left latched where nothing moves."""
    if name != KILLING_TEST and found.outcome not in ("failed", "unproven"):
        return
    with suppress(DaqError), contract.make() as daq:
        if name == KILLING_TEST or daq.capabilities.virtual:
            daq.clear()


def _found(contract: DriverContract, name: str) -> Finding:
    words, duty = _words(contract, name)
    try:
        with contract.punctual():
            getattr(contract, name)()
    except Unproven as reason:
        return Finding(words, duty, "unproven", str(reason))
    except NotApplicable as reason:
        return Finding(words, duty, "not applicable", str(reason))
    except Exception as error:  # a driver may fail in any way: that is what is looked for
        return Finding(words, duty, "failed", " ".join(f"{type(error).__name__}: {error}".split()))
    return Finding(words, duty, "passed")


def _left_out(contract: DriverContract, name: str) -> Finding:
    return Finding(*_words(contract, name), "not applicable", "the driver is too slow to be tested any further")


def _words(contract: DriverContract, name: str) -> tuple[str, str]:
    """Name and duty of a test."""
    return name.removeprefix("test_").replace("_", " "), " ".join(
        (inspect.getdoc(getattr(contract, name)) or "").split()
    )
