"""What stands for a sample that is lost, against the vibration that went on meanwhile."""

import cmath
import math
from functools import cache
from typing import NamedTuple

import numpy as np
import pytest

from controller import AmplitudeLaw, preset
from rig.tick.measure import bridge_lost_sample, read_inputs
from rig.tick.safety.layout import EndReason
from rig.tick.sequencer.layout import SegmentKind
from rig.tick.sequencer.segments import Segment, SettleRule
from rig.tick.tick import Tick, TickSettings
from tests.rig.rigs import bench_with
from vibrolock.compiled import bound

FORCE, DRIVE = cmath.rect(3.0, 0.7), cmath.rect(20.0, -1.1)


@pytest.fixture
def tick():
    return tick_of(bench_with())


@pytest.fixture
def fast_tick():
    return tick_of(bench_with({"sample_rate_hz": 48_000.0}))


def tick_of(bench):
    segments = [Segment(SegmentKind.RAMP, -1, 0.5, 2.0), Segment(SegmentKind.HOLD, -1, 0.5, 1000.0)]
    made = Tick(TickSettings(bench, preset("magnet-beam"), AmplitudeLaw.VOLTAGE, SettleRule(), segments), 1.5)
    vibration = made.arrays.control["vibration"]
    vibration["force"], vibration["drive"] = FORCE, DRIVE
    return made


def lose(tick, theta):
    """Lose a sample at this angle of the output; the readings that it leaves."""
    readings = np.zeros(len(tick.arrays.inputs))
    bridge_lost_sample(tick.arrays, readings, math.cos(theta), math.sin(theta))
    return readings


@pytest.mark.parametrize("theta", [0.0, 0.4, 2.0, -1.3])
def test_force_and_motion_are_those_of_their_fundamentals_at_the_angle_of_the_output(tick, theta):
    readings = lose(tick, theta)
    loop = tick.arrays.loop
    assert loop["force"][0] == pytest.approx(3.0 * math.cos(theta + 0.7), rel=1e-12)
    assert loop["drive_motion"][0] == pytest.approx(20.0 * math.cos(theta - 1.1), rel=1e-12)
    assert loop["lost"][0] == 1
    assert np.isnan(readings).all()


def test_the_mean_of_the_force_goes_on_as_if_its_samples_had_come(tick):
    """To the first order of the low-pass's gain g: a sample away from the mean by F moves it by ``g F``."""
    arrays = tick.arrays
    means, gain = arrays.watches["mean"], arrays.law["detector"]["mean_gain"][0]
    channel = arrays.loop["force_channel"][0]
    means[channel] = seen = 0.5
    forces = 3.0 * np.cos(0.01 * np.arange(60))
    for k, force in enumerate(forces):
        lose(tick, 0.01 * k - 0.7)
        seen += gain * (0.5 + force - seen)
    assert means[channel] == pytest.approx(0.5 + gain * forces.sum(), rel=1e-12)
    assert means[channel] - 0.5 == pytest.approx(seen - 0.5, rel=60 * gain)


SIZE_M = 1e-3


class Vibrating(NamedTuple):
    """The arrays of a tick that has read a vibration for long, and the displacements of the last period, m."""

    arrays: list[np.ndarray]
    displacements: list[float]


@cache
def vibrating(at_deg):
    """After 30 000 samples of a harmonic vibration of 1 mm; the next one is at this phase."""
    arrays, first, seen = tick_of(bench_with()).arrays, 30_000, []
    volts, readings = volts_of(arrays, np.arange(-first, 0), at_deg), np.zeros(len(arrays.inputs))
    read = bound(read_inputs, arrays, volts[0], readings)
    for volt in volts:
        read(arrays, volt, readings)
        seen.append(displacement_of(arrays))
    period = round(2.0 * math.pi / (float(arrays.control["frequency"]["omega"][0]) * arrays.loop["dt_s"][0]))
    return Vibrating([array.copy() for array in arrays], seen[-period:])


def volts_of(arrays, samples, phase_deg):
    """Volts [n, n_channels] at samples of that vibration, by the phase of sample 0: those of the drive channel, and 0."""
    omega, channel = float(arrays.control["frequency"]["omega"][0]), int(arrays.loop["drive_channel"][0])
    volts = np.zeros((samples.size, len(arrays.inputs)))
    per_m = -(omega**2) / arrays.inputs["unit_per_volt"][channel]
    volts[:, channel] = SIZE_M * per_m * np.cos(omega * arrays.loop["dt_s"][0] * samples + math.radians(phase_deg))
    return volts


