"""Values in the four bytes of a parameter: floats, doubles in two of them, texts in eight."""

import struct

NAME_WORDS = 8
"""Words of four bytes of a text parameter; word w of channel c is item ``8 c + w``."""


def float_word(value: float) -> int:
    """A float32 as the four bytes of a parameter."""
    return int.from_bytes(struct.pack("<f", value), "little")


def as_float(word: int) -> float:
    """The float32 in the four bytes of a parameter."""
    return float(struct.unpack("<f", word.to_bytes(4, "little"))[0])


def double_words(value: float) -> tuple[int, int]:
    """A float64 as the low and the high word of a parameter of two items."""
    low, high = struct.unpack("<II", struct.pack("<d", value))
    return int(low), int(high)


def as_double(low: int, high: int) -> float:
    """The float64 in two words."""
    return float(struct.unpack("<d", struct.pack("<II", low, high))[0])


def text_words(text: str) -> list[int]:
    """A text of up to 32 ASCII characters as the words of a parameter."""
    data = text.encode("ascii", "replace")[: 4 * NAME_WORDS].ljust(4 * NAME_WORDS, b"\0")
    return [int.from_bytes(data[4 * word : 4 * word + 4], "little") for word in range(NAME_WORDS)]


def as_text(words: list[int]) -> str:
    """The text in the words of a parameter; what is not printable ASCII becomes a question mark."""
    data = b"".join(word.to_bytes(4, "little") for word in words).split(b"\0")[0]
    return "".join(chr(byte) if 32 <= byte < 127 else "?" for byte in data)
