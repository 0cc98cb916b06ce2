"""A virtual rig whose cables were exchanged behind the bench's back."""

from collections.abc import Callable

import numpy as np
import pytest

from rig.bench import Bench
from rig.daq import DAQ, Capabilities
from rig.drivers.virtual.driver import VirtualDAQ

Rewiring = Callable[[np.ndarray, Bench], None]
"""Changes readings [n, n_channels], in volts, in place."""


def column(bench: Bench, name: str) -> int:
    """Index of a channel."""
    return [channel.name for channel in bench.channels].index(name)


def flipped(name: str) -> Rewiring:
    """A sensor mounted the other way round."""

    def rewire(volts: np.ndarray, bench: Bench) -> None:
        volts[:, column(bench, name)] *= -1.0

    return rewire


def swapped(one: str, other: str) -> Rewiring:
    """Two cables in each other's socket."""

    def rewire(volts: np.ndarray, bench: Bench) -> None:
        i, j = column(bench, one), column(bench, other)
        volts[:, [i, j]] = volts[:, [j, i]]

    return rewire


def noise_only(name: str) -> Rewiring:
    """A cut cable: noise of some bits."""
    generator = np.random.default_rng(5)

    def rewire(volts: np.ndarray, bench: Bench) -> None:
        volts[:, column(bench, name)] = np.round(2.0 * generator.standard_normal(len(volts))) * 20.0 / 65536.0

    return rewire


def constant(name: str) -> Rewiring:
    """A channel that stands still."""

    def rewire(volts: np.ndarray, bench: Bench) -> None:
        volts[:, column(bench, name)] = 20.0 / 65536.0

    return rewire


def scaled(name: str, factor: float) -> Rewiring:
    """A sensor of another sensitivity."""

    def rewire(volts: np.ndarray, bench: Bench) -> None:
        volts[:, column(bench, name)] *= factor

    return rewire


class RewiredDAQ(DAQ):
    """A virtual rig, its readings rewired; ``virtual`` false makes it pass for something physical."""

    wall_clock = False  # in the test's own process

    def __init__(
        self,
        bench: Bench,
        seed: int,
        rewire: Rewiring | None,
        *,
        virtual: bool = True,
        safe_without_host: bool = True,
    ) -> None:
        super().__init__(bench.channels, bench.sample_rate_hz, bench.output_range_v)
        self.inner = VirtualDAQ(bench, seed)
        self.bench, self.rewire = bench, rewire
        self.differently = {"virtual": virtual, "safe_without_host": safe_without_host}

    @property
    def capabilities(self) -> Capabilities:
        """Those of the rig, but for whether anything moves, and what becomes of it without the host."""
        return self.inner.capabilities.model_copy(update=self.differently)

    @property
    def latency_samples(self) -> float:
        """That of the rig."""
        return self.inner.latency_samples

    @property
    def identity(self) -> dict[str, str]:
        """A made-up device."""
        return {"model": "rewired", "serial_number": "7"}

    def _open(self) -> None:
        self.inner.open()

    def _start(self) -> None:
        self.inner.start(self.block)

    def _exchange(self, voltages: np.ndarray, inputs: np.ndarray) -> None:
        inputs[:] = self.inner.exchange(voltages)
        if self.rewire is not None:
            self.rewire(inputs, self.bench)

    def _stop(self) -> None:
        self.inner.stop()

    def _close(self) -> None:
        self.inner.close()


def rewire(patch: pytest.MonkeyPatch, rewiring: Rewiring | None, **differently: bool) -> None:
    """Have every bench that is opened from now on rewired."""
    patch.setattr("rig.loop.session.make_daq", lambda bench, seed: RewiredDAQ(bench, seed, rewiring, **differently))


Column = Callable[[int, np.ndarray], np.ndarray]
"""Readings, V, of a channel from the first instant of a block and the outputs on the converter in it."""


class ExtraChannelDAQ(RewiredDAQ):
    """A virtual rig with one more channel, the last of the bench, that the rig knows nothing of."""

    def __init__(self, bench: Bench, seed: int, column: Column, *, virtual: bool = True) -> None:
        super().__init__(bench.model_copy(update={"channels": bench.channels[:-1]}), seed, None, virtual=virtual)
        self.channels = bench.channels
        self.column, self.first = column, 0

    def _exchange(self, voltages: np.ndarray, inputs: np.ndarray) -> None:
        inputs[:, :-1] = self.inner.exchange(voltages)
        inputs[:, -1] = self.column(self.first, voltages)
        self.first += len(voltages)


def add_channel(patch: pytest.MonkeyPatch, column: Column, *, virtual: bool = True) -> None:
    """Have every bench that is opened from now on deliver its last channel from elsewhere."""
    patch.setattr(
        "rig.loop.session.make_daq", lambda bench, seed: ExtraChannelDAQ(bench, seed, column, virtual=virtual)
    )
