"""One tick for every driver: the same samples open loop for any block, the same run closed loop, bit for bit."""

import numpy as np
import pytest

from controller import AmplitudeLaw
from rig.drivers import make_daq
from rig.loop.loop import Loop
from rig.tick.kernels import tick_block
from rig.tick.sequencer.layout import SegmentKind
from rig.tick.sequencer.segments import Excitation, Segment, SettleRule
from rig.tick.tick import Tick, TickSettings
from tests.closed_loop.laws import law_of
from tests.rig.rigs import bench_with, tick_for

SAMPLES = 12_000


def _open_loop(block, **options):
    """Readings of the virtual rig under a given voltage, swapped in blocks."""
    voltages = 0.4 * np.sin(2 * np.pi * 24.5 * np.arange(SAMPLES) / 5000.0)
    with make_daq(bench_with(**options), seed=3) as daq:
        daq.start(block)
        return np.vstack([daq.exchange(part.copy()) for part in voltages.reshape(-1, block)])


@pytest.mark.parametrize("block", [8, 48, 600])
def test_open_loop_every_block_size_gives_the_same_samples(block):
    np.testing.assert_array_equal(_open_loop(block), _open_loop(1))


@pytest.mark.parametrize("options", [{"queue_blocks": 2}, {"delay_samples": 16}])
def test_open_loop_a_queue_only_shifts_the_answer(options):
    shift = 16
    late = _open_loop(8, noise_scale=0.0, **options)
    np.testing.assert_array_equal(late[shift:], _open_loop(8, noise_scale=0.0)[:-shift])


def _exchanged(block, **options):
    bench = bench_with({"block": block}, **options)
    with make_daq(bench, seed=5) as daq:
        daq.start(block)
        tick = tick_for(bench, block + daq.latency_samples, 0.4)
        voltages, chunks = np.zeros(block), []
        for _ in range(SAMPLES // block):
            readings, rows = tick.buffers(block)
            tick_block(
                tick.arrays, daq.exchange(voltages), daq.flags, readings, rows, voltages, daq.put_out, daq.continuation
            )
            chunks.append(tick.joined(readings, rows))
        return np.concatenate(chunks), tick


def _fused(block, **options):
    bench = bench_with({"block": block}, **options)
    with make_daq(bench, seed=5) as daq:
        daq.start(block)
        tick = tick_for(bench, block + daq.latency_samples, 0.4)
        readings, rows = tick.buffers(SAMPLES)
        assert daq.run_fused(tick.arrays, readings, rows) == SAMPLES
        return tick.joined(readings, rows), tick


@pytest.mark.parametrize(
    ("block", "options"),
    [(1, {}), (1, {"queue_blocks": 1}), (8, {}), (8, {"queue_blocks": 2}), (5, {"delay_samples": 7}), (40, {})],
)
def test_closed_loop_blocks_are_bit_identical_to_the_fused_run_with_their_latency(block, options):
    exchanged, tick_e = _exchanged(block, **options)
    fused, tick_f = _fused(block, **options)
    assert exchanged.tobytes() == fused.tobytes()
    for name, ours, theirs in zip(tick_e.arrays._fields, tick_e.arrays, tick_f.arrays, strict=True):
        assert ours.tobytes() == theirs.tobytes(), name
    assert np.abs(exchanged["command_v"]).max() > 0.3  # the loop was driving, not idling


def test_latency_changes_the_closed_loop():
    assert _fused(1)[0].tobytes() != _fused(8)[0].tobytes()


def test_a_run_is_repeated_bit_for_bit_by_its_seed_and_by_no_other():
    def whole_run(seed):
        bench = bench_with()
        with make_daq(bench, seed) as daq:
            daq.start(1)
            tick = tick_for(bench, 1 + daq.latency_samples, 0.3)
            return np.concatenate(list(Loop(daq, tick).run())).tobytes()

    assert whole_run(1) == whole_run(1)
    assert whole_run(1) != whole_run(2)


def test_the_loop_through_exchange_is_the_loop_fused():
    bench = bench_with()
    runs = []
    for fused in (True, False):
        with make_daq(bench, 7) as daq:
            daq.start(bench.block)
            tick = tick_for(bench, bench.block + daq.latency_samples, 0.3)
            runs.append(np.concatenate(list(Loop(daq, tick, fused=fused).run())))
    assert runs[0].tobytes() == runs[1].tobytes()


def _through_all_laws(bench, lead, force_loop):
    """A tick that goes from a tone to the loop, and through every amplitude law, a ramp of the lag and a geometric ramp."""
    laws = AmplitudeLaw
    steps = [
        (laws.VOLTAGE, 0.3, {"excitation": Excitation(24.4)}),
        (laws.VOLTAGE, 0.3, {}),
        (laws.RESPONSE, 2.5e-4, {"geometric": True}),
        (laws.FORCE, 0.06, {"lag_deg": -80.0}),
        (laws.FORCE_RMS, 0.05, {"lag_deg": -100.0}),
        (laws.VOLTAGE, 0.2, {}),
    ]
    segments = [
        Segment(kind, -1, level, 8.0, amplitude_law=law, **keys)
        for law, level, keys in steps
        for kind in (SegmentKind.RAMP, SegmentKind.HOLD)
    ]
    law = law_of("magnet-beam", force_loop=force_loop, k4=10.0)
    return Tick(TickSettings(bench, law, laws.VOLTAGE, SettleRule(), segments), lead)


@pytest.mark.parametrize("force_loop", ["linear", "logarithmic", "through-response"])
@pytest.mark.parametrize(("block", "options"), [(1, {}), (8, {"queue_blocks": 1}), (40, {})])
def test_through_every_law_the_exchanged_run_is_the_fused_one_bit_for_bit(block, options, force_loop):
    runs = []
    for fused in (True, False):
        bench = bench_with({"block": block}, **options)
        with make_daq(bench, 7) as daq:
            daq.start(block)
            tick = _through_all_laws(bench, block + daq.latency_samples, force_loop)
            rows = np.concatenate(list(Loop(daq, tick, fused=fused).run()))
            runs.append((rows, tick))
    (ours, tick_f), (theirs, tick_e) = runs
    samples = min(ours.size, theirs.size)  # the fused run ends with the sample, the other with its block
    assert ours[:samples].tobytes() == theirs[:samples].tobytes()
    assert abs(ours.size - theirs.size) < block
    assert tick_f.outcomes.tobytes() == tick_e.outcomes.tobytes()
    assert tick_f.guard["reason"][0] == tick_e.guard["reason"][0] == 1  # completed
    assert np.unique(ours["segment"]).size == 13
