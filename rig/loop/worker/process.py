"""The loop process: it opens the driver, takes orders from the campaign, runs the loop and reports the result."""

import select
import signal
import sys
from collections.abc import Callable
from functools import partial
from multiprocessing.connection import Connection
from types import FrameType
from typing import Any

import numpy as np

from rig.bench import Bench
from rig.daq import DAQ
from rig.drivers import make_daq
from rig.errors import ConfigurationError, DaqError, RigError
from rig.loop.on_device import ON_DEVICE, DeviceLoop, RunsLoops
from rig.loop.worker.collector import Collector
from rig.loop.worker.examination import examine_device
from rig.loop.worker.loop import WallClockLoop
from rig.loop.worker.memory import Layout, SharedMemory, chunk_of, packed
from rig.loop.worker.pace import pacing_of
from rig.loop.worker.placement import who_runs, why_no_room
from rig.loop.worker.probe import probe, round_trips
from rig.loop.worker.queue_choice import DelayBounds, QueueChoice, presumed_latency, queue_of, settle_queue
from rig.system.privileges import ordinary_scheduling, prepare
from rig.tick.kernels import tick_block
from rig.tick.layout import TickArrays
from rig.tick.tick import Tick, TickSettings

SIGNALS = ("SIGTERM", "SIGINT", "SIGHUP", "SIGQUIT")
COLLECTED_S, COLLECTED_CHUNKS = 120.0, 5
"""Rows of a loop on the device that wait for a late campaign at least, s, and chunks that it takes at a time; chosen: nothing
hurries it, and on a busy computer it may get a twentieth of a processor."""
LOCKSTEP_S = 40.0
"""The same in lockstep, s; chosen. A start that a late campaign judges may last so much longer."""
COLLECTED_BYTES = 256 * 2**20
"""Memory that these rows may take at most, bytes; chosen. Fewer seconds of them wait at high rates of many channels."""
MEASUREMENTS: dict[str, Callable[..., object]] = {
    "probe": probe,
    "round trips": round_trips,
    "examination": examine_device,
}
"""Orders that are answered once (`rig.loop.worker.spawn.ask`)."""


def main() -> None:
    """Run the loop process; its arguments are the descriptors of two pipes and the memory, see `rig.loop.worker.spawn`."""
    commands = Connection(int(sys.argv[1]), writable=False)
    facts = Connection(int(sys.argv[2]), readable=False)
    memory = int(sys.argv[3])
    try:
        name, *arguments = _told(commands)
        if name == "open":
            _serve(commands, facts, memory, *arguments)
        else:
            facts.send((name, MEASUREMENTS[name](*arguments)))
    except (EOFError, BrokenPipeError):
        return  # the campaign is gone, and the driver is closed
    except RigError as error:
        facts.send(("failed", described(error)))
    except Exception as error:
        facts.send(("failed", described(DaqError(f"the driver has failed: {type(error).__name__}: {error}"))))
        raise


def _told(commands: Connection) -> Any:
    """Return the next order; raise `ConfigurationError` if it holds an object whose class cannot be imported here."""
    try:
        return commands.recv()
    except (AttributeError, ImportError) as error:
        raise ConfigurationError(
            f"the loop's process cannot import what it was sent ({error}): a law, plan or driver of one's own must be "
            "defined in a module that can be imported, not in the script that is run"
        ) from None


def described(error: RigError) -> tuple[tuple[str, ...], str]:
    """Return an error in a form for the other process: names of its classes, most specific first, and its message."""
    return tuple(kind.__name__ for kind in type(error).__mro__), str(error)


def _serve(commands: Connection, facts: Connection, descriptor: int, bench: Bench, seed: int, privileged: bool) -> None:
    """Open the driver, and run one loop over it if the campaign says so."""
    with make_daq(bench, seed) as daq:
        on_device, why = who_runs(daq, bench)
        identity = dict(daq.identity) | ({"loop": "device"} if on_device else {})
        facts.send(("opened", daq.capabilities, identity, daq.latched, daq.remarks, dict(daq.counters)))
        _, of_plan, sizes, may_change = _told(commands)
        if on_device:
            why = why_no_room(daq, sizes, may_change=may_change)
        if on_device and not why:
            _serve_on_device(daq, bench, commands, facts, descriptor, privileged)
            return
        choice = _queue_choice(daq, bench, commands, of_plan, privileged)
        if choice is not None and why:
            choice = choice._replace(note=f"the loop runs on the computer: {why}")
        facts.send(("queue", choice))
        _, settings, ring_s = _told(commands)
        presumed = presumed_latency(daq, bench, queue_of(bench)) if choice is None else choice.latency_samples
        layout, memory = _shared(daq, settings, presumed, ring_s, descriptor)
        _load_kernels(daq, bench, settings)
        came, _ = _listen()
        # lockstep: no deadlines, and it never sleeps
        said = prepare(privileged=privileged and pacing_of(daq) != "lockstep")
        daq.start(bench.block)
        if daq.latency_samples > presumed:
            layout, memory = _shared(daq, settings, daq.latency_samples, ring_s, descriptor)
        released = _released(commands)
        tick = settings.build(daq.latency_samples)
        tick.arrays, state = packed(tick.arrays)
        loop = WallClockLoop(daq, tick, state, memory, facts, lambda: _asked(came, released))
        delay = bench.block + daq.latency_samples
        facts.send(("started", delay, layout, daq.remarks, daq.images, dict(daq.identity)))
        try:
            loop.run()
        finally:
            loop.stop()
        real_time = said | {"pacing": pacing_of(daq)}
        real_time |= {name: str(value) for name, value in (loop.disturbances | loop.times.report()).items()}
        statistics = {"deadline_us": round(1e-3 * loop.deadline_ns, 1), "real_time": real_time, **daq.statistics}
    failure = None if loop.failure is None else described(loop.failure)
    facts.send(("ended", failure, loop.cause, loop.counters, statistics))


