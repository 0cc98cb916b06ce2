"""The test that a device that is gone is an error in time, and can be closed."""

import time

import numpy as np

from rig.conformance.subject import TOO_BUSY
from rig.conformance.timing import TimingTests
from rig.daq import State
from rig.errors import DaqError

BLOCKS = 1000
"""Blocks that a driver may have in store."""


class GoneTests(TimingTests):
    """A cable that is pulled."""

    def test_a_device_that_is_gone_is_a_daq_error_and_can_be_closed(self) -> None:
        """`unplug` takes the device away: within a second exchange raises a `DaqError` that says something, and close ends."""
        daq, message = self.make(), ""
        try:
            daq.open()
            daq.start(1)
            if not self.unplug(daq):
                self.unproven("the contract has not been told how this device is unplugged (override unplug)")
            with self.host() as host:
                began = time.perf_counter()
                try:
                    for _ in range(BLOCKS):
                        before_s = self.now_s(daq)
                        daq.exchange(np.zeros(1))
                except DaqError as error:
                    message = str(error)
                assert message, "exchange went on without a device, or failed without a word"
                closing_s = self.now_s(daq)
                daq.close()
                closed_s = self.now_s(daq)
                host_late_s = host.late_s(began, time.perf_counter())
        finally:
            daq.close()
        assert daq.state is State.CLOSED, f"after close the driver is {daq.state.value}"
        for what, taken_s in (("exchange", closing_s - before_s), ("close", closed_s - closing_s)):
            if self.prompt_s < taken_s <= self.prompt_s + host_late_s:
                self.unproven(TOO_BUSY)
            assert taken_s <= self.prompt_s, (
                f"{what} takes {taken_s:.3g} s once the device is gone: allowed is {self.prompt_s:g} s"
            )
