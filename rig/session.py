"""A session with a bench: its driver open and its loop running, in this process.

A virtual rig runs here, as fast as the machine allows.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from controller.law import Law
from controller.layout import AmplitudeLaw
from rig.bench import Bench
from rig.daq import DAQ, Capabilities
from rig.drivers import make_daq
from rig.loop import Loop, RunningLoop
from rig.sequencer.segments import Segment, SettleRule
from rig.tick.tick import Tick

__all__ = ["Session", "TickSettings", "open_session"]


@dataclass(frozen=True, eq=False)
class TickSettings:
    """What a tick is built from once the latency of the device is known; can be handed to another process."""

    bench: Bench
    law: Law
    amplitude_law: AmplitudeLaw
    settle: SettleRule
    segments: Sequence[Segment]
    waveforms: np.ndarray | None = None
    armed: bool = True

    def build(self, latency_samples: float) -> Tick:
        """The tick for a device of this latency: its outputs are one block later still."""
        return Tick(
            self.bench,
            self.law,
            self.amplitude_law,
            self.settle,
            self.segments,
            self.bench.block + latency_samples,
            waveforms=self.waveforms,
            armed=self.armed,
        )


class Session(Protocol):
    """A bench whose device is open."""

    capabilities: Capabilities
    """What its driver can do."""
    identity: dict[str, str]
    """What stands behind the driver, for the record."""

    def start(self, settings: TickSettings) -> RunningLoop:
        """Start the device and a loop over it; the loop runs when its rows are asked for. Once in a session."""


class LocalSession:
    """A session in this process."""

    def __init__(self, daq: DAQ, *, realtime: bool) -> None:
        self._daq, self._realtime = daq, realtime
        self.capabilities = daq.capabilities
        self.identity = daq.identity

    def start(self, settings: TickSettings) -> RunningLoop:
        """Start the device; the loop runs while its rows are taken."""
        self._daq.start(settings.bench.block)
        return Loop(self._daq, settings.build(self._daq.latency_samples), paced=self._realtime)


@contextmanager
def open_session(bench: Bench, seed: int = 0, *, realtime: bool = False) -> Iterator[Session]:
    """Open the bench's driver; on the way out its output is at 0 V and it is closed, whatever happened.

    ``realtime`` holds a virtual rig back to the wall clock. Raises `ConfigurationError`, `rig.errors.DaqError`.
    """
    with make_daq(bench, seed) as daq:
        yield LocalSession(daq, realtime=realtime)
