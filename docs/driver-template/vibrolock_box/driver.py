"""A driver for the box, a small DAQ with a serial number."""

import math

import numpy as np
from pydantic import Field

from rig.bench import Bench
from rig.bench.configuration import Configured, validated
from rig.daq import DAQ, Capabilities
from rig.errors import DaqDisconnected, DaqRefused

FILTER_HZ = 2000.0


def settled_share(rate_hz: float) -> float:
    """Part of a step that the input filter has let through one sample later."""
    return 1.0 - math.exp(-2.0 * math.pi * FILTER_HZ / rate_hz)


class Box:
    """Stand-in for the vendor's library."""

    def __init__(self, serial_number: str, n_inputs: int, rate_hz: float) -> None:
        self.plugged, self.output_v = True, 0.0
        self._inputs = np.zeros(n_inputs)
        self._gain = settled_share(rate_hz)

    def swap(self, voltages: np.ndarray, inputs: np.ndarray) -> None:
        """Sample by sample: put out at its beginning and hold, measure at its end."""
        if not self.plugged:
            raise OSError("no such device")
        for voltage, row in zip(voltages, inputs, strict=True):
            self.output_v = voltage
            self._inputs += self._gain * (voltage - self._inputs)
            row[:] = self._inputs

    def rest(self) -> None:
        """0 V."""
        self.output_v = 0.0
        self._inputs[:] = 0.0


class BoxOptions(Configured):
    """``[driver.options]`` of a bench with this driver."""

    serial_number: str = Field(min_length=1)
    """As printed on the box."""
    fastest_hz: float = Field(20000.0, gt=0)
    """Largest sample rate of this model, Hz."""


class BoxDAQ(DAQ):
    """The box behind the DAQ contract. Not handled: its digital lines."""

    def __init__(self, bench: Bench, seed: int = 0) -> None:
        super().__init__(bench.channels, bench.sample_rate_hz, bench.output_range_v)
        self.options = validated(BoxOptions, bench.driver.options, "driver.options")
        self.device: Box | None = None

    @property
    def capabilities(self) -> Capabilities:
        """Up to 256 samples a call; a real box is paced, not virtual, and does not repeat itself.

        ``safe_without_host`` only where the device has a watchdog of its own: the conformance suite kills a host to see.
        """
        return Capabilities(largest_block=256, paced=False, virtual=True, repeatable=True, safe_without_host=False)

    @property
    def latency_samples(self) -> float:
        """No queue, and the hold is over when the box measures; what is left is the filter's delay."""
        return 1.0 / settled_share(self.sample_rate_hz) - 1.0

    def _open(self) -> None:
        if self.sample_rate_hz > self.options.fastest_hz:
            raise DaqRefused(
                f"box {self.options.serial_number}: {self.sample_rate_hz:g} samples/s asked for, "
                f"it takes up to {self.options.fastest_hz:g}; lower sample_rate_hz of the bench"
            )
        self.device = Box(self.options.serial_number, len(self.channels), self.sample_rate_hz)

    def _start(self) -> None:
        pass  # the box samples on demand

    def _exchange(self, voltages: np.ndarray, inputs: np.ndarray) -> None:
        assert self.device is not None  # running implies open
        try:
            self.device.swap(voltages, inputs)
        except OSError as error:
            raise DaqDisconnected(
                f"box {self.options.serial_number}: {error}; plug it in and run `rig resume`"
            ) from error

    def _stop(self) -> None:
        if self.device is not None:
            self.device.rest()

    def _close(self) -> None:
        if self.device is not None:
            self.device.rest()
        self.device = None
