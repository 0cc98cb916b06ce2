"""The driver of NI devices under the contract, over the emulated device server in lockstep."""

from collections.abc import Iterator

import numpy as np
import pytest
from nidaqmx.error_codes import DAQmxErrors
from scipy.signal import butter, lfilter

from rig.bench import Bench
from rig.conformance import DriverContract
from rig.daq import DAQ
from rig.drivers.nidaqmx.driver import NiDaqmxDAQ
from rig.drivers.virtual import VirtualDAQ
from rig.emulator.nidaqmx.devices import NI_9234
from rig.emulator.nidaqmx.faults import Injection
from rig.emulator.nidaqmx.timeline import HOLD_SAMPLES, converter_of
from tests.rig.drivers.nidaqmx.test_driver import Served, served


def delayed(samples: np.ndarray, by: float) -> np.ndarray:
    """Samples [n] of a signal without a mean, later by a number of samples that need not be whole: a turn of their spectrum."""
    n = 2 * samples.size
    turned = np.fft.rfft(samples, n) * np.exp(-2j * np.pi * np.fft.rfftfreq(n) * by)
    return np.asarray(np.fft.irfft(turned, n)[: samples.size])


@pytest.fixture(scope="module")
def chassis() -> Iterator[Served]:
    with served() as one:
        yield one


class TestOverADeviceServer(DriverContract):
    """Each call takes some milliseconds, so that blocks are few and large."""

    blocks = (16, 64)
    long_run_blocks = late_blocks = 100
    late_s = prompt_s = 10.0  # the server is in this process, on a machine that the tests keep busy

    @pytest.fixture(autouse=True)
    def _chassis(self, chassis: Served) -> Iterator[None]:
        self.chassis = chassis
        yield
        chassis.server.calls.injections.clear()

    def make(self) -> DAQ:
        return NiDaqmxDAQ(self.chassis.bench())

    def bench_for_another_process(self) -> Bench:
        return self.chassis.bench()

    def known_inputs(self, outputs: np.ndarray, block: int) -> np.ndarray:
        """What the rig without any device reads, later by the filters of an NI 9234, the sensors through its AC coupling."""
        virtual, rate_hz = self.chassis.virtual, self.chassis.bench().sample_rate_hz
        options = virtual.driver.options | {"converter": converter_of(NI_9234, virtual.output_range_v, rate_hz)}
        driver = virtual.driver.model_copy(update={"options": options})
        outputs = outputs[: outputs.size // block * block]
        with VirtualDAQ(virtual.model_copy(update={"sample_rate_hz": rate_hz, "driver": driver})) as daq:
            daq.start(block)
            read = np.vstack([daq.exchange(part.copy()) for part in outputs.reshape(-1, block)])
            late = NI_9234.delay_samples + NI_9234.delay_s * rate_hz
            sensors = late - daq.filter_delay_samples
        passed = lfilter(*butter(1, NI_9234.high_pass_hz, "highpass", fs=rate_hz), read[:, :-1], axis=0)
        columns = [delayed(column, sensors) for column in passed.T]
        return np.column_stack([*columns, delayed(outputs, late + HOLD_SAMPLES)])

    def witness(self, daq: DAQ | None) -> float | None:
        return abs(self.chassis.output_v)

    def unplug(self, daq: DAQ) -> bool:
        gone = DAQmxErrors.DEV_ABSENT_OR_UNAVAILABLE
        for call in ("ReadAnalogF64", "WriteAnalogF64"):  # the server, which is not gone, lets its tasks go
            self.chassis.server.calls.injections.append(Injection(call, gone, times=1_000_000))
        return True


del DriverContract
