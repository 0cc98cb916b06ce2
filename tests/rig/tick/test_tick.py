"""The tick by itself: what it refers its phases to, and what it writes into a row."""

import math

import numpy as np
import pytest

from controller import AmplitudeLaw, preset
from rig.errors import ConfigurationError
from rig.tick.kernels import tick_block
from rig.tick.layout import ROW_COLUMNS
from rig.tick.sequencer.layout import SegmentKind
from rig.tick.sequencer.segments import Segment, SettleRule
from rig.tick.tick import Tick, TickSettings
from tests.refused import refused
from tests.rig.rigs import bench_with
from tests.rig.tick.blocks import nothing_told
from vibrolock.compiled import bound

HELD = [Segment(SegmentKind.RAMP, -1, 0.5, 2.0), Segment(SegmentKind.HOLD, -1, 0.5, 1000.0)]


def _tick(lead, bench=None, law=None):
    return Tick(
        TickSettings(bench or bench_with(), law or preset("magnet-beam"), AmplitudeLaw.VOLTAGE, SettleRule(), HELD),
        lead,
    )


def _wired(delay_whole, delay_fraction, samples=20_000, bench=None, skew=(0.0, 0.0), law=None):
    """A tick whose inputs are its own output, late by the lead and by the channels' skew: force as it is, drive a quarter
    turn ahead of it, so that the lag is that of phase resonance."""
    bench = bench or bench_with()
    still = preset("magnet-beam").model_copy(update={"k1": 0.0, "k2": 0.0})  # the oscillator keeps its 24 Hz
    tick = _tick(delay_whole + delay_fraction, bench, law or still)
    omega, dt = 2 * math.pi * 24.0, 1 / bench.sample_rate_hz
    readings, rows = tick.buffers(samples)
    estimates = np.zeros(samples, complex)
    out, volts = np.zeros(1), np.zeros((1, 4))
    scale = [channel.sensitivity_v_per_unit for channel in bench.channels]
    flags, told = np.zeros(1, np.uint16), nothing_told(1)
    block = bound(tick_block, tick.arrays, volts, flags, readings[:1], rows[:1], out, *told)
    for k in range(samples):
        phase = [omega * dt * (k - delay_whole - delay_fraction - s) for s in skew]
        volts[0, 0] = scale[0] * math.cos(phase[0])
        volts[0, 1:] = scale[1] * math.cos(phase[1] + math.pi / 2)
        block(tick.arrays, volts, flags, readings[k : k + 1], rows[k : k + 1], out, *told)
        estimates[k] = tick.arrays.control["vibration"]["force"][0]
    return estimates, rows


@pytest.mark.parametrize(("whole", "fraction"), [(1, 0.0), (1, 0.5), (8, 0.25), (70, 0.5)])
def test_inputs_are_demodulated_against_the_phase_that_was_on_the_output(whole, fraction):
    estimates, rows = _wired(whole, fraction)
    force = estimates[-6250:].mean()  # thirty periods: the detector's ripple averages out
    # the demodulated force is the output itself, 1 N at phase 0, but for the lead of the 0.3 Hz high-pass
    assert abs(force) == pytest.approx(1.0, abs=1e-3)
    assert np.angle(force) == pytest.approx(math.atan(0.3 / 24.0), abs=1e-3)  # half a sample is 15e-3
    assert np.abs(np.mean(rows["phase_error_rad"][-5000:])) < 2e-3
    assert rows["frequency_hz"][-1] == pytest.approx(24.0, abs=0.05)


def test_skew_between_channels_is_taken_out_of_the_lag():
    channels = [channel.model_dump() for channel in bench_with().channels]
    channels[0]["skew_samples"] = 3.5
    bench = bench_with({"channels": channels})
    _, rows = _wired(1, 0.5, bench=bench, skew=(3.5, 0.0))
    assert np.abs(np.mean(rows["phase_error_rad"][-5000:])) < 2e-3
    _, uncompensated = _wired(1, 0.5, skew=(3.5, 0.0))
    expected = 2 * math.pi * 24.0 * 3.5 / 5000
    assert np.mean(uncompensated["phase_error_rad"][-5000:]) == pytest.approx(expected, rel=0.03)


