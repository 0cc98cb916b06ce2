"""Spoilt bytes, whatever kind of file they are of: cut short, flipped, doubled, with something put between."""

from collections.abc import Callable
from random import Random

PUT_BETWEEN = (
    b"\0",
    b"\xff\xfe",
    b"\x1b[2J\x1b[31m",
    b"\x80",
    b"\r",
    b"\xe2\x80\xae",
    b"]" * 3,
    b"[" * 3,
    b'"',
    b"'''",
    b"\n=",
)


def cut_short(data: bytes, random: Random) -> bytes:
    """The beginning alone."""
    return data[: random.randrange(len(data))]


def flipped(data: bytes, random: Random) -> bytes:
    """Up to eight bits are others."""
    out = bytearray(data)
    for _ in range(random.randint(1, 8)):
        out[random.randrange(len(out))] ^= 1 << random.randrange(8)
    return bytes(out)


def put_between(data: bytes, random: Random) -> bytes:
    """A few bytes that nobody types stand somewhere."""
    at = random.randrange(len(data))
    return data[:at] + random.choice(PUT_BETWEEN) + data[at:]


def piece_doubled(data: bytes, random: Random) -> bytes:
    """A piece comes twice, elsewhere the second time."""
    first, at = random.randrange(len(data)), random.randrange(len(data))
    return data[:at] + data[first : first + random.randint(1, 200)] + data[at:]


def piece_lost(data: bytes, random: Random) -> bytes:
    """A piece is missing."""
    first = random.randrange(len(data))
    return data[:first] + data[first + random.randint(1, 200) :]


BYTE_MUTATIONS: tuple[Callable[[bytes, Random], bytes], ...] = (
    cut_short,
    flipped,
    put_between,
    piece_doubled,
    piece_lost,
)
"""Each takes the bytes of a file and a source of chance, and returns other bytes."""
