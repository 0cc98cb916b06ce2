"""Hostile frames at both ends of both wires; the command sends far more of them."""

import sys
from itertools import product

import pytest

if sys.platform == "win32":
    pytest.skip("this counts memory by resource, which Windows has not", allow_module_level=True)

from tests.reliability.frames.hostile import ENDS, MODES, hostile_bytes
from tests.reliability.frames.lines import LINES


@pytest.mark.parametrize(("wire", "end", "mode"), [*product(LINES, ENDS, MODES)])
def test_rows_are_right_or_gaps_errors_are_ours_and_the_output_comes_to_0_v(wire, end, mode):
    found = hostile_bytes(wire, end, mode, 10_000 if (wire, mode) == ("can", "damaged") else 60_000, 1)
    assert found.wrong == []
    assert found.rows_wrong == 0
    assert found.frames > 20
