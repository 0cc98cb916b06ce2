"""Planted faults: drivers with one fault each, all of which the kit must fail in the test that names the fault."""

from tests.contract.planted import continuing, inputs, life_cycle, outputs, timing, ways_out  # noqa: F401 (they fill the table)
from tests.contract.planted.table import PLANTED, Planted

__all__ = ["PLANTED", "Planted"]
