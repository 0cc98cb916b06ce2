"""Tests that the output is at 0 V before and after a run: after open, start, 0 V, stop, close, and errors."""

from collections.abc import Callable

import numpy as np

from rig.conformance.looking import STILL, UNSEEN, OutputSteps, replaced
from rig.conformance.subject import TOO_BUSY
from rig.daq import HELD, State
from rig.errors import DaqError


class WaysOutTests(OutputSteps):
    """Tests that look at the output from outside."""

    def test_a_witness_sees_the_voltage_that_was_handed_over(self) -> None:
        """Held outputs of either sign and of half the amplitude, within 10 % of the amplitude."""
        with self.punctual(), self.make_visible() as daq:
            if self.witness(daq) is None:
                self.unproven("no witness but the driver's own loopback: a gain of both cancels. Override witness")
            daq.start(min(max(self.blocks), daq.capabilities.largest_block))
            for level_v in (self.amplitude_v, -self.amplitude_v, 0.5 * self.amplitude_v):
                held = daq.counters.get(HELD, 0)
                seen = self.drive(daq, level_v)
                if daq.counters.get(HELD, 0) > held:
                    self.unproven(f"{TOO_BUSY}: outputs came too late")
                assert seen is not None, "the witness has seen the output at first, and does not any more"
                assert abs(seen - abs(level_v)) <= STILL * self.amplitude_v, (
                    f"{level_v:g} V were handed over for {daq.queue_blocks + 2} blocks, and {seen:.3g} V are on the output"
                )

    def test_open_and_start_leave_the_output_at_0_v(self) -> None:
        """Also after the device was driven; what it was driven with does not come back. Only a witness sees it."""
        daq = self.make_visible()
        try:
            for when in ("at first", "after it was driven"):
                daq.open()
                if self.witness(daq) is None:
                    self.unproven(f"no witness sees the output before the first block: {UNSEEN}")
                self.require_still(self.look(daq), f"after open {when}")
                for again in ("", " again"):
                    daq.start(min(max(self.blocks), daq.capabilities.largest_block))
                    self.require_still(self.look(daq), f"after start{again} {when}")
                    self.drive(daq, self.amplitude_v)
                    daq.stop()
                daq.close()
        finally:
            daq.close()

    def test_0_v_that_are_exchanged_are_on_the_converter(self) -> None:
        """After the blocks of the queue and one more."""
        with self.driven() as daq:
            held = daq.counters.get(HELD, 0)
            daq.exchange_zeros()
            seen = self.look(daq)
            for _ in range(daq.queue_blocks + 1):  # until the flags of these blocks are there
                daq.exchange(np.zeros(daq.block))
            if daq.counters.get(HELD, 0) > held:
                self.unproven(f"{TOO_BUSY}: outputs came too late")
        self.require_still(seen, "after 0 V was exchanged")

    def test_stop_alone_brings_the_output_to_0_v(self) -> None:
        """Where no block of 0 V can be exchanged any more."""
        with self.driven() as daq:
            daq.stop()
            seen = self.look(daq)
        self.require_still(seen, "after stop", "_stop")

    def test_close_alone_brings_the_output_to_0_v(self) -> None:
        """Where `_stop` was never called, or has not got through."""
        with self.driven() as daq:
            daq.state = State.OPEN
            daq.close()
            seen = self.look(daq)
        self.require_still(seen, "after close", "_stop", "_close")

    def test_an_exception_in_exchange_ends_at_0_v(self) -> None:
        """A block that fails in any way is a `DaqError`, and what follows brings the output down."""
        with self.driven() as daq:
            failed = False
            with replaced(daq, "_exchange", _failing(RuntimeError("made to fail by the contract"))):
                try:
                    daq.exchange(np.full(daq.block, self.amplitude_v))
                except DaqError:
                    failed = True
                daq.exchange_zeros()
                daq.stop()
            assert failed, "an exception inside the driver is not a DaqError"
            seen = self.look(daq)
        self.require_still(seen, "after an exception and stop", "_stop")

    def test_an_interruption_in_exchange_ends_at_0_v(self) -> None:
        """Ctrl-C goes through the driver as it is, and the context then brings the output down."""
        went_through = False
        try:
            with self.driven() as daq, replaced(daq, "_exchange", _failing(KeyboardInterrupt())):
                daq.exchange(np.full(daq.block, self.amplitude_v))
        except KeyboardInterrupt:
            went_through = True
        assert went_through, "KeyboardInterrupt inside the driver does not come out of exchange"
        assert daq.state is State.CLOSED, f"after KeyboardInterrupt the driver is {daq.state.value}"
        try:
            seen = self.look(daq)
        finally:
            daq.close()
        self.require_still(seen, "after KeyboardInterrupt and close", "_stop", "_close")


def _failing(error: BaseException) -> Callable[..., None]:
    def fail(*arguments: object) -> None:
        raise error

    return fail
