"""The formula behind the converters of the script's board (firmware/boards/script/bench.c), as an emulator's plant."""

from dataclasses import dataclass

import numpy as np

from rig.wire.messages import DeviceFlag

RANGE_V = 10.0
FULL_RANGE_V = 16.0
"""Of the output where the device says that it is simulated and repeats itself: all that a count can say."""
V_PER_COUNT = {16: 2.0**-11, 32: 2.0**-27}
OVERLOAD = 0.5
"""Share of full scale from which on the inputs are overloaded."""


def readings(counts: np.ndarray, first: int, n_channels: int, bits: int) -> np.ndarray:
    """Counts [n, n_channels] from output counts int64 [n]; channel 0 reads the output itself."""
    channel = np.arange(n_channels, dtype=np.int64)
    index = (first + np.arange(counts.size, dtype=np.int64)) % 1000003
    values = (2 * channel + 1) * counts[:, None] + 77 * channel * index[:, None]
    return values.astype(f"<i{bits // 8}")  # modulo 2^bits, as in C


def is_overloaded(counts: np.ndarray, bits: int) -> bool:
    """Whether one of the outputs overloads the inputs."""
    return bool((np.abs(counts) > OVERLOAD * 2 ** (bits - 1)).any())


@dataclass
class Formula:
    """A plant for `rig.emulator.Device`."""

    n_channels: int
    bits: int
    rate_hz: float
    output_range_v: float = RANGE_V

    def __post_init__(self) -> None:
        n = self.n_channels
        self.names = tuple(f"channel-{channel:02d}" for channel in range(n))
        self.range_v = np.full(n, RANGE_V)
        self.v_per_count = np.full(n, V_PER_COUNT[self.bits])
        self.skew_s = 1e-6 * np.arange(n)
        self.output_v_per_count = V_PER_COUNT[self.bits]
        self.filter_delay_s = 0.00025
        self.blocks: list[np.ndarray] = []
        """Output of every block since the beginning, in counts, with fractions where a ramp has them."""
        self.firsts: list[int] = []
        """Index of the first sample of each."""
        self.reset()

    def reset(self) -> None:
        self._first = 0

    def step(self, voltages: np.ndarray) -> tuple[np.ndarray, int]:
        wanted = voltages / self.output_v_per_count
        largest = self.output_range_v / self.output_v_per_count
        put_out = np.clip(wanted, -largest, largest)
        self.blocks.append(put_out)
        self.firsts.append(self._first)
        counts = np.rint(put_out).astype(np.int64)
        flags = DeviceFlag.OUTPUT_CLIPPED * bool((np.abs(wanted) > largest).any())
        flags |= DeviceFlag.OVERLOAD * is_overloaded(counts, self.bits)
        out = readings(counts, self._first, self.n_channels, self.bits)
        self._first += voltages.size
        return out, int(flags)
