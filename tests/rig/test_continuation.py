"""The rule of continuation, against the protocol's page in exact integers, against fractions, and against closed forms."""

import math
from dataclasses import dataclass, field
from fractions import Fraction
from random import Random

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from rig.continuation import (
    SOURCE,
    STEPS,
    begin,
    count_at,
    forget,
    keep,
    period_steps,
    ramp_length,
    ring_for,
)

RATE_HZ = 5000.0
LONGEST = 40  # for random blocks: short, so that a ring goes round often
LARGEST = 2**31 - 1


class Device:
    """The kernels, with their record and ring."""

    def __init__(self, longest: int = LONGEST) -> None:
        self.source, self.ring = np.zeros(1, SOURCE)[0], ring_for(longest)
        begin(self.source, longest)

    def keep(self, first: int, counts: list[int] | np.ndarray, period: int, ramp: int = 0) -> None:
        keep(self.source, self.ring, first, np.asarray(counts, np.int64), period, ramp)

    def arm(self, instant: int) -> None:
        forget(self.source, instant)

    def at(self, instant: int) -> int | None:
        return int(count_at(self.source, self.ring, instant)) if self.source["period"] else None


@dataclass
class Page:
    """The rule as the page words it: every output that ever came, by index, and whole numbers of any size."""

    longest: int = LONGEST
    armed: int = 0
    kept: dict[int, int] = field(default_factory=dict)
    run: tuple[int, int] | None = None
    source: tuple[int, int, int] | None = None

    def arm(self, instant: int) -> None:
        self.armed, self.run, self.source = instant, None, None

    def keep(self, first: int, counts: list[int], period: int, ramp: int = 0) -> None:
        end = first + len(counts)
        self.kept.update({first + index: count for index, count in enumerate(counts)})
        if self.source and end - self.source[0] > self.longest:
            self.source = None
        if not 4 << 16 <= period <= self.longest << 16:
            self.run = self.source = None
            return
        if self.run and first < self.run[1]:
            return
        begun = self.run[0] if self.run and first == self.run[1] else max(first, self.armed)
        self.run = begun, end
        if end - begun >= (period >> 16) + 4:
            self.source = end, period, ramp

    def at(self, instant: int) -> int | None:
        if self.source is None:
            return None
        end, period, ramp = self.source
        k = instant - end
        x = ((end - 2) << 16) - period + ((k + 2) << 16) % period
        b, f = x >> 16, x & 0xFFFF
        p, q, r, s = (self.kept[b + j] for j in (-1, 0, 1, 2))
        c0, c1, c2, c3 = 6 * q, -2 * p - 3 * q + 6 * r - s, 3 * p - 6 * q + 3 * r, -p + 3 * q - 3 * r + s
        c0, c1, c2, c3 = c0 << 8, c1 << 8, c2 << 8, c3 << 8
        v = ((((((c3 * f >> 16) + c2) * f) >> 16) + c1) * f >> 16) + c0
        period_of = [self.kept[index] for index in range(end - (period >> 16) - 4, end)]
        y = min(max(math.floor(Fraction(v + 768, 1536)), min(period_of)), max(period_of))
        if ramp > 0:
            left = ramp - k
            if left <= 0:
                return 0
            g = min(1 << 30, (left << 30) // (ramp + end - b))
            y = (1 if y >= 0 else -1) * (((abs(y) * g >> 30) * g) >> 30)
        return y


counts = st.one_of(st.integers(-5, 5), st.integers(-(2**15), 2**15 - 1), st.integers(-LARGEST - 1, LARGEST))
periods = st.one_of(
    st.integers(4 << 16, 12 << 16),
    st.sampled_from([0, (4 << 16) - 1, 4 << 16, LONGEST << 16, (LONGEST << 16) + 1, (7 << 16) + 1, 2**32 - 1]),
)
ramps = st.one_of(st.just(0), st.integers(1, 80), st.just(2**32 - 1))


def some_counts(seed: int, n: int) -> list[int]:
    """Small, middling, large and largest counts, one beside the other; to draw each of them would take most of the time."""
    chance = Random(seed)
    extremes = [(-LARGEST - 1, -LARGEST), (LARGEST - 1, LARGEST)]
    ends = chance.choices([(-5, 5), (-(2**15), 2**15 - 1), (-LARGEST - 1, LARGEST), *extremes], k=n)
    return [chance.randint(*one) for one in ends]


def test_outputs_far_ahead_from_before_arm_take_no_room_from_those_after_it() -> None:
    device, page = Device(), Page()
    for one in (device, page):
        one.keep(1000 * LONGEST, list(range(10)), 7 << 16)
        one.arm(0)
        for first in range(0, 60, 10):
            one.keep(first, [37 * index % 101 for index in range(first, first + 10)], 7 << 16)
    assert [device.at(instant) for instant in range(60, 70)] == [page.at(instant) for instant in range(60, 70)]
    assert device.at(60)


@pytest.mark.slow
@settings(max_examples=300, deadline=None)
@given(data=st.data(), n=st.sampled_from([1, 3, 5, 16, 50]))
def test_blocks_in_any_order_are_continued_as_the_page_says(data: st.DataObject, n: int) -> None:
    device, page, block, period = Device(), Page(), 0, 5 << 16
    for _ in range(data.draw(st.integers(1, 30))):
        what = data.draw(st.sampled_from(["next", "next", "next", "next", "next", "gap", "old", "arm", "other"]))
        if what == "arm":
            instant = max(0, block * n + data.draw(st.integers(-2 * n, 2 * n)))
            device.arm(instant)
            page.arm(instant)
            continue
        if what == "gap":
            block += data.draw(st.integers(1, 60))
        if what == "other":
            period = data.draw(periods)
        at = max(0, block - data.draw(st.integers(1, 60))) if what == "old" else block
        outputs = some_counts(data.draw(st.integers(0, 2**32 - 1), label="seed of the counts"), n)
        ramp = data.draw(ramps)
        device.keep(at * n, outputs, period, ramp)
        if what == "old" and (at + 1) * n <= max(page.kept, default=0) + 1 - 2 * LONGEST - 4:
            before = dict(page.kept)  # so far back that nothing reads it any more: kept or not is all the same
            page.keep(at * n, outputs, period, ramp)
            page.kept |= {index: before.get(index, page.kept[index]) for index in range(at * n, (at + 1) * n)}
        else:
            page.keep(at * n, outputs, period, ramp)
        block += what != "old"
        for beyond in (-n, -1, 0, 1, n, 3 * n + 1, 1000, 10**7):
            instant = max(0, block * n + beyond)
            assert device.at(instant) == page.at(instant)


@settings(max_examples=200, deadline=None)
@given(
    outputs=st.lists(st.integers(-(2**15), 2**15 - 1), min_size=30, max_size=30),
    period=st.integers(4 << 16, 26 << 16),
    beyond=st.integers(0, 10**6),
)
def test_a_continued_count_is_the_cubic_through_four_outputs_in_fractions(
    outputs: list[int], period: int, beyond: int
) -> None:
    device = Device()
    device.keep(0, outputs, period)
    place = Fraction(28) - Fraction(period, STEPS) + Fraction((beyond + 2) * STEPS % period, STEPS)
    at = math.floor(place)
    exact = Fraction(0)
    for one in range(at - 1, at + 3):
        weight = Fraction(outputs[one])
        for other in range(at - 1, at + 3):
            weight *= Fraction(1) if other == one else (place - other) / (one - other)
        exact += weight
    part = outputs[30 - (period >> 16) - 4 :]
    exact = min(max(exact, Fraction(min(part))), Fraction(max(part)))
    got = device.at(30 + beyond)
    assert got is not None
    assert abs(got - exact) <= Fraction(1, 2) + Fraction(
        3, 1536
    )  # rounding, and one step lost in each of three products


def sine(frequency_hz: float, amplitude: float, first: int, n: int) -> np.ndarray:
    return amplitude * np.sin(2.0 * math.pi * frequency_hz / RATE_HZ * np.arange(first, first + n) + 0.3)


def sent(frequency_hz: float, amplitude: float, n: int = 10, longest: int = 2048) -> tuple[Device, int]:
    """A device that has been sent two periods and more of a sine; the end of what was sent."""
    device, period_samples = Device(longest), RATE_HZ / frequency_hz
    end = n * math.ceil((2.0 * period_samples + 10) / n)
    for first in range(0, end, n):
        device.keep(first, np.rint(sine(frequency_hz, amplitude, first, n)), period_steps(period_samples))
    return device, end


def clipped(wave: np.ndarray, last: np.ndarray) -> np.ndarray:
    """A wave cut to the extremes of the outputs before it; a cut brings no two waves further apart."""
    return np.clip(wave, last.min(), last.max())


CUBIC = 3.0 / 128.0  # of the fourth derivative: 1/24 times 9/16, halfway between two samples


@pytest.mark.parametrize("periods_later", [0, 100])
@pytest.mark.parametrize("frequency_hz", [23.0, 149.0, 745.0])  # the last is harmonic 5 of 149 Hz
def test_a_continued_sine_is_off_by_the_cubics_error_and_no_more(frequency_hz: float, periods_later: int) -> None:
    amplitude, omega, period_samples = 2.0**28, 2.0 * math.pi * frequency_hz / RATE_HZ, RATE_HZ / frequency_hz
    device, end = sent(frequency_hz, amplitude)
    first, n = end + math.floor(periods_later * period_samples), math.ceil(period_samples)
    got = np.array([device.at(instant) for instant in range(first, first + n)])
    wanted, last = sine(frequency_hz, amplitude, first, n), math.floor(period_samples) + 4
    cut = clipped(wanted, sine(frequency_hz, amplitude, end - last, last))
    drift = (periods_later + 2) * omega / (2.0 * STEPS)  # the period is known to half a step
    assert np.abs(got - cut).max() <= amplitude * (CUBIC * omega**4 + drift) + 2.0
    assert np.abs(cut - wanted).max() <= amplitude * omega**2 / 8.0  # a sine's peak lies between two samples


def test_harmonics_are_continued_with_the_fundamental() -> None:
    device, n, period_samples = Device(2048), 5, RATE_HZ / 149.0
    omega = 2.0 * math.pi / period_samples

    def wave(index: np.ndarray) -> np.ndarray:
        return 1e8 * np.cos(omega * index) + 2e7 * np.cos(3 * omega * index + 1.0) + 1e7 * np.sin(5 * omega * index)

    for first in range(0, 100, n):
        device.keep(first, np.rint(wave(np.arange(first, first + n))), period_steps(period_samples))
    k = np.arange(100, 600)
    got = np.array([device.at(int(one)) for one in k])
    fourth = omega**4 * (1e8 + 3**4 * 2e7 + 5**4 * 1e7)
    drift = 17 / (2.0 * STEPS) * omega * (1e8 + 3 * 2e7 + 5 * 1e7)
    wanted = clipped(wave(k), wave(np.arange(100 - 33 - 4, 100)))
    assert np.abs(got - wanted).max() <= CUBIC * fourth + drift + 2.0


@settings(max_examples=200, deadline=None)
@given(outputs=st.lists(counts, min_size=30, max_size=30), period=st.integers(4 << 16, 26 << 16), ramp=ramps)
def test_nothing_goes_beyond_the_extremes_of_the_period(outputs: list[int], period: int, ramp: int) -> None:
    device = Device()
    device.keep(0, outputs, period, ramp)
    part = outputs[30 - (period >> 16) - 4 :]
    for instant in range(30, 90):
        got = device.at(instant)
        assert got is not None
        assert min(0 if ramp else LARGEST, *part) <= got <= max(0 if ramp else -LARGEST, *part)


@pytest.mark.parametrize("left", [1, 7, 200, 950])
@pytest.mark.parametrize("frequency_hz", [23.0, 149.0])
def test_a_late_ramp_stays_below_the_hosts_and_ends_when_that_would_have_ended(frequency_hz: float, left: int) -> None:
    n, length, amplitude, period_samples = 10, 1000, 2.0**24, RATE_HZ / frequency_hz
    device, end = Device(2048), 500 + length - left  # the ramp begins at 500

    def envelope(index: np.ndarray) -> np.ndarray:
        return 0.5 + 0.5 * np.cos(math.pi * np.clip((index - 500) / length, 0.0, 1.0))

    begun = end % n
    for first in range(begun, end, n):
        index = np.arange(first, first + n)
        outputs = np.rint(envelope(index) * sine(frequency_hz, amplitude, first, n))
        device.keep(first, outputs, period_steps(period_samples), 500 + length - first - n if first + n > 500 else 0)
    k = np.arange(end, 1600)
    got = np.array([device.at(int(one)) for one in k])
    omega = 2.0 * math.pi / period_samples
    over = CUBIC * omega**4 * amplitude + 2.0
    assert (np.abs(got) <= amplitude * envelope(k) + over).all()
    assert (got[k >= 500 + length] == 0).all()
    assert np.abs(got).max() <= amplitude * envelope(np.array([end]))[0] + over
    if left > 2 * period_samples:  # and it is a ramp, not a drop: half of the way on it is still there
        tail = got[(k >= end) & (k < end + 1.2 * period_samples)]
        assert np.abs(tail).max() > 0.2 * amplitude * envelope(np.array([end]))[0]


def test_nothing_is_continued_before_a_whole_period_has_come_since_arm() -> None:
    device = Device()
    for first in range(0, 20, 5):
        device.keep(first, [1, 2, 3, 4, 5], 10 << 16)
    device.arm(23)
    assert device.at(23) is None
    for first in (20, 25, 30):  # 23 ... 34: twelve outputs, two too few
        device.keep(first, [1, 2, 3, 4, 5], 10 << 16)
        assert device.at(first + 5) is None
    device.keep(35, [1, 2, 3, 4, 5], 10 << 16)
    assert device.at(40) is not None


def test_a_block_without_a_period_ends_it() -> None:
    device = Device()
    device.keep(0, list(range(20)), 8 << 16)
    assert device.at(20) is not None
    device.keep(20, [0], 0)
    assert device.at(21) is None
    device.keep(21, list(range(11)), 8 << 16)
    assert device.at(32) is None
    device.keep(32, [1], 8 << 16)
    assert device.at(33) is not None


def test_a_source_is_forgotten_once_the_host_is_a_longest_period_ahead() -> None:
    device = Device()
    device.keep(0, list(range(20)), 8 << 16)
    device.keep(21, [0] * (LONGEST - 1), 40 << 16)  # something is missing between, and the new run is too short
    assert device.at(20) is not None
    device.keep(20 + LONGEST, [0], 40 << 16)
    assert device.at(20) is None


@pytest.mark.parametrize(
    ("samples", "steps"),
    [
        (0.0, 0),
        (-1.0, 0),
        (math.nan, 0),
        (math.inf, 0),
        (65536.0, 0),
        (33.5, 33 * 65536 + 32768),
        (4.0 + 0.6 / 65536.0, 4 * 65536 + 1),
        (65535.0, 65535 * 65536),
    ],
)
def test_a_period_in_steps(samples: float, steps: int) -> None:
    assert period_steps(samples) == steps


@pytest.mark.parametrize(
    ("samples", "length"), [(0.0, 0), (-3.0, 0), (math.nan, 0), (0.2, 1), (7.0, 7), (7.1, 8), (1e12, 2**32 - 1)]
)
def test_a_ramp_in_samples(samples: float, length: int) -> None:
    assert ramp_length(samples) == length


def test_a_block_without_a_period_ends_the_run_also_for_a_block_that_comes_in_its_place() -> None:
    device, page = Device(), Page()
    for one in (device, page):
        one.keep(0, list(range(20)), 8 << 16)
        one.keep(20, list(range(10)), 0)
        one.keep(20, list(range(10)), 8 << 16)
    assert device.at(30) is page.at(30) is None
