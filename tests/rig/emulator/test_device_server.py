"""The emulated NI gRPC Device Server, with NI's own package as client and no driver of ours."""

import math

import numpy as np
import pytest

nidaqmx = pytest.importorskip("nidaqmx")
grpc = pytest.importorskip("grpc")

from nidaqmx.constants import (  # noqa: E402
    AccelSensitivityUnits,
    AcquisitionType,
    Coupling,
    RegenerationMode,
    TaskMode,
    WatchdogAOExpirState,
)
from nidaqmx.error_codes import DAQmxErrors  # noqa: E402
from nidaqmx.stream_readers import AnalogMultiChannelReader  # noqa: E402
from nidaqmx.stream_writers import AnalogSingleChannelWriter  # noqa: E402
from nidaqmx.system import System  # noqa: E402
from nidaqmx.system.watchdog import AOExpirationState, WatchdogTask  # noqa: E402
from scipy.signal import butter, freqz  # noqa: E402

from rig.emulator.nidaqmx.faults import Injection  # noqa: E402
from rig.emulator.nidaqmx.server import DeviceServer  # noqa: E402
from rig.emulator.settings import EmulatorSettings  # noqa: E402
from tests.refused import refused  # noqa: E402
from tests.rig.rigs import bench_with  # noqa: E402

RATE_HZ = 12800.0
BLOCK = 64
SENSORS = 4
LOOPBACK = "cDAQ1Mod2/ai0"
INPUT, OUTPUT = "cDAQ1Mod1/ai0", "cDAQ1Mod3/ao0"
DELAY = 38.4 + 3.2e-6 * RATE_HZ
"""Input delay of an NI-9234, samples (its specifications: 38.4/fs + 3.2 us)."""
HOLD = 0.5
"""A held output is half a sample late."""


class Clock:
    """A clock of a test's own, s."""

    def __init__(self):
        self.now_s = 100.0

    def __call__(self):
        return self.now_s


class Client:
    """NI's package in front of a server."""

    def __init__(self, server):
        self.server = server
        own = (("grpc.use_local_subchannel_pool", 1),)  # a connection of its own, as another process has
        self.channel = grpc.insecure_channel(f"127.0.0.1:{server.port}", own)
        self.options = nidaqmx.GrpcSessionOptions(self.channel, "")
        self.tasks = []

    def task(self):
        self.tasks.append(nidaqmx.Task(grpc_options=self.options))
        return self.tasks[-1]

    def inputs(self, *names, rate_hz=RATE_HZ, range_v=5.0, source=""):
        task = self.task()
        for name in names:
            task.ai_channels.add_ai_voltage_chan(name, min_val=-range_v, max_val=range_v)
        task.timing.cfg_samp_clk_timing(rate_hz, source, sample_mode=AcquisitionType.CONTINUOUS, samps_per_chan=10000)
        return task

    def output(self, ahead, name=OUTPUT, source="/cDAQ1/ai/SampleClock", trigger="/cDAQ1/ai/StartTrigger"):
        task = self.task()
        task.ao_channels.add_ao_voltage_chan(name, min_val=-10, max_val=10)
        task.timing.cfg_samp_clk_timing(RATE_HZ, source, sample_mode=AcquisitionType.CONTINUOUS)
        if trigger:
            task.triggers.start_trigger.cfg_dig_edge_start_trig(trigger)
        task.out_stream.regen_mode = RegenerationMode.DONT_ALLOW_REGENERATION
        task.out_stream.output_buf_size = 8 * BLOCK
        if ahead:
            write(task, np.zeros(ahead * BLOCK))
        return task

    def close(self):
        for task in self.tasks:
            if task._handle is not None:
                task.close()
        self.channel.close()


def write(task, volts):
    return AnalogSingleChannelWriter(task.out_stream, auto_start=False).write_many_sample(volts, timeout=0.0)


def read(task, n, channels=1, timeout_s=0.0):
    data = np.empty((channels, n))
    AnalogMultiChannelReader(task.in_stream).read_many_sample(data, n, timeout=timeout_s)
    return data


def served(clock=None, **settings):
    server = DeviceServer(EmulatorSettings(wire="nidaqmx", bench=bench_with().model_dump(), **settings))
    if clock is not None:
        server.timeline.clock = clock
        server.timeline.tick = lambda: None
    return server


