"""The driver of sound devices over a card without a clock; everything it promises is told by a closed form."""

import sys

import numpy as np
import pytest

from rig.bench import Bench
from rig.daq import LOST
from rig.drivers import make_daq
from rig.drivers.sound import stream as streams
from rig.drivers.sound.devices import found
from rig.drivers.sound.lost_time import CALLS_IN_DOUBT
from rig.drivers.sound.rates import PASS_BAND, Decimator, Interpolator, low_pass
from rig.errors import (
    DaqBusy,
    DaqDisconnected,
    DaqError,
    DaqMismatch,
    DaqRefused,
    DaqTimeout,
    DaqWatchdog,
)
from tests.refused import refused
from tests.rig.drivers.sound.card import RATE_HZ, Card, PortAudioError

SCALE_V = 10.0
TONE_HZ = 100.0


def bench(rate_hz=RATE_HZ, block=128, loopback=True, **options):
    """A bench with a sound device; the last channel is the loopback."""
    given = {
        "device": "box",
        "output_full_scale_v": SCALE_V,
        "input_full_scale_v": SCALE_V,
        "queue_blocks": 2,
        **options,
    }
    channel = {"sensitivity_v_per_unit": 1.0, "range_v": SCALE_V}
    return Bench.model_validate(
        {
            "name": "on a card",
            "driver": {"name": "sound", "options": given},
            "sample_rate_hz": rate_hz,
            "block": block,
            "output_range_v": 5.0,
            "channels": [
                {"name": "force", "role": "force", **channel},
                {"name": "drive", "role": "drive", **channel},
                {"name": "cable", "role": "monitor", "unit": "V", "loopback": loopback, **channel},
            ],
            "limits": {
                "voltage_v": 5.0,
                "force_n": 5.0,
                "acceleration_m_s2": 5.0,
                "displacement_m": 1.0,
                "frequency_hz": [5.0, 1000.0],
            },
            "specimen": {"name": "cable", "linear_frequency_hz": 20.0},
        }
    )


@pytest.fixture
def card(monkeypatch):
    """A function that puts a card into the computer."""

    def put(**facts):
        made = Card(**facts)
        monkeypatch.setitem(sys.modules, "sounddevice", made)
        monkeypatch.setattr(streams, "time", made)
        return made

    return put


class Driven:
    """A running driver, and what it has exchanged: a sine of 1 V with its period, or any other output."""

    def __init__(self, bench_, periodic=True):
        self.daq = make_daq(bench_)
        self.periodic = periodic
        self.sent, self.read, self.flags, self.put_out = [], [], [], []

    def __enter__(self):
        self.daq.open()
        self.daq.start(self.daq._bench.block)
        return self

    def __exit__(self, *_):
        self.daq.close()

    def volts(self, instants):
        return np.sin(2.0 * np.pi * TONE_HZ * instants / self.daq.sample_rate_hz)

    def exchange(self, blocks):
        for _ in range(blocks):
            first = sum(part.size for part in self.sent)
            voltages = self.volts(np.arange(first, first + self.daq.block))
            if self.periodic:
                self.daq.continuation[0] = self.daq.sample_rate_hz / TONE_HZ, 0.0
            self.read.append(self.daq.exchange(voltages))
            self.sent.append(voltages)
            self.flags.append(self.daq.flags.copy())
            self.put_out.append(self.daq.put_out.copy())

    def together(self):
        parts = (self.sent, self.read, self.flags, self.put_out)
        return tuple(np.concatenate(part) for part in parts)


# Delay and filters


@pytest.mark.parametrize("delay", [128, 256, 1531])
def test_delay_is_measured_through_the_cable_whatever_the_stamps_say(card, delay):
    card(delay=delay).stamps = 0.1
    with Driven(bench(block=64)) as driven:
        assert driven.daq.latency_samples == pytest.approx(2 * 64 + delay, abs=0.01)
        assert driven.daq.identity["latency_from"] == "loopback channel cable"
        assert not driven.daq.remarks


