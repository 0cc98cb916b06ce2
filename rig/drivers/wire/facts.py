"""A device's description of itself, and whether it is the device that the bench describes."""

from dataclasses import dataclass

import numpy as np

from rig.bench import Bench
from rig.drivers.wire.dialogue import Dialogue
from rig.errors import DaqMismatch, DaqProtocol
from rig.wire.messages import LOWEST_VERSION, VERSION, Command, Parameter
from rig.wire.parameter_words import as_double, as_text

FLOAT_TOLERANCE = 1e-6  # float32 on the wire
MOST_CHANNELS = 31  # items of a text parameter are numbered by one byte
SAME_RESOLUTION = 0.01  # relative difference of resolutions that is worth a remark; chosen
DIGEST_WORDS = 16  # of four characters each
SAME_SKEW_SAMPLES = 0.01  # samples; difference of skews that is worth a remark; chosen


@dataclass(frozen=True, eq=False)
class DeviceFacts:
    """A device's description of itself."""

    model: str
    firmware: str
    serial_number: str
    boot: int
    simulated: bool
    repeatable: bool
    """Whether the same outputs after START always give the same samples."""
    names: tuple[str, ...]
    units: tuple[str, ...]
    range_v: np.ndarray
    """float64[n_channels]."""
    v_per_count: np.ndarray
    """float64[n_channels]."""
    skew_s: np.ndarray
    """float64[n_channels]: delay of each channel behind the first."""
    output_range_v: float
    output_v_per_count: float
    bits: int
    rate_hz: tuple[float, float]
    """Lowest and highest."""
    largest_block: int
    largest_queue: int
    watchdog_s: tuple[float, float]
    """Shortest and longest."""
    filter_delay_s: float
    layout_crc: int
    version: int
    """Version of the protocol in use."""
    longest_period: int
    """Longest period of outputs that the device can go on with, samples; 0 for none."""
    loop_digest: str = ""
    """Digest of the compiled loop that the device has; empty if it has none."""


def negotiate(dialogue: Dialogue, latest: int = VERSION) -> None:
    """Agree on the latest version of the protocol that both speak, up to ``latest``; raise `DaqProtocol` if there is none.

    A device that can run the loop is told that the host does.
    """
    lowest, highest = dialogue.get(Parameter.LOWEST_VERSION), dialogue.get(Parameter.HIGHEST_VERSION)
    ours = min(dialogue.link.highest_version, latest)
    version = min(highest, ours)
    if version < max(lowest, LOWEST_VERSION):
        raise DaqProtocol(
            f"{dialogue.link.name}: the device speaks versions {lowest} to {highest} of the protocol, "
            f"this product speaks {LOWEST_VERSION} to {ours}; update the older of the two"
        )
    dialogue.do(Command.SET, Parameter.VERSION, value=version)
    dialogue.link.speak(version)
    if version > LOWEST_VERSION:  # most devices do not know it; an earlier host may have left another value
        dialogue.ask(Command.SET, Parameter.LOOP, value=0)


def read_facts(dialogue: Dialogue) -> DeviceFacts:
    """Ask the device for everything it says of itself."""
    get, get_float = dialogue.get, dialogue.get_float
    count = get(Parameter.N_CHANNELS)
    if not 1 <= count <= MOST_CHANNELS:
        raise DaqProtocol(
            f"{dialogue.link.name}: the device says it has {count} channels: allowed is 1 to {MOST_CHANNELS}"
        )
    bits = get(Parameter.BITS)
    if bits not in (16, 32):
        raise DaqProtocol(f"{dialogue.link.name}: the device counts in {bits} bits: allowed is 16 or 32")
    simulated = get(Parameter.SIMULATED, default=0)
    if simulated not in (0, 1, 2):
        raise DaqProtocol(f"{dialogue.link.name}: the device says SIMULATED = {simulated}: allowed is 0, 1 or 2")
    channels = range(count)
    # the double-precision filter delay if the device has it and it agrees, else whole nanoseconds
    delay_s = 1e-9 * get(Parameter.FILTER_DELAY_NS, default=0)
    exact_s = as_double(*(get(Parameter.FILTER_DELAY_S, item, default=0) for item in (0, 1)))
    facts = DeviceFacts(
        model=dialogue.get_text(Parameter.MODEL),
        firmware=dialogue.get_text(Parameter.FIRMWARE),
        serial_number=dialogue.get_text(Parameter.SERIAL_NUMBER),
        boot=get(Parameter.BOOT),
        simulated=simulated != 0,
        repeatable=simulated == 2,
        names=tuple(dialogue.get_text(Parameter.CHANNEL_NAME, channel) for channel in channels),
        units=tuple(dialogue.get_text(Parameter.CHANNEL_UNIT, channel) for channel in channels),
        range_v=np.array([get_float(Parameter.CHANNEL_RANGE_V, channel) for channel in channels]),
        v_per_count=np.array([get_float(Parameter.CHANNEL_V_PER_COUNT, channel) for channel in channels]),
        skew_s=np.array([1e-9 * get(Parameter.SKEW_NS, channel, default=0) for channel in channels]),
        output_range_v=get_float(Parameter.OUTPUT_RANGE_V),
        output_v_per_count=get_float(Parameter.OUTPUT_V_PER_COUNT),
        bits=bits,
        rate_hz=(1e-3 * get(Parameter.LOWEST_RATE_MHZ), 1e-3 * get(Parameter.HIGHEST_RATE_MHZ)),
        largest_block=get(Parameter.LARGEST_BLOCK),
        largest_queue=get(Parameter.LARGEST_QUEUE),
        watchdog_s=(1e-6 * get(Parameter.SHORTEST_WATCHDOG_US), 1e-6 * get(Parameter.LONGEST_WATCHDOG_US)),
        filter_delay_s=exact_s if abs(exact_s - delay_s) <= 1e-9 else delay_s,
        layout_crc=get(Parameter.LAYOUT_CRC, default=0),
        version=dialogue.link.version,
        longest_period=get(Parameter.LONGEST_PERIOD, default=0) if dialogue.link.version > LOWEST_VERSION else 0,
        loop_digest=_loop_digest(dialogue) if dialogue.link.version > LOWEST_VERSION else "",
    )
    scales = np.array([*facts.v_per_count, *facts.range_v, facts.output_v_per_count, facts.output_range_v])
    if not (np.isfinite(scales).all() and (scales > 0.0).all() and facts.largest_block >= 1):
        raise DaqProtocol(
            f"{dialogue.link.name}: the device reports ranges, steps or blocks that are not positive numbers"
        )
    return facts


