"""CAN frames as lines of text, as adapters on a serial line write them (slcan), classical and FD.

A line is a letter (``t`` classical, ``d`` FD, ``b`` FD with the data at the data bit rate; capitals: identifier of 29 bits),
identifier and length code in hexadecimal digits, the data, and a carriage return. ``S8`` chooses 1 Mbit/s, ``Y2`` 2 Mbit/s for
data, ``O`` opens, ``C`` closes. The text has no checksum: a digit damaged between adapter and computer passes as another digit.
"""

from collections import deque

from rig.errors import DaqRefused
from rig.wire.can.frames import FD_LENGTHS, BusTiming, Frame

LONGEST_LINE = 2 + 8 + 128  # characters: type and length, identifier of 29 bits, 64 bytes
BIT_RATES = {10_000: 0, 20_000: 1, 50_000: 2, 100_000: 3, 125_000: 4, 250_000: 5, 500_000: 6, 750_000: 7, 1_000_000: 8}
"""Number of slcan's command for each bit rate, bit/s."""
DATA_BIT_RATES = (1_000_000, 2_000_000, 4_000_000, 5_000_000, 8_000_000)  # bit/s that slcan has commands for
_CODES = {length: f"{code:X}" for code, length in enumerate(FD_LENGTHS)}
_KINDS = {ord("t"): (False, False), ord("T"): (False, True)} | {
    ord(letter): (True, letter in "DB") for letter in "dDbB"
}
_REMOTE = b"rR"
_COMMANDS = b"SYOLCXZVNFsmM"


def opening(timing: BusTiming) -> bytes:
    """The commands that open an adapter; `DaqRefused` for a bit rate that adapters have no command for."""
    fd, bit_rate_hz, data_bit_rate_hz = timing
    if bit_rate_hz not in BIT_RATES:
        allowed = ", ".join(str(rate) for rate in BIT_RATES)
        raise DaqRefused(f"adapters know {allowed}", field="driver.options.bitrate", value=bit_rate_hz)
    out = f"S{BIT_RATES[bit_rate_hz]}\r"
    if fd:
        if data_bit_rate_hz not in DATA_BIT_RATES:
            allowed = ", ".join(str(rate) for rate in DATA_BIT_RATES)
            raise DaqRefused(f"adapters know {allowed}", field="driver.options.data_bitrate", value=data_bit_rate_hz)
        out += f"Y{data_bit_rate_hz // 1_000_000}\r"
    return (out + "O\r").encode("ascii")


def encode_line(frame: Frame) -> bytes:
    """The line of a frame, with its carriage return."""
    letter = "b" if frame.fd else "t"
    head = f"{letter.upper()}{frame.identifier:08X}" if frame.extended else f"{letter}{frame.identifier:03X}"
    return f"{head}{_CODES[len(frame.data)]}{frame.data.hex().upper()}\r".encode("ascii")


def _decode_line(line: bytes) -> Frame | None:
    """The frame of a line without its carriage return; None where it is none."""
    kind = _KINDS.get(line[0])
    if kind is None:
        return None
    fd, extended = kind
    text = line[1:]
    try:
        raw = bytes.fromhex("0" * extended + text.decode("ascii"))
    except ValueError:
        return None
    head = 5 if extended else 2
    if len(raw) < head or 2 * len(raw) != len(text) + extended:  # the latter: blanks, which fromhex passes over
        return None
    word = int.from_bytes(raw[:head], "big")
    identifier, length = word >> 4, FD_LENGTHS[word & 0xF]
    if length != len(raw) - head or identifier > (0x1FFFFFFF if extended else 0x7FF) or (length > 8 and not fd):
        return None
    return Frame(identifier, raw[head:], fd, extended)


class SlcanLines:
    """Splits a stream of bytes into frames and commands; garbage is counted and ends at the next line end."""

    def __init__(self, counters: dict[str, int]) -> None:
        self._counters = counters
        counters.setdefault("garbage_bytes", 0)
        counters.setdefault("damaged_lines", 0)
        self._rest = b""
        self.frames: deque[Frame] = deque()
        self.commands: deque[bytes] = deque(maxlen=64)

    def feed(self, data: bytes) -> None:
        """Take bytes as they come."""
        *lines, rest = (self._rest + data if self._rest else data).split(b"\r")
        if len(rest) > LONGEST_LINE:
            self._counters["garbage_bytes"] += len(rest) - LONGEST_LINE
            rest = rest[-LONGEST_LINE:]
        self._rest = rest
        for line in lines:
            line = line.lstrip(b"\a")  # an adapter reports an error by this character, without a line end
            if line:
                self._take(line)

    def _take(self, line: bytes) -> None:
        frame = _decode_line(line)
        if frame is None and line[0] in _COMMANDS and len(line) < 16:
            self.commands.append(line)
        elif frame is None and line[0] in _REMOTE:
            self._counters["foreign_frames"] = self._counters.get("foreign_frames", 0) + 1
        elif frame is None and line not in (b"z", b"Z"):  # these acknowledge a frame
            self._counters["damaged_lines"] += 1
        elif frame is not None:
            self.frames.append(frame)
