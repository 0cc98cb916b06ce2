"""A driver under test: what a driver provides for the contract, and steps that the tests share."""

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import NoReturn

import numpy as np

from rig.bench import Bench
from rig.conformance.host import HostWatch
from rig.daq import DAQ
from rig.errors import DaqOverrun, DaqRefused, DaqTimeout, DaqWatchdog

TOO_BUSY = "this machine was too busy to judge the device: try again when it is idle"


class NotApplicable(Exception):  # noqa: N818 (not an error)
    """A test does not concern the driver, by its capabilities, and is skipped with this reason."""


class Unproven(NotApplicable):
    """A test concerns the driver, and cannot be judged: what it needs to see is missing, or the host was late."""


def has_clock(daq: DAQ) -> bool:
    """Whether a device has a clock that does not wait for the host."""
    return daq.capabilities.paced and not daq.capabilities.repeatable


class DriverUnderTest(ABC):
    """The driver as the tests see it. Override `make`; and ``amplitude_v``, ``tolerance_v`` for a physical bench."""

    amplitude_v = 0.05
    """Largest output of any test where something physical moves, V."""
    tolerance_v = 0.02
    """Noise of the inputs with 0 V on the output, V RMS."""
    blocks: tuple[int, ...] = (1, 4, 10)
    """Block sizes that are tried, if the driver allows them; the largest one in every test that takes more than some blocks."""

    prompt_s = 1.0
    """Time that stop and close may take, and that it may take to find out that the device is gone, s."""

    @abstractmethod
    def make(self) -> DAQ:
        """A driver that is not open."""

    def make_loopback(self) -> DAQ | None:
        """A driver that is not open, with a channel that the output is connected to; None where there is none."""
        daq = self.make()
        return daq if any(channel.loopback for channel in daq.channels) else None

    def witness(self, daq: DAQ | None) -> float | None:
        """Magnitude of the voltage on the converter now, V, seen independently of the driver; None if that is not possible.

        Without a ``daq``, once the process that drove is dead. A virtual rig is looked at directly; override this for a
        device whose output is written down or measured.
        """
        seen = getattr(daq, "output_v", None)
        return None if seen is None else abs(float(seen))

    def known_inputs(self, outputs: np.ndarray, block: int) -> np.ndarray | None:
        """Inputs that the device is known to return for ``outputs`` [n] from `start` on, [n, channels], V; None if unknown.

        For a device whose answer is known from elsewhere: a virtual rig, a calibrated filter in place of the structure.
        """
        return None

    def bench_for_another_process(self) -> Bench | None:
        """A bench with which another process makes the same driver, to be killed; None where there is none."""
        return None

    def unplug(self, daq: DAQ) -> bool:
        """Take the device away while it is running; False if that is not possible."""
        return False

    def now_s(self, daq: DAQ) -> float:
        """Time by a clock that the device knows nothing of, s."""
        return time.perf_counter()

    def pause(self, daq: DAQ, seconds: float) -> None:
        """Let time pass by the clock of `now_s`."""
        time.sleep(seconds)

    def host(self) -> HostWatch:
        """A context that notes when this machine was late."""
        return HostWatch()

    def skip(self, reason: str) -> NoReturn:
        """Skip a test that does not apply: by pytest if it is installed, else by `NotApplicable`."""
        try:
            import pytest
        except ImportError:
            raise NotApplicable(reason) from None
        pytest.skip(reason)

    def unproven(self, reason: str) -> NoReturn:
        """End a test that applies and cannot be judged, with what it would take."""
        self.skip(f"unproven: {reason}")

    @contextmanager
    def punctual(self) -> Iterator[HostWatch]:
        """A context in which a device that complains of a late host is not judged if this machine was late."""
        with self.host() as host:
            began = time.perf_counter()
            try:
                yield host
            except (DaqOverrun, DaqTimeout, DaqWatchdog) as error:
                if not host.late_s(began, time.perf_counter()):
                    raise
                self.unproven(f"{TOO_BUSY}: {error}")

    @contextmanager
    def running(self, block: int = 1) -> Iterator[DAQ]:
        """A driver that is running, in blocks of that size or of the largest that it allows."""
        with self.punctual(), self.make() as daq:
            daq.start(min(block, daq.capabilities.largest_block))
            yield daq

    def sine(self, samples: int, rate_hz: float) -> np.ndarray:
        """A quiet sine of 20 Hz."""
        return np.asarray(self.amplitude_v * np.sin(2.0 * np.pi * 20.0 * np.arange(samples) / rate_hz))

    def signs(self, samples: int) -> np.ndarray:
        """``amplitude_v`` with random signs, the same at every call."""
        return np.asarray(self.amplitude_v * np.random.default_rng(1).choice([-1.0, 1.0], samples))

    def refused(self, action: Callable[[], object]) -> str:
        """The message of the `DaqRefused` that an action must raise."""
        try:
            action()
        except DaqRefused as error:
            return str(error)
        raise AssertionError("was not refused")
