"""Kill -9 in every phase of a run on a virtual rig, and once on every other device; the command does many more."""

import sys

import pytest

from tests.reliability.kills.cases import PHASES, Case
from tests.reliability.kills.killing import carried_out

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no SIGKILL on Windows")

CASES = [
    *(Case(phase, "virtual", "campaign", 1 if phase in ("conversion", "resume") else 0) for phase in PHASES[2:]),
    Case("loop", "real time", "loop", 7),
    Case("loop", "serial", "campaign", 5),
    Case("loop", "can", "loop", 5),
]


ON_WIRES = ("serial", "can")


@pytest.mark.parametrize(
    "case",
    [pytest.param(case, id=case.name, marks=[pytest.mark.slow] if case.device in ON_WIRES else []) for case in CASES],
)
def test_a_kill_loses_no_row_and_leaves_nothing_behind(tmp_path, case):
    found = carried_out(case, tmp_path)
    assert found.wrong == []
    assert found.killed