@pytest.mark.parametrize(("promised_s", "frames"), [(0.0, 256), (0.02, 960)])
def test_before_the_start_two_periods_or_what_the_device_promises_are_presumed(card, promised_s, frames):
    card(delay=300).promised_s = promised_s
    with make_daq(bench()) as daq:
        assert daq.filter_delay_samples == pytest.approx(frames)
        daq.start(128)
        assert daq.filter_delay_samples == pytest.approx(300, abs=0.01)


def test_stamps_count_without_a_cable_and_are_said_not_to_be_trusted(card):
    card(delay=256).stamps = 300.0 / RATE_HZ
    with Driven(bench(loopback=False)) as driven:
        assert driven.daq.latency_samples == pytest.approx(2 * 128 + 300, abs=1e-6)
        assert "time stamps" in driven.daq.remarks[0]


@pytest.mark.parametrize(
    ("rate_hz", "block"), [(48000.0, 128), (48000.0, 100), (12000.0, 32), (6000.0, 20), (16000.0, 60)]
)
def test_an_output_comes_back_after_the_latency_with_the_gain_of_its_input(card, rate_hz, block):
    made = card(delay=250)
    with Driven(bench(rate_hz, block)) as driven:
        driven.exchange(round(0.25 * rate_hz / block))
        _, read, flags, _ = driven.together()
        late = np.arange(read.shape[0]) - driven.daq.latency_samples
        settled = late > 0.05 * rate_hz
        expected = driven.volts(late)[settled, None] * made.gains
        assert np.max(np.abs(read[settled] - expected)) < 3e-5  # 24 bits, and 90 dB of the filters
        assert not flags.any()
        assert driven.daq.latency_samples == pytest.approx(
            2 * block + 2 * low_pass(round(RATE_HZ / rate_hz)).delay + 250 * rate_hz / RATE_HZ, abs=0.01
        )


@pytest.mark.parametrize("factor", [2, 4, 8, 32])
def test_filters_pass_what_is_tested_and_stop_what_folds_back(factor):
    taps = low_pass(factor).taps
    at = np.linspace(0.0, 0.5 * factor, 20001)  # over the bench's rate
    gain = np.abs(np.exp(-2j * np.pi * np.outer(at[::20], np.arange(taps.size)) / factor) @ taps)
    assert np.abs(gain[at[::20] <= PASS_BAND] - 1.0).max() < 1e-4
    assert gain[at[::20] >= 1.0 - PASS_BAND].max() < 1e-4
    assert (taps.size - 1) / 2 == low_pass(factor).delay * factor
    np.testing.assert_allclose(taps, taps[::-1])


def test_blocks_of_any_size_are_filtered_alike():
    rng = np.random.default_rng(1)
    samples, frames = rng.normal(size=120), rng.normal(size=(480, 2))
    at_once = Interpolator(4)(samples), Decimator(4, 2)(frames)
    up, down = Interpolator(4), Decimator(4, 2)
    np.testing.assert_allclose(np.concatenate([up(part) for part in samples.reshape(-1, 8)]), at_once[0])
    np.testing.assert_allclose(np.concatenate([down(part) for part in frames.reshape(-1, 32, 2)]), at_once[1])


