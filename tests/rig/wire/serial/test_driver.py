"""`SerialDAQ` in front of an emulated device: what only the serial line adds to the protocol."""

import contextlib

import numpy as np
import pytest

from rig.bench import load_bench
from rig.drivers import make_daq
from rig.drivers.serial import SerialDAQ
from rig.emulator.emulated import emulated
from rig.errors import ConfigurationError, DaqBusy, DaqDisconnected, DaqRefused
from tests.refused import refused


@pytest.fixture(scope="module")
def bench():
    with emulated(load_bench("magnet-beam")) as reached:
        yield reached


def told(bench, **options):
    driver = bench.driver.model_copy(update={"options": {**bench.driver.options, **options}})
    return bench.model_copy(update={"driver": driver})


def test_samples_come_over_the_line_and_nothing_is_lost(bench):
    with make_daq(bench) as daq:
        assert isinstance(daq, SerialDAQ)
        daq.start(5)
        inputs = np.array([daq.exchange(np.full(5, 0.1)) for _ in range(20)])
        assert np.isfinite(inputs).all()
        assert np.ptp(inputs) > 0.0
        assert daq.identity["port"] == bench.driver.options["port"]
        assert daq.counters["lost_samples"] == daq.counters["crc_errors"] == 0


def test_a_port_in_use_is_busy_and_free_again_afterwards(bench):
    for _ in range(2):
        with make_daq(bench), refused(DaqBusy, where=f"port {bench.driver.options['port']!r}"):
            make_daq(bench).open()


def test_a_rate_that_the_line_does_not_carry_is_refused_with_the_sum(bench, monkeypatch):
    monkeypatch.setattr("rig.wire.serial.link.is_pseudo_terminal", lambda descriptor: False)
    with contextlib.closing(make_daq(told(bench, baud=115_200))) as daq, pytest.raises(DaqRefused) as refusal:
        daq.open()
    assert "115200 baud carry 115.2 kbit/s" in str(refusal.value)
    assert f"{bench.sample_rate_hz / bench.block:g}/s x " in str(refusal.value)
    with make_daq(told(bench, baud=3_000_000)) as daq:
        share = daq.statistics["wire_load_share"]
        assert 0.1 < share < 0.9
        assert daq.statistics["wire_needed_bit_s"] == pytest.approx(share * 3_000_000)
    monkeypatch.undo()
    with make_daq(told(bench, baud=3_000_000)) as daq:  # a pseudo-terminal carries any rate, and is asked the same
        assert daq.statistics["wire_load_share"] == 0.0
        assert daq.statistics["wire_needed_bit_s"] == pytest.approx(share * 3_000_000)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"port": ""}, {"field": "port", "value": ""}),
        ({"port": "x", "baud": 110}, {"field": "baud", "value": 110}),
        ({"port": "x", "bauds": 9600}, {"field": "bauds"}),
        ({}, {"says": "missing", "field": "port"}),
    ],
)
def test_options_that_make_no_sense_are_refused_by_name(bench, options, said):
    driver = bench.driver.model_copy(update={"options": options})
    with refused(ConfigurationError, **said):
        make_daq(bench.model_copy(update={"driver": driver}))


def test_a_device_that_is_not_there_is_said_at_open(bench):
    with refused(DaqDisconnected, "dev-no-such-port-it-is"):
        make_daq(told(bench, port="/dev/no-such-port")).open()


def test_a_device_that_vanishes_in_mid_run_is_said_and_can_be_closed():
    with contextlib.ExitStack() as stack:
        daq = make_daq(stack.enter_context(emulated(load_bench("magnet-beam"))))
        daq.open()
        daq.start(5)
        daq.exchange(np.zeros(5))
        stack.close()
        with refused(DaqDisconnected, "the-port-is-gone"):
            any(daq.exchange(np.zeros(5)) is None for _ in range(3))
        daq.close()