@pytest.fixture
def client():
    """A client of a server in lockstep."""
    with served(lockstep=True) as server:
        client = Client(server)
        yield client
        client.close()


@pytest.fixture
def clocked():
    """A client of a server that goes by a clock which the test turns."""
    clock = Clock()
    with served(clock) as server:
        client = Client(server)
        client.clock = clock
        yield client
        client.close()


def _passes(client, seconds):
    """Let time pass in steps that the server does not take for a pause of its own process."""
    steps = math.ceil(seconds / 0.005)
    for _ in range(steps):
        client.clock.now_s += seconds / steps
        with client.server.timeline.lock:
            client.server.timeline.advance()
            client.server.tasks.watchdogs.expire()


def _refused(code):
    return refused(nidaqmx.errors.DaqError, error_code=code)


def test_the_system_lists_chassis_modules_and_channels(client):
    devices = {device.name: device for device in System.remote(client.options).devices}
    assert devices["cDAQ1"].chassis_module_devices[0].product_type == "NI 9234"
    assert devices["cDAQ1Mod1"].ai_physical_chans.channel_names[-1] == "cDAQ1Mod1/ai3"
    assert devices["cDAQ1Mod3"].ao_voltage_rngs == [-10.0, 10.0]
    assert devices["cDAQ1Mod1"].ai_voltage_rngs == [-5.0, 5.0]
    assert devices["Dev1"].product_type == "PXIe-6356"
    assert all(device.is_simulated for device in devices.values())


@pytest.mark.parametrize(
    ("asked_hz", "taken_hz"), [(12800.0, 12800.0), (12000.0, 12800.0), (12801.0, 51200.0 / 3), (5000.0, 5120.0)]
)
def test_a_delta_sigma_module_takes_the_next_higher_rate_that_it_has(client, asked_hz, taken_hz):
    task = client.inputs(INPUT, rate_hz=asked_hz)
    task.control(TaskMode.TASK_COMMIT)
    assert task.timing.samp_clk_rate == pytest.approx(taken_hz, rel=1e-12)


@pytest.mark.parametrize("asked_hz", [1000.0, 60000.0])
def test_a_rate_beyond_the_module_is_refused(client, asked_hz):
    task = client.inputs(INPUT, rate_hz=asked_hz)
    with _refused(DAQmxErrors.INVALID_ATTRIBUTE_VALUE):
        task.control(TaskMode.TASK_VERIFY)


def test_a_multifunction_device_divides_its_timebase(client):
    task = client.inputs("Dev1/ai0", rate_hz=12345.0, range_v=10.0)
    task.control(TaskMode.TASK_COMMIT)
    assert task.timing.samp_clk_rate == pytest.approx(1e8 / math.floor(1e8 / 12345.0), rel=1e-12)
    assert task.ai_channels[0].ai_filter_delay == 0.0


def test_the_delay_of_the_filter_is_the_data_sheets(client):
    task = client.inputs(INPUT)
    task.control(TaskMode.TASK_COMMIT)
    assert task.ai_channels[0].ai_filter_delay == pytest.approx(38.4 / RATE_HZ + 3.2e-6, rel=1e-12)


@pytest.mark.parametrize(
    ("make", "code"),
    [
        (lambda c: c.inputs("cDAQ1Mod1/ai4"), DAQmxErrors.PHYSICAL_CHAN_DOES_NOT_EXIST),
        (lambda c: c.inputs("cDAQ9Mod1/ai0"), DAQmxErrors.INVALID_DEVICE_ID),
        (lambda c: c.inputs(INPUT, range_v=10.0), DAQmxErrors.INVALID_ATTRIBUTE_VALUE),
        (lambda c: c.inputs(INPUT, source="/cDAQ1/PFI0"), DAQmxErrors.ROUTE_NOT_SUPPORTED_BY_HW_ROUTING),
        (
            lambda c: c.inputs(INPUT, source="/cDAQ1/ai9/Clock"),
            DAQmxErrors.INVALID_ROUTING_SOURCE_TERMINAL_NAME_ROUTING,
        ),
        (lambda c: (c.inputs(INPUT).start(), c.inputs(INPUT))[1], DAQmxErrors.PAL_RESOURCE_RESERVED),
    ],
)
def test_what_a_device_cannot_do_is_refused_by_nis_code(client, make, code):
    with _refused(code):
        make(client).control(TaskMode.TASK_COMMIT)


