"""CAN frames, and how long they occupy a bus at worst."""

from typing import NamedTuple

DATA_BIT_RATE_HZ = 5_000_000
"""CAN FD's bit rate within the data where none is given: common adapters have it, and it carries 5 kHz sample by sample."""

FD_LENGTHS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)
"""Bytes of a CAN FD frame by its length code; a classical frame has 0 to 8."""

_PADDED = tuple(next(length for length in FD_LENGTHS if length >= wanted) for wanted in range(65))


class BusTiming(NamedTuple):
    """Frames and bit rates of a bus, the same for all who speak on it."""

    fd: bool = False
    """CAN FD, or classical CAN."""
    bit_rate_hz: int = 1_000_000
    """Bit rate of the bus."""
    data_bit_rate_hz: int = DATA_BIT_RATE_HZ
    """CAN FD: bit rate within the data."""


class Frame(NamedTuple):
    """A data frame with an identifier of 11 bits (29 where ``extended``)."""

    identifier: int
    data: bytes
    fd: bool = False
    """CAN FD, data at the data bit rate."""
    extended: bool = False


def padded_length(wanted: int) -> int:
    """The smallest length of a CAN FD frame that holds so many bytes (up to 64)."""
    return _PADDED[wanted]


def frame_seconds(n_bytes: int, fd: bool, bit_rate_hz: float, data_bit_rate_hz: float = 0.0) -> float:
    """Longest time on the bus of a frame with an 11-bit identifier, with all stuff bits and the pause behind it, s.

    Classical (ISO 11898-1): 34 + 8 n bits from the start of frame to the end of the checksum can be stuffed, one in four
    after the first; 13 more bits with the pause of 3 are not. CAN FD: 17 bits up to the switch of rate, stuffed as above; then
    at the data bit rate 5 bits of control and the data, stuffed, and a stuff count of 4 bits and a checksum of 17 (up to 16
    bytes) or 21 bits with a fixed stuff bit before every fourth; 13 more bits at the slow rate.
    """
    if not fd:
        stuffed = 34 + 8 * n_bytes
        return (stuffed + (stuffed - 1) // 4 + 13) / bit_rate_hz
    n_bytes = padded_length(n_bytes)
    checksum, fixed = (17, 6) if n_bytes <= 16 else (21, 7)
    control = 5 + 8 * n_bytes
    return (17 + 4 + 13) / bit_rate_hz + (control + control // 4 + 4 + checksum + fixed) / data_bit_rate_hz
