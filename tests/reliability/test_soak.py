"""A few seconds of the soak; the command takes an hour."""

import sys

import pytest

if sys.platform == "win32":
    pytest.skip("Windows has no pseudo-terminals", allow_module_level=True)

from tests.reliability.soak import soak, table


def test_a_short_soak_counts_its_samples_and_is_ended_in_order():
    found = soak(0.05, 1000.0, 50)
    assert found.samples > 1000
    assert found.rows_wrong == 0
    assert "SIGTERM" in found.ended or "stood still" in found.ended or "watchdog" in found.ended
    assert len(table([found])) == 3
