"""A small host of a device that runs the loop itself: it uploads the records of a run, and takes rows and states."""

import os
import select
import signal
import time
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from controller import AmplitudeLaw, preset
from rig.bench import Bench
from rig.drivers.virtual.driver import HOLD_SAMPLES
from rig.emulator.firmware import Firmware, description
from rig.emulator.plant import VirtualPlant
from rig.emulator.programs import Running, running
from rig.emulator.settings import EmulatorSettings
from rig.firmware.signature import arguments_for
from rig.tick.kernels import tick_block
from rig.tick.layout import ROW, TickArrays
from rig.tick.safety.layout import GuardMode
from rig.tick.sequencer.segments import Segment
from rig.tick.tick import Tick, TickSettings
from rig.wire.messages import (
    ARM_KEY,
    LARGEST_PIECE,
    VERSION,
    Answer,
    Command,
    DeviceFlag,
    Heartbeat,
    Message,
    Parameter,
    Record,
    Request,
    Rows,
    State,
    Stream,
)
from rig.wire.serial.codec import Codec
from rig.wire.serial.frames import FrameReader, frame
from rig.wire.serial.port import PseudoTerminal
from tests.firmware.building import built_with_loop
from tests.firmware.test_host_board import Board
from tests.rig.rigs import SETTLE, bench_with, point_segments
from tests.waiting import LONG_S
from vibrolock.compiled import bound

BLOCK = 50
WATCHDOG_S, RAMP_S = 30.0, 0.02
AT_A_TIME = 1 << 16

Changes = Mapping[str, Any]


def bench_for_loop() -> Bench:
    """The magnet beam, whose tick is called for every sample."""
    return bench_with({"block": 1})


def settings_for(*levels: float, segments: list[Segment] | None = None, **kwargs: Any) -> TickSettings:
    """A plan in volts on that bench, by default one that gets to its levels slowly."""
    plan = point_segments(*(levels or (0.2, 0.4))) if segments is None else segments
    law = kwargs.pop("law", preset("magnet-beam"))
    amplitude_law = kwargs.pop("amplitude_law", AmplitudeLaw.VOLTAGE)
    return TickSettings(bench_for_loop(), law, amplitude_law, kwargs.pop("settle", SETTLE), plan, **kwargs)


def latency_samples(plant: VirtualPlant) -> float:
    """Samples from an output to the input that shows it, beside the one for the tick."""
    return HOLD_SAMPLES + plant.filter_delay_s * plant.rate_hz


class WatchedPlant(VirtualPlant):
    """The structure, which keeps the voltages that it was given since it was at rest."""

    def reset(self) -> None:
        super().reset()
        self.volts: list[float] = []

    def step(self, voltages: np.ndarray) -> tuple[np.ndarray, int]:
        self.volts += voltages.tolist()
        return super().step(voltages)


