"""The DAQ contract as tests: what every driver has to pass before a rig is trusted to it.

Derive a test class from `DriverContract` and say how a driver is made; pytest collects the rest::

    class TestMyDriver(DriverContract):
        def make(self):
            return MyDriver(bench)

Tests that do not concern a driver, by its `rig.daq.Capabilities`, say so instead of passing in silence; so do tests that
cannot be judged, because nothing sees the output or because this machine was busy: these are *unproven*.
Where something physical moves, outputs stay within ``amplitude_v``.
"""

from rig.conformance.continuing import ContinuingTests
from rig.conformance.gone import GoneTests
from rig.conformance.life_cycle import LifeCycleTests
from rig.conformance.loopback import LoopbackTests
from rig.conformance.samples import SamplesTests
from rig.conformance.ways_out import WaysOutTests
from rig.conformance.without_host import WithoutHostTests


class DriverContract(
    LifeCycleTests, SamplesTests, LoopbackTests, ContinuingTests, WaysOutTests, WithoutHostTests, GoneTests
):
    """Tests of one driver. Override `make`; and ``amplitude_v``, ``tolerance_v`` for a physical bench."""
