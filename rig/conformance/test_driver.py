"""The contract over the driver of the bench that pytest was given: ``pytest --pyargs rig.conformance --rig-bench BENCH``."""

import pytest

from rig.conformance.contract import BenchContract as _Contract
from rig.hil.subject import Subject


class TestDriver(_Contract):
    """The bench's driver."""

    @pytest.fixture(autouse=True)
    def _on_the_bench(self, rig_subject: Subject) -> None:
        rig_subject.require_arming()
        self.take(rig_subject.bench)
