from rig.conformance import DriverContract
from rig.daq import DAQ
from rig.drivers import make_daq
from tests.rig.rigs import bench_with


class TestVirtualRigWithFilters(DriverContract):
    def make(self) -> DAQ:
        converter = {"oversampling": 2, "anti_alias_hz": 800.0, "reconstruction_hz": 800.0}
        return make_daq(bench_with(converter=converter))


class TestVirtualRigWithFiltersAndDelay(DriverContract):
    def make(self) -> DAQ:
        converter = {"oversampling": 2, "anti_alias_hz": 800.0}
        return make_daq(bench_with(converter=converter, delay_samples=4))