def _loop_digest(dialogue: Dialogue) -> str:
    """The digest of the device's own loop, or an empty text."""
    if not dialogue.get(Parameter.TICK_DIGEST, 0, 0):
        return ""
    return as_text([dialogue.get(Parameter.TICK_DIGEST, item, 0) for item in range(DIGEST_WORDS)])


def compare(facts: DeviceFacts, bench: Bench, name: str, layout_crc: int) -> None:
    """Raise `DaqMismatch` if the device is not the one that the bench describes."""
    ours = [channel.name for channel in bench.channels]
    if ours != list(facts.names):
        how = "in another order" if sorted(ours) == sorted(facts.names) else "and not these"
        raise DaqMismatch(
            f"{name}: the device has the channels {', '.join(facts.names)}, the bench {', '.join(ours)}: {how}"
        )
    if layout_crc != facts.layout_crc:
        raise DaqMismatch(
            f"{name}: the device's definition of its messages has the CRC {facts.layout_crc:08x}, "
            f"ours {layout_crc:08x}; both need the same definition"
        )
    for channel, unit, range_v in zip(bench.channels, facts.units, facts.range_v, strict=True):
        if unit != "V":
            raise DaqMismatch(f"{name}: channel {channel.name}: the device scales it to {unit!r}, allowed is 'V'")
        if channel.range_v > range_v * (1.0 + FLOAT_TOLERANCE):
            raise DaqMismatch(
                f"{name}: channel {channel.name}: range_v = {channel.range_v:g} in the bench, "
                f"the device reads up to {range_v:g} V"
            )
    if bench.output_range_v > facts.output_range_v * (1.0 + FLOAT_TOLERANCE):
        raise DaqMismatch(
            f"{name}: output_range_v = {bench.output_range_v:g} in the bench, "
            f"the device puts out up to {facts.output_range_v:g} V"
        )
    lowest, highest = facts.rate_hz
    if not lowest * (1.0 - FLOAT_TOLERANCE) <= bench.sample_rate_hz <= highest * (1.0 + FLOAT_TOLERANCE):
        raise DaqMismatch(
            f"{name}: sample_rate_hz = {bench.sample_rate_hz:g} in the bench, "
            f"the device samples at {lowest:g} to {highest:g} Hz"
        )


def remarks_on(facts: DeviceFacts, bench: Bench) -> list[str]:
    """Differences from the bench that are worth a remark but do not make it another device.

    The skew of a loopback is left out: a direct cable is read at an edge of the hold, which is the bench's to say.
    """
    out = []
    skew_samples = facts.skew_s * bench.sample_rate_hz
    for channel, step_v, skew in zip(bench.channels, facts.v_per_count, skew_samples, strict=True):
        if abs(channel.resolution_v - step_v) > SAME_RESOLUTION * step_v:
            out.append(
                f"channel {channel.name}: the bench says resolution_v = {channel.resolution_v:g}, the device has {step_v:g}"
            )
        if not channel.loopback and abs(channel.skew_samples - skew) > SAME_SKEW_SAMPLES:
            out.append(
                f"channel {channel.name}: the bench says skew_samples = {channel.skew_samples:g}, "
                f"the device says {skew:.4g}"
            )
    return out
