"""The messages that host and device exchange, whatever the wire: requests and answers, samples, outputs, heartbeats.

A device is a dictionary of parameters of four bytes each, a state (`DeviceState`) and two streams. Every command is one
`Request`, answered by one `Answer` with the same number. The host repeats a request until it is answered; a device that
receives its last request again only repeats the answer. Samples and outputs are never repeated: a lost one stays a gap.
"""

from enum import IntEnum, IntFlag
from typing import NamedTuple

import numpy as np

LOWEST_VERSION, VERSION = 1, 2
"""Oldest and latest version of the protocol that this package speaks."""

ROW_BYTES = 32
"""Bytes of a telemetry row (`rig.tick.layout.ROW`)."""
LARGEST_PIECE = 512
"""Bytes of a record in one message."""
STATE_BYTES = 1280
"""Bytes that a device's state takes at most with all that frames it; for the load of a wire."""

ENDED_SEGMENTS_HZ = 2.0
"""Segments of a plan that end per second, each with a state of its own; for the load of a wire, chosen."""
LOOP_PINGS_HZ = 10
"""Pings per second that feed the watchdog of a loop on the device; chosen."""
HEARTBEATS_HZ = 10
"""Heartbeats per second; every change of state or of what has latched sends a further one."""


class Command(IntEnum):
    """What a request asks for."""

    GET = 1
    """The value of a parameter."""
    SET = 2
    """A new value of a parameter; the answer holds the value in force. Only while idle."""
    START = 3
    """Begin sampling at index 0, output 0 V, with the rate, block, queue and watchdog that were set."""
    STOP = 4
    """0 V at once, end sampling. Any time."""
    ARM = 5
    """Put outputs on the converter from now on, and start the watchdog; ``value`` is `ARM_KEY`. Only while running."""
    DISARM = 6
    """0 V at once; sampling goes on."""
    CLEAR = 7
    """Forget a latched watchdog or emergency stop, once its cause is gone. Only while idle."""
    RAMP = 8
    """Ramp to 0 V, which ends the plan. Only while the device runs the loop, as `RELEASE`."""
    RELEASE = 9
    """Let the start segment of the plan end at its time."""


ARM_KEY = 0x41524D21  # "ARM!": no bit error in another command arms a device


class Status(IntEnum):
    """What a device says to a request."""

    DONE = 0
    UNKNOWN = 1
    """There is no such command, parameter or item."""
    NOT_ALLOWED = 2
    """The value is not allowed; the answer's ``value`` is the nearest that is."""
    WRONG_STATE = 3
    """Not in the present state; the answer's ``value`` is the `DeviceState`."""
    LATCHED = 4
    """The watchdog or the emergency stop has latched: clear it first."""


class DeviceState(IntEnum):
    """Life of a device."""

    IDLE = 0
    """0 V, not sampling."""
    RUNNING = 1
    """Sampling, 0 V."""
    ARMED = 2
    """Sampling, outputs on the converter, watchdog running."""
    LATCHED = 3
    """0 V until it is stopped and cleared; sampling goes on if it was under way."""


class DeviceFlag(IntFlag):
    """What the device has noticed in a block of samples."""

    OVERLOAD = 1
    """An input was beyond its range."""
    OUTPUT_CLIPPED = 2
    """An output was beyond the converter's range."""
    OUTPUT_HELD = 4
    """An output did not arrive in time: the last one was held."""
    WATCHDOG = 8
    """The watchdog has brought the output to 0 V, and latched."""
    EMERGENCY_STOP = 16
    """The emergency stop has brought the output to 0 V, and latched."""
    OUTPUT_CONTINUED = 32
    """An output did not arrive in time: the device went on with the last period (version 2)."""


STOPPED = int(DeviceFlag.WATCHDOG | DeviceFlag.EMERGENCY_STOP)  # asked for with every block, where members are slow
"""Flags of a device that has brought its output to 0 V by itself."""
MISSED = int(DeviceFlag.OUTPUT_HELD | DeviceFlag.OUTPUT_CONTINUED)
"""Flags of a block in which an output did not arrive in time."""


