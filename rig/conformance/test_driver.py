"""The contract over the driver of the bench that pytest was given: ``pytest --pyargs rig.conformance --rig-bench BENCH``."""

import pytest

from rig.bench import Bench
from rig.conformance.answers import with_loopback
from rig.conformance.contract import DriverContract as _Contract
from rig.daq import DAQ
from rig.drivers import make_daq
from rig.hil.subject import Subject


class TestDriver(_Contract):
    """The bench's driver."""

    @pytest.fixture(autouse=True)
    def _on_the_bench(self, rig_subject: Subject) -> None:
        rig_subject.require_arming()
        self._bench = rig_subject.bench

    def make(self) -> DAQ:
        """A driver as the bench asks for it."""
        return make_daq(self._bench)

    def make_loopback(self) -> DAQ | None:
        """The same with a loopback, if it has one or is virtual."""
        bench = with_loopback(self._bench)
        return None if bench is None else make_daq(bench)

    def bench_for_another_process(self) -> Bench:
        """The bench itself."""
        return self._bench
