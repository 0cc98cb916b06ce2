"""What a tuning learns of a device that knows its queue only once it runs."""

import pytest

from rig.emulator.emulated import emulated
from rig.tuning import TuningRequest, tune
from tests.rig.rigs import bench_with

BLOCK, QUEUE = 10, 1
SLOW = {"sample_rate_hz": 1000.0, "block": BLOCK, "limits": {"frequency_hz": (8.0, 200.0)}}
UNFILTERED = {"substeps": 10, "anti_alias_hz": 0.0, "oversampling": 1}


@pytest.mark.slow
def test_the_queue_of_a_device_and_its_block_are_in_the_latency_that_gains_are_designed_for(tmp_path):
    bench = bench_with(SLOW, converter=UNFILTERED)
    with emulated(bench, "serial", seed=1, options={"queue_blocks": QUEUE}) as emulated_bench:
        tuned = tune(emulated_bench, tmp_path / "test.h5", TuningRequest(level_rms_v=0.02, points=2))
    hold = 0.5
    assert tuned.plant.latency_samples == pytest.approx(BLOCK + QUEUE * BLOCK + hold, abs=0.01)
    assert tuned.chosen.design.loop.plant.latency_samples == tuned.plant.latency_samples
    assert tuned.plan.plant.latency_samples == tuned.plant.latency_samples