def _serve_on_device(
    daq: DAQ, bench: Bench, commands: Connection, facts: Connection, descriptor: int, privileged: bool
) -> None:
    """Bring the plan to a device that runs the loop, and collect its rows."""
    assert isinstance(daq, RunsLoops)
    daq.clear()
    facts.send(("queue", None))  # there is none
    _, settings, ring_s = _told(commands)
    tick = Tick(settings, 1.0 + daq.loop_latency_samples)
    tick.arrays, state = packed(tick.arrays)
    lockstep = daq.capabilities.repeatable
    layout = (
        Layout.of(bench, tick.arrays, len(daq.counters), LOCKSTEP_S)
        if lockstep
        else collecting_layout(bench, tick.arrays, len(daq.counters), ring_s)
    )
    memory = SharedMemory(descriptor, layout, create=True)
    _ = tick.over  # loads its kernel
    came, _ = _listen()
    said = prepare(privileged=privileged and not lockstep)
    released = _released(commands)
    remote = daq.load_loop(tick.arrays, chunk_of(bench))
    loop = DeviceLoop(daq, remote, tick)
    collector = Collector(loop, state, memory, facts, lambda: _asked(came, released), lockstep=lockstep)
    try:
        remote.begin()
        identity = dict(daq.identity) | {"loop": "device"}
        facts.send(("started", 1.0 + daq.loop_latency_samples, layout, (ON_DEVICE, *daq.remarks), daq.images, identity))
        collector.run()
    finally:
        loop.stop()
    statistics = {"real_time": said | {"pacing": "device", "loop": "device"}, **daq.statistics}
    failure = None if loop.failure is None else described(loop.failure)
    facts.send(("ended", failure, collector.cause, dict(daq.counters), statistics))


def collecting_layout(bench: Bench, arrays: TickArrays, n_counters: int, ring_s: float) -> Layout:
    """Return the layout of the memory in which rows of a loop on the device wait, ``ring_s`` of them at least."""

    def of(seconds: float) -> Layout:
        return Layout.of(bench, arrays, n_counters, max(ring_s, seconds), COLLECTED_CHUNKS)

    whole = of(COLLECTED_S)
    return whole if whole.size <= COLLECTED_BYTES else of(COLLECTED_S * COLLECTED_BYTES / whole.size)


def _queue_choice(
    daq: DAQ, bench: Bench, commands: Connection, of_plan: DelayBounds, privileged: bool
) -> QueueChoice | None:
    """Settle the queue under the loop's own priority; a signal, or a campaign that is gone, ends the measurement.

    ``of_plan``: arguments of `settle_queue` that the plan gives.
    """
    daq.clear()
    allowed = daq.adjustable
    if allowed is None or not allowed.automatic or pacing_of(daq) == "lockstep":
        return settle_queue(daq, bench, **of_plan)
    came, before = _listen()
    released = _released(commands)
    prepare(privileged=privileged)
    try:
        return settle_queue(daq, bench, **of_plan, asked=lambda: _asked(came, released))
    finally:
        ordinary_scheduling()  # kernels may have to be compiled before the loop begins
        for restore in before:
            restore()


def _shared(
    daq: DAQ, settings: TickSettings, latency_samples: float, ring_s: float, descriptor: int
) -> tuple[Layout, SharedMemory]:
    """Return layout and shared memory, with room for a ramp and for the samples then still in the device's queue."""
    arrays = settings.build(latency_samples).arrays
    layout = Layout.of(settings.bench, arrays, len(daq.counters), ring_s)
    return layout, SharedMemory(descriptor, layout, create=True)


def _load_kernels(daq: DAQ, bench: Bench, settings: TickSettings) -> None:
    """Compile the loop's kernels, or load them from the cache, before any device runs."""
    tick = settings.build(0.0)
    arrays, _ = packed(tick.arrays)
    readings, rows = tick.buffers(0)
    nothing = np.empty((0, len(bench.channels)))
    none = np.empty(0)
    tick_block(arrays, nothing, np.zeros(0, np.uint16), readings, rows, none, none, daq.continuation)
    _ = tick.over
    if not daq.wall_clock:  # software, which begins anew at the next start
        daq.start(bench.block)
        daq.exchange(np.zeros(bench.block))
        daq.stop()


def _listen() -> tuple[list[str], list[Callable[[], object]]]:
    """Let signals only be noted from now on; return a list that collects their names, and what restores the handlers."""
    came: list[str] = []
    before: list[Callable[[], object]] = []

    def note(number: int, frame: FrameType | None) -> None:
        came.append(signal.Signals(number).name)

    for name in SIGNALS:
        if hasattr(signal, name):
            number = getattr(signal, name)
            before.append(partial(signal.signal, number, signal.signal(number, note)))
    return came, before


def _released(commands: Connection) -> select.poll:
    """Return a poll on the campaign's end of a pipe, because `Connection.poll` makes one at every call, as long as a block."""
    out = select.poll()
    out.register(commands, select.POLLIN)
    return out


def _asked(came: list[str], released: select.poll) -> str:
    """Return one sentence on what has asked this process to end (a signal, a campaign that is gone), or an empty text."""
    if came:
        return f"the loop's process was asked to end ({came[0]})"
    return "the campaign has released the loop" if released.poll(0) else ""  # readable: it was closed
