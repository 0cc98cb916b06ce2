"""The DAQ contract as tests: what every driver has to pass before a rig is trusted to it.

Derive a test class from `DriverContract` and say how a driver is made; pytest collects the rest::

    class TestMyDriver(DriverContract):
        def make(self):
            return MyDriver(bench)

Tests that do not concern a driver, by its `rig.daq.Capabilities`, say so instead of passing in silence; so do tests that
cannot be judged, because nothing sees the output or because this machine was busy: these are *unproven*.
Where something physical moves, outputs stay within ``amplitude_v``.
"""

from rig.bench import Bench
from rig.conformance.answers import with_loopback
from rig.conformance.continuing import ContinuingTests
from rig.conformance.life_cycle import LifeCycleTests
from rig.conformance.loopback import LoopbackTests
from rig.conformance.samples import SamplesTests
from rig.conformance.timing import TimingTests
from rig.conformance.ways_out import WaysOutTests
from rig.conformance.without_host import WithoutHostTests
from rig.daq import DAQ
from rig.drivers import make_daq


class DriverContract(
    LifeCycleTests, SamplesTests, LoopbackTests, ContinuingTests, WaysOutTests, WithoutHostTests, TimingTests
):
    """Tests of one driver. Override `make`; and ``amplitude_v``, ``tolerance_v`` for a physical bench."""


class BenchContract(DriverContract):
    """Tests of the installed driver of ``bench``."""

    bench: Bench

    def take(self, bench: Bench) -> None:
        """Take a bench; its own block is tried too, for one that is far shorter than a device's may be too much for Python."""
        self.bench = bench
        self.blocks = tuple(sorted({*self.blocks, bench.block}))

    def make(self) -> DAQ:
        """A driver as the bench asks for it."""
        return make_daq(self.bench)

    def make_loopback(self) -> DAQ | None:
        """The same with a loopback, if it has one or is virtual."""
        bench = with_loopback(self.bench)
        return None if bench is None else make_daq(bench)

    def bench_for_another_process(self) -> Bench:
        """The bench itself."""
        return self.bench
