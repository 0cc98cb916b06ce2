"""How a test sees the output: by a witness, or by a loopback that is read before the first new output shows."""

import math
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from typing import NamedTuple

import numpy as np

from rig.conformance.subject import DriverUnderTest
from rig.daq import DAQ, State
from rig.errors import DaqError

STILL = 0.1  # of the amplitude: an output below it counts as 0 V
POLL_S = 0.02  # s between two looks at the witness; chosen
UNSEEN = (
    "nothing sees the output: connect it to a channel with loopback = true, or override witness (voltmeter, second DAQ)"
)
BLIND = (
    "the loopback shows nothing that the output was left with: the device puts out its first new output, or 0 V, before it "
    "is read again. Override witness (voltmeter, second DAQ)"
)


class OutputReading(NamedTuple):
    """What is on the output, V, and whether that was read after a restart, which may itself have brought it to 0 V."""

    volts: float
    after_restart: bool


class OutputSteps(DriverUnderTest):
    """Steps of tests that look at the output."""

    message_s = 1.0
    """Time that a message takes to the device, and what it does to the witness, at most, s."""

    def make_visible(self) -> DAQ:
        """A driver that is not open, with a loopback where there is one."""
        return self.make_loopback() or self.make()

    @contextmanager
    def driven(self) -> Iterator[DAQ]:
        """A driver with its output at the amplitude, confirmed independently."""
        with self.punctual(), self.make_visible() as daq:
            daq.start(min(max(self.blocks), daq.capabilities.largest_block))
            if self.witness(daq) is None and loopback_of(daq) is None:
                self.unproven(UNSEEN)
            seen = self.drive(daq, self.amplitude_v)
            assert seen is None or seen > STILL * self.amplitude_v, (
                f"{self.amplitude_v:g} V were handed over for {daq.queue_blocks + 2} blocks, and {seen:g} V are on the output"
            )
            yield daq

    def drive(self, daq: DAQ, level_v: float) -> float | None:
        """Hand a voltage over until it is on the converter and the witness sees it, or a message has had its time.

        Returns what the witness sees, V; None without one.
        """
        end = time.monotonic() + self.message_s
        while True:
            for _ in range(daq.queue_blocks + 2):
                daq.exchange(np.full(daq.block, level_v))
            seen = self.witness(daq)
            if seen is None or abs(seen - abs(level_v)) <= STILL * self.amplitude_v or time.monotonic() > end:
                return seen

    def look(self, daq: DAQ) -> OutputReading:
        """What is on the output once a message has had its time; without a witness by the loopback, which needs a block."""
        end = time.monotonic() + self.message_s
        while (seen := self.witness(daq)) is not None and seen > STILL * self.amplitude_v and time.monotonic() < end:
            time.sleep(POLL_S)
        if seen is not None:
            return OutputReading(seen, after_restart=False)
        was_running = daq.state is State.RUNNING
        return OutputReading(self.reading_before_new_output(daq), after_restart=not was_running)

    def require_still(self, seen: OutputReading, when: str, *taken_away: str) -> None:
        """Require 0 V. What a restart shows counts only if it shows an output left without the methods ``taken_away``."""
        assert seen.volts <= STILL * self.amplitude_v, f"{seen.volts:g} V are on the output {when}"
        if seen.after_restart and not self._restart_shows_what_was_left(*taken_away):
            self.unproven(BLIND)

    def reading_before_new_output(self, daq: DAQ) -> float:
        """What the loopback reads before the first new output can show: what the converter has held until then, V.

        Behind filters that are late by a block or more, a loopback reads old outputs for twice their delay.
        """
        column = loopback_of(daq)
        assert column is not None
        if daq.state is State.RUNNING:
            for _ in range(math.floor(2.0 * daq.filter_delay_samples / daq.block)):
                daq.exchange(np.zeros(daq.block))
        if daq.state is State.CLOSED:
            daq.open()
            daq.clear()
        if daq.state is State.OPEN:
            daq.start(max(1, daq.block))
        first = daq.exchange(np.zeros(daq.block))[0, column]
        return abs(float(first) / daq.channels[column].sensitivity_v_per_unit)

    def _restart_shows_what_was_left(self, *taken_away: str) -> bool:
        """Drive, leave the output as it is by taking the driver's own way out away, and read the loopback at a restart."""
        with self.driven() as daq, suppress(DaqError):
            try:
                with ExitStack() as without:
                    for name in taken_away:
                        without.enter_context(replaced(daq, name, lambda *_: None))
                    daq.close() if "_close" in taken_away else daq.stop()
                return self.reading_before_new_output(daq) > 0.5 * self.amplitude_v
            finally:
                if daq.state is State.CLOSED:  # a restart that failed: let go of the device all the same
                    daq._close()
        return False


def loopback_of(daq: DAQ) -> int | None:
    """Column of the first loopback; None if there is none."""
    return next((index for index, channel in enumerate(daq.channels) if channel.loopback), None)


@contextmanager
def replaced(daq: DAQ, name: str, method: object) -> Iterator[None]:
    """A method of one driver, for a while another."""
    setattr(daq, name, method)
    try:
        yield
    finally:
        delattr(daq, name)
