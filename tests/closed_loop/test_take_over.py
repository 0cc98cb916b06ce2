"""From one law to another while the rig vibrates: output, level and frequency go on from where they are."""

import itertools
import math

import numpy as np
import pytest

from controller import AmplitudeLaw
from rig.tick.sequencer.layout import SegmentKind
from rig.tick.sequencer.segments import Excitation, Segment
from tests.closed_loop.laws import FREQUENCY_HZ, carried_out, law_of
from tests.rig.rigs import bench_with

V, F, RMS, X = AmplitudeLaw
TONE = Excitation(FREQUENCY_HZ["magnet-beam"])
PERIOD = round(5000 / FREQUENCY_HZ["magnet-beam"])
QUIET = bench_with(noise_scale=0.0)


def _law(force_loop="through-response"):
    return law_of("magnet-beam", force_loop=force_loop, k4=10.0)


def _start(excitation=None):
    ramp = Segment(SegmentKind.RAMP, -1, 0.3, 10.0, excitation=excitation, amplitude_law=V)
    return [ramp, Segment(SegmentKind.HOLD, -1, 0.3, 60.0, excitation=excitation, amplitude_law=V)]


def _fundamental(rows, channel):
    return abs(2 * np.mean(rows["inputs"][:, channel] * np.exp(-1j * rows["theta_rad"].astype(float))))


@pytest.fixture(scope="module")
def levels():
    """What 0.3 V makes at resonance, in every quantity."""
    rows, _ = carried_out(QUIET, _law(), _start())
    last = rows[rows["segment"] == 1][-10 * PERIOD :]
    omega = 2 * math.pi * last["frequency_hz"].astype(float).mean()
    return {
        V: 0.3,
        F: _fundamental(last, 0),
        RMS: float(last["inputs"][:, 0].std()),
        X: _fundamental(last, 1) / omega**2,
    }


def _changed(levels, before, after, first=None, then=None, force_loop="through-response", level=1.0):
    """Rows of a run that changes from one law and drive to others, and the sample where it does."""
    segments = _start(first)
    if before is not V:
        for kind in (SegmentKind.RAMP, SegmentKind.HOLD):
            segments.append(Segment(kind, -1, levels[before], 30.0, amplitude_law=before, excitation=first))
    end = Segment(SegmentKind.RAMP, -1, level * levels[after], 10.0, amplitude_law=after, excitation=then)
    still = Segment(SegmentKind.HOLD, -1, level * levels[after], 150.0, amplitude_law=after, excitation=then)
    rows, tick = carried_out(QUIET, _law(force_loop), [*segments, end, still])
    return rows, int(np.argmax(rows["segment"] == len(segments))), tick


def _is_smooth(rows, at):
    """Nothing jumps at a sample: not by more than it moved from sample to sample before, or 0.02 % of itself."""
    command, frequency = rows["command_v"].astype(complex), rows["frequency_hz"].astype(float)
    for values, jitter in ((command, 2e-4), (frequency, 1e-5)):
        steps = np.abs(np.diff(values)) / abs(values[at])
        assert steps[at - 1 : at + 3].max() <= max(1.5 * steps[at - 2 * PERIOD : at - 1].max(), jitter)
    moved, before = (
        np.abs(command[k : k + PERIOD] - command[k]).max() / abs(command[at]) for k in (at - 1, at - 1 - PERIOD)
    )
    assert moved < max(2.0 * before, 0.02)  # in a whole period; a quantity at its level has no reason to go anywhere


@pytest.mark.parametrize("force_loop", ["linear", "logarithmic", "through-response"])
@pytest.mark.parametrize(("before", "after"), list(itertools.permutations((V, F, RMS, X), 2)))
def test_from_every_amplitude_law_to_every_other_nothing_jumps(levels, before, after, force_loop):
    rows, at, _ = _changed(levels, before, after, force_loop=force_loop)
    _is_smooth(rows, at)


@pytest.mark.parametrize(("before", "after"), [(V, V), (V, F), (V, X), (X, X), (X, V), (F, F)])
@pytest.mark.parametrize(("first", "then"), [(TONE, None), (None, TONE)])
def test_from_a_tone_to_the_loop_and_back_nothing_jumps(levels, before, after, first, then):
    rows, at, tick = _changed(levels, before, after, first, then)
    _is_smooth(rows, at)
    assert tick.guard["reason"][0] == 1  # completed: the frequency went nowhere near a limit
    frequency = rows["frequency_hz"][at : at + 10 * PERIOD]
    assert np.abs(frequency - FREQUENCY_HZ["magnet-beam"]).max() < 0.2


@pytest.mark.parametrize("after", [F, RMS, X])
def test_a_law_that_takes_over_ramps_to_its_own_level_without_overshoot(levels, after):
    rows, at, _ = _changed(levels, V, after, level=1.5)
    _is_smooth(rows, at)
    voltage = np.abs(rows["command_v"][rows["guard"] == 1][at:])
    assert voltage[-1] == pytest.approx(1.5 * 0.3, rel=0.1)  # a nearly linear rig at this level
    assert voltage.max() < 1.1 * voltage[-1]
