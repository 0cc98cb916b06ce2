"""A session with a bench: its driver is open and its loop runs, in this process or in another.

A virtual rig runs in this process, as fast as the machine allows. A rig with a clock runs in `rig.loop.worker`.
"""

import math
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, TypeAlias

from rig.bench import Bench
from rig.bench.cross_checks import refuse
from rig.daq import DAQ
from rig.drivers import make_daq
from rig.errors import ConfigurationError, RigError
from rig.loop.loop import Loop
from rig.loop.on_device import RunsLoops
from rig.loop.worker.queue_choice import QueueChoice, settle_queue
from rig.tick.tick import TickSettings

if TYPE_CHECKING:
    from rig.loop.worker.session import WorkerLoop, WorkerSession

RunningLoop: TypeAlias = "Loop | WorkerLoop"
"""A loop as a campaign sees it; it runs in this process, or in another or on the device and is collected there."""

NO_COLLECTOR = "this system has no process that collects the rows of a loop on the device"
NO_PROCESS = "this system has no process for the loop alone: it shares its time with the recorder, nothing is promised"


class LocalSession:
    """A session in this process.

    ``capabilities`` and ``identity`` are those of driver and device, ``latched`` is what the device had latched when it was
    opened, in words.
    """

    def __init__(self, daq: DAQ, bench: Bench, *, realtime: bool) -> None:
        self._daq, self._bench, self._realtime = daq, bench, realtime
        self._loop: Loop | None = None
        self._settled = False
        self.capabilities = daq.capabilities
        self.identity = daq.identity
        self.latched = daq.latched

    def settle_queue(
        self,
        *,
        feedback: bool = True,
        delay_s: float = math.inf,
        sizes: Mapping[str, int] | None = None,
        may_change: bool = False,
    ) -> QueueChoice | None:
        """Set the queue of the device for the run, once in a session and before `start`; return the choice.

        With ``queue_blocks = "auto"`` 0 V is exchanged with the device for a second and a half, see
        `rig.loop.worker.queue_choice.settle_queue`. ``feedback``: whether the plan's outputs answer what is measured;
        ``delay_s``: the longest delay that its gains bear. None if the driver has no queue to set. Conditions that the device
        had latched when it was opened are reset, so the caller must be armed if there are any. ``sizes``: of the plan's records
        (`rig.loop.on_device.record_sizes`), for a device that is to run the loop; if it has no room for them, the computer runs
        the loop of a bench with ``loop = "auto"``, and of any if it ``may_change``. Raises `rig.errors.DaqError`.
        """
        del sizes, may_change  # such a device has a process of its own
        self._daq.clear()
        self._settled = True
        return settle_queue(self._daq, self._bench, feedback=feedback, delay_s=delay_s)

    def start(self, settings: TickSettings) -> Loop:
        """Start the device and a loop over it, once in a session; the loop runs while its rows are taken.

        The queue is settled as for feedback unless that was done. Conditions that the device had latched when it was opened
        are reset, so the caller must be armed.
        """
        if not self._settled:
            self.settle_queue()
        self._daq.start(settings.bench.block)
        self.identity = self._daq.identity  # may say more once it runs
        loop = Loop(self._daq, settings.build(self._daq.latency_samples), paced=self._realtime)
        if self._realtime or self._daq.wall_clock:
            loop.notes = (NO_PROCESS,)
        self._loop = loop
        return loop

    def finish(self) -> None:
        """Ramp down a loop that still runs when the session is left early."""
        if self._loop is not None and not self._loop.over:
            self._loop.bring_down()


Session: TypeAlias = "LocalSession | WorkerSession"
"""A bench whose device is open."""


@contextmanager
def open_session(bench: Bench, seed: int = 0, *, realtime: bool = False) -> Iterator[Session]:
    """Open the bench's driver; when the context ends, whatever happened, set the output to 0 V and close the driver.

    A driver whose device has a clock is opened in a separate process, and so is a virtual rig that ``realtime`` slows to the
    wall clock. Raises `ConfigurationError` or `rig.errors.DaqError`.
    """
    from rig.loop.worker.session import WorkerSession
    from rig.loop.worker.spawn import supported

    refuse(bench)
    daq = make_daq(bench, seed)
    if isinstance(daq, RunsLoops) and daq.loop == "device" and not supported():
        raise ConfigurationError(NO_COLLECTOR, field="driver.options.loop", value=daq.loop)
    if supported() and (realtime or daq.wall_clock):
        del daq  # not open yet; the other process makes its own driver
        with WorkerSession(bench, seed) as session:
            yield session
        return
    try:
        daq.open()
        local = LocalSession(daq, bench, realtime=realtime)
        try:
            yield local
        finally:
            local.finish()
    finally:
        try:
            daq.close()
        except RigError as error:  # dropped, so that the recording is not lost
            warnings.warn(f"the driver failed when it was closed: {error}", RuntimeWarning, stacklevel=2)