def test_nothing_beyond_the_largest_output_is_put_out_between_two_samples(card):
    made = card()
    with Driven(bench(12000.0, 32), periodic=False) as driven:
        limit_v = driven.daq.output_range_v
        driven.volts = lambda instants: np.where(instants // 5 % 2, limit_v, -limit_v)
        driven.exchange(50)
        sent, *_ = driven.together()
        assert np.abs(Interpolator(4)(sent)).max() > 1.05 * limit_v
    assert np.abs(made.put_out).max() * SCALE_V == pytest.approx(limit_v, rel=1e-6)


# Late outputs


@pytest.mark.parametrize(("rate_hz", "block"), [(48000.0, 128), (12000.0, 32)])
def test_a_late_output_is_continued_by_the_period_and_told(card, rate_hz, block):
    made = card()
    with Driven(bench(rate_hz, block)) as driven:
        driven.exchange(round(0.1 * rate_hz / block))
        for _ in range(7):
            made.period()  # the host sleeps
        driven.exchange(20)
        sent, read, flags, put_out = driven.together()
        late = np.isfinite(put_out)
        assert late.sum() == pytest.approx(5 * 128 * rate_hz / RATE_HZ, abs=2)  # of seven periods the queue covers two
        assert np.array_equal(flags > 0, late)
        assert set(flags[late]) == {2}
        assert driven.daq.counters["output_continued"] == late.sum()
        queue = driven.daq.queue_samples
        expected = driven.volts(np.arange(sent.size) - queue)
        assert np.abs(put_out[late] - expected[late]).max() < 2e-4  # a cubic through four outputs
        settled = np.arange(sent.size) > 0.05 * rate_hz
        whole = driven.volts(np.arange(sent.size) - driven.daq.latency_samples)
        assert np.abs(read[settled, 0] / made.gains[0] - whole[settled]).max() < 2e-3  # it never stopped swinging


def test_a_late_output_without_a_period_is_held(card):
    made = card()
    with Driven(bench(), periodic=False) as driven:
        driven.exchange(30)
        for _ in range(7):
            made.period()
        driven.exchange(20)
        _, _, flags, put_out = driven.together()
        late = np.isfinite(put_out)
        assert set(flags[late]) == {1}
        assert np.ptp(put_out[late]) == 0.0
        assert driven.daq.counters["output_held"] == late.sum() > 0


def test_the_watchdog_fades_the_output_and_ends_the_run(card):
    made = card()
    with Driven(bench(watchdog_s=0.1, ramp_s=0.02)) as driven:
        driven.exchange(60)
        before = made.put_out.shape[0]
        for _ in range(80):
            made.period()
        with pytest.raises(DaqWatchdog):
            driven.exchange(2)
        after = made.put_out[before:, 0]
        silent = round((0.1 + 2 * 128 / RATE_HZ + 0.02) * RATE_HZ) + 2 * 128
        assert np.abs(after[: round(0.1 * RATE_HZ)]).max() == pytest.approx(0.1, rel=1e-3)
        assert not after[silent:].any()
        assert np.abs(np.diff(after)).max() < 1.2 * 0.1 * 2 * np.pi * TONE_HZ / RATE_HZ  # no step


# Frames lost by the audio system


@pytest.mark.parametrize(("rate_hz", "block"), [(48000.0, 128), (12000.0, 32)])
def test_frames_that_the_system_loses_are_rows_of_nan_and_the_rest_keeps_its_place(card, rate_hz, block):
    made = card()
    with Driven(bench(rate_hz, block)) as driven:
        driven.exchange(100)
        made.lose(3)
        driven.exchange(100)
        _, read, flags, _ = driven.together()
        lost = flags == LOST
        assert np.array_equal(lost, np.isnan(read).any(axis=1))
        at_least, in_doubt = 3 * 128 * rate_hz / RATE_HZ, CALLS_IN_DOUBT * 128 * rate_hz / RATE_HZ
        assert at_least <= lost.sum() <= at_least + in_doubt + 2 * low_pass(round(RATE_HZ / rate_hz)).delay + 1
        assert driven.daq.counters["lost_samples"] == lost.sum()
        assert driven.daq.counters["interruptions"] == 1
        late = np.arange(flags.size) - driven.daq.latency_samples
        end = slice(flags.size - 60 * block, None)
        assert np.abs(read[end, 0] / made.gains[0] - driven.volts(late)[end]).max() < 1e-4


def test_a_call_that_is_late_and_catches_up_has_lost_nothing(card):
    made = card()
    with Driven(bench()) as driven:
        driven.exchange(100)
        made.be_late(3 * 128 / RATE_HZ)
        driven.exchange(100)
        _, read, flags, _ = driven.together()
        assert driven.daq.counters["interruptions"] == 1
        lost = flags == LOST
        assert 0 < lost.sum() <= 6 * 128  # half a period is caught up in a call
        late = np.arange(flags.size) - driven.daq.latency_samples
        there = ~lost & (late > 0)
        assert np.abs(read[there, 0] / made.gains[0] - driven.volts(late)[there]).max() < 1e-4


def test_an_input_at_full_scale_is_an_overload(card):
    made = card(gains=(25.0, 0.25, -1.0))
    with Driven(bench()) as driven:
        driven.exchange(30)
        _, read, flags, _ = driven.together()
        assert np.array_equal((flags & 4) > 0, np.abs(read[:, 0]) >= SCALE_V * (1.0 - 2.0**-22))
        assert (flags & 4).any()
        assert made.put_out.shape[1] == 1


# The end


def test_the_output_fades_to_zero_at_the_stop(card):
    made = card()
    with Driven(bench(ramp_s=0.01)) as driven:
        driven.exchange(60)
        driven.daq.stop()
        end = made.put_out[:, 0]
        assert end[-1] == 0.0
        assert np.abs(np.diff(end[-1500:])).max() < 1.2 * 0.1 * 2 * np.pi * TONE_HZ / RATE_HZ
        assert not made.stream.active


def test_before_the_first_output_there_is_nothing_but_the_signal_of_the_cable(card):
    made = card()
    with Driven(bench()) as driven:
        largest = 0.01 * 5.0 / SCALE_V
        assert np.abs(made.put_out).max() == pytest.approx(largest, rel=1e-3)
        before = made.put_out.shape[0]
        for _ in range(100):
            made.period()
        assert not made.put_out[before:].any()
        driven.exchange(10)  # no watchdog has tripped meanwhile


def test_it_is_started_again_after_a_stop(card):
    card()
    with Driven(bench()) as driven:
        driven.exchange(10)
        driven.daq.stop()
        driven.daq.start(128)
        driven.exchange(10)


def test_other_outputs_of_the_device_get_zero(card):
    made = card(outputs=4, gains=(0.5, 0.25, -1.0, 0.1))
    with Driven(bench(output=3)) as driven:
        driven.exchange(20)
        assert made.put_out.shape[1] == 3
        assert made.put_out[:, 2].any()
        assert not made.put_out[:, :2].any()


def test_inputs_are_taken_in_the_benchs_order(card):
    made = card(gains=(0.5, 0.25, -1.0, 0.125, 0.0625))
    with Driven(bench(inputs=[5, 1, 3])) as driven:
        driven.exchange(60)
        _, read, _, _ = driven.together()
        np.testing.assert_allclose(read[-1000:, 1] / made.gains[0], read[-1000:, 0] / made.gains[4], atol=1e-5)


# What goes wrong


def test_a_card_that_is_unplugged_ends_like_an_unplugged_wire(card):
    made = card()
    with Driven(bench()) as driven:
        driven.exchange(10)
        made.fault = "unplugged"
        with refused(DaqDisconnected, "gone"):
            driven.exchange(10)


def test_a_card_that_is_silent_is_told_from_one_that_is_gone(card):
    made = card()
    with Driven(bench()) as driven:
        driven.exchange(10)
        made.fault = "silent"
        with pytest.raises(DaqTimeout):
            driven.exchange(10)


def test_another_rate_than_was_asked_for_is_noticed(card):
    made = card()
    with Driven(bench()) as driven:
        driven.exchange(10)
        made.slow = 48.0 / 44.1
        with refused(DaqError, "another-program-has-changed-its-rate"):
            driven.exchange(1600)


def test_a_card_in_use_is_busy(card):
    card().fault = "in use"
    daq = make_daq(bench())
    daq.open()
    with pytest.raises(DaqBusy):
        daq.start(128)
    daq.close()


@pytest.mark.parametrize(
    ("options", "error", "field", "value"),
    [
        ({"device": "bax"}, DaqDisconnected, "driver.options.device", "bax"),
        ({"device": 7}, DaqDisconnected, "driver.options.device", 7),
        ({"host_api": "ASIO"}, DaqDisconnected, "driver.options.device", "box"),
        ({"output": 3}, DaqMismatch, "driver.options.output", 3),
        ({"inputs": [1, 2, 9]}, DaqMismatch, "driver.options.inputs", 9),
        ({"device_rate_hz": 96000.0}, DaqRefused, "driver.options.device_rate_hz", 96000.0),
        ({"output_full_scale_v": 4.0}, DaqMismatch, "output_range_v", 5.0),
        ({"input_full_scale_v": 4.0}, DaqMismatch, "range_v", 10.0),
        ({"input_full_scale_v": [10.0, 10.0]}, DaqRefused, "driver.options.input_full_scale_v", [10.0, 10.0]),
    ],
)
def test_what_the_device_is_not_is_refused(card, options, error, field, value):
    card()
    with refused(error, field=field, value=value):
        make_daq(bench(**options)).open()


@pytest.mark.parametrize("field", ["output_full_scale_v", "input_full_scale_v"])
def test_without_volts_per_full_scale_nothing_is_armed(card, field):
    card()
    given = bench()
    given.driver.options.pop(field)
    with refused(DaqRefused, field=f"driver.options.{field}"):
        make_daq(given).open()


def test_a_rate_that_divides_none_of_the_devices_is_refused_with_those_that_do(card):
    card()
    with refused(DaqRefused, field="sample_rate_hz", value=5000.0) as told:
        make_daq(bench(rate_hz=5000.0)).open()
    assert "4900" in told.value.allowed
    assert "4800" in told.value.allowed


def test_limits_beyond_the_filters_are_refused(card):
    card()
    table = bench(rate_hz=2400.0, block=16).model_dump()
    with refused(DaqRefused, field="limits.frequency_hz", value=1000.0):
        make_daq(Bench.model_validate(table)).open()


def test_a_queue_shorter_than_a_period_is_refused(card):
    card()
    daq = make_daq(bench(block=32, queue_blocks=1))
    daq.open()
    with refused(DaqRefused, field="driver.options.queue_blocks", value=1):
        daq.start(32)
    daq.close()


@pytest.mark.parametrize("block", [1, 5, 32, 100])
def test_a_queue_that_is_left_open_covers_a_period_of_the_audio_system(card, block):
    card()
    daq = make_daq(bench(12000.0, 32, queue_blocks="auto"))
    with daq:
        daq.start(block)
        for _ in range(200):
            daq.exchange(np.zeros(block))
            assert not daq.flags.any()
        assert daq.queue_samples >= 32


def test_two_devices_of_one_name_need_the_host_interface(card):
    made = card()
    made.devices.append(("box", 1, 3, 2))
    with refused(DaqRefused, field="driver.options.device", value="box"):
        make_daq(bench()).open()
    with make_daq(bench(host_api="jack")) as daq:
        assert daq.identity["host_api"] == "JACK Audio Connection Kit"


def test_a_cable_that_is_not_there_is_said(card):
    card(gains=(0.5, 0.25, 0.0))
    daq = make_daq(bench())
    daq.open()
    with refused(DaqError, "does-not-come-back"):
        daq.start(128)
    daq.close()


@pytest.mark.parametrize(("failures", "begins"), [(2, True), (3, False)])
def test_an_audio_server_that_has_no_time_is_asked_again_and_then_said_not_to_answer(card, failures, begins):
    made, left = card(), [None] * failures

    def initialise():
        if left:
            left.pop()
            raise PortAudioError("Start thread error", -9999)
        made._initialized += 1

    made._initialize = initialise
    daq = make_daq(bench())
    if begins:
        with daq:
            daq.start(128)
        return
    with refused(DaqTimeout, "does-not-answer-start-thread-error"):
        daq.open()


@pytest.mark.parametrize(("unanswered", "is_found"), [(3, True), (4, False)])
def test_a_device_that_is_not_listed_is_looked_for_again(card, monkeypatch, unanswered, is_found):
    made, pauses = card(), []
    monkeypatch.setattr("rig.drivers.sound.devices.time.sleep", pauses.append)
    listed = [[]] * unanswered
    every, made.query_devices = made.query_devices, lambda: listed.pop() if listed else every()
    if is_found:
        assert found("box", "").name == "box"
    else:
        with refused(DaqDisconnected, field="driver.options.device", value="box"):
            found("box", "")
    assert pauses == [0.5] * 3


def test_a_missing_package_is_said_in_one_line(monkeypatch):
    monkeypatch.setitem(sys.modules, "sounddevice", None)
    with refused(DaqRefused, "sounddevice-is-not-installed"):
        make_daq(bench()).open()


def test_channels_must_be_as_many_as_the_benchs_and_each_once(card):
    card()
    with refused(DaqRefused, field="driver.options.inputs", value=[1, 2]):
        make_daq(bench(inputs=[1, 2]))
    with refused(Exception, "channel-is-named-twice", field="inputs"):
        make_daq(bench(inputs=[1, 2, 1]))
