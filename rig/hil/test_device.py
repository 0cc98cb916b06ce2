"""The device in open loop: its life cycle, rest after a stop, the same answer twice."""

import numpy as np

from rig.bench import Bench
from rig.daq import DAQ, LOST, State

PART = 0.02  # of the largest voltage
SECONDS = 0.5  # of a run; chosen


def _driven(daq: DAQ, bench: Bench, amplitude_v: float) -> np.ndarray:
    """The inputs while a sine below resonance is put out."""
    calls = int(SECONDS * bench.sample_rate_hz / bench.block)
    time_s = np.arange(calls * bench.block) / bench.sample_rate_hz
    voltages = amplitude_v * np.sin(2.0 * np.pi * 0.8 * bench.specimen.linear_frequency_hz * time_s)
    inputs = []
    for block in voltages.reshape(calls, bench.block):
        inputs.append(daq.exchange(block.copy()))
        assert not (daq.flags & LOST).any(), "samples were lost"
    return np.vstack(inputs)


def test_the_device_starts_stops_and_starts_again(rig_daq: DAQ, rig_bench: Bench) -> None:
    """And says how late its output shows."""
    for _ in range(2):
        rig_daq.start(rig_bench.block)
        assert rig_daq.latency_samples >= 0.0
        inputs = rig_daq.exchange(np.zeros(rig_bench.block))
        assert inputs.shape == (rig_bench.block, len(rig_bench.channels))
        rig_daq.stop()
        assert rig_daq.state is State.OPEN


def test_no_reading_is_at_the_end_of_its_range_while_nothing_moves(rig_daq: DAQ, rig_bench: Bench) -> None:
    """Nor anything but a number."""
    rig_daq.start(rig_bench.block)
    inputs = _driven(rig_daq, rig_bench, 0.0)
    assert np.isfinite(inputs).all()
    for channel, column in zip(rig_bench.channels, inputs.T, strict=True):
        assert np.abs(column).max() < rig_bench.limits.overload_fraction * channel.range_v, channel.name


def test_the_same_output_is_answered_alike_and_a_stop_leaves_nothing_on_it(rig_daq: DAQ, rig_bench: Bench) -> None:
    """Force driven, twice, and at rest: bit for bit on a device that repeats itself."""
    amplitude_v = PART * rig_bench.limits.voltage_v
    force = rig_bench.index_of("force")
    answers = []
    for level in (amplitude_v, amplitude_v, 0.0):
        rig_daq.start(rig_bench.block)
        answers.append(_driven(rig_daq, rig_bench, level))
        rig_daq.stop()
    first, second, rest = (float(np.std(answer[answer.shape[0] // 2 :, force])) for answer in answers)
    assert abs(second / first - 1.0) < 0.2
    assert rest < 0.5 * first
    if rig_daq.capabilities.repeatable:
        np.testing.assert_array_equal(answers[0], answers[1])
