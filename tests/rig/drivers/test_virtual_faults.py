"""Passing faults of the virtual device: outputs that are held, samples that are lost."""

import numpy as np
import pytest

from rig.daq import LOST, Channel
from rig.drivers import make_daq
from rig.drivers.virtual.faults import OUTPUT_CONTINUED, OUTPUT_HELD
from rig.emulator.emulated import emulated
from rig.emulator.plant import VirtualPlant
from rig.errors import ConfigurationError
from rig.loop.loop import Loop
from rig.tick.layout import DEVICE_SHIFT
from tests.refused import refused
from tests.rig.rigs import bench_with, tick_for

FAULTS = {"held_per_s": 2.0, "held_s": 0.004, "lost_per_s": 3.0, "lost_s": 0.002, "late_per_s": 5.0, "late_s": 0.01}
LOOPBACK = {"name": "out", "role": "monitor", "unit": "V", "sensitivity_v_per_unit": 1.0, "loopback": True}
SINE = 6000  # period of the sine that is continued, in hundredths of a sample


def exchanged(faults, block, seed=1, n=8400, **changes):
    """Inputs, flags and counters of a run in blocks; the output is its own sample number."""
    with make_daq(bench_with({"block": 14, **changes}, faults=faults), seed) as daq:
        daq.start(block)
        inputs, flags = [], []
        for first in range(0, n, block):
            inputs.append(daq.exchange(1e-5 * np.arange(first, first + block)))
            flags.append(daq.flags.copy())
        return np.concatenate(inputs), np.concatenate(flags), daq.counters


@pytest.mark.parametrize("block", [1, 14, 50])
@pytest.mark.parametrize("wear", [{}, {"frequency_per_s": [-0.01], "until_s": 2.0, "every_s": 0.113}])
def test_fused_and_exchanged_runs_agree_bit_for_bit(block, wear):
    rows, counted = [], []
    bench = bench_with({"block": block, "limits": {"lost_s": 1.0}}, faults=FAULTS, queue_blocks=1, wear=wear)
    for fused in (True, False):
        with make_daq(bench, 3) as daq:
            daq.start(block)
            tick = tick_for(bench, block + daq.latency_samples, 0.3)
            rows.append(np.concatenate([*Loop(daq, tick, fused=fused).run()]))
            counted.append(daq.counters)
    shortest = min(part.size for part in rows)
    flags = rows[0]["flags"][:shortest] >> DEVICE_SHIFT
    assert np.count_nonzero(flags & OUTPUT_HELD) > 40
    assert np.count_nonzero(flags & OUTPUT_CONTINUED) > 40
    assert np.count_nonzero(flags & LOST) > 40
    for name in rows[0].dtype.names:
        np.testing.assert_array_equal(rows[0][name][:shortest], rows[1][name][:shortest])
    assert counted[0]["lost_samples"] == np.count_nonzero(flags & LOST)


def test_faults_do_not_depend_on_how_the_samples_are_cut_into_blocks():
    inputs, flags, _ = exchanged(FAULTS, 1)
    for block in (7, 14, 600):
        other, raised, _ = exchanged(FAULTS, block)
        np.testing.assert_array_equal(raised, flags)
        np.testing.assert_array_equal(other, inputs)


def test_faults_are_those_of_the_seed():
    flags = [exchanged(FAULTS, 14, seed)[1] for seed in (1, 1, 2)]
    np.testing.assert_array_equal(flags[0], flags[1])
    assert not np.array_equal(flags[0], flags[2])


def test_without_faults_the_readings_are_those_of_a_device_that_has_none():
    inputs, flags, counters = exchanged({}, 14)
    assert not flags.any()
    assert counters["output_held"] == counters["lost_samples"] == 0
    with make_daq(bench_with(), 1) as daq:
        daq.start(8400)
        np.testing.assert_array_equal(daq.exchange(1e-5 * np.arange(8400)), inputs)


def test_faults_last_whole_blocks_and_come_as_often_as_they_should():
    held_only = {"held_per_s": 5.0, "held_s": 0.0056}  # two blocks of 14 samples at 5 kHz
    _, flags, counters = exchanged(held_only, 14, n=280_000)
    held = (flags & OUTPUT_HELD) != 0
    edges = np.flatnonzero(np.diff(held.astype(int)))
    assert np.all((edges + 1) % 28 == 0)
    share = 1.0 - np.exp(-5.0 * 0.0056)  # at least one arrival of a Poisson process in a slot
    assert held.mean() == pytest.approx(share, abs=4.0 * np.sqrt(share / 10_000))
    assert counters["output_held"] == held.sum()


def test_a_held_output_is_the_last_one_and_the_late_ones_are_dropped():
    channels = [*bench_with().model_dump()["channels"], LOOPBACK]
    inputs, flags, _ = exchanged({"held_per_s": 20.0, "held_s": 0.0028}, 14, channels=channels)
    held = (flags & OUTPUT_HELD) != 0
    expected = 1e-5 * np.arange(flags.size)
    for index in np.flatnonzero(held):
        expected[index] = expected[index - 1] if index else 0.0
    assert 0 < held.sum() < held.size
    # The loopback reads half a sample of hold and the filters' delay late, linearly between two samples.
    with make_daq(bench_with()) as daq:
        delay = 0.5 + daq.filter_delay_samples
    late = np.interp(np.arange(expected.size) - delay, np.arange(expected.size), expected)
    np.testing.assert_allclose(inputs[20:, -1], late[20:], atol=1e-12)


