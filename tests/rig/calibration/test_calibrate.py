"""`rig calibrate` over cables with known high-passes, gains and delays: the bench then takes the true phases out."""

import json
import math

import numpy as np
import pytest
from scipy import signal

from rig.bench import Bench, load_bench
from rig.daq import DAQ, Capabilities
from rig.loop import session
from rig.recording.reader import Recording

RATE_HZ = 12000.0
GAINS = 1.0, -1.02, 0.98, 1.0
DELAYS = 0, 0, 1, 0
CORNERS_HZ = 2.0, 5.0, 10.0, 1.0
OUTPUT_HZ = 5.0
LATENCY = 64
FULL_SCALE_V = 10.0
TRUE_VOLTS = 1.3
"""Volts on the output for each that the bench believes."""

BENCH = """
name = "cables"
sample_rate_hz = 12000.0
block = 64
output_range_v = 5.0

[driver]
name = "cables"

[limits]
voltage_v = 5.0
force_n = 40.0
acceleration_m_s2 = 400.0
displacement_m = 1.0
frequency_hz = [8.0, 600.0]

[specimen]
name = "none"
linear_frequency_hz = 25.0

[[channels]]
name = "force"
role = "force"
sensitivity = "112.4 mV/N"
high_pass_hz = 0.3

[[channels]]
name = "drive"
role = "drive"
sensitivity_v_per_unit = 0.0102

[[channels]]
name = "tip"
role = "response"
sensitivity_v_per_unit = 0.0102

[[channels]]
name = "cable"
role = "monitor"
unit = "V"
sensitivity_v_per_unit = 1.0
loopback = true
"""


class Cables(DAQ):
    """Cables from the output to every input but those in ``cut``, with a first-order high-pass in each."""

    wall_clock = False
    cut: tuple[int, ...] = ()

    def __init__(self, bench, seed=0):
        super().__init__(bench.channels, bench.sample_rate_hz, bench.output_range_v)
        self.filters = [signal.butter(1, corner, "high", fs=RATE_HZ) for corner in (OUTPUT_HZ, *CORNERS_HZ)]

    @property
    def capabilities(self):
        return Capabilities(largest_block=4096, paced=False, virtual=True, repeatable=True)

    @property
    def latency_samples(self):
        return float(LATENCY)

    def _open(self):
        pass

    _stop = _close = _open

    def _start(self):
        self.states = [np.zeros(1) for _ in self.filters]
        self.sent = np.zeros(LATENCY + max(DELAYS))

    def _exchange(self, voltages, inputs):
        out, self.states[0] = signal.lfilter(*self.filters[0], voltages, zi=self.states[0])
        self.sent = np.concatenate((self.sent, out))
        n = voltages.size
        for column, (gain, delay) in enumerate(zip(GAINS, DELAYS, strict=True)):
            late = self.sent[self.sent.size - n - LATENCY - delay : self.sent.size - LATENCY - delay]
            read, self.states[1 + column] = signal.lfilter(*self.filters[1 + column], late, zi=self.states[1 + column])
            inputs[:, column] = gain * read * (0.002 if column in self.cut else 1.0)
        self.sent = self.sent[-(LATENCY + max(DELAYS)) :]


@pytest.fixture
def cables(monkeypatch, tmp_path):
    monkeypatch.setattr(session, "make_daq", Cables)
    monkeypatch.setattr(Cables, "cut", ())
    (tmp_path / "bench.toml").write_text(BENCH)
    monkeypatch.chdir(tmp_path)
    return Cables


