"""The rule by which the vibration goes on, in the firmware's core alone, against plain integers: bit for bit."""

import ctypes
import subprocess
from pathlib import Path
from random import Random

import pytest

from tests.firmware.building import FOLDER, need
from tests.firmware.plain_continuation import STEP, Vibration

BESIDE = """
#include "device.h"
struct vl_settings vl_in_force;
static uint32_t n_bytes;
uint32_t vl_count_bytes(void) { return n_bytes; }
void board_lock(void) {}
void board_unlock(void) {}
void set_up(uint32_t block, uint32_t bytes) { vl_in_force.block = block; n_bytes = bytes; }
"""
"""What the rule asks of the rest of the core."""


class Core:
    """The rule in C, for blocks of one size."""

    def __init__(self, library: Path, block: int, bits: int) -> None:
        self._c = ctypes.CDLL(str(library))
        self._c.vl_continue.restype = ctypes.c_bool
        self._bytes = bits // 8
        self._c.set_up(block, self._bytes)

    def arm(self, instant: int) -> None:
        self._c.vl_forget_period_locked(ctypes.c_uint64(instant))

    def keep(self, first: int, counts: list[int], period: int, ramp: int) -> None:
        data = b"".join(count.to_bytes(self._bytes, "little", signed=True) for count in counts)
        self._c.vl_keep_period(ctypes.c_uint64(first), data, ctypes.c_uint32(period), ctypes.c_uint32(ramp))

    def count(self, instant: int) -> int | None:
        out = ctypes.c_int32()
        goes_on = self._c.vl_continue(ctypes.c_uint64(instant), ctypes.byref(out))
        return out.value if goes_on else None


def library_for(folder: Path, longest: int, count_bytes: int = 4) -> Path:
    """The rule as a library, with undefined behaviour caught; each build is another file, so that no two share their memory."""
    need("cc")
    source, out = folder / "beside.c", folder / f"continuation-{longest}-{count_bytes}.so"
    if not out.exists():
        source.write_text(BESIDE)
        limits = (f"-DVL_LONGEST_PERIOD={longest}", f"-DVL_MOST_COUNT_BYTES={count_bytes}")
        checked = ("-fsanitize=undefined", "-fno-sanitize-recover=all")
        files = (f"-I{FOLDER}/core", FOLDER / "core/continuation.c", source)
        subprocess.run(["cc", "-std=c11", "-O2", "-shared", "-fPIC", *checked, *limits, *files, "-o", out], check=True)
    return out


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("continuation")


def a_period(random: Random, longest: int) -> int:
    """Mostly one that is soon reached; sometimes none, or one at or beyond a bound."""
    bounds = (
        0,
        1,
        4 * STEP - 1,
        4 * STEP,
        4 * STEP + 1,
        longest * STEP - 1,
        longest * STEP,
        longest * STEP + 1,
        2**32 - 1,
    )
    if random.random() < 0.1:
        return min(random.choice(bounds), 2**32 - 1)
    return random.randrange(4 * STEP, min(longest, random.choice((5, 12, 40, longest))) * STEP + 1)


