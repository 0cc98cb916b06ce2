"""A host that does all that it may and much that it must not, by a generator of random numbers."""

import struct
from random import Random

import numpy as np

from rig.wire.can.blocks import StreamFrames
from rig.wire.can.frames import Frame
from rig.wire.can.protocol import FrameKind
from rig.wire.messages import ARM_KEY, Command, DeviceState, Parameter
from rig.wire.serial.frames import frame
from tests.firmware.events import BEGIN_US, SERIAL, Choice, Event, Kind, of_frame, protocol_of
from tests.firmware.nonsense import nonsense_on_the_bus, nonsense_on_the_line
from tests.firmware.python_device import LONGEST_PERIOD, PythonDevice

SETTABLE = (48, 49, 50, 51, 52)
BLOCKS = (1, 1, 2, 3, 5, 7, 8, 10, 16, 31, 32, 33, 62, 63, 64, 100, 125, 256, 500, 1000)
BOUNDS = (0, 1, 2, 999, 1000, 1001, 2**16, 2**31 - 1, 2**31, 4_000_000_000, 4_000_000_001, 2**32 - 1)
GRID_HAIR = 3e-6  # of a sample: nothing happens so close to a sample instant, where rounding would decide


class Host:
    """Plays a random script to a device while it makes it up; ``events`` is what it has done."""

    def __init__(self, choice: Choice, random: Random) -> None:
        self.choice, self.random = choice, random
        self.python = PythonDevice(choice)
        self.events: list[Event] = []
        self.requests = self.streams = 0
        self._now_us = BEGIN_US
        self._origin_us = BEGIN_US
        self._number = 0
        self._last: bytes | None = None
        self._pressed = False
        self.period = self.ramp = 0
        """Of the outputs from the next on: 1/65536 sample, and samples from the end of a block to 0 V."""
        self._dtype = np.dtype(f"<i{choice.bits // 8}")
        if choice.wire != SERIAL:
            self._protocol = protocol_of(choice.n_channels, choice.fd, choice.node)

    # -- facts of the device -------------------------------------------------------------------------------------------

    @property
    def state(self) -> DeviceState:
        return self.python.device.state

    def _setting(self, parameter: Parameter) -> int:
        return self.python.device.words[parameter, 0]

    @property
    def block(self) -> int:
        return self._setting(Parameter.BLOCK)

    @property
    def version(self) -> int:
        """Version of the protocol in use."""
        return self.python.link.version

    @property
    def _is_sampling(self) -> bool:
        return self.python.device._sampling.on

    @property
    def queue(self) -> int:
        return self._setting(Parameter.QUEUE)

    @property
    def _block_us(self) -> float:
        return 1e9 * self.block / self._setting(Parameter.RATE_MHZ)

    @property
    def next_block(self) -> int:
        """Number of the block under way."""
        return self.python.device.measured // self.block

    # -- time ------------------------------------------------------------------------------------------------------------

    def wait(self, microseconds: float) -> None:
        self._now_us += max(1, round(microseconds))
        while self._is_on_the_grid():
            self._now_us += 1

    def _is_on_the_grid(self) -> bool:
        """Whether the present, or the watchdog's time if it is fed now, falls on a sample instant."""
        if not self._is_sampling or self.choice.lockstep:
            return False
        for microseconds in (self._now_us, self._now_us + self._setting(Parameter.WATCHDOG_US)):
            phase = (microseconds - self._origin_us) * self._setting(Parameter.RATE_MHZ) % 10**9 * 1e-9
            if min(phase, 1.0 - phase) < GRID_HAIR:
                return True
        return False

    def _happens(self, event: Event) -> None:
        was_idle = not self._is_sampling
        self.events.append(event)
        self.python.play(event)
        if was_idle and self._is_sampling:
            self._origin_us = event.time_us
            self.streams += 1

    def happens(self, kind: Kind, data: bytes = b"") -> None:
        self.wait(self.random.choice((1, 3, 17, 131)))
        self._happens(Event(self._now_us, kind, data))

    # -- messages --------------------------------------------------------------------------------------------------------

    def _payload(self, payload: bytes) -> None:
        """A payload on a serial line, sometimes in two pieces."""
        data = frame(payload)
        cut = self.random.randrange(len(data)) if self.random.random() < 0.1 else 0
        if cut:
            self.happens(Kind.BYTES, data[:cut])
        self.happens(Kind.BYTES, data[cut:])

    def send_frame(self, one: Frame) -> None:
        self.wait(self.random.choice((1, 3, 17, 131)))
        self._happens(of_frame(self._now_us, one))

    def _send_request(self, body: bytes) -> None:
        self.requests += 1
        self._last = body
        if self.choice.wire == SERIAL:
            version = self.version if self.random.random() < 0.95 else self.random.randrange(256)
            self._payload(bytes((version, 1, 0, 0)) + body)
        else:
            self.send_frame(Frame(0x020 + self.choice.node, body))

    def request(self, command: int, parameter: int = 0, item: int = 0, value: int = 0) -> None:
        self._number = self._number % 255 + 1
        self._send_request(struct.pack("<BBBBI", self._number, command, parameter, item, value))

    def repeat(self) -> None:
        """The last request again; or with one bit changed, so that it is another one."""
        if self._last is None:
            return
        body = bytearray(self._last)
        if self.random.random() < 0.3:
            body[self.random.randrange(8)] ^= 1 << self.random.randrange(8)
        self._send_request(bytes(body))

    def stop_message(self) -> None:
        self.requests += 1
        data = bytes((self.random.randrange(256),))
        if self.choice.wire == SERIAL:
            self._payload(bytes((self.random.choice((1, 2, 9)), 6, 0, 0)) + data)
        else:
            self.send_frame(Frame(0, self.random.choice((b"", data, bytes(8)))))

    def switch(self) -> None:
        self._pressed = not self._pressed
        self.happens(Kind.PRESS if self._pressed else Kind.RELEASE)
        if self.random.random() < 0.5:
            self.request(Command.STOP)
            self.request(Command.CLEAR)

    def reset(self) -> None:
        if not self._pressed:
            self.happens(Kind.RESET)

    # -- settings --------------------------------------------------------------------------------------------------------

    def get(self) -> None:
        parameter = self.random.choice((self.random.randrange(70), self.random.randrange(256), 9, 17, 49))
        item = self.random.choice((0, 0, 1, 2, self.random.randrange(256)))
        if self.random.random() < 0.5:
            parameter, item = self.random.choice(list(self.python.device.words))
        self.request(Command.GET, parameter, item, self.random.choice((0, 0, 7)))

    def set(self) -> None:
        parameter = self.random.choice((3, *SETTABLE, *SETTABLE, self.random.randrange(256)))
        if parameter == Parameter.RAMP_US:  # a longer one would go on for ever in lockstep
            value = self.random.choice((0, 1, 1000, 33_300, 50_000, 4_000_000_001, 2**32 - 1))
        else:
            value = self.random.choice((*BOUNDS, self.random.randrange(2**32), self._setting(Parameter.RATE_MHZ)))
        self.request(Command.SET, parameter, self.random.choice((0, 0, 0, 0, 1)), value)

    def set_up(self) -> None:
        """Settings that make a stream that can be driven."""
        random = self.random
        self.request(Command.STOP)
        if not self._pressed:
            self.request(Command.CLEAR)
        largest = self._setting(Parameter.LARGEST_BLOCK)
        self.request(Command.SET, Parameter.BLOCK, 0, random.choice([n for n in BLOCKS if n <= largest] + [largest]))
        self.request(Command.SET, Parameter.QUEUE, 0, random.choice((1, 1, 2, 3, 5, 64)))
        low, high = self.choice.lowest_rate_mhz, self.choice.highest_rate_mhz
        self.request(Command.SET, Parameter.RATE_MHZ, 0, random.choice((high, high, (low + high) // 2 | 1)))
        watchdog_us = random.choice((1, 2, 3, 7, 30)) * max(1, round(self._block_us / 1000)) * 1000
        self.request(Command.SET, Parameter.WATCHDOG_US, 0, watchdog_us)
        self.request(Command.SET, Parameter.RAMP_US, 0, random.choice((0, 1000, 20_000, 33_300, 50_000)))
        self.request(Command.SET, Parameter.VERSION, 0, random.choice((1, 2, 2)))
        self.request(Command.START)
        if random.random() < 0.9:
            self.wait(random.choice((50, 1500, self._block_us)))
            self.request(Command.ARM, value=ARM_KEY)

    def command(self) -> None:
        random = self.random
        command = random.choice((2, 3, 3, 4, 5, 5, 5, 6, 6, 7, 7, random.randrange(256)))
        key = random.choice((ARM_KEY, ARM_KEY, ARM_KEY, ARM_KEY ^ 1, 0))
        self.request(command, 0, 0, key if command == Command.ARM else 0)

    # -- outputs ---------------------------------------------------------------------------------------------------------

    def counts(self, n: int) -> np.ndarray:
        largest = 2 ** (self.choice.bits - 1) - 1
        level = self.random.choice((0.0, 0.1, 0.3, 0.5, 0.62, 0.63, 1.0)) * largest
        if self.random.random() < 0.05:
            return np.full(n, self.random.choice((largest, -largest, -largest - 1)), self._dtype)
        if self.random.random() < 0.1:  # no byte is zero: long runs for COBS
            return np.frombuffer(bytes(self.random.choices(range(1, 64), k=n * self.choice.bits // 8)), self._dtype)
        noise = np.frombuffer(self.random.randbytes(2 * n), np.int16) / 2**15
        return np.rint(level * noise).astype(self._dtype)

    def output(self, number: int, amiss: int = 0, longer: int = 0, counts: np.ndarray | None = None) -> None:
        """The outputs of a block, as they should be; or, on a serial line, at a sample beside it or of another length."""
        self.requests += 1
        if counts is None:
            counts = self.counts(max(0, self.block + longer))
        if self.choice.wire == SERIAL:
            first = (number * self.block + amiss) % 2**64
            self._payload(self.output_head(number, first) + counts.tobytes())
        elif number >= 0:
            for one in self.output_frames(number, counts):
                self.send_frame(one)

    def output_head(self, number: int, first: int) -> bytes:
        """What stands before the counts of an output on a serial line; now and then that of the other version."""
        version = self.version if self.random.random() < 0.98 else 3 - self.version
        head = struct.pack("<BBHQ", version, 4, number & 0xFFFF, first)
        return head if version == 1 else head + struct.pack("<II", self.period, self.ramp)

    def output_frames(self, number: int, counts: np.ndarray) -> list[Frame]:
        stream = StreamFrames(self._protocol, FrameKind.OUTPUT, self.block)
        frames = stream.frames(number * self.block, counts[:, None], 0)
        if number * stream.groups % (stream.wrap // 2) < stream.groups:
            frames.insert(0, Frame(0x040 + self.choice.node, struct.pack("<I", number * self.block & 0xFFFFFFFF)))
        return frames

    @property
    def half_a_wrap(self) -> int:
        """Blocks of outputs that half of the sequence numbers count."""
        stream = StreamFrames(self._protocol, FrameKind.OUTPUT, self.block)
        return stream.wrap // 2 // stream.groups

    def some_output(self) -> None:
        """Outputs of the block under way or another one."""
        queue = self.queue
        ahead = self.random.choice((-3, -1, 0, 0, 1, queue, queue, queue + 1, queue + 3, queue + 4, queue + 5, 70))
        amiss, longer = 0, 0
        if self.choice.wire == SERIAL and self.random.random() < 0.3:
            amiss, longer = self.random.choice(((1, 0), (-1, 0), (0, 1), (0, -1)))
        for _ in range(self.random.choice((1, 1, 1, 2))):
            self.output(max(self.next_block + ahead, 0), amiss, longer)

    def drive(self, blocks: int, share: float = 1.0) -> None:
        """Outputs in time for so many blocks, as a good host gives them; or for a share of them."""
        queue = self.queue
        for _ in range(blocks):
            if not self._is_sampling or self._block_us > 2e5:
                return
            if self.random.random() < share:
                self.output(self.next_block + queue)
            self.wait(self._block_us * self.random.choice((1.0, 1.0, 0.9, 1.1)))

    def drive_a_while(self) -> None:
        self.drive(self.random.choice((3, 10, 20, 60)), self.random.choice((1.0, 1.0, 0.9, 0.5)))

    def tell_period(self) -> None:
        """Begin to send outputs with another period, or none; or a ramp."""
        random, longest = self.random, LONGEST_PERIOD << 16
        largest = min(longest, max(5 << 16, random.choice((5, 40, 4 * self.block, 20 * self.block)) << 16))
        bounds = (0, 1, (4 << 16) - 1, longest, longest + 1, 2**32 - 1)
        self.period = random.choice(bounds) if random.random() < 0.1 else random.randrange(4 << 16, largest + 1)
        self.ramp = random.choice((0, 0, 0, 1, 3 * self.block, 500, 10**5, 2**32 - 1))
        if self.choice.wire != SERIAL and (self.version > 1 or random.random() < 0.1):
            self.send_frame(Frame(0x050 + self.choice.node, struct.pack("<II", self.period, self.ramp)))

    def drive_over_gaps(self) -> None:
        """Outputs of a vibration, of which some stretches come late, out of order, or never; disarmed or ramped in between."""
        random, queue = self.random, self.queue
        waiting: list[int] = []
        self.tell_period()
        for _ in range(random.choice((20, 60))):
            if not self._is_sampling or self._block_us > 2e5:
                return
            waiting.append(self.next_block + queue)
            if random.random() < (0.7 if len(waiting) == 1 else 0.3):
                self._send_waiting(waiting)
                waiting = []
            if self.ramp:
                self.ramp = max(0, self.ramp - self.block)
            if random.random() < 0.03:
                random.choice((self.tell_period, self._arm_again))()
            self.wait(self._block_us * random.choice((1.0, 1.0, 0.9, 1.1)))

    def vibrate(self) -> None:
        """A stream of version 2 whose watchdog bears the gaps; then perhaps the other version, and an output of no stream."""
        random = self.random
        self.request(Command.STOP)
        if not self._pressed:
            self.request(Command.CLEAR)
        block = random.choice([n for n in BLOCKS if n <= min(64, self._setting(Parameter.LARGEST_BLOCK))])
        settings = {Parameter.BLOCK: block, Parameter.QUEUE: random.choice((1, 2, 5, 64)), Parameter.VERSION: 2}
        settings[Parameter.RATE_MHZ] = self.choice.highest_rate_mhz
        settings[Parameter.WATCHDOG_US] = random.choice((7, 50)) * max(
            1000, round(1e9 * block / self.choice.highest_rate_mhz)
        )
        for parameter, value in settings.items():
            self.request(Command.SET, parameter, 0, value)
        self.request(Command.START)
        self.request(Command.ARM, value=ARM_KEY)
        for _ in range(random.choice((1, 3))):
            self.drive_over_gaps()
        if random.random() < 0.2:
            self.request(Command.STOP)
            self.request(Command.SET, Parameter.VERSION, 0, random.choice((1, 2)))
            self.output(self.queue)

    def _send_waiting(self, numbers: list[int]) -> None:
        """The outputs of blocks that were held up; a part of them, or in another order."""
        kind = self.random.random()
        if kind < 0.2:
            numbers = numbers[1:]
        elif kind < 0.3:
            numbers = numbers[-1:]
        elif kind < 0.4:
            self.random.shuffle(numbers)
        for number in numbers[-8:]:
            self.output(number)

    def _arm_again(self) -> None:
        self.request(Command.DISARM)
        if self.random.random() < 0.5:
            self.wait(self.random.choice((30, 0.4 * self._block_us, 3 * self._block_us)))
        self.request(Command.ARM, value=ARM_KEY)

    def nonsense(self) -> None:
        """Something that no host sends."""
        self.requests += 1
        if self.choice.wire == SERIAL:
            nonsense_on_the_line(self)
        else:
            nonsense_on_the_bus(self)

    # -- a whole script --------------------------------------------------------------------------------------------------

    def act(self) -> None:
        """Do something."""
        actions = {
            self.get: 8,
            self.set: 6,
            self.set_up: 3 if self._is_sampling else 12,
            self.command: 8,
            self.repeat: 5,
            self.some_output: 12 if self._is_sampling else 1,
            self.drive_a_while: 6 if self._is_sampling else 0,
            self.drive_over_gaps: 8 if self._is_sampling else 0,
            self.tell_period: 1,
            self.vibrate: 4,
            self.nonsense: 16,
            self.stop_message: 1,
            self.switch: 30 if self._pressed else 0.5,
            self.reset: 0.5,
            self.pause: 6,
        }
        self.random.choices(list(actions), list(actions.values()))[0]()

    def pause(self) -> None:
        short, long = self._block_us, self._setting(Parameter.WATCHDOG_US)
        most = 3e5 if self.block > 1 else 1e5
        self.wait(min(most, self.random.choice((7, 0.3 * short, 1.3 * short, 5 * short, long, 1.1 * long, 120_000))))
        self.happens(Kind.NOTHING)
