"""The driver over the emulated device server, in lockstep: what it reads and refuses, and what is on the output at the end."""

import tomllib
from contextlib import contextmanager

import numpy as np
import pytest
from nidaqmx.error_codes import DAQmxErrors

from rig.bench import Bench, load_bench
from rig.conformance import with_loopback
from rig.drivers import make_daq
from rig.drivers.nidaqmx.library import BY_CODE
from rig.emulator.nidaqmx.faults import Injection
from rig.emulator.nidaqmx.reaching import chassis_options, reaching_bench
from rig.emulator.nidaqmx.server import DeviceServer
from rig.emulator.settings import EmulatorSettings
from rig.errors import ConfigurationError, DaqBusy, DaqDisconnected, DaqError, DaqMismatch, DaqRefused
from rig.loop.worker.queue_choice import HOLD_SAMPLES, presumed_latency
from tests.refused import refused
from tests.rig.rigs import bench_with

PATIENCE = {"timeout_s": 60.0, "watchdog_s": 60.0}


class Served:
    """A server in lockstep, and benches that reach it."""

    def __init__(self, server, virtual):
        self.server, self.virtual = server, virtual

    def bench(self, changes=(), **options) -> Bench:
        given = chassis_options(self.virtual, self.server.port, lockstep=True)
        bench = reaching_bench(self.virtual, {**given, **PATIENCE, "queue_blocks": 1, **options})
        return Bench.model_validate(bench.model_dump() | dict(changes))

    @property
    def output_v(self):
        return self.server.timeline.held_v


@contextmanager
def served(**settings):
    virtual = with_loopback(bench_with())
    virtual = virtual.model_copy(
        update={"channels": (*virtual.channels[:-1], virtual.channels[-1].model_copy(update={"range_v": 5.0}))}
    )
    with DeviceServer(
        EmulatorSettings(wire="nidaqmx", bench=virtual.model_dump(), lockstep=True, **settings)
    ) as server:
        yield Served(server, virtual)


@pytest.fixture(scope="module")
def chassis():
    with served() as one:
        yield one


def driven(daq, blocks, frequency_hz=200.0, amplitude_v=1.0):
    """Exchange a sine; return outputs [n] and inputs [n, n_channels]."""
    instants = np.arange(blocks * daq.block)
    sent = amplitude_v * np.sin(2.0 * np.pi * frequency_hz * instants / daq.sample_rate_hz)
    return sent, np.vstack([daq.exchange(part) for part in sent.reshape(blocks, -1)])


def begun(chassis):
    """Open, start, exchange and close."""
    with make_daq(chassis.bench()) as daq:
        daq.start(64)
        driven(daq, 3)


