"""How long a block takes: what a loop can rely on, with room for a busy machine."""

import math
import time

import numpy as np

from rig.conformance.subject import DriverUnderTest

__all__ = ["SLOW_TEST", "TimingTests"]

SLOW_TEST = "test_a_block_takes_no_longer_than_it_lasts"
BLOCK_S = 0.05
BLOCKS = 5
PACED_FACTOR = 2.0  # of a block's own time: the median block of a device with a clock
WAITING_FACTOR = 10.0  # of one that returns at once, or waits for the host
SHORTEST_S = 0.1  # that a busy machine may need for any block


class TimingTests(DriverUnderTest):
    """Tests of the clock."""

    def test_a_block_takes_no_longer_than_it_lasts(self) -> None:
        """The median of some blocks: up to twice its own time where the device has a clock, ten times where it has none."""
        with self.make() as daq:
            capabilities = daq.capabilities
            block = min(capabilities.largest_block, max(1, math.ceil(BLOCK_S * daq.sample_rate_hz)))
            daq.start(block)
            daq.exchange(np.zeros(block))  # what is compiled or filled at first takes no part
            taken_s = []
            for _ in range(BLOCKS):
                began = time.perf_counter()
                daq.exchange(np.zeros(block))
                taken_s.append(time.perf_counter() - began)
        block_s = block / daq.sample_rate_hz
        has_clock = capabilities.paced and not capabilities.repeatable
        allowed_s = max(SHORTEST_S, block_s * (PACED_FACTOR if has_clock else WAITING_FACTOR))
        median_s = float(np.median(taken_s))
        assert median_s <= allowed_s, (
            f"a block of {block} samples lasts {block_s:.3g} s and takes {median_s:.3g} s: allowed is {allowed_s:.3g} s"
        )
