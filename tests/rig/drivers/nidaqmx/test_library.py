"""The driver through NI's C interface: a library with the calls that it makes takes them in the types of NI's reference.

Over gRPC a number is a number; in C an argument of another type is another value. The library is compiled here and is found
where NI's would be.
"""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("nidaqmx")

import nidaqmx._lib as ni_library

from rig.drivers import make_daq
from rig.errors import DaqDisconnected, DaqRefused
from tests.refused import refused
from tests.rig.rigs import bench_with

RATE_HZ, BLOCK, AHEAD = 12_500.0, 50, 2
AC, INTERNAL, CURRENT, SECONDS, NO_REGENERATION = 10045, 10200, 10134, 10364, 10158
"""Values of NI-DAQmx (NIDAQmx.h)."""
DEFAULT_TERMINAL, VOLTS, RISING, CONTINUOUS, COMMIT = -1, 10348, 10280, 10123, 3
BY_CHANNEL = 0


@pytest.fixture(scope="module")
def compiled(tmp_path_factory):
    if not shutil.which("cc"):
        pytest.skip("no compiler")
    path = tmp_path_factory.mktemp("library") / "libnidaqmx.so"
    source = Path(__file__).with_name("nidaqmx_stub.c")
    command = ["cc", "-std=c11", "-O1", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC", str(source), "-o", str(path)]
    subprocess.run(command, check=True)
    return path


@pytest.fixture
def calls(compiled, monkeypatch, tmp_path):
    """What the library was called with: a function that returns the lines."""
    monkeypatch.setattr(ni_library, "find_library", lambda name: str(compiled) if name == "nidaqmx" else None)
    monkeypatch.setattr(ni_library, "lib_importer", ni_library.lib_importer)
    ni_library.lib_importer._import_lib()
    path = tmp_path / "calls.txt"
    ni_library.lib_importer.cdll.stub_open(str(path).encode())
    yield lambda: path.read_text(encoding="utf-8").splitlines()
    ni_library.lib_importer._cdll = ni_library.lib_importer._windll = None


def _bench(**options):
    table = {
        "output": "Dev1/ao0",
        "inputs": ["Dev1/ai0", "Dev1/ai1"],
        "buffer_blocks": AHEAD,
        "queue_blocks": 1,
        "lockstep": True,
        "timeout_s": 5.0,
        "watchdog_s": 1.0,
        "ramp_s": 0.01,
        **options,
    }
    bench = bench_with({"sample_rate_hz": RATE_HZ, "block": BLOCK})
    driver = bench.driver.model_copy(update={"name": "nidaqmx", "options": table})
    return bench.model_copy(update={"driver": driver, "channels": bench.channels[:2]})


def test_every_call_has_the_types_and_values_of_nis_reference(calls):
    with make_daq(_bench(coupling="AC", excitation_ma=2.0)) as daq:
        daq.start(BLOCK)
        sent = np.random.default_rng(1).uniform(-1.0, 1.0, (8, BLOCK))
        came = np.vstack([daq.exchange(block) for block in sent])
    late = (1 + AHEAD) * BLOCK
    expected = np.concatenate(sent)[:-late]
    np.testing.assert_array_equal(came[late:, 0], expected)
    np.testing.assert_array_equal(came[late:, 1], 2.0 * expected)
    said = calls()
    assert not [line for line in said if line.startswith("unknown")]
    buffered = (AHEAD + 4) * BLOCK
    kept = 4 * round(RATE_HZ)
    for line in (
        "CreateTask ''",
        f"CreateAIVoltageChan Dev1/ai0 '' {DEFAULT_TERMINAL} -5 5 {VOLTS} ''",
        f"CreateAOVoltageChan Dev1/ao0 '' -10 10 {VOLTS} ''",
        f"SetChanAttribute Dev1/ai0 0x64 {AC}",
        f"SetChanAttribute Dev1/ai1 0x17f4 {INTERNAL}",
        f"SetChanAttribute Dev1/ai1 0x17f6 {CURRENT}",
        "SetChanAttribute Dev1/ai1 0x17f5 0.002",
        f"CfgSampClkTiming i '' 12500 {RISING} {CONTINUOUS} {kept}",
        f"CfgSampClkTiming o '/Dev1/ai/SampleClock' 12500 {RISING} {CONTINUOUS} {buffered}",
        f"SetBufferAttribute i 0x186c {kept}",
        f"SetBufferAttribute o 0x186d {buffered}",
        f"SetWriteAttribute o 0x1453 {NO_REGENERATION}",
        f"CfgDigEdgeStartTrig o /Dev1/ai/StartTrigger {RISING}",
        f"TaskControl i {COMMIT}",
        f"TaskControl o {COMMIT}",
        f"SetChanAttribute Dev1/ai0 0x3071 {SECONDS}",
        f"ReadAnalogF64 {BLOCK} 5 {BY_CHANNEL} {2 * BLOCK} NULL",
        f"WriteAnalogF64 {BLOCK} 0 5 {BY_CHANNEL} NULL",
        "WriteAnalogScalarF64 1 10 0 NULL",
    ):
        assert line in said
    assert said.index("StartTask o") < said.index("StartTask i")


def test_an_error_of_the_library_becomes_one_of_ours_with_its_code(calls):
    with refused(DaqDisconnected), make_daq(_bench(output="Dev2/ao0")):
        pass


def test_without_the_library_it_is_said_what_to_install(monkeypatch):
    monkeypatch.setattr(ni_library, "find_library", lambda name: None)
    monkeypatch.setattr(ni_library.lib_importer, "_cdll", None)
    monkeypatch.setattr(ni_library.lib_importer, "_windll", None)
    with refused(DaqRefused), make_daq(_bench()):
        pass
