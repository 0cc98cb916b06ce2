"""Tests of opening, starting, closing and refusing, and of what a driver says of itself."""

import threading
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from rig.conformance.subject import DriverUnderTest
from rig.daq import State
from rig.errors import DaqRefused

CYCLES = 3  # openings that are compared; chosen: what is left behind by each of them is a leak
DESCRIPTORS = Path("/proc/self/fd")


class LifeCycleTests(DriverUnderTest):
    """Tests of the order of calls."""

    def test_nothing_is_opened_by_the_constructor(self) -> None:
        """A driver that was made and thrown away leaves no trace."""
        state = self.make().state
        assert state is State.CLOSED, f"a driver that was only constructed is {state.value}"

    def test_the_life_cycle_is_open_start_stop_close(self) -> None:
        """Every step leads to its state."""
        daq = self.make()
        steps: list[Callable[[], None]] = [daq.open, daq.start, daq.stop, daq.close]
        states = State.OPEN, State.RUNNING, State.OPEN, State.CLOSED
        try:
            for step, state in zip(steps, states, strict=True):
                step()
                assert daq.state is state, f"after {step.__name__} the driver is {daq.state.value}, not {state.value}"
        finally:
            daq.close()

    def test_close_may_be_called_at_any_time_and_again(self) -> None:
        """Before opening, while running, twice."""
        daq = self.make()
        daq.close()
        daq.open()
        daq.start(1)
        daq.close()
        daq.close()
        assert daq.state is State.CLOSED, f"after close the driver is {daq.state.value}"

    def test_a_driver_may_be_opened_again(self) -> None:
        """After close, the same object works once more."""
        daq = self.make()
        for _ in range(2):
            with daq:
                daq.start(1)
                assert np.isfinite(daq.exchange(np.zeros(1))).all()

    def test_another_driver_may_open_what_one_has_closed(self) -> None:
        """Close lets go of the device, while the object is still there."""
        kept = [self.make(), self.make()]
        for daq in kept:
            with daq:
                daq.start(1)
                assert np.isfinite(daq.exchange(np.zeros(1))).all()

    def test_close_leaves_nothing_behind(self) -> None:
        """Neither a thread nor an open file is more after every cycle."""
        kept, threads = [], []
        files: list[set[str]] = []
        for cycle in range(CYCLES):
            before, opened = set(threading.enumerate()), _open_files()
            kept.append(self.make())
            with kept[-1] as daq:
                daq.start(1)
                daq.exchange(np.zeros(1))
            threads.append(_left(before, self.prompt_s))
            is_last = cycle == CYCLES - 1
            files.append(_left_open(opened, self.prompt_s if is_last and all(files) else 0.0))
        # what all drivers share is begun once, and is not left behind
        assert not all(threads), f"after close these threads still run: {', '.join(threads[-1])}"
        assert not all(files), f"after close these file descriptors are still open: {', '.join(sorted(files[-1]))}"

    def test_an_error_inside_the_context_closes(self) -> None:
        """Whatever happens, the device is let go of."""
        daq = self.make()
        try:
            with daq:
                daq.start(1)
                raise KeyError("anything")
        except KeyError:
            pass
        assert daq.state is State.CLOSED, f"after an error inside the context the driver is {daq.state.value}"

    def test_steps_out_of_order_are_refused(self) -> None:
        """Exchange before start and after stop, start before open and after close, open twice, start twice."""
        daq = self.make()
        for _ in range(2):
            assert "closed" in self.refused(lambda: daq.exchange(np.zeros(1)))
            assert "closed" in self.refused(lambda: daq.start(1))
            with daq:
                self.refused(daq.open)
                assert "open" in self.refused(lambda: daq.exchange(np.zeros(1)))
                daq.start(1)
                self.refused(lambda: daq.start(1))
                daq.exchange(np.zeros(1))
                daq.stop()
                assert "open" in self.refused(lambda: daq.exchange(np.zeros(1)))

    def test_blocks_beyond_the_device_are_refused_with_what_is_allowed(self) -> None:
        """0, and one more than the largest."""
        with self.make() as daq:
            largest = daq.capabilities.largest_block
            for block in (0, -1, largest + 1):
                assert str(largest) in self.refused(partial(daq.start, block))

    def test_a_block_of_another_size_is_refused(self) -> None:
        """N is fixed at start."""
        with self.running(4) as daq:
            self.refused(lambda: daq.exchange(np.zeros(daq.block + 1)))
            self.refused(lambda: daq.exchange(np.zeros((daq.block, 1))))

    def test_voltages_beyond_the_range_or_not_a_number_are_refused(self) -> None:
        """The message names the voltage and the range; the device goes on."""
        with self.running(2) as daq:
            for wrong in (1.5 * daq.output_range_v, np.nan, -np.inf):
                voltages = np.zeros(daq.block)
                voltages[-1] = wrong
                assert f"{daq.output_range_v:g}" in self.refused(partial(daq.exchange, voltages))
            daq.exchange(np.zeros(daq.block))

    def test_closed_after_a_refusal_a_driver_can_be_used_again(self) -> None:
        """A mistake of the host's leaves nothing behind."""
        daq = self.make()
        try:
            with daq:
                daq.start(1)
                daq.exchange(np.zeros(7))
        except DaqRefused:
            pass
        assert daq.state is State.CLOSED, f"after a refusal inside the context the driver is {daq.state.value}"
        with daq:
            daq.start(1)
            assert daq.exchange(np.zeros(1)).shape == (1, len(daq.channels))

    def test_the_device_says_who_it_is_in_words(self) -> None:
        """Identity in text, statistics in numbers, remarks in lines, all known once open."""
        with self.make() as daq:
            for name, value in daq.identity.items():
                assert isinstance(name, str), f"identity: {name!r} is not text"
                assert isinstance(value, str), f"identity: {name} = {value!r} is not text"
            for name, number in daq.statistics.items():
                assert isinstance(number, int | float), f"statistics: {name} = {number!r} is no number"
            for remark in daq.remarks:
                assert isinstance(remark, str), f"remarks: {remark!r} is not text"
                assert "\n" not in remark, f"remarks: {remark!r} is more than one line"

    def test_capabilities_are_the_same_before_and_while_running(self) -> None:
        """Whether something physical moves is known before anything is started."""
        with self.make() as daq:
            before = daq.capabilities
            daq.start(1)
            daq.exchange(np.zeros(1))
            assert daq.capabilities == before, f"capabilities were {before} and are {daq.capabilities} while running"

    def test_rate_range_and_channels_are_those_of_the_bench(self) -> None:
        """Once it is open and while it runs: what the device cannot do it refuses."""
        bench = self.bench_for_another_process()
        if bench is None:
            self.unproven("the contract has no bench to compare with (override bench_for_another_process)")
        wanted = bench.sample_rate_hz, bench.output_range_v, bench.channels
        with self.make() as daq:
            for when in ("once open", "while running"):
                said = daq.sample_rate_hz, daq.output_range_v, tuple(daq.channels)
                for name, mine, theirs in zip(
                    ("sample_rate_hz", "output_range_v", "channels"), said, wanted, strict=True
                ):
                    assert mine == theirs, f"{name} = {mine} {when}: the bench has {theirs}"
                if daq.state is State.OPEN:
                    daq.start(1)
                    daq.exchange(np.zeros(1))


def _left(before: set[threading.Thread], wait_s: float) -> list[str]:
    """Names of the threads that were not there before, once they have had time to end."""
    end = time.monotonic() + wait_s
    for thread in set(threading.enumerate()) - before:
        thread.join(max(0.0, end - time.monotonic()))
    return [thread.name for thread in set(threading.enumerate()) - before]


def _left_open(before: set[str], wait_s: float) -> set[str]:
    """Numbers of the file descriptors that were not open before, once libraries have had time to close theirs."""
    end = time.monotonic() + wait_s
    while (left := _open_files() - before) and time.monotonic() < end:
        time.sleep(0.02)
    return left


def _open_files() -> set[str]:
    """Numbers of the open file descriptors; none where the system does not list them.

    The list has its own descriptor, which is closed when it is looked at again, and not always the same.
    """
    return {path.name for path in DESCRIPTORS.iterdir() if path.is_symlink()} if DESCRIPTORS.is_dir() else set()
