"""Tests that the output is at 0 V after a run: after 0 V, stop, close, an exception, and without the host."""

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from rig.bench import Bench
from rig.conformance.subject import DriverUnderTest
from rig.daq import DAQ, State
from rig.errors import DaqError

__all__ = ["KILLING_TEST", "WaysOutTests", "last_output_v"]

KILLING_TEST = "test_the_output_comes_to_0_v_without_the_host"

STILL = 0.1  # of the amplitude: an output below it counts as 0 V
LOOKS_S = 0.02
MESSAGE_S = 1.0  # to a device in another process of a busy machine
UNSEEN = "nobody sees the output: override witness, or connect it to a channel with loopback = true"


def last_output_v(log: Path) -> float:
    """The last output in an emulator's log (``rig emulate --log-output``), V: a witness that is not the driver."""
    lines = log.read_text(encoding="ascii").rpartition("\n")[0].splitlines()
    return float(lines[-1].split()[2]) if lines else 0.0


class WaysOutTests(DriverUnderTest):
    """Tests that look at the output from outside."""

    safe_within_s = 5.0
    """Time that a device has to bring its output to 0 V once its host is dead, s."""

    def test_0_v_that_are_exchanged_are_on_the_converter(self) -> None:
        """After the blocks of the queue and one more."""
        with self._driven() as daq:
            daq.exchange_zeros()
            self._require_still(daq, "after 0 V was exchanged")

    def test_stop_alone_brings_the_output_to_0_v(self) -> None:
        """Where no block of 0 V can be exchanged any more."""
        with self._driven() as daq:
            daq.stop()
            self._require_still(daq, "after stop")

    def test_close_alone_brings_the_output_to_0_v(self) -> None:
        """Where `_stop` was never called, or has not got through."""
        with self._driven() as daq:
            daq.state = State.OPEN
            daq.close()
            self._require_still(daq, "after close")

    def test_an_exception_in_exchange_ends_at_0_v(self) -> None:
        """A block that fails in any way is a `DaqError`, and what follows brings the output down."""
        with self._driven() as daq:
            failed = False
            with _replaced(daq, "_exchange", _fail):
                try:
                    daq.exchange(np.zeros(daq.block))
                except DaqError:
                    failed = True
                daq.exchange_zeros()
                daq.stop()
            assert failed, "an exception inside the driver is no DaqError"
            self._require_still(daq, "after an exception and stop")

    def test_the_output_comes_to_0_v_without_the_host(self) -> None:
        """A driver that says ``safe_without_host`` is driven in a process of its own, which is killed."""
        with self.make() as daq:
            capabilities, column = daq.capabilities, _loopback_of(daq)
        if not capabilities.safe_without_host:
            self.skip(
                "the driver does not say that it is safe without the host: [arming] asks for a hardware emergency stop"
            )
        bench = self.bench_for_another_process()
        if bench is None:
            self.skip("the contract has no bench that another process could open (override bench_for_another_process)")
        assert bench is not None
        if self.witness(None) is None and (column is None or capabilities.virtual):
            self.skip("nothing is left to look at once the process is dead: no witness (override witness), no loopback")
        self._drive_and_kill(bench)
        seen = self._waited_for_0_v()
        assert seen <= STILL * self.amplitude_v, (
            f"{seen:g} V are on the output {self.safe_within_s:g} s after the process that drove it was killed"
        )

    def _waited_for_0_v(self) -> float:
        """Output once it is at 0 V or the time is over; without a witness it is read from the loopback of a new driver."""
        end = time.monotonic() + self.safe_within_s
        while time.monotonic() < end:
            seen = self.witness(None)
            if seen is not None and seen <= STILL * self.amplitude_v:
                return seen
            time.sleep(LOOKS_S)
        seen = self.witness(None)
        if seen is not None:
            return seen
        with self.make() as daq:
            return self._restarted(daq)

    def _drive_and_kill(self, bench: Bench) -> None:
        """Have another process drive the bench, and kill it."""
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path or str(Path.cwd()) for path in sys.path)}
        command = [sys.executable, "-P", "-m", "rig.conformance.driving"]
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
        with subprocess.Popen(command, text=True, env=environment, **pipes) as process:  # type: ignore[call-overload]
            try:
                told = {"bench": bench.model_dump(mode="json"), "amplitude_v": self.amplitude_v}
                process.stdin.write(json.dumps(told) + "\n")
                process.stdin.flush()
                assert process.stdout.readline().strip() == "driven", "the other process could not drive the bench"
                seen = self.witness(None)
                assert seen is None or seen > STILL * self.amplitude_v, "the witness sees nothing of what is driven"
            finally:
                process.kill()

    @contextmanager
    def _driven(self) -> Iterator[DAQ]:
        """A driver with its output at the amplitude, confirmed independently."""
        with self.make() as daq:
            daq.start(min(10, daq.capabilities.largest_block))
            if self.witness(daq) is None and _loopback_of(daq) is None:
                self.skip(UNSEEN)
            for _ in range(daq.queue_blocks + 2):
                daq.exchange(np.full(daq.block, self.amplitude_v))
            seen = self.witness(daq)
            assert seen is None or seen > STILL * self.amplitude_v, (
                f"{self.amplitude_v:g} V were handed over for {daq.queue_blocks + 2} blocks, and {seen:g} V are on the output"
            )
            yield daq

    def _require_still(self, daq: DAQ, when: str) -> None:
        """Require 0 V, after the time that a message takes to the device."""
        end = time.monotonic() + MESSAGE_S
        while (seen := self.witness(daq)) is not None and seen > STILL * self.amplitude_v and time.monotonic() < end:
            time.sleep(LOOKS_S)
        seen = self._restarted(daq) if seen is None else seen
        assert seen <= STILL * self.amplitude_v, f"{seen:g} V are on the output {when}"

    def _restarted(self, daq: DAQ) -> float:
        """What the loopback reads before the first new output can show: what the converter has held until then."""
        column = _loopback_of(daq)
        assert column is not None
        if daq.state is State.CLOSED:
            daq.open()
            daq.clear()
        if daq.state is State.OPEN:
            daq.start(max(1, daq.block))
        first = daq.exchange(np.zeros(daq.block))[0, column]
        return abs(float(first) / daq.channels[column].sensitivity_v_per_unit)


def _loopback_of(daq: DAQ) -> int | None:
    return next((index for index, channel in enumerate(daq.channels) if channel.loopback), None)


def _fail(*arguments: object) -> None:
    raise RuntimeError("made to fail by the contract")


@contextmanager
def _replaced(daq: DAQ, name: str, method: object) -> Iterator[None]:
    """A method of one driver, for a while another."""
    setattr(daq, name, method)
    try:
        yield
    finally:
        delattr(daq, name)
