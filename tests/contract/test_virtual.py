"""The virtual driver under the contract, with and without latency."""

from rig.conformance import DriverContract, with_loopback
from rig.daq import DAQ
from rig.drivers import make_daq
from tests.rig.rigs import bench_with


class VirtualContract(DriverContract):
    """The contract over a virtual bench, and over the same with a loopback."""

    bench = bench_with()

    def make(self) -> DAQ:
        return make_daq(self.bench)

    def make_loopback(self) -> DAQ:
        return make_daq(with_loopback(self.bench))


class TestVirtualRig(VirtualContract):
    pass


class TestSymmetricRig(VirtualContract):
    bench = bench_with(name="magnet-beam-symmetric")


class TestVirtualRigWithDelay(VirtualContract):
    bench = bench_with(delay_samples=3)


class TestVirtualRigWithQueue(VirtualContract):
    bench = bench_with(queue_blocks=2)


class TestOversampledRig(VirtualContract):
    bench = bench_with({"oversample": 4})