@pytest.mark.parametrize(("block", "buffer_blocks"), [(64, None), (50, 3)])
def test_an_output_comes_back_after_the_latency_with_its_amplitude(chassis, block, buffer_blocks):
    bench = chassis.bench({"block": block}, buffer_blocks=buffer_blocks)
    with make_daq(bench) as daq:
        assert presumed_latency(daq, bench, 1) == pytest.approx(daq.latency_samples + HOLD_SAMPLES - 0.5)
        daq.start(block)
        _, read = driven(daq, 40)
        assert daq.queue_samples == (1 + (buffer_blocks or 2)) * block
        omega = 2.0 * np.pi * 200.0 / daq.sample_rate_hz
        late = slice(read.shape[0] // 2, None)
        angle = omega * np.arange(read.shape[0])[late]
        sine, cosine = np.linalg.lstsq(np.stack([np.sin(angle), np.cos(angle)], 1), read[late, -1], rcond=None)[0]
        assert np.hypot(sine, cosine) == pytest.approx(1.0, rel=2e-3)
        phase = (np.arctan2(cosine, sine) + omega * daq.latency_samples + np.pi) % (2.0 * np.pi) - np.pi
        assert abs(phase) < omega * 0.1  # a tenth of a sample
        assert not daq.flags.any()
        daq.exchange_zeros()
    assert chassis.output_v == 0.0


def test_a_rate_that_the_device_does_not_have_is_refused_with_those_it_has(chassis):
    with (
        refused(DaqMismatch, "device-takes", field="sample_rate_hz", value=13000.0) as caught,
        make_daq(chassis.bench({"sample_rate_hz": 13000.0})),
    ):
        pass
    assert "12800" in caught.value.allowed


def test_a_range_that_the_module_does_not_have_is_refused(chassis):
    bench = chassis.bench()
    channels = [channel.model_dump() for channel in bench.channels]
    channels[1]["range_v"] = 10.0
    with (
        refused(DaqMismatch, "up-to-5-v", where="channel 'drive'", field="range_v"),
        make_daq(chassis.bench({"channels": channels})),
    ):
        pass
    with refused(DaqMismatch, "up-to-10-v", field="output_range_v"), make_daq(chassis.bench({"output_range_v": 12.0})):
        pass


def test_a_channel_without_its_device_is_told_how_it_is_written(chassis):
    bench = chassis.bench(inputs=["ai0", *chassis.bench().driver.options["inputs"][1:]])
    with refused(ConfigurationError, field="inputs[0]", value="ai0", allowed=bool):
        make_daq(bench)


@pytest.mark.parametrize("address", ["", "host", "host:1:2"])
def test_a_device_server_is_named_with_its_port(command, address):
    said = command("new", "bench", "--from", f"nidaqmx:cDAQ1@{address}", "-o", "other.toml")
    assert said.status == 1
    assert "HOST:PORT" in said.err


@pytest.mark.parametrize(
    ("options", "kind", "field"),
    [
        ({"output": "cDAQ1Mod3/ao9"}, DaqMismatch, "driver.options.output"),
        ({"output": "cDAQ1Mod1/ao0"}, DaqMismatch, "driver.options.output"),
        ({"output": "Dev9/ao0"}, DaqDisconnected, "driver.options.output"),
        ({"inputs": [f"cDAQ1Mod3/ai{n}" for n in range(5)]}, DaqMismatch, "driver.options.inputs"),
        ({"coupling": ["AC", "AC"]}, DaqRefused, "driver.options.coupling"),
        ({"inputs": ["cDAQ1Mod1/ai0"]}, DaqRefused, "driver.options.inputs"),
    ],
)
def test_channels_that_are_not_there_are_refused_with_those_that_are(chassis, options, kind, field):
    with refused(kind, field=field, allowed=bool), make_daq(chassis.bench(**options)):
        pass


def test_a_device_that_another_task_has_is_busy(chassis):
    with make_daq(chassis.bench()) as first:
        first.start(64)
        with refused(DaqBusy, "another-program"), make_daq(chassis.bench()):
            pass


def test_nothing_physical_moves_behind_devices_that_are_simulated(chassis):
    with make_daq(chassis.bench()) as daq:
        assert daq.capabilities.virtual
        assert daq.capabilities.repeatable
        assert not daq.capabilities.safe_without_host
        assert daq.identity["device_watchdog"].startswith("the device has none")
        assert daq.identity["clock"] == "/cDAQ1/ai/SampleClock"
    with served(as_hardware=True) as real, make_daq(real.bench(watchdog_s=1.0)) as daq:
        assert not daq.capabilities.virtual


def test_the_watchdog_of_a_device_is_used_where_it_has_one():
    with served(device_watchdog=True) as one:
        calls = []
        one.server.calls.on_call = calls.append
        with make_daq(one.bench()) as daq:
            daq.start(64)
            driven(daq, 10)
            assert daq.identity["device_watchdog"] == "0 V after 60 s"
        with make_daq(one.bench(device_watchdog=False)) as daq:
            assert daq.identity["device_watchdog"] == "not used"


INJECTED = [
    ("ReadAnalogF64", DAQmxErrors.SAMPLES_NO_LONGER_AVAILABLE),
    ("ReadAnalogF64", DAQmxErrors.ACQ_STOPPED_TO_PREVENT_INPUT_BUFFER_OVERWRITE),
    ("ReadAnalogF64", DAQmxErrors.INPUT_FIFO_OVERFLOW),
    ("ReadAnalogF64", DAQmxErrors.DEV_ABSENT_OR_UNAVAILABLE),
    ("ReadAnalogF64", DAQmxErrors.SAMPLES_NOT_YET_AVAILABLE),
    ("ReadAnalogF64", DAQmxErrors.OPERATION_ABORTED),
    ("ReadAnalogF64", DAQmxErrors.CHASSIS_COMMUNICATION_INTERRUPTED),
    ("WriteAnalogF64", DAQmxErrors.GEN_STOPPED_TO_PREVENT_REGEN_OF_OLD_SAMPLES),
    ("WriteAnalogF64", DAQmxErrors.OUTPUT_FIFO_UNDERFLOW_2),
    ("WriteAnalogF64", DAQmxErrors.SAMPLES_CAN_NOT_YET_BE_WRITTEN),
    ("WriteAnalogF64", DAQmxErrors.DEVICE_REMOVED),
    ("WriteAnalogF64", DAQmxErrors.INVALID_AO_DATA_WRITE),
    ("WriteAnalogF64", DAQmxErrors.WRITE_FAILED_BECAUSE_WATCHDOG_EXPIRED),
]
OPENING = [
    ("TaskControl", DAQmxErrors.RESOURCE_ALREADY_RESERVED),
    ("TaskControl", DAQmxErrors.SAMP_CLK_RATE_INVALID),
    ("TaskControl", DAQmxErrors.NO_COMMON_TRIG_LINE_FOR_ROUTE_ROUTING),
    ("StartTask", DAQmxErrors.EXT_SAMP_CLK_SRC_NOT_SPECIFIED),
    ("CreateAIVoltageChan", DAQmxErrors.PHYSICAL_CHAN_DOES_NOT_EXIST),
    ("CreateAOVoltageChan", DAQmxErrors.AO_MIN_MAX_NOT_IN_DAC_RANGE),
]


@pytest.mark.parametrize(("call", "code"), INJECTED, ids=lambda value: getattr(value, "name", value))
def test_an_error_while_running_ends_with_zero_on_the_output_and_its_code(chassis, call, code):
    kind, _ = BY_CODE[code.value]
    with make_daq(chassis.bench()) as daq:
        daq.start(64)
        driven(daq, 10)
        assert chassis.output_v != 0.0
        injection = Injection(call, code, after=3)
        chassis.server.calls.injections.append(injection)
        with refused(DaqError, reason=lambda text: f"(NI-DAQmx {code.value}: " in text) as caught:
            driven(daq, 10)
        assert type(caught.value) is kind
        assert "\n" not in str(caught.value)
        chassis.server.calls.injections.remove(injection)
        daq.stop()
        assert chassis.output_v == 0.0


@pytest.mark.parametrize(("call", "code"), OPENING, ids=lambda value: getattr(value, "name", value))
def test_an_error_while_opening_or_starting_has_its_code_and_leaves_nothing_reserved(chassis, call, code):
    kind, _ = BY_CODE[code.value]
    injection = Injection(call, code)
    chassis.server.calls.injections.append(injection)
    with refused(DaqError, reason=lambda text: f"(NI-DAQmx {code.value}: " in text) as caught:
        begun(chassis)
    assert type(caught.value) is kind
    chassis.server.calls.injections.remove(injection)
    begun(chassis)
    assert chassis.output_v == 0.0


def test_a_server_that_goes_away_is_a_device_that_is_gone():
    with served() as one:
        daq = make_daq(one.bench(timeout_s=2.0))
        daq.open()
        daq.start(64)
        driven(daq, 5)
    with refused(DaqDisconnected, "device-server"):
        driven(daq, 5)
    daq.close()


def test_a_server_that_is_not_there_is_told(chassis):
    with refused(DaqDisconnected, "device-server"), make_daq(chassis.bench(server="127.0.0.1:1")):
        pass


def test_a_bench_begins_from_a_chassis_and_its_sensors_from_their_teds(chassis, command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    port = chassis.server.port
    said = command("new", "bench", "--from", f"nidaqmx:cDAQ1@127.0.0.1:{port}", "-o", "ni.toml").succeeded().out
    assert "ni-sensors.toml" in said
    bench, virtual = load_bench("ni.toml"), chassis.virtual
    assert [channel.role for channel in bench.channels] == [channel.role for channel in virtual.channels]
    for found, there in zip(bench.channels, virtual.channels, strict=True):
        assert abs(found.sensitivity_v_per_unit) == pytest.approx(abs(there.sensitivity_v_per_unit), rel=1e-3)
        assert found.range_v == 5.0
        assert found.input_high_pass_hz == (0.0 if found.loopback else 0.5)
    sensors = tomllib.loads((tmp_path / "ni-sensors.toml").read_text())["sensors"]
    assert len(sensors) == len(virtual.channels) - 1
    assert bench.driver.options["inputs"][-1] not in bench.driver.options["inputs"][:-1]
    with make_daq(bench) as daq:
        assert daq.sample_rate_hz == bench.sample_rate_hz
    again = command("new", "bench", "--from", f"nidaqmx:cDAQ9@127.0.0.1:{port}", "-o", "other.toml")
    assert again.status == 1
    assert "nidaqmx:cDAQ1" in again.err