def sine_exchanged(faults, stated=SINE / 100, n=28_000, block=14):
    """Loopback and flags of a run whose output is a sine, and what the driver tells of the converter."""
    channels = [*bench_with().model_dump()["channels"], LOOPBACK]
    sine = np.sin(2.0 * np.pi * np.arange(n) / (SINE / 100))
    with make_daq(bench_with({"block": block, "channels": channels}, faults=faults), 1) as daq:
        daq.start(block)
        seen, flags, told = [], [], []
        for first in range(0, n, block):
            daq.continuation["period_samples"] = stated
            seen.append(daq.exchange(sine[first : first + block])[:, -1])
            flags.append(daq.flags.copy())
            told.append(daq.put_out.copy())
        delay = 0.5 + daq.filter_delay_samples
    return np.concatenate(seen), np.concatenate(flags), np.concatenate(told), sine, delay


def test_late_outputs_of_a_known_period_go_on_as_they_would_have_and_the_driver_tells_what_was_put_out():
    """The loopback is an independent witness; the sine itself is the truth, within the error of a cubic."""
    seen, flags, told, sine, delay = sine_exchanged({"late_per_s": 20.0, "late_s": 0.0112})
    continued = (flags & OUTPUT_CONTINUED) != 0
    assert 0.1 < continued.mean() < 0.3
    assert np.count_nonzero(flags & OUTPUT_HELD) < 100  # before a whole period was out
    np.testing.assert_array_equal(np.isfinite(told), flags != 0)
    np.testing.assert_allclose(told[continued], sine[continued], atol=0.0234 * (2.0 * np.pi / 60.0) ** 4 + 2e-6)
    out = np.where(np.isfinite(told), told, sine)
    late = np.interp(np.arange(out.size) - delay, np.arange(out.size), out)
    np.testing.assert_allclose(seen[20:], late[20:], atol=1e-12)


def test_late_outputs_without_a_period_are_held():
    _, flags, told, _, _ = sine_exchanged({"late_per_s": 20.0, "late_s": 0.0112}, stated=0.0)
    assert not np.any(flags & OUTPUT_CONTINUED)
    held = np.flatnonzero(flags & OUTPUT_HELD)
    again = held[np.isin(held - 1, held)]
    np.testing.assert_array_equal(told[again], told[again - 1])


def test_rows_hold_what_was_put_out_in_place_of_a_late_output():
    """The loopback reads the converter; a row's output is that which shows in its readings."""
    bench = bench_with({"block": 14}, faults={"late_per_s": 20.0, "late_s": 0.0112}, queue_blocks=2)
    bench = bench.model_copy(update={"channels": (*bench.channels, Channel(**LOOPBACK))})
    with make_daq(bench, 2) as daq:
        daq.start(14)
        tick = tick_for(bench, 14 + daq.latency_samples, 0.5)
        rows = np.concatenate([*Loop(daq, tick).run()])
        late = 0.5 + daq.filter_delay_samples
    continued = (rows["flags"] >> DEVICE_SHIFT & OUTPUT_CONTINUED) != 0
    assert np.count_nonzero(continued) > 500
    shift = late - int(late)  # the whole samples are in the row already
    put_out = rows["output_v"].astype(float)
    np.testing.assert_allclose(rows["inputs"][1:, -1], (1.0 - shift) * put_out[1:] + shift * put_out[:-1], atol=3e-7)
    assert np.ptp(put_out[-8000:-6000]) > 0.5  # it is driven


def test_lost_samples_are_rows_of_no_numbers_and_the_others_are_untouched():
    whole, _, _ = exchanged({}, 14)
    inputs, flags, counters = exchanged({"lost_per_s": 3.0, "lost_s": 0.0028}, 14)
    lost = (flags & LOST) != 0
    assert np.isnan(inputs[lost]).all()
    np.testing.assert_array_equal(inputs[~lost], whole[~lost])
    assert counters["lost_samples"] == lost.sum() > 0


def test_an_emulated_device_holds_the_same_outputs_with_the_flag_of_the_wire():
    bench = bench_with({"block": 14}, faults={"held_per_s": 20.0, "held_s": 0.0056})
    with emulated(bench, lockstep=True, seed=1) as reached, make_daq(reached) as daq:
        daq.start(14)
        raised = []
        for _ in range(300):
            daq.exchange(np.zeros(14))
            raised.append(daq.flags.copy())
    _, flags, _ = exchanged({"held_per_s": 20.0, "held_s": 0.0056}, 14, n=300 * 14)
    np.testing.assert_array_equal(np.concatenate(raised) == 4, flags == OUTPUT_HELD)
    assert flags.any()


def test_an_emulated_device_refuses_late_outputs_that_are_drawn():
    bench = bench_with({"block": 14}, faults={"late_per_s": 1.0})
    with refused(ConfigurationError, field="driver.options.faults.late_per_s", value=1.0):
        VirtualPlant(bench)


@pytest.mark.parametrize(
    ("faults", "line"),
    [
        ({"held_per_s": -1.0}, {"field": "faults.held_per_s", "value": -1.0}),
        ({"lost_s": 0.0}, {"field": "faults.lost_s", "value": 0.0}),
        ({"sticky": 1.0}, {"field": "faults.sticky"}),
    ],
)
def test_faults_that_are_none_are_refused_by_name(faults, line):
    with refused(ConfigurationError, **line):
        make_daq(bench_with(faults=faults))
