"""A device that runs at a multiple of the loop's rate: images, what is lost, and what a device cannot do."""

import numpy as np
import pytest
from scipy.signal import freqz, lfilter

from rig.bench.cross_checks import cautions, refuse
from rig.conformance import with_loopback
from rig.daq import CONTINUATION, LOST, Adjustable
from rig.drivers import make_daq
from rig.drivers.oversampled import PASS_BAND, STOP_BAND, OversampledDAQ, decimation_taps
from rig.drivers.resampling import decimate, draw_lines
from rig.errors import ConfigurationError
from tests.refused import refused
from tests.rig.rigs import bench_with


def bench_at(oversample, **options):
    return bench_with({"oversample": oversample}, **options)


@pytest.mark.parametrize("oversample", [2, 3, 8])
def test_what_would_alias_is_80_db_down_and_what_is_measured_is_left_as_it_is(oversample):
    at = np.concatenate((np.linspace(0.0, PASS_BAND, 200), np.linspace(STOP_BAND, 0.5 * oversample, 2000)))
    _, response = freqz(decimation_taps(oversample), worN=at, fs=oversample)
    passed, stopped = np.abs(response[:200]), np.abs(response[200:])
    assert np.max(np.abs(passed - 1.0)) < 1.2e-4
    assert np.max(stopped) < 1.2e-4


@pytest.mark.parametrize(("times", "block"), [(2, 1), (3, 7), (8, 50), (64, 1)])
def test_block_by_block_the_inputs_are_one_record_filtered_and_every_nth_kept(times, block):
    taps = decimation_taps(times)
    read = np.random.default_rng(1).normal(size=(12 * block * times, 3))
    past, inputs, found = np.zeros((taps.size - 1, 3)), np.zeros((block, 3)), []
    for part in np.split(read, 12):
        decimate(past, part, taps, inputs)
        found.append(inputs.copy())
    expected = lfilter(taps, 1.0, read, axis=0)[times - 1 :: times]
    np.testing.assert_allclose(np.concatenate(found), expected, rtol=0, atol=1e-14)


@pytest.mark.parametrize(("times", "block"), [(2, 1), (3, 7), (8, 50)])
def test_outputs_lie_on_the_lines_between_voltages(times, block):
    voltages = np.random.default_rng(2).uniform(-1.0, 1.0, block)
    drawn = np.zeros(times * block)
    draw_lines(0.7, voltages, drawn)
    knots = times * np.arange(block + 1)
    expected = np.interp(np.arange(1, times * block + 1), knots, np.concatenate(([0.7], voltages)))
    np.testing.assert_allclose(drawn, expected, rtol=0, atol=1e-15)


class Recording(OversampledDAQ):
    """Remembers what the device was given."""

    def _start(self):
        super()._start()
        self.given = []
        inner = self.device._exchange

        def exchange(voltages, inputs):
            self.given.append(voltages.copy())
            inner(voltages, inputs)

        self.device._exchange = exchange


def opened(bench):
    return Recording(make_daq(bench.at_device), bench)


def test_the_device_gets_straight_lines_and_the_loopback_reads_them_late_by_the_latency():
    bench = with_loopback(bench_at(5))
    slope = 1e-3
    with opened(bench) as daq:
        daq.start(20)
        ramps = slope * np.arange(200.0).reshape(-1, 20)
        read = np.concatenate([daq.exchange(part) for part in ramps])[:, -1]
        given = np.concatenate(daq.given)
    assert np.allclose(np.diff(given)[5:], slope / 5, rtol=1e-12)
    late = np.arange(200) - read / daq.channels[-1].sensitivity_v_per_unit / slope
    assert np.allclose(late[60:], daq.latency_samples, atol=0.02)


def test_a_sample_that_the_device_lost_takes_those_with_it_whose_filter_needs_it():
    bench = bench_at(4)
    with opened(bench) as daq:
        daq.start(100)
        inner = daq.device._exchange

        def losing(voltages, inputs):
            inner(voltages, inputs)
            inputs[41] = np.nan
            daq.device.flags[41] |= LOST

        daq.device._exchange = losing
        rows = daq.exchange(np.zeros(100))
        lost = np.isnan(rows).all(axis=1)
        assert np.array_equal(lost, np.isnan(rows).any(axis=1))
        assert np.array_equal(lost, (daq.flags & LOST) != 0)
        assert np.flatnonzero(lost)[0] == 41 // 4
        assert lost.sum() == -(-decimation_taps(4).size // 4)
        daq.device._exchange = inner
        assert np.isfinite(daq.exchange(np.zeros(100))).all()


def test_what_is_said_in_samples_is_said_in_the_loops_and_handed_on_in_the_devices(monkeypatch):
    bench = bench_at(4)
    with opened(bench) as daq:
        daq.start(10)
        daq.continuation[:] = np.array([(200.0, 30.0)], CONTINUATION)
        daq.exchange(np.zeros(10))
        assert daq.device.continuation.tolist() == [(800.0, 120.0)]
        daq.device.put_out[:] = np.nan
        inner = daq.device._exchange

        def putting_out(voltages, inputs):
            inner(voltages, inputs)
            daq.device.put_out[4:8] = [0.1, 0.2, 0.3, 0.4]

        daq.device._exchange = putting_out
        daq.exchange(np.zeros(10))
        assert np.flatnonzero(np.isfinite(daq.put_out)).tolist() == [1]
        assert daq.put_out[1] == 0.4
    assert daq.capabilities.largest_block == daq.device.capabilities.largest_block // 4
    allowed = Adjustable(0.1, 8, (0.01, 1.0), (1e3, 4e4), {1: 0.5, 4: 0.2, 40: 0.1}, 0.9, longest_period=4000)
    monkeypatch.setattr(type(daq.device), "adjustable", allowed)
    said = daq.adjustable
    assert (said.rate_range_hz, said.wire_share, said.longest_period) == ((250.0, 1e4), {1: 0.2, 10: 0.1}, 1000)


def test_a_device_that_runs_the_loop_itself_does_not_oversample():
    driver = {"name": "serial", "options": {"port": "/dev/null", "loop": "device"}}
    bench = bench_with({"driver": driver, "oversample": 4})
    with refused(ConfigurationError, field="oversample", value=4, allowed="1 with driver.options.loop = 'device'"):
        refuse(bench)


@pytest.mark.parametrize(("corner_hz", "oversample", "is_told"), [(None, 1, 1), (0.0, 1, 1), (2e3, 1, 0), (None, 4, 0)])
def test_a_board_whose_bench_says_no_filter_of_the_force_is_told_so(corner_hz, oversample, is_told):
    bench = bench_with({"driver": {"name": "serial", "options": {"port": "/dev/null"}}, "oversample": oversample})
    force = bench.index_of("force")
    channels = [c.model_copy(update={"anti_alias_hz": corner_hz}) if c.role == "force" else c for c in bench.channels]
    told = cautions(bench.model_copy(update={"channels": tuple(channels)}))
    assert sum(f"channels[{force}].anti_alias_hz" in line for line in told) == is_told
