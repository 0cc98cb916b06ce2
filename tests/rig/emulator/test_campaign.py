"""A whole run over a wire is the virtual driver's with the same queue, bit for bit."""

from typing import Any

import numpy as np
import pytest

import rig
from rig.bench import Bench
from rig.campaigns.backbone.plan import BackbonePlan
from rig.campaigns.plans import load_plan
from rig.emulator.emulated import emulated
from tests.rig.rigs import bench_with

QUEUE = 2
BLOCK = 20


def short_plan() -> BackbonePlan:
    plan = load_plan("magnet-beam/backbone")
    assert isinstance(plan, BackbonePlan)
    return plan.model_copy(update={"levels_v": (0.3923,), "record_periods": 10})


def recorded(bench: Bench) -> np.ndarray:
    with rig.run(short_plan(), bench=bench, seed=5) as run:
        assert run.recording.complete
        (part,) = run.recording.parts
        return part.read(0, part.n_rows)


@pytest.fixture(scope="module")
def virtual() -> np.ndarray:
    return recorded(bench_with({"block": BLOCK}, queue_blocks=QUEUE))


@pytest.mark.parametrize("wire", ["serial", pytest.param("can", marks=pytest.mark.slow)])
def test_every_recorded_row_is_that_of_the_virtual_driver(wire: str, virtual: np.ndarray) -> None:
    require_rows_of_the_virtual_driver(wire, virtual)


def require_rows_of_the_virtual_driver(wire: str, virtual: np.ndarray, **settings: Any) -> None:
    with emulated(bench_with({"block": BLOCK}), wire, seed=5, options={"queue_blocks": QUEUE}, **settings) as bench:
        over_the_wire = recorded(bench)
    assert over_the_wire.dtype == virtual.dtype
    n = virtual.size
    assert n > 10_000
    assert n <= over_the_wire.size < n + BLOCK  # a device ends with a whole block
    assert not over_the_wire["output_v"][n:].any()
    for field in virtual.dtype.names or ():
        np.testing.assert_array_equal(over_the_wire[field][:n], virtual[field], err_msg=field)
