"""The memory in which rows of a loop on the device wait for a late campaign."""

from rig.loop.worker.process import COLLECTED_BYTES, COLLECTED_S, collecting_layout
from tests.rig.loop.worker.rigs import tone
from tests.rig.rigs import bench_with

RING_S = 10.0


def layout_at(rate_hz):
    bench = bench_with().model_copy(update={"sample_rate_hz": rate_hz})
    return bench, collecting_layout(bench, tone(bench_with(), 0.1).build(0.0).arrays, 20, RING_S)


def seconds(bench, layout):
    return (layout.slots - layout.reserve) * layout.chunk / bench.sample_rate_hz


def test_two_minutes_of_rows_wait_in_chunks_of_a_tenth_of_a_second():
    bench, layout = layout_at(5000.0)
    assert layout.chunk == 500
    assert seconds(bench, layout) >= COLLECTED_S
    assert layout.size < COLLECTED_BYTES


def test_at_high_rates_fewer_seconds_wait_in_bounded_memory_but_those_of_any_loop():
    bench, layout = layout_at(100_000.0)
    assert layout.size < 1.1 * COLLECTED_BYTES
    assert RING_S < seconds(bench, layout) < COLLECTED_S
    bench, layout = layout_at(2_000_000.0)
    assert seconds(bench, layout) >= RING_S
