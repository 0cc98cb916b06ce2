"""A device by the clock whose own process is woken late: what it holds against the host, and what not."""

import numpy as np
import pytest

from rig.emulator import Device
from rig.emulator.parameters import described
from rig.emulator.process import keep_serving
from rig.wire.messages import ARM_KEY, Command, Message, Output, Parameter, Request, Samples
from tests.rig.emulator.test_device import BLOCK, QUEUE, RATE_HZ, Notebook, Outbox

BLOCK_S = BLOCK / RATE_HZ
BLOCKS = 50
SETTINGS = {Parameter.BLOCK: BLOCK, Parameter.QUEUE: QUEUE, Parameter.WATCHDOG_US: 10_000_000}


class HostOnALine(Outbox):
    """A host that answers every block after ``host_s``; the device's waits end ``oversleep_s`` late."""

    def __init__(self, host_s: float, oversleep_s: float) -> None:
        super().__init__()
        self.host_s, self.oversleep_s = host_s, oversleep_s
        self.now_s = 0.0
        requests = [Request(n + 1, Command.SET, one, 0, value) for n, (one, value) in enumerate(SETTINGS.items())]
        requests += [Request(10, Command.START), Request(11, Command.ARM, value=ARM_KEY)]
        self.under_way: list[tuple[float, Message]] = [(0.0, request) for request in requests]
        self.under_way.append((0.0, self.output(QUEUE)))

    def output(self, block: int) -> Output:
        return Output(block * BLOCK, np.full(BLOCK, 100, np.int16))

    def clock(self) -> float:
        return self.now_s

    def send(self, message: Message) -> None:
        super().send(message)
        if isinstance(message, Samples):
            block = message.first // BLOCK
            self.under_way.append((self.now_s + self.host_s, self.output(block + 1 + QUEUE)))

    def receive(self, timeout_s: float) -> Message | None:
        if not self.has_come() and timeout_s > 0.0:
            first = self.under_way[0][0] if self.under_way else np.inf
            self.now_s = min(first, self.now_s + timeout_s) + self.oversleep_s
        return self.under_way.pop(0)[1] if self.has_come() else None

    def has_come(self) -> bool:
        return bool(self.under_way) and self.under_way[0][0] <= self.now_s


def served(host_s: float, oversleep_s: float) -> tuple[Device, Notebook]:
    link, plant = HostOnALine(host_s, oversleep_s), Notebook()
    device = Device(plant, described(plant), link)
    keep_serving(device, lambda: device.measured >= BLOCKS * BLOCK, link.clock)
    return device, plant


@pytest.mark.parametrize("oversleep_s", [0.0, 0.2 * BLOCK_S, 0.6 * BLOCK_S, 0.9 * BLOCK_S])
def test_outputs_that_came_in_time_are_not_held_because_the_device_woke_late(oversleep_s: float) -> None:
    device, plant = served(QUEUE * BLOCK_S - oversleep_s - 0.001, oversleep_s)
    assert device.counts["held_blocks"] == device.counts["stalls"] == 0
    np.testing.assert_array_equal(plant.output_v[: QUEUE * BLOCK], 0.0)
    np.testing.assert_allclose(plant.output_v[QUEUE * BLOCK :], 0.1, rtol=1e-12)


@pytest.mark.parametrize("oversleep_s", [0.0, 0.2 * BLOCK_S])
def test_outputs_that_came_late_are_held_whether_it_woke_late_or_not(oversleep_s: float) -> None:
    device, _ = served((QUEUE + 0.5) * BLOCK_S, oversleep_s)
    assert device.counts["held_blocks"] > BLOCKS // 4
    assert device.counts["stalls"] == 0


def test_a_device_that_wakes_later_than_half_its_queue_stops_its_clock_and_says_so() -> None:
    device, plant = served(0.4 * QUEUE * BLOCK_S, 1.7 * BLOCK_S)
    assert device.counts["stalls"] > BLOCKS // 4
    assert device.counts["held_blocks"] == 0
    np.testing.assert_allclose(plant.output_v[QUEUE * BLOCK :], 0.1, rtol=1e-12)