def test_a_voltage_beyond_the_output_is_refused(client):
    with refused(nidaqmx.errors.DaqWriteError, error_code=-200561):
        write(client.output(1), np.full(BLOCK, 10.1))


def test_what_is_put_out_comes_back_after_the_delay_of_the_data_sheet(client):
    ai, ao = client.inputs(INPUT, LOOPBACK), client.output(1)
    ao.start()
    ai.start()
    assert np.all(read(ai, BLOCK, 2)[1] == 0.0)
    cycles_per_sample, n = 1.0 / 128.0, 16 * BLOCK
    sent = np.sin(2.0 * np.pi * cycles_per_sample * np.arange(n))
    came = []
    for block in sent.reshape(-1, BLOCK):
        write(ao, block)
        came.append(read(ai, BLOCK, 2)[1])
    settled = slice(4 * BLOCK, None)  # the filter is 77 samples long
    carrier = np.exp(-2j * np.pi * cycles_per_sample * np.arange(n))
    ratio = np.sum(np.concatenate(came)[settled] * carrier[settled]) / np.sum(sent[settled] * carrier[settled])
    assert -np.angle(ratio) / (2.0 * np.pi * cycles_per_sample) == pytest.approx(DELAY + HOLD, abs=1e-3)
    assert abs(ratio) == pytest.approx(1.0, abs=1e-3)


def test_an_ac_coupled_input_is_a_high_pass_of_half_a_hertz(client):
    ai, ao = client.inputs(INPUT, LOOPBACK), client.output(1)
    ai.ai_channels[1].ai_coupling = Coupling.AC
    ao.start()
    ai.start()
    read(ai, BLOCK, 2)
    came = []
    for _ in range(100):
        write(ao, np.ones(BLOCK))
        came.append(read(ai, BLOCK, 2)[1])
    b, a = butter(1, 0.5, "highpass", fs=RATE_HZ)
    decay = np.concatenate(came)[200:]
    assert decay[1:] / decay[:-1] == pytest.approx(-a[1], rel=1e-9)
    assert abs(freqz(b, a, [0.5], fs=RATE_HZ)[1][0]) == pytest.approx(math.sqrt(0.5), rel=1e-6)


def test_samples_are_in_order_and_by_channel(client):
    ai, ao = client.inputs(INPUT, LOOPBACK), client.output(2)
    ao.start()
    ai.start()
    ramp = np.arange(5 * BLOCK) / 1000.0
    write(ao, ramp)
    came = np.hstack([read(ai, 32, 2) for _ in range(14)])
    straight = came[1, 2 * BLOCK + 100 : 7 * BLOCK]
    assert np.diff(straight) == pytest.approx(1e-3, abs=2e-5)
    assert straight[0] == pytest.approx((100 - DELAY - HOLD) / 1000.0, abs=1e-4)


def test_the_loopback_cable_is_at_the_first_free_input_and_at_the_last(client):
    ai, ao = client.inputs(LOOPBACK, "cDAQ1Mod2/ai3"), client.output(2)
    ao.start()
    ai.start()
    write(ao, np.arange(4 * BLOCK) / 1000.0)
    came = read(ai, 6 * BLOCK, 2)
    assert came.any()
    np.testing.assert_array_equal(came[0], came[1])


def test_lockstep_gives_only_as_many_inputs_as_outputs_were_written(client):
    ai, ao = client.inputs(INPUT), client.output(2)
    ao.start()
    ai.start()
    read(ai, 2 * BLOCK)
    with refused(nidaqmx.errors.DaqReadError, error_code=-200284) as caught:
        read(ai, 1)
    assert caught.value.samps_per_chan_read == 0


def test_outputs_that_are_not_written_in_time_end_the_task_at_the_last_voltage(clocked):
    ai, ao = clocked.inputs(INPUT), clocked.output(1)
    write(ao, np.full(BLOCK, 2.5))
    ao.start()
    ai.start()
    _passes(clocked, 2 * BLOCK / RATE_HZ - 1e-6)
    write(ao, np.full(BLOCK, 1.5))  # just in time
    _passes(clocked, BLOCK / RATE_HZ + 2e-6)
    with refused(nidaqmx.errors.DaqWriteError, error_code=-200290):
        write(ao, np.zeros(BLOCK))
    assert clocked.server.timeline.held_v == 1.5
    read(ai, BLOCK)  # the inputs go on
    ao.stop()
    assert clocked.server.timeline.held_v == 1.5