class LoopHost:
    """The host of a board, and the structure behind the board, in one."""

    def __init__(self, board: Board, plant: WatchedPlant) -> None:
        self.board, self.plant = board, plant
        self._structure = Firmware(Running(board.child, board.requests, board.answers, "", False), plant)
        self.codec, self.counters = Codec(), dict[str, int]()
        self.reader = FrameReader(self.codec, self.counters)
        self._number = 0
        self.answers: list[Answer] = []
        self.rows: list[Rows] = []
        self.states: list[State] = []
        self.beats: list[Heartbeat] = []
        self.told: list[Message] = []
        """All blocks and states in the order in which they came."""

    def send(self, message: Message) -> None:
        self.board.send(b"\0" + frame(self.codec.encode(message)))

    def pump(self) -> None:
        """Answer for the structure, and take what has come over the line."""
        line = self.board.line.far_descriptor
        ready, _, _ = select.select((self.board.requests, line), (), (), 0.001)
        if self.board.requests in ready:
            self._structure._answer()
        if line in ready:
            for message in self.reader.feed(os.read(line, AT_A_TIME)):
                self._take(message)

    def _take(self, message: Message) -> None:
        if isinstance(message, Answer):
            self.answers.append(message)
        elif isinstance(message, Heartbeat):
            self.beats.append(message)
        else:
            self.told.append(message)
            if isinstance(message, Rows):
                self.rows.append(message)
            elif isinstance(message, State):
                self.states.append(message)

    def until(self, has_come: Callable[[], bool], longest_s: float = LONG_S) -> None:
        until_s = time.monotonic() + longest_s
        while not has_come():
            assert time.monotonic() < until_s, "it has not come"
            self.pump()

    def ask(self, command: int, parameter: int = 0, item: int = 0, value: int = 0) -> Answer:
        self._number = self._number % 255 + 1
        self.answers.clear()
        self.send(Request(self._number, command, parameter, item, value))
        self.until(lambda: any(one.number == self._number for one in self.answers))
        return self.answers[-1]

    def get(self, parameter: Parameter, item: int = 0) -> int:
        answer = self.ask(Command.GET, parameter, item)
        assert answer.status == 0
        return answer.value

    def set(self, parameter: Parameter, value: int, item: int = 0) -> Answer:
        return self.ask(Command.SET, parameter, item, value)

    def set_up(
        self, block: int = BLOCK, loop: int = 1, watchdog_s: float = WATCHDOG_S, state_blocks: int | None = None
    ) -> None:
        """Agree on the version, on the stream, and on who runs the loop."""
        assert self.set(Parameter.VERSION, VERSION).status == 0
        self.codec.version = VERSION
        plant = self.plant
        values = {
            Parameter.RATE_MHZ: round(1e3 * plant.rate_hz),
            Parameter.BLOCK: block,
            Parameter.WATCHDOG_US: round(1e6 * watchdog_s),
            Parameter.RAMP_US: round(1e6 * RAMP_S),
            Parameter.LOOP: loop,
        }
        if state_blocks is not None:
            values[Parameter.STATE_BLOCKS] = state_blocks
        for parameter, value in values.items():
            assert self.set(parameter, value).status == 0, parameter
        stream = Stream(len(plant.names), block, plant.rate_hz, plant.bits, loop=bool(loop))
        self.codec.configure(stream)
        self.reader.configure(stream)

    def upload(self, arrays: TickArrays, sizes: Mapping[int, int] | None = None) -> None:
        """Send the records of a run; ``sizes`` (bytes, by place) are told in place of the true ones."""
        for place, array in enumerate(arrays):
            size = (sizes or {}).get(place, array.nbytes)
            if size:
                assert self.set(Parameter.TICK_BYTES, size, place).status == 0, (place, size)
        assert self.set(Parameter.TICK_PERIOD, arrays.waveforms.shape[1]).status == 0
        for place, array in enumerate(arrays):
            self.send_records(place, array.tobytes())

    def send_records(self, place: int, data: bytes, at: int = 0) -> None:
        for offset in range(0, len(data), LARGEST_PIECE):
            self.send(Record(place, at + offset, data[offset : offset + LARGEST_PIECE]))

    def require_uploaded(self, arrays: TickArrays) -> None:
        for place, array in enumerate(arrays):
            assert self.get(Parameter.TICK_CRC, place) == zlib.crc32(array.tobytes()), TickArrays._fields[place]

    def begin(self, arrays: TickArrays, armed: bool = True, **kwargs: Any) -> None:
        """All up to ARM."""
        self.set_up(**kwargs)
        self.upload(arrays)
        self.require_uploaded(arrays)
        assert self.ask(Command.START).status == 0
        if armed:
            assert self.ask(Command.ARM, value=ARM_KEY).status == 0

    def run_to(self, sample: int) -> tuple[np.ndarray, np.ndarray]:
        """Readings [n, n_channels] and rows [n] up to this sample, or to the end of the block with it."""
        self.until(lambda: bool(self.rows) and self.rows[-1].first + len(self.rows[-1].rows) >= sample)
        return joined(self.rows)

    def counted(self) -> dict[str, str]:
        """End the board; what it has counted."""
        self.board.child.send_signal(signal.SIGTERM)
        while self.board.child.poll() is None:
            self.pump()
        return dict(line.split() for line in self.board.ended()[1].splitlines())

    def run_until_off(self) -> tuple[np.ndarray, np.ndarray]:
        """Readings and rows up to a block at whose end the loop's guard is off."""
        self.until(lambda: bool(self.rows) and rows_of(self.rows[-1])["guard"][-1] == GuardMode.OFF)
        return joined(self.rows)