def displacement_of(arrays):
    return arrays.watches["displacement"][arrays.loop["drive_channel"][0]]


@pytest.mark.parametrize("jump_deg", [-40.0, -25.0, 0.0, 25.0, 40.0, 180.0])
@pytest.mark.parametrize("at_deg", [0.0, 45.0, 90.0, 135.0])
@pytest.mark.parametrize("lost", [1, 60])
def test_a_vibration_that_goes_on_with_another_phase_after_a_loss_feigns_no_displacement(tick, lost, at_deg, jump_deg):
    """A harmonic vibration of 1 mm; integrated alone, a jump by 40 degrees would show 4 mm, and for tenths of a second."""
    arrays, seen = tick.arrays, list(vibrating(at_deg).displacements)
    for mine, vibrated in zip(arrays, vibrating(at_deg).arrays, strict=True):
        mine[...] = vibrated
    period, readings = len(seen), np.zeros(len(arrays.inputs))
    for _ in range(lost):
        bridge_lost_sample(arrays, readings, 1.0, 0.0)
        seen.append(displacement_of(arrays))
    volts = volts_of(arrays, np.arange(lost, lost + 40 * period), at_deg + jump_deg)
    read = bound(read_inputs, arrays, volts[0], readings)
    for volt in volts:
        read(arrays, volt, readings)
        seen.append(displacement_of(arrays))
    sizes = np.abs(seen) / SIZE_M
    assert sizes[:period].max() == pytest.approx(1.0, rel=0.02)
    assert sizes[period:].max() < (1.2 if abs(jump_deg) < 90.0 else 1.4)
    assert sizes[-period:].max() == pytest.approx(1.0, rel=0.1)


def displacements(tick, accelerations, step):
    """Displacement of the drive channel after every sample, m, if its readings have steps of this size, m/s^2."""
    arrays, samples = tick.arrays, np.arange(accelerations.size)
    channel = int(arrays.loop["drive_channel"][0])
    arrays.loop["held"] = 1
    stepped = step * np.round(np.minimum(samples / 48_000, 1.0) * accelerations / step)
    volts = np.tile(1e-6 * (samples % 2), (len(arrays.inputs), 1)).T.copy()  # the other sensors do not stand still
    volts[:, channel] = stepped / arrays.inputs["unit_per_volt"][channel]
    readings, seen, displacement = np.zeros(len(arrays.inputs)), np.empty(samples.size), arrays.watches["displacement"]
    read = bound(read_inputs, arrays, volts[0], readings)
    for sample in samples:
        read(arrays, volts[sample], readings)
        seen[sample] = displacement[channel]
    assert tick.guard["reason"][0] == EndReason.NONE
    return seen


@pytest.mark.parametrize("steps", [12.0, 40.0, 1500.0])
def test_equal_readings_at_turning_points_are_no_drift(fast_tick, steps):
    """At 48 kHz and 24 Hz, 12 to 150 readings in a row are equal there."""
    rate, omega, size_m = 48_000, 2.0 * math.pi * 24.0, 1e-3
    size = size_m * omega**2
    seen = displacements(fast_tick, size * np.cos(omega / rate * np.arange(4 * rate)), size / steps)
    last = seen[-rate:].reshape(-1, 2000)  # periods
    assert np.abs(last).max(axis=1) == pytest.approx(size_m, rel=0.03)
    assert np.abs(last.mean(axis=1)).max() < 0.02 * size_m


@pytest.mark.parametrize("at_deg", [0.0, 45.0, 90.0, 180.0])
def test_a_sensor_that_stands_still_for_a_while_feigns_little_displacement(fast_tick, at_deg):
    rate, omega, size_m = 48_000, 2.0 * math.pi * 24.0, 1e-3
    size, first = size_m * omega**2, 2 * rate + round(at_deg / 360.0 * rate / 24.0)
    n = np.arange(3 * rate)
    still = (first <= n) & (n < first + 0.2 * rate)
    readings = size * np.cos(omega / rate * np.where(still, first, n))
    seen = np.abs(displacements(fast_tick, readings, size / 3000.0))
    assert seen[first:].max() < 2.3 * size_m
    assert seen[-2000:].max() == pytest.approx(size_m, rel=0.3)