class Parameter(IntEnum):
    """Four bytes each, little-endian: unsigned, or float32 where ``_V``, or four ASCII bytes of a text, zeros behind."""

    LOWEST_VERSION = 1
    HIGHEST_VERSION = 2
    VERSION = 3
    """Set first: a version that host and device both speak."""
    MODEL = 4
    """Text."""
    FIRMWARE = 5
    """Text."""
    SERIAL_NUMBER = 6
    """Text."""
    BOOT = 7
    """Another number after every reset."""
    SIMULATED = 8
    """1: nothing physical moves. 2: moreover, the same outputs after START always give the same samples."""
    STATE = 9
    """`DeviceState`."""
    N_CHANNELS = 16
    CHANNEL_NAME = 17
    """Text, by channel."""
    CHANNEL_UNIT = 18
    """Text, by channel: unit that `CHANNEL_V_PER_COUNT` scales to, ``V``."""
    CHANNEL_RANGE_V = 19
    """Largest reading, by channel."""
    CHANNEL_V_PER_COUNT = 20
    """Volts of one count, by channel."""
    OUTPUT_RANGE_V = 21
    OUTPUT_V_PER_COUNT = 22
    BITS = 23
    """16 or 32: size of counts on the wire, signed."""
    LOWEST_RATE_MHZ = 32
    """Millihertz."""
    HIGHEST_RATE_MHZ = 33
    """Millihertz."""
    LARGEST_BLOCK = 34
    LARGEST_QUEUE = 35
    SHORTEST_WATCHDOG_US = 36
    LONGEST_WATCHDOG_US = 37
    FILTER_DELAY_NS = 38
    """Mean delay of the converters' filters at low frequency."""
    SKEW_NS = 39
    """Delay behind the first channel, by channel."""
    FILTER_DELAY_S = 40
    """`FILTER_DELAY_NS` to the last bit, for a device in software: a double, its low word in item 0, its high one in item 1."""
    LONGEST_PERIOD = 41
    """Longest period of outputs that the device can go on with, samples (version 2); 0 for none."""
    RATE_MHZ = 48
    """Set: sample rate, millihertz."""
    BLOCK = 49
    """Set: samples a block."""
    QUEUE = 50
    """Set: blocks between the handing over of an output and the converter, at least 1."""
    WATCHDOG_US = 51
    """Set: longest time without a valid output while armed."""
    RAMP_US = 52
    """Set: time in which the watchdog ramps the output to 0 V; 0 drops it."""
    LAYOUT_CRC = 64
    """CRC-32 of the definition that sender and receiver must share; 0 where there is none."""
    PING = 65
    """Any item, answered at once."""
    TICK_DIGEST = 80
    """Text of 64 characters, in version 2: digest of the compiled loop that the device has; left out where it has none."""
    TICK_ROOM = 81
    """Bytes of memory for the records of a run."""
    LOOP = 82
    """Set: 0, the host runs the loop; 1, the device does."""
    TICK_BYTES = 83
    """Set, by array of the records: its size; array 0 forgets all of them."""
    TICK_PERIOD = 84
    """Set: entries in one waveform."""
    TICK_CRC = 85
    """By array of the records: CRC-32 of what lies in the device."""
    TICK_FAULT = 86
    """Why the last START of a loop on the device was refused: 256 times the array, and a reason; 0 for none."""
    STATE_BLOCKS = 87
    """Set: blocks of rows, of which the last has the loop's state."""


class Request(NamedTuple):
    """Host to device, eight bytes: ``<BBBBI``."""

    number: int
    command: int
    parameter: int = 0
    item: int = 0
    value: int = 0


class Answer(NamedTuple):
    """Device to host, eight bytes: ``<BBBBI``."""

    number: int
    status: int
    parameter: int = 0
    item: int = 0
    value: int = 0


