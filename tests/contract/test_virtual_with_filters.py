from tests.contract.test_virtual import VirtualContract
from tests.rig.rigs import bench_with

CONVERTER = {"oversampling": 2, "anti_alias_hz": 800.0}


class TestVirtualRigWithFilters(VirtualContract):
    bench = bench_with(converter=CONVERTER | {"reconstruction_hz": 800.0})


class TestVirtualRigWithFiltersAndDelay(VirtualContract):
    bench = bench_with(converter=CONVERTER, delay_samples=4)


del VirtualContract
