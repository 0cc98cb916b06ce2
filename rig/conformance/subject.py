"""A driver under test: what the contract is told of it, and the steps that its tests share."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np

from rig.bench import Bench
from rig.daq import DAQ
from rig.errors import DaqRefused

__all__ = ["DriverUnderTest", "NotApplicable"]


class NotApplicable(Exception):  # noqa: N818 (not an error)
    """A test asks for a capability that the driver says it has not; a reason to skip, said aloud."""


class DriverUnderTest(ABC):
    """What the tests know of a driver. Override `make`; and ``amplitude_v``, ``tolerance_v`` for a physical bench."""

    amplitude_v = 0.05
    """Largest output of any test, V."""
    tolerance_v = 0.02
    """How still the inputs are with 0 V on the output, V RMS."""
    blocks = (1, 4, 10)
    """Block sizes that are tried, as far as the driver takes them."""

    @abstractmethod
    def make(self) -> DAQ:
        """A driver that is not open."""

    def make_loopback(self) -> DAQ | None:
        """A driver that is not open, with a channel that the output is connected to; None where there is none."""
        daq = self.make()
        return daq if any(channel.loopback for channel in daq.channels) else None

    def witness(self, daq: DAQ | None) -> float | None:
        """Largest voltage on the converter now, V, as others see it than the driver; None where nobody looks.

        Without a ``daq``, once the process that drove is dead. A virtual rig is looked at directly; override this for a
        device whose output is written down or measured.
        """
        seen = getattr(daq, "output_v", None)
        return None if seen is None else abs(float(seen))

    def bench_for_another_process(self) -> Bench | None:
        """A bench with which another process makes the same driver, to be killed; None where there is none."""
        return None

    def unplug(self, daq: DAQ) -> bool:
        """Take the device away while it is running; False where the contract does not know how."""
        return False

    def skip(self, reason: str) -> None:
        """What to do with a test that does not apply; pytest's skip where pytest runs the suite."""
        try:
            import pytest
        except ImportError:
            raise NotApplicable(reason) from None
        pytest.skip(reason)

    @contextmanager
    def running(self, block: int = 1) -> Iterator[DAQ]:
        """A driver that is running."""
        with self.make() as daq:
            if block > daq.capabilities.largest_block:
                self.skip(f"block {block}: the driver takes up to {daq.capabilities.largest_block}")
            daq.start(block)
            yield daq

    def sine(self, samples: int, rate_hz: float) -> np.ndarray:
        """A quiet sine of 20 Hz."""
        return np.asarray(self.amplitude_v * np.sin(2.0 * np.pi * 20.0 * np.arange(samples) / rate_hz))

    def refused(self, action: Callable[[], object]) -> str:
        """The message of the `DaqRefused` that an action must raise."""
        try:
            action()
        except DaqRefused as error:
            return str(error)
        raise AssertionError("was not refused")
