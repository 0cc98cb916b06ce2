"""The emulated NI gRPC Device Server: it listens on this computer alone."""

import sys
import threading
import time
from collections.abc import Callable
from concurrent import futures
from typing import TYPE_CHECKING, Self

import grpc

from rig.emulator.nidaqmx.calls import Calls
from rig.emulator.nidaqmx.devices import NI_9234, system
from rig.emulator.nidaqmx.facts import Facts
from rig.emulator.nidaqmx.faults import injections
from rig.emulator.nidaqmx.reaching import chassis_options, reaching_bench
from rig.emulator.nidaqmx.tasks import Tasks
from rig.emulator.nidaqmx.timeline import TICK_S, Timeline
from rig.emulator.plant import OutputLog, Wiring

if TYPE_CHECKING:
    from rig.bench.configuration import Table
    from rig.emulator.settings import EmulatorSettings

HOST = "127.0.0.1"
"""Address that it listens on."""
THREADS = 4
"""Threads that answer calls: one that waits for samples, one that writes them, and two to spare."""
IDLE_S = 0.02
"""Interval at which watchdogs are looked after where nothing is sampled, s."""
SWITCH_S = 2e-4
"""Time after which a thread of Python lets another one run, s: 5 ms, as it is by itself, last as long as a block."""


class DeviceServer:
    """A server with the virtual rig of a bench behind its devices; a context manager."""

    def __init__(self, settings: "EmulatorSettings", *, on_call: Callable[[str], None] = lambda name: None) -> None:
        bench = settings.bench
        sensors = tuple(channel for channel in bench.channels if not channel.loopback)
        wiring = Wiring(tuple(c.name for c in sensors), settings.flip, settings.dead, settings.swap)
        devices = system(watchdog=settings.device_watchdog)
        self.timeline = Timeline(bench, settings.seed, wiring, lockstep=settings.lockstep)
        if settings.log_output is not None:
            self.timeline.log = OutputLog(settings.log_output)
        facts = Facts(devices, sensors, simulated=not settings.as_hardware)
        self.tasks = Tasks(devices, self.timeline)
        self.calls = Calls(self.tasks, facts, on_call)
        self.calls.injections += injections(settings.faults)
        with self.timeline.lock:  # what takes long is done before a client can connect
            self.timeline.prepare(reaching_bench(bench, {}).sample_rate_hz, NI_9234)
        self._ends = threading.Event()
        self.port = 0
        """Port that it listens on, while it does."""

    def __enter__(self) -> Self:
        sys.setswitchinterval(SWITCH_S)
        self._server = grpc.server(
            futures.ThreadPoolExecutor(THREADS, thread_name_prefix="call"), handlers=(self.calls,)
        )
        self.port = self._server.add_insecure_port(f"{HOST}:0")
        self._server.start()
        self._ticker = threading.Thread(target=self._tick, name="clock")
        self._ticker.start()
        return self

    @property
    def counts(self) -> dict[str, int]:
        """Calls that were refused, and how often this process was not scheduled in time."""
        return {**self.calls.counts, "stalls": self.timeline.stood_still}

    def _tick(self) -> None:
        while not self._ends.wait(TICK_S if self.timeline.on else IDLE_S):
            with self.timeline.lock:
                self.timeline.tick()
                self.tasks.watchdogs.expire()

    def __exit__(self, *_: object) -> None:
        self._ends.set()
        self._server.stop(0.2).wait()
        self._ticker.join()


def run_device_server(
    settings: "EmulatorSettings", when_ready: Callable[["Table"], None], should_end: Callable[[], bool]
) -> dict[str, int]:
    """Serve until ``should_end``; return what was counted. ``when_ready`` is given the driver options that reach it."""
    with DeviceServer(settings) as server:
        when_ready(chassis_options(settings.bench, server.port, lockstep=settings.lockstep))
        while not should_end():
            time.sleep(0.05)
        return server.counts