def some_counts(random: Random, n: int, bits: int) -> list[int]:
    most = 2 ** (bits - 1)
    kind = random.randrange(4)
    if kind == 0:
        return [random.choice((-most, most - 1)) for _ in range(n)]
    return [random.randrange(-most, most) >> (kind - 1) * bits // 4 for _ in range(n)]


class Both:
    """The core and its judge, told the same."""

    def __init__(self, core: Core, plain: Vibration, random: Random, block: int, bits: int) -> None:
        self.core, self.plain, self.random = core, plain, random
        self.block, self.bits = block, bits
        self.next, self.present, self.period, self.ramp = 0, 0, 0, 0

    def arm(self) -> None:
        for one in (self.core, self.plain):
            one.arm(self.present)

    def keep(self, first: int) -> None:
        counts = some_counts(self.random, self.block, self.bits)
        for one in (self.core, self.plain):
            one.keep(first, counts, self.period, self.ramp)

    def act(self, longest: int) -> None:
        """A block in its place, or lost, late, early, twice; another period or ramp; ARM."""
        random, block = self.random, self.block
        kind = random.random()
        if kind < 0.02:
            self.arm()
        elif kind < 0.06:
            self.period, self.ramp = a_period(random, longest), random.choice((0, 0, 1, 50, 2000, 2**32 - 1))
        elif kind < 0.09:  # lost
            self.next += random.choice((1, 2, 3, 1 + longest // block)) * block
        elif kind < 0.15:  # late
            self.keep(max(0, self.next - random.choice((1, 2, 5, longest // block, 2 * longest // block + 5)) * block))
        elif kind < 0.16:  # of a host that begins before the newest again
            self.next = max(0, self.next - random.choice((1, 10)) * block)
        else:
            self.keep(self.next)
            self.next += block
        self.present = max(0, self.next + random.randrange(-3 * block, 10 * block))

    def check(self) -> bool:
        """Whether it goes on; the same in both, some instants away."""
        found = None
        for beyond in (0, 1, self.random.randrange(300), self.random.randrange(10**6)):
            found = self.plain.count(self.present + beyond)
            assert self.core.count(self.present + beyond) == found, (self.plain.source, self.present + beyond)
        return found is not None


@pytest.mark.parametrize("bits", [16, 32])
@pytest.mark.parametrize("longest", [4, 5, 37, 300, 2048])
def test_the_core_goes_on_as_plain_integers_do(longest: int, bits: int, folder: Path) -> None:
    random = Random(longest + bits)
    continued = 0
    for block in (1, 2, 7, 40):
        core = Core(library_for(folder, longest), block, bits)
        both = Both(core, Vibration(longest), random, block, bits)
        both.arm()
        for _ in range(600 if longest < 2048 else 300):
            both.act(longest)
            continued += both.check()
    assert continued > 300


def test_a_ring_of_two_bytes_a_count_holds_the_same(folder: Path) -> None:
    random = Random(5)
    both = Both(Core(library_for(folder, 50, 2), 3, 16), Vibration(50), random, 3, 16)
    both.arm()
    assert sum(both.act(50) or both.check() for _ in range(1000)) > 300


def test_the_longest_period_of_the_protocol_can_be_kept(folder: Path) -> None:
    longest, block = 65535, 1000
    core, plain, random = Core(library_for(folder, longest), block, 16), Vibration(longest), Random(1)
    for one in (core, plain):
        one.arm(0)
    for first in range(0, 67_000, block):
        counts = some_counts(random, block, 16)
        for one in (core, plain):
            one.keep(first, counts, longest * STEP, 0)
    assert plain.source is not None
    for instant in (67_000, 67_001, 70_000, 132_531, 132_537, 10**12):
        assert core.count(instant) == plain.count(instant)


def test_without_a_longest_period_all_is_held(folder: Path) -> None:
    core = Core(library_for(folder, 0), 10, 16)
    core.arm(0)
    for first in range(0, 100, 10):
        core.keep(first, [100] * 10, 4 * STEP, 0)
        assert core.count(first + 10) is None


@pytest.mark.parametrize("pair", [(30_000, 29_000), (29_000, 30_000)])
def test_any_output_of_the_period_bounds_it(pair: tuple[int, int], folder: Path) -> None:
    """Between two large outputs the cubic is above both; the larger one is found wherever it stands."""
    period, end = 150 * STEP + STEP // 2, 200
    core, plain = Core(library_for(folder, 300), 1, 16), Vibration(300)
    for at in range(end - 148, end - 3):
        core.arm(0), plain.arm(0)
        for first in range(end):
            counts = [pair[first - at]] if first in (at, at + 1) else [first % 7]
            core.keep(first, counts, period, 0), plain.keep(first, counts, period, 0)
        (instant,) = (one for one in range(end, end + 151) if plain.place(one) == (at, STEP // 2))
        assert core.count(instant) == plain.count(instant) == 30_000


@pytest.mark.parametrize("late", range(0, 200, 10))
def test_a_late_block_changes_what_bounds_the_vibration(late: int, folder: Path) -> None:
    """A peak that stood in its place is gone, or a larger one has come."""
    period, end = 150 * STEP + 7, 200
    for before, after in ((30_000, 1_000), (1_000, 30_000)):
        core, plain, random = Core(library_for(folder, 300), 10, 16), Vibration(300), Random(late)
        core.arm(0), plain.arm(0)
        for first in [*range(0, end, 10), late]:
            level = after if first == late and plain.source else before if first == late else 500
            counts = [random.choice((-level, level)) for _ in range(10)]
            core.keep(first, counts, period, 0), plain.keep(first, counts, period, 0)
            for instant in range(end, end + 150) if plain.source and plain.source[0] == end else ():
                assert core.count(instant) == plain.count(instant)


@pytest.mark.parametrize("bits", [16, 32])
def test_the_integers_are_the_cubic_of_lagrange_to_half_a_count(bits: int, folder: Path) -> None:
    """Where no bound is in the way: a sine is nowhere above its largest output but near it."""
    random, core, plain = Random(bits), Core(library_for(folder, 300), 10, bits), Vibration(300)
    within = 0
    for _ in range(100):
        period = random.randrange(5 * STEP, 60 * STEP)
        for one in (core, plain):
            one.arm(0)
        for first in range(0, 80, 10):
            counts = some_counts(random, 10, bits)
            for one in (core, plain):
                one.keep(first, counts, period, 0)
        whole = [plain.outputs[index] for index in range(80 - (period >> 16) - 4, 80)]
        for instant in range(80, 90):
            exact, count = plain.exact(instant), core.count(instant)
            assert count is not None
            if min(whole) < exact < max(whole):
                within += 1
                assert abs(count - exact) <= 0.5 + 2.0**-8
    assert within > 500
