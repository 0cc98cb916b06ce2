"""Every trip provoked in a running rig: it is noticed, latched, told, and the output comes down."""

import math

import numpy as np
import pytest

from rig.drivers import make_daq
from rig.tick.kernels import tick_block
from rig.tick.safety.layout import EndReason, GuardMode
from rig.tick.safety.limits import describe_end
from tests.rig.rigs import bench_with, tick_for

FORCE, DRIVE, RESPONSE = 0, 1, 3
LOCKED_AFTER = 8000


class Running:
    """A rig that is driven through `exchange`, sample by sample, with a hand in the wires."""

    def __init__(self, changes=None, level=1.0):
        self.bench = bench_with(changes)
        self.daq = make_daq(self.bench, seed=2)
        self.daq.open()
        self.daq.start(1)
        self.tick = tick_for(self.bench, 1 + self.daq.latency_samples, level)
        self.voltages = np.zeros(1)
        self.rows = []

    def go(self, samples, spoil=None):
        for _ in range(samples):
            inputs = self.daq.exchange(self.voltages)
            if spoil is not None:
                spoil(inputs[0])
            readings, rows = self.tick.buffers(1)
            told = self.daq.put_out, self.daq.continuation
            tick_block(self.tick.arrays, inputs, self.daq.flags, readings, rows, self.voltages, *told)
            self.rows.append((float(rows["frequency_hz"][0]), float(self.voltages[0]), int(rows["guard"][0])))
        return self

    @property
    def reason(self):
        return EndReason(int(self.tick.guard["reason"][0]))

    @property
    def mode(self):
        return GuardMode(int(self.tick.guard["mode"][0]))


def _stuck(channel):
    held = []

    def spoil(volts):
        held.append(volts[channel])
        volts[channel] = held[0]

    return spoil


def _set(channel, value):
    def spoil(volts):
        volts[channel] = value

    return spoil


@pytest.mark.parametrize(
    ("spoil", "reason", "channel"),
    [
        (_set(FORCE, 4.6), EndReason.FORCE_LIMIT, FORCE),
        (_set(RESPONSE, -3.5), EndReason.RESPONSE_LIMIT, RESPONSE),
        (_set(DRIVE, math.nan), EndReason.NON_FINITE_INPUT, DRIVE),
        (_set(FORCE, math.inf), EndReason.NON_FINITE_INPUT, FORCE),
        (_stuck(DRIVE), EndReason.SENSOR_STUCK, DRIVE),
        (_stuck(FORCE), EndReason.SENSOR_STUCK, FORCE),
    ],
)
def test_a_bad_reading_trips_names_its_channel_and_ramps_down_at_frozen_frequency(spoil, reason, channel):
    run = Running().go(LOCKED_AFTER).go(4000, spoil)
    assert run.reason is reason
    assert run.bench.channels[channel].name in describe_end(run.tick.guard, run.bench)
    # an infinite or missing number, a stuck or runaway channel: 0.5 s ramp, then 0 V for good
    run.go(3000)
    assert run.mode is GuardMode.OFF
    ramp = [row for row in run.rows if row[2] == GuardMode.RAMPING]
    assert len(ramp) == round(run.bench.limits.ramp_down_s * run.bench.sample_rate_hz)
    assert max(abs(voltage) for _, voltage, mode in run.rows if mode == GuardMode.OFF) == 0.0
    frequencies = [row[0] for row in ramp[2:]]
    assert max(frequencies) - min(frequencies) < 1e-9


def test_the_ramp_is_a_half_cosine():
    run = Running({"limits": {"ramp_down_s": 1.0}}).go(LOCKED_AFTER)
    run.tick.request_stop()
    run.go(5100)
    amplitude = run.tick.guard["ramp_from_v"][0]
    ramp = np.array([voltage for _, voltage, mode in run.rows if mode == GuardMode.RAMPING])
    quarter = ramp[1200:1300]  # about a quarter of the way: 0.5 (1 + cos(pi/4)) of the amplitude at the most
    assert np.abs(quarter).max() <= 0.5 * (1 + math.cos(math.pi * 1200 / 5000)) * amplitude + 1e-9
    assert np.abs(ramp[1100:1400]).max() > 0.8 * amplitude
    assert run.reason is EndReason.STOP_REQUESTED
    assert not run.reason.is_trip


def test_overload_of_a_sensor_trips_after_its_time():
    high = 0.99 * 5.0
    short = Running({"limits": {"force_n": 44.4}}).go(LOCKED_AFTER).go(9, _set(FORCE, high)).go(100)
    assert short.reason is EndReason.NONE
    long = Running({"limits": {"force_n": 44.4}}).go(LOCKED_AFTER).go(11, _set(FORCE, high))
    assert long.reason is EndReason.SENSOR_OVERLOAD


def test_too_large_a_displacement_ramps_and_far_too_large_a_one_drops_at_once():
    gentle = Running({"limits": {"displacement_m": 1.0e-3}}, level=1.5).go(15_000)
    assert gentle.reason is EndReason.DISPLACEMENT_LIMIT
    assert "m)" in describe_end(gentle.tick.guard, gentle.bench)
    hard = Running({"limits": {"displacement_m": 2e-3}}).go(LOCKED_AFTER)
    before = hard.mode
    hard.go(3000, lambda volts: volts.__setitem__(DRIVE, 40 * volts[DRIVE]))
    assert before is GuardMode.ARMED
    dropped = [row for row in hard.rows if row[2] == GuardMode.OFF]
    assert dropped
    assert max(abs(voltage) for _, voltage, _ in dropped) == 0.0


def test_a_frequency_outside_the_limits_trips():
    run = Running({"limits": {"frequency_hz": (20.0, 24.2)}}).go(LOCKED_AFTER)
    assert run.reason is EndReason.FREQUENCY_LIMIT
    assert "Hz" in describe_end(run.tick.guard, run.bench)


def test_the_first_cause_is_kept():
    run = Running().go(LOCKED_AFTER).go(50, _set(FORCE, 4.6)).go(50, _set(DRIVE, math.nan))
    assert run.reason is EndReason.FORCE_LIMIT


def test_a_law_that_produces_no_number_is_dropped_at_once():
    run = Running().go(LOCKED_AFTER)
    run.tick.arrays.progress["level"] = np.nan
    run.tick.arrays.segments["level"] = np.nan
    run.go(1)
    assert run.reason is EndReason.NON_FINITE_OUTPUT
    assert run.mode is GuardMode.OFF
    assert run.voltages[0] == 0.0


def test_a_disarmed_rig_puts_out_nothing():
    run = Running()
    run.tick.guard["mode"] = GuardMode.DISARMED
    run.go(500)
    assert all(voltage == 0.0 for _, voltage, _ in run.rows)


def test_the_output_never_exceeds_the_voltage_limit_nor_its_slew():
    run = Running({"limits": {"voltage_v": 0.3, "slew_v_per_s": 0.5}}, level=5.0).go(6000)
    voltages = np.array([voltage for _, voltage, _ in run.rows])
    assert np.abs(voltages).max() <= 0.3
    assert np.abs(voltages[:1000]).max() <= 0.5 * 0.2 + 1e-9


def test_a_trip_that_is_over_stays_latched():
    run = Running().go(LOCKED_AFTER).go(10, _set(FORCE, 4.6)).go(20_000)
    assert run.mode is GuardMode.OFF
    assert run.reason is EndReason.FORCE_LIMIT
