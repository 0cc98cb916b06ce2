"""Outputs in whole bits whose rounding is fed back into the next one."""

import numpy as np
import pytest

from rig.measurements import point_rows
from rig.tick.kernels import with_shaped_rounding
from rig.tick.layout import LOOP
from tests.recorded import recorded_run
from tests.rig.rigs import bench_with

BIT = 0.01


def shaped(values, largest_v=10.0):
    loop = np.zeros(1, LOOP)
    loop["output_bit_v"] = BIT
    return np.array([with_shaped_rounding(loop[0], value, largest_v) for value in values]), loop


def test_outputs_are_whole_bits_that_follow_within_one():
    rng = np.random.default_rng(5)
    wanted = rng.uniform(-1.0, 1.0, 2000)
    out, _ = shaped(wanted)
    assert np.allclose(out / BIT, np.rint(out / BIT), atol=1e-9)
    assert np.max(np.abs(out - wanted)) <= BIT * (1.0 + 1e-9)


def test_the_error_of_a_slow_sine_has_no_mean_and_little_at_low_frequencies():
    """The sum of all errors stays within half a bit, which is error feedback of first order."""
    wanted = 0.2 * np.sin(2.0 * np.pi * 0.00731 * np.arange(20_000)) + 0.003
    out, _ = shaped(wanted)
    assert np.max(np.abs(np.cumsum(out - wanted))) <= 0.5 * BIT * (1.0 + 1e-6)
    plain = BIT * np.round(wanted / BIT) - wanted
    assert np.max(np.abs(np.cumsum(plain))) > 10.0 * BIT


def test_0_v_is_0_v_and_forgets_what_was_left():
    out, loop = shaped([0.004, 0.0, 0.0])
    assert out.tolist() == [0.0, 0.0, 0.0]
    assert loop["rounding_v"][0] == 0.0


def test_no_output_goes_beyond_the_limit():
    out, loop = shaped(np.full(1000, 0.0497), largest_v=0.0499)
    assert np.max(out) < 0.045
    assert abs(loop["rounding_v"][0]) <= BIT
    out, _ = shaped([-0.0497], largest_v=0.0499)
    assert out.tolist() == [pytest.approx(-0.04)]


def test_a_run_with_it_puts_out_whole_bits_and_has_a_purer_force():
    """The magnet beam at a level of some 40 bits: lines of the force between its harmonics, beside a run without."""
    bench = bench_with({"output_resolution_v": 20.0 / 4096.0}, converter={"dac_bits": 12})
    lines = {}
    for shapes in (True, False):
        run = recorded_run("magnet-beam/backbone", bench, levels_v=[0.2], noise_shaping=shapes)
        (point,) = run.recording.latest.values()
        output = point_rows(run.recording, 0)["output_v"].astype(float)
        bits = output / bench.output_bit_v
        assert bool(np.max(np.abs(bits - np.rint(bits))) < 1e-3) == shapes
        assert point["quality"] in ("good", "warned")
        lines[shapes] = point["nonharmonic_force"]
    assert lines[True] < 0.2 * lines[False]