def test_a_full_buffer_takes_no_more_until_samples_have_gone(clocked):
    ai, ao = clocked.inputs(INPUT), clocked.output(8)
    ao.start()
    ai.start()
    with refused(nidaqmx.errors.DaqWriteError, error_code=-200292):
        write(ao, np.zeros(BLOCK))
    _passes(clocked, BLOCK / RATE_HZ)
    assert write(ao, np.zeros(BLOCK)) == BLOCK


def test_inputs_that_are_not_fetched_in_time_are_lost(clocked):
    ai = clocked.inputs(INPUT)
    ai.in_stream.input_buf_size = 2 * BLOCK
    ai.start()
    _passes(clocked, 2 * BLOCK / RATE_HZ - 1e-6)
    read(ai, 1)
    _passes(clocked, 2 * BLOCK / RATE_HZ)
    with refused(nidaqmx.errors.DaqReadError, error_code=-200279):
        read(ai, 1)


def test_a_sample_exists_when_its_time_has_come(clocked):
    ai = clocked.inputs(INPUT)
    ai.start()
    _passes(clocked, (BLOCK - 1.1) / RATE_HZ)
    assert ai.in_stream.avail_samp_per_chan == BLOCK - 1
    _passes(clocked, 0.2 / RATE_HZ)
    assert ai.in_stream.avail_samp_per_chan == BLOCK


def test_a_pause_of_the_servers_own_process_is_not_the_hosts_fault(clocked):
    ai, ao = clocked.inputs(INPUT), clocked.output(2)
    ao.start()
    ai.start()
    clocked.clock.now_s += 1.0
    write(ao, np.zeros(BLOCK))
    assert clocked.server.counts["stalls"] == 1


def test_the_output_keeps_its_voltage_until_0_v_is_written_without_a_clock(client):
    ai, ao = client.inputs(INPUT), client.output(0)
    write(ao, np.full(BLOCK, 3.0))
    ao.start()
    ai.start()
    read(ai, BLOCK)
    zero = client.task()
    zero.ao_channels.add_ao_voltage_chan(OUTPUT, min_val=-10, max_val=10)
    with _refused(DAQmxErrors.PAL_RESOURCE_RESERVED):
        zero.write(0.0)
    ao.close()
    ai.close()
    assert client.server.timeline.held_v == 3.0
    zero.write(0.0)
    assert client.server.timeline.held_v == 0.0


def test_tasks_of_a_client_that_has_gone_are_freed_once_they_have_failed(clocked):
    ai, ao = clocked.inputs(INPUT), clocked.output(1)
    ao.start()
    ai.start()
    other = Client(clocked.server)
    with _refused(DAQmxErrors.PAL_RESOURCE_RESERVED):
        other.inputs(INPUT).control(TaskMode.TASK_COMMIT)
    _passes(clocked, 2 * BLOCK / RATE_HZ)
    other.tasks[-1].control(TaskMode.TASK_COMMIT)
    other.close()
    clocked.tasks.clear()


@pytest.mark.parametrize("code", [DAQmxErrors.DEV_CANNOT_BE_ACCESSED, DAQmxErrors.SAMPLES_NO_LONGER_AVAILABLE])
def test_an_error_is_raised_on_request(client, code):
    ai = client.inputs(INPUT)
    ai.start()
    client.server.calls.injections.append(Injection("ReadAnalogF64", code, after=2))
    read(ai, BLOCK)
    with _refused(code):
        read(ai, BLOCK)
    read(ai, BLOCK)


def test_teds_tells_maker_model_and_sensitivity(client):
    inputs = System.remote(client.options).devices["cDAQ1Mod1"].ai_physical_chans
    assert (inputs["ai1"].teds_mfg_id, inputs["ai1"].teds_model_num) == (18, 35224)  # PCB 352A24
    task = client.task()
    channel = task.ai_channels.add_teds_ai_accel_chan("cDAQ1Mod1/ai1")
    assert channel.ai_accel_sensitivity_units is AccelSensitivityUnits.MILLIVOLTS_PER_G
    assert channel.ai_accel_sensitivity == pytest.approx(10.2 * 9.80665)  # 10.2 mV per m/s^2
    with _refused(DAQmxErrors.TEDS_SENSOR_NOT_DETECTED):
        System.remote(client.options).devices["cDAQ1Mod2"].ai_physical_chans["ai3"].teds_mfg_id  # noqa: B018
    with _refused(DAQmxErrors.TEDS_NOT_SUPPORTED):
        System.remote(client.options).devices["Dev1"].ai_physical_chans["ai0"].teds_mfg_id  # noqa: B018


