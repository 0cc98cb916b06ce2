"""What the tick tells a device of how its outputs go on: their period, and how long a ramp to 0 V still lasts."""

import numpy as np
import pytest

from controller import AmplitudeLaw, preset
from rig.drivers import make_daq
from rig.loop.loop import Loop
from rig.tick.sequencer.layout import SegmentKind
from rig.tick.sequencer.segments import Excitation, Segment
from rig.tick.tick import Tick, TickSettings
from tests.rig.rigs import SETTLE, bench_with, tick_for

BLOCK = 14


def told_of(tick_of, bench=None, stop_after=None):
    """Outputs [n, block] of a run, what was told with each of its blocks [n], and its rows."""
    bench = bench or bench_with({"block": BLOCK, "limits": {"ramp_down_s": 0.1}})
    outputs, told = [], []
    with make_daq(bench, 1) as daq:
        daq.start(bench.block)
        tick = tick_of(bench, bench.block + daq.latency_samples)
        exchange = daq.exchange

        def spy(voltages):
            outputs.append(voltages.copy())
            told.append(daq.continuation[0].copy())
            if stop_after is not None and len(outputs) == stop_after:
                tick.request_stop()
            return exchange(voltages)

        daq.exchange = spy
        rows = np.concatenate([*Loop(daq, tick, fused=False).run()])
    return np.array(outputs), np.array(told), rows


@pytest.fixture(scope="module")
def locked():
    return told_of(lambda bench, lead: tick_for(bench, lead, 0.5))


def test_the_period_of_a_loop_is_that_of_its_oscillator(locked):
    outputs, told, rows = locked
    lead = BLOCK
    for block in range(40, outputs.shape[0] - 60, 97):
        frequency_hz = rows["frequency_hz"][block * BLOCK + lead - 1].astype(float)
        assert told["period_samples"][block] == pytest.approx(5000.0 / frequency_hz, rel=2e-3)
        assert told["ramp_samples"][block] == 0.0


def test_a_ramp_to_0_v_ends_when_it_was_said_to_end(locked):
    outputs, told, _ = locked
    flat = outputs.reshape(-1)
    last = np.flatnonzero(flat)[-1] + 1
    ramping = np.flatnonzero(told["ramp_samples"])
    assert ramping.size > 20
    for block in ramping:
        assert (block + 1) * BLOCK + told["ramp_samples"][block] == pytest.approx(last, abs=2)  # sine near zero


def test_nothing_goes_on_once_the_output_is_0_v(locked):
    outputs, told, _ = locked
    flat = np.abs(outputs).max(axis=1)
    silent = np.flatnonzero(flat)[-1] + 1
    assert np.all(told["period_samples"][silent:] == 0.0)
    assert np.all(told["ramp_samples"][silent:] == 0.0)
    assert told["period_samples"][0] == 0.0  # before anything was put out


def playing(*numbers):
    """A tick that plays waveforms of 210 samples one after the other, and a tone in between where a number is None."""
    waveforms = np.array([np.sin(2.0 * np.pi * order * np.arange(210) / 210) for order in (1, 2)])

    def tick_of(bench, lead):
        segments = [
            Segment(kind, -1, 0.5, 4.0, excitation=Excitation(5000.0 / 210, waveform=number))
            for number in numbers
            for kind in (SegmentKind.RAMP, SegmentKind.HOLD)
        ]
        return Tick(
            TickSettings(bench, preset("magnet-beam"), AmplitudeLaw.VOLTAGE, SETTLE, segments, waveforms=waveforms),
            lead,
        )

    return tick_of


def test_a_waveform_has_its_own_period_but_none_in_the_block_in_which_it_begins():
    _, told, _ = told_of(playing(0, 1, None, 1))
    periods = told["period_samples"]
    begins = np.flatnonzero((periods[1:] == 0.0) & (periods[:-1] > 0.0)) + 1
    assert begins.size == 4  # the second waveform, the tone, the second waveform again, the end
    for begin in begins[:3]:
        assert periods[begin + 1] > 0.0
    segments = np.split(periods, begins)
    for stretch in (segments[0], segments[1][1:], segments[3][1:]):
        driven = stretch[stretch > 0.0]
        assert driven.size > 40
        np.testing.assert_array_equal(driven, 210.0)
    np.testing.assert_allclose(segments[2][1:], 210.0, rtol=1e-9)


def test_a_run_that_is_stopped_tells_its_ramp_from_the_first_block_on():
    outputs, told, _ = told_of(lambda bench, lead: tick_for(bench, lead, 0.5), stop_after=100)
    ramp = np.flatnonzero(told["ramp_samples"])
    assert ramp[0] == 100
    assert told["ramp_samples"][100] == pytest.approx(500 - BLOCK, abs=1)
    assert np.abs(outputs[100]).max() <= np.abs(outputs[:100]).max()