def test_the_bench_that_is_written_takes_the_true_phases_out(cables, command):
    said = command("calibrate", "bench.toml", "-o", "calibrated.toml").succeeded().out
    assert "polarity reversed" in said
    bench = load_bench("calibrated.toml")
    assert isinstance(bench, Bench)
    own = 0.3, 0.0, 0.0, 0.0  # of the sensors
    for index, channel in enumerate(bench.channels):
        for frequency_hz in (10.0, 25.0, 100.0):
            ours = math.atan(channel.high_pass_hz / frequency_hz) + math.atan(channel.input_high_pass_hz / frequency_hz)
            true = math.atan(CORNERS_HZ[index] / frequency_hz) + math.atan(own[index] / frequency_hz)
            assert math.degrees(abs(ours - true)) < 0.2, channel.name
    assert [channel.skew_samples for channel in bench.channels] == pytest.approx([0.0, 0.0, 1.0, 0.0], abs=0.005)
    assert bench.channels[1].sensitivity_v_per_unit == -0.0102
    assert bench.channels[0].sensitivity_v_per_unit == pytest.approx(0.1124)
    assert bench.driver.options["output_high_pass_hz"] == pytest.approx(OUTPUT_HZ, abs=0.02)
    assert bench.driver.options["calibrated"]


def test_an_input_without_a_cable_keeps_what_it_had(cables, command, monkeypatch):
    monkeypatch.setattr(Cables, "cut", (0,))
    said = command("calibrate", "bench.toml", "-o", "calibrated.toml").succeeded().out
    assert "crosstalk -54 dB" in said
    assert load_bench("calibrated.toml").channels[0].high_pass_hz == 0.3
    assert load_bench("calibrated.toml").channels[0].input_high_pass_hz == 0.0


def test_no_cable_at_all_is_said(cables, command, monkeypatch):
    monkeypatch.setattr(Cables, "_exchange", lambda self, voltages, inputs: inputs.fill(0.0))
    said = command("calibrate", "bench.toml", "-o", "calibrated.toml")
    assert said.status == 1
    assert "check the cables" in said.err


def test_a_calibrated_bench_is_calibrated_anew_from_its_base(cables, command, tmp_path):
    command("calibrate", "bench.toml", "-o", "calibrated.toml").succeeded()
    command("calibrate", "calibrated.toml", "-o", "again.toml").succeeded()
    assert (tmp_path / "again.toml").read_text() == (tmp_path / "calibrated.toml").read_text()


def test_what_begins_from_a_calibrated_bench_is_not_calibrated(cables, command, tmp_path):
    command("calibrate", "bench.toml", "-o", "calibrated.toml").succeeded()
    (tmp_path / "mine.toml").write_text('base = "calibrated.toml"\n')
    said = command("calibrate", "mine.toml", "-o", "again.toml")
    assert said.status == 1
    assert "it was made of" in said.err


def test_a_reading_behind_the_high_pass_gives_the_volts_before_it(cables, command, tmp_path):
    options = f"{{ output_full_scale_v = {FULL_SCALE_V}, input_full_scale_v = {FULL_SCALE_V} }}"
    (tmp_path / "bench.toml").write_text(
        BENCH.replace('name = "cables"\n\n[l', f'name = "cables"\noptions = {options}\n\n[l')
    )
    found = json.loads(command("calibrate", "bench.toml", "-o", "first.toml", "--json").succeeded().out)
    with Recording(tmp_path / "first.h5") as recording:
        sent = recording.parts[-1].rows("output_v").astype(float)
    sent = sent[-3 * int(RATE_HZ) : -int(RATE_HZ)]  # whole periods of the steady signal
    passed = signal.lfilter(*signal.butter(1, OUTPUT_HZ, "high", fs=RATE_HZ), np.tile(sent, 2))[sent.size :]
    reading = TRUE_VOLTS * np.sqrt(np.mean(passed**2))
    assert reading < 0.999 * TRUE_VOLTS * found["rms_v"]
    command("calibrate", "bench.toml", "-o", "again.toml", "--rms-v", str(reading)).succeeded()
    options = load_bench("again.toml").driver.options
    assert options["output_full_scale_v"] == pytest.approx(TRUE_VOLTS * FULL_SCALE_V, rel=3e-4)
    for full_scale_v, gain in zip(options["input_full_scale_v"], GAINS, strict=True):
        assert full_scale_v == pytest.approx(TRUE_VOLTS * FULL_SCALE_V / abs(gain), rel=3e-4)


def test_a_voltage_beyond_the_limits_is_refused_by_its_option(cables, command):
    said = command("calibrate", "bench.toml", "-o", "calibrated.toml", "--voltage", "4")
    assert said.status == 1
    assert "--voltage = 4 V" in said.err