class Samples(NamedTuple):
    """Device to host: one block, once it is measured."""

    first: int
    """Index of the first row, since START."""
    counts: np.ndarray
    """int16 or int32 [n, n_channels]."""
    flags: int = 0
    """`DeviceFlag`."""
    dropped: int = 0
    """Number of samples since START that the device could not send."""
    clock_us: int = 0
    """Device clock when the last row was measured, microseconds; 0 on wires that do not carry it."""
    sequence: int = 0
    """Number of the block on the wire, wrapping."""

    @property
    def shape(self) -> tuple[int, ...]:
        """Samples and channels."""
        return self.counts.shape


class Output(NamedTuple):
    """Host to device: the outputs of one block."""

    first: int
    """Index of the sample at which the first of them is due: (j + q) n."""
    counts: np.ndarray
    """int16 or int32 [n]."""
    sequence: int = 0
    """Number of the block on the wire, wrapping."""
    period: int = 0
    """Period of the outputs, in 1/65536 sample; 0 for none, and in version 1."""
    ramp: int = 0
    """Samples from the end of the block until a ramp to 0 V is over; 0 where there is none, and in version 1."""


class Readback(NamedTuple):
    """Device to host, in version 2: what was put out at the instants of a block that was held or continued.

    It goes immediately before the `Samples` of that block.
    """

    first: int
    """Index of the first instant, as in `Samples`."""
    counts: np.ndarray
    """int16 or int32 [n]."""
    sequence: int = 0
    """Number of the block on the wire, wrapping."""


class Record(NamedTuple):
    """Host to device, in version 2: a piece of the records with which the device runs the loop. Not answered."""

    array: int
    """Place of the array among the records."""
    offset: int
    """Of the piece in the array, bytes."""
    data: bytes
    """At most `LARGEST_PIECE` bytes."""


class State(NamedTuple):
    """Device to host, in version 2: parts of the records at the end of a block of `Rows`, which it goes immediately before."""

    sample: int
    """Number of samples that the loop has processed."""
    pieces: tuple[Record, ...]


class Rows(NamedTuple):
    """Device to host, in place of `Samples` where the device runs the loop: a block of what the loop makes of its samples."""

    first: int
    """Index of the first row, since START."""
    readings: np.ndarray
    """float32 [n, n_channels], SI units."""
    rows: np.ndarray
    """uint8 [n, `ROW_BYTES`]: telemetry rows of the loop, as they lie in memory."""
    flags: int = 0
    """`DeviceFlag`."""
    dropped: int = 0
    """Number of samples since START that the device could not send."""
    clock_us: int = 0
    """Device clock when the last row was measured, microseconds."""
    sequence: int = 0
    """Number of the block on the wire, wrapping."""

    @property
    def shape(self) -> tuple[int, ...]:
        """Samples and channels."""
        return self.readings.shape


class Heartbeat(NamedTuple):
    """Device to host, ten times a second and at every change of state or of what has latched."""

    state: int
    """`DeviceState`."""
    flags: int
    """`DeviceFlag`."""
    boot: int
    """Low byte of the parameter BOOT; another number after every reset."""
    samples: int
    """Samples measured since START."""
    dropped: int = 0
    """As in `Samples`."""


class EmergencyStop(NamedTuple):
    """Command to put out 0 V at once and to latch the stop, from the host or from any node of a bus.

    The sender sends it three times; the device answers with a heartbeat.
    """

    reason: int = 0


Message = Request | Answer | Samples | Output | Readback | Record | State | Rows | Heartbeat | EmergencyStop


class Stream(NamedTuple):
    """Shape and rate of samples and outputs from START on; both ends know it from the parameters."""

    n_channels: int
    block: int
    rate_hz: float
    bits: int = 16
    queue: int = 1
    loop: bool = False
    """Whether the device runs the loop, so that `Rows` and `State` come in place of samples."""
    state_blocks: int = 1
    """Blocks of rows, of which the last has a state; further states come with what ends a segment."""

    @property
    def states_hz(self) -> float:
        """States per second of a loop on the device, with those of segments that end."""
        blocks_hz = self.rate_hz / self.block
        return min(blocks_hz, blocks_hz / self.state_blocks + ENDED_SEGMENTS_HZ)
