import numpy as np

from rig.conformance import DriverContract
from rig.daq import DAQ
from rig.drivers import make_daq
from tests.rig.rigs import bench_with


class TestVirtualRigWithFilters(DriverContract):
    def make(self) -> DAQ:
        converter = {"oversampling": 2, "anti_alias_hz": 800.0, "reconstruction_hz": 800.0}
        return make_daq(bench_with(converter=converter))

    def test_an_output_does_not_show_before_its_latency(self) -> None:
        """A filter begins to answer at once and is late on the average: only the first sample is silent for certain."""
        with self.make() as daq:
            quiet, driven = (self._answer(daq, 1, 100, level) for level in (0.0, self.amplitude_v))
        assert np.array_equal(quiet[0], driven[0])
        assert not np.array_equal(quiet, driven)