def test_high_passes_of_the_channels_are_taken_out_of_the_lag():
    """A first-order high-pass leads by atan(corner / frequency): 12 degrees of 5 Hz at 24 Hz."""
    corners_hz = 5.0, 0.5
    lead_samples = [-math.atan(corner / 24.0) / (2 * math.pi * 24.0 / 5000) for corner in corners_hz]
    channels = [channel.model_dump() for channel in bench_with().channels]
    for channel, corner in zip(channels, corners_hz, strict=False):
        channel["high_pass_hz"] = corner
    _, rows = _wired(1, 0.5, bench=bench_with({"channels": channels}), skew=lead_samples)
    assert np.abs(np.mean(rows["phase_error_rad"][-5000:])) < math.radians(0.2)
    _, uncompensated = _wired(1, 0.5, skew=lead_samples)
    expected = math.atan(0.5 / 24.0) - math.atan(5.0 / 24.0)
    assert np.mean(uncompensated["phase_error_rad"][-5000:]) == pytest.approx(expected, rel=0.03)


def test_with_the_mean_of_periods_the_detectors_ripple_leaves_the_frequency_alone():
    proportional = preset("magnet-beam").model_copy(update={"k2": 0.0})
    swings = {}
    for period_mean in (False, True):
        _, rows = _wired(1, 0.5, law=proportional.model_copy(update={"period_mean": period_mean}))
        frequency_hz, theta = rows["frequency_hz"][-6250:], rows["theta_rad"][-6250:]
        swings[period_mean] = abs(np.mean(frequency_hz * np.exp(-2j * theta)))
        assert np.mean(frequency_hz) == pytest.approx(24.0, abs=0.01)
    assert swings[False] > 1e-4
    assert swings[True] < 0.02 * swings[False]
    assert np.count_nonzero(np.diff(frequency_hz)) <= 31  # once a period


def test_a_row_shows_output_phase_and_amplitude_that_belong_to_the_same_instant():
    _, rows = _wired(8, 0.0, samples=4000)
    late = rows[1000:]
    np.testing.assert_allclose(
        late["output_v"], late["command_v"].real * np.cos(late["theta_rad"].astype(float)), atol=2e-6
    )


def test_readings_are_in_si_units_and_a_flipped_sensor_is_turned_back():
    channels = [channel.model_dump() for channel in bench_with().channels]
    channels[1]["sensitivity_v_per_unit"] *= -1
    tick = _tick(1.5, bench_with({"channels": channels}))
    readings, rows = tick.buffers(1)
    volts, out = np.array([[0.1124, -0.0102, 0.0102, 0.0204]]), np.zeros(1)
    tick_block(tick.arrays, volts, np.zeros(1, np.uint16), readings, rows, out, *nothing_told(1))
    np.testing.assert_allclose(readings[0], [1.0, 1.0, 1.0, 2.0], rtol=1e-6)


def test_every_recorded_column_is_described():
    tick = _tick(1.5)
    assert [column["name"] for column in ROW_COLUMNS] == list(tick.row_dtype.names)
    assert tick.row_dtype.itemsize <= 50


def test_a_lead_below_one_sample_is_refused():
    with refused(ConfigurationError, field="loop_delay_samples", value=0.5):
        _tick(0.5)


def test_a_law_that_the_bench_cannot_sample_is_refused():
    law = preset("friction-beam").model_copy(update={"frequency_window_hz": (100.0, 1400.0)})
    with refused(ConfigurationError, "frequency-window-hz-ends-at-hz", field="controller"):
        _tick(1.5, law=law)