def test_two_devices_share_a_clock_line(client):
    ai = client.inputs("Dev1/ai0", f"Dev1/ai{SENSORS}", range_v=10.0, source="/Dev1/PFI0")
    ao = client.output(1, "Dev2/ao0", source="/Dev2/PFI0", trigger="/Dev1/ai/StartTrigger")
    ao.start()
    ai.start()
    read(ai, BLOCK, 2)
    write(ao, np.ones(BLOCK))
    assert read(ai, BLOCK, 2)[1, 2:] == pytest.approx(1.0)


def test_a_clock_that_does_not_come_leaves_the_reader_waiting(client):
    ai = client.inputs("Dev1/ai0", range_v=10.0, source="/Dev1/PFI7")
    ai.start()
    with refused(nidaqmx.errors.DaqReadError, error_code=-200284):
        read(ai, 1)


def _watchdog(client, timeout_s=0.1):
    watchdog = WatchdogTask("cDAQ1", timeout=timeout_s, grpc_options=client.options)
    watchdog.cfg_watchdog_ao_expir_states([AOExpirationState(OUTPUT, 0.0, WatchdogAOExpirState.VOLTAGE)])
    return watchdog


def test_most_chassis_have_no_watchdog(client):
    with _refused(DAQmxErrors.WATCHDOG_TIMER_NOT_SUPPORTED):
        _watchdog(client)


def test_a_watchdog_that_is_not_reset_puts_the_output_to_its_state_and_ends_the_tasks():
    clock = Clock()
    with served(clock, device_watchdog=True) as server:
        client = Client(server)
        client.clock = clock
        watchdog = _watchdog(client)
        watchdog.start()
        ai, ao = client.inputs(INPUT), client.output(0)
        write(ao, np.full(8 * BLOCK, 2.0))
        ao.start()
        ai.start()
        _passes(client, 0.09)
        assert server.timeline.held_v == 2.0
        watchdog.reset_timer()
        _passes(client, 0.09)
        assert not watchdog.expired
        _passes(client, 0.02)
        assert watchdog.expired
        assert server.timeline.held_v == 0.0
        with _refused(DAQmxErrors.CHASSIS_WATCHDOG_TIMER_EXPIRED):
            write(ao, np.zeros(BLOCK))
        watchdog.close()
        client.close()


def test_a_watchdog_is_not_started_while_tasks_run():
    with served(lockstep=True, device_watchdog=True) as server:
        client = Client(server)
        watchdog = _watchdog(client)
        watchdog.control(TaskMode.TASK_COMMIT)
        client.inputs(INPUT).start()
        with _refused(DAQmxErrors.CANT_RESERVE_WATCHDOG_TASK_WHILE_OTHER_TASKS_RESERVED):
            watchdog.start()
        watchdog.close()
        client.close()


def test_the_log_has_what_the_output_did(tmp_path):
    log = tmp_path / "output.log"
    with served(lockstep=True, log_output=log) as server:
        client = Client(server)
        ai, ao = client.inputs(INPUT), client.output(0)
        write(ao, np.linspace(0.0, 2.0, BLOCK))
        ao.start()
        ai.start()
        read(ai, BLOCK)
        client.close()
    lines = np.loadtxt(log)
    assert lines[:, 2].max() == 2.0
    assert np.all(np.diff(lines[:, 0]) >= 0.0)


def test_a_call_that_is_not_answered_is_named():
    calls = []
    server = DeviceServer(EmulatorSettings(wire="nidaqmx", bench=bench_with().model_dump()), on_call=calls.append)
    with server:
        client = Client(server)
        with pytest.raises(nidaqmx.errors.RpcError):
            client.task().add_global_channels([])
        client.close()
    assert "not implemented: AddGlobalChansToTask" in calls
