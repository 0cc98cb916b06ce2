"""What a worker loads before its first twin is what a twin needs."""

import subprocess
import sys

SCRIPT = """
import sys
from rig.rehearsal.loading import load
load()
known = set(sys.modules)
from rig.rehearsal.rehearsal import RehearsalRequest
from tests.rig.rehearsal.plans import SHORT, magnet_beam
assert RehearsalRequest(plan=SHORT, bench=magnet_beam())(0).trial.completed
print(*(name for name in set(sys.modules) - known if not name.startswith("tests")))
"""


def test_a_twin_imports_nothing_that_is_not_loaded():
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []
