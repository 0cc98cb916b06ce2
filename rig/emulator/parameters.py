"""A device's parameters: the values that it reports, and the settings that are allowed."""

from rig.emulator.faults import Faults
from rig.emulator.plant import VirtualPlant
from rig.wire.link import Link
from rig.wire.messages import LOWEST_VERSION, VERSION, Parameter, Status
from rig.wire.parameter_words import NAME_WORDS, double_words, float_word, text_words

Words = dict[tuple[int, int], int]
"""Words by parameter and item."""

LARGEST_BLOCK = 1000  # samples; chosen: 0.2 s at 5 kHz
LARGEST_QUEUE = 64  # blocks; of the protocol (docs/reference/wire-protocol.md)
SHORTEST_WATCHDOG_US = 1000  # us; chosen
LONGEST_WATCHDOG_US = 4_000_000_000  # us; chosen: below 32 bits
LONGEST_PERIOD = 16384  # samples of a period that can be continued; chosen

SETTINGS = {
    Parameter.VERSION: (Parameter.LOWEST_VERSION, Parameter.HIGHEST_VERSION),
    Parameter.RATE_MHZ: (Parameter.LOWEST_RATE_MHZ, Parameter.HIGHEST_RATE_MHZ),
    Parameter.BLOCK: (None, Parameter.LARGEST_BLOCK),
    Parameter.QUEUE: (None, Parameter.LARGEST_QUEUE),
    Parameter.WATCHDOG_US: (Parameter.SHORTEST_WATCHDOG_US, Parameter.LONGEST_WATCHDOG_US),
    Parameter.RAMP_US: (None, Parameter.LONGEST_WATCHDOG_US),
}
"""Parameters that can be set, with those that hold their bounds. Without a lower bound it is 1; 0 for the ramp."""


def described(
    plant: VirtualPlant,
    *,
    model: str = "vibrolock emulator",
    firmware: str = "1.0",
    serial_number: str = "0001",
    simulated: int = 1,
    layout_crc: int = 0,
    boot: int = 1,
) -> Words:
    """Return the words of a device in front of a plant."""
    rate_mhz = round(1e3 * plant.rate_hz)
    numbers = {
        Parameter.LOWEST_VERSION: LOWEST_VERSION,
        Parameter.HIGHEST_VERSION: VERSION,
        Parameter.VERSION: LOWEST_VERSION,
        Parameter.BOOT: boot,
        Parameter.SIMULATED: simulated,
        Parameter.N_CHANNELS: len(plant.names),
        Parameter.OUTPUT_RANGE_V: float_word(plant.output_range_v),
        Parameter.OUTPUT_V_PER_COUNT: float_word(plant.output_v_per_count),
        Parameter.BITS: plant.bits,
        Parameter.LOWEST_RATE_MHZ: rate_mhz,
        Parameter.HIGHEST_RATE_MHZ: rate_mhz,
        Parameter.LARGEST_BLOCK: LARGEST_BLOCK,
        Parameter.LARGEST_QUEUE: LARGEST_QUEUE,
        Parameter.SHORTEST_WATCHDOG_US: SHORTEST_WATCHDOG_US,
        Parameter.LONGEST_WATCHDOG_US: LONGEST_WATCHDOG_US,
        Parameter.FILTER_DELAY_NS: round(1e9 * plant.filter_delay_s),
        Parameter.LONGEST_PERIOD: LONGEST_PERIOD,
        Parameter.RATE_MHZ: rate_mhz,
        Parameter.BLOCK: 1,
        Parameter.QUEUE: 1,
        Parameter.WATCHDOG_US: 100_000,
        Parameter.RAMP_US: 50_000,
        Parameter.LAYOUT_CRC: layout_crc,
    }
    words: Words = {(int(parameter), 0): word for parameter, word in numbers.items()}
    words |= {
        (int(Parameter.FILTER_DELAY_S), item): word for item, word in enumerate(double_words(plant.filter_delay_s))
    }
    texts = [
        (Parameter.MODEL, 0, model),
        (Parameter.FIRMWARE, 0, firmware),
        (Parameter.SERIAL_NUMBER, 0, serial_number),
    ]
    for channel, name in enumerate(plant.names):
        texts += [(Parameter.CHANNEL_NAME, channel, name), (Parameter.CHANNEL_UNIT, channel, "V")]
        words[Parameter.CHANNEL_RANGE_V, channel] = float_word(float(plant.range_v[channel]))
        words[Parameter.CHANNEL_V_PER_COUNT, channel] = float_word(float(plant.v_per_count[channel]))
        words[Parameter.SKEW_NS, channel] = round(1e9 * float(plant.skew_s[channel]))
    for parameter, channel, text in texts:
        _put_text(words, parameter, channel, text)
    return words


def _put_text(words: Words, parameter: Parameter, channel: int, text: str) -> None:
    words.update({(int(parameter), NAME_WORDS * channel + k): word for k, word in enumerate(text_words(text))})


def carried(words: Words, plant: VirtualPlant, link: Link) -> Words:
    """The words of a device whose blocks and versions are no larger than its wire carries."""
    carried_block = link.largest_block_of(len(plant.names), plant.bits)
    most = {Parameter.LARGEST_BLOCK: carried_block, Parameter.HIGHEST_VERSION: link.highest_version}
    return {**words, **{(int(one), 0): min(words[one, 0], largest) for one, largest in most.items()}}


class Parameters:
    """The words of a device as it reports them, with those that ``faults`` falsify."""

    def __init__(self, words: Words, faults: Faults) -> None:
        self.words = dict(words)
        if faults.version is not None:
            for parameter in (Parameter.LOWEST_VERSION, Parameter.HIGHEST_VERSION, Parameter.VERSION):
                self.words[parameter, 0] = faults.version
            if faults.version == LOWEST_VERSION:
                del self.words[Parameter.LONGEST_PERIOD, 0]
        for channel, name in enumerate(faults.channel_names or ()):
            _put_text(self.words, Parameter.CHANNEL_NAME, channel, name)
        self._settings = {(int(one), 0): self.words[one, 0] for one in SETTINGS}

    def begin_anew(self) -> None:
        """Forget what was set."""
        self.words.update(self._settings)

    def value(self, parameter: Parameter) -> int:
        """The value of a parameter in force."""
        return self.words[parameter, 0]

    def get(self, parameter: int, item: int) -> tuple[Status, int]:
        """Answer to GET."""
        if parameter == Parameter.PING:
            return Status.DONE, 0
        word = self.words.get((parameter, item))
        return (Status.UNKNOWN, 0) if word is None else (Status.DONE, word)

    def set(self, parameter: int, item: int, value: int) -> tuple[Status, int]:
        """Answer to SET; the value is set if it is allowed."""
        bounds = {int(one): both for one, both in SETTINGS.items()}.get(parameter)
        if bounds is None or item:
            return Status.UNKNOWN, 0
        lowest = self.value(bounds[0]) if bounds[0] else int(parameter != Parameter.RAMP_US)
        nearest = min(max(value, lowest), self.value(bounds[1]))
        if nearest != value:
            return Status.NOT_ALLOWED, nearest
        self.words[parameter, 0] = value
        return Status.DONE, value