def rows_of(block: Rows) -> np.ndarray:
    """The rows [n] of a block."""
    return np.ascontiguousarray(block.rows).view(ROW)[:, 0]


def joined(blocks: list[Rows]) -> tuple[np.ndarray, np.ndarray]:
    """Readings and rows of blocks, of which none is missing."""
    n = len(blocks[0].rows)
    assert [one.first for one in blocks] == list(range(0, n * len(blocks), n))
    return np.concatenate([one.readings for one in blocks]), np.concatenate([rows_of(one) for one in blocks])


@contextmanager
def loop_host(
    program: str = "host-sanitized",
    *,
    log: Path | None = None,
    lockstep: bool = True,
    plant: WatchedPlant | None = None,
    **changes: Any,
) -> Iterator[LoopHost]:
    """A board with the compiled tick, described by the bench, and its host; with a structure, or the bench's own."""
    given = EmulatorSettings(wire=changes.pop("wire", "serial"), bench=bench_for_loop(), lockstep=lockstep, **changes)
    plant = plant or WatchedPlant(given.bench)
    arguments = () if log is None else ("--log-output", str(log))
    board = Board(description(given, plant), *arguments, program=built_with_loop(program))
    try:
        yield LoopHost(board.began(), plant)
    finally:
        board.close()


def tick_for(settings: TickSettings, plant: VirtualPlant) -> Tick:
    """The tick of a device with this structure behind it."""
    return settings.build(latency_samples(plant))


def run_in_python(
    tick: Tick, plant: VirtualPlant, n: int, at: Mapping[int, Callable[[Tick], None]] | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Readings and rows of n samples of the loop in this process, with the device's converters between tick and structure.

    What ``at`` names is done to the tick before it takes the sample of this number.
    """
    arguments = arguments_for(tick, 1)
    run = bound(tick_block, *arguments)
    v_per_count = plant.v_per_count.astype(np.float32).astype(float)
    counts_per_v = 1.0 / float(np.float32(plant.output_v_per_count))
    largest = 2.0 ** (plant.bits - 1)
    all_readings, all_rows = tick.buffers(n)
    for sample in range(n):
        counts = np.clip(np.rint(arguments.outputs * counts_per_v), -largest, largest - 1.0)
        inputs, flags = plant.step(counts * plant.output_v_per_count)
        arguments.volts[:] = inputs * v_per_count
        arguments.flags[:] = flags & DeviceFlag.OVERLOAD
        if at is not None and sample in at:
            at[sample](tick)
        run(*arguments)
        all_readings[sample], all_rows[sample] = arguments.readings[0], arguments.rows[0]
    return all_readings, all_rows


def copy_of(arrays: TickArrays) -> TickArrays:
    return TickArrays(*(array.copy() for array in arrays))


class _ImageBoard(Board):
    """An image that runs in QEMU, as the board of a host."""

    def __init__(self, program: Running, descriptor: int) -> None:
        self.child, self.requests, self.answers = program.child, program.requests, program.answers
        self.line = PseudoTerminal(-1, descriptor, program.port)


@contextmanager
def loop_host_of_image(image: Path) -> Iterator[LoopHost]:
    """An image for ARM with the compiled tick in QEMU, described by the bench, and its host."""
    given = EmulatorSettings(wire="serial", bench=bench_for_loop(), lockstep=True, firmware=image)
    plant = WatchedPlant(given.bench)
    with running(given) as program:
        descriptor = os.open(program.port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            Firmware(program, plant).begin(description(given, plant))
            yield LoopHost(_ImageBoard(program, descriptor), plant)
        finally:
            os.close(descriptor)
