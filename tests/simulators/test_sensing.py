import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from simulators.layout import CHANNEL, CONVERTER, Flag
from simulators.sensing.kernels import condition, quantise
from simulators.sensing.parts import Sensor
from simulators.simulation import Simulation
from simulators.stepping import run_open_loop, sample
from simulators.virtual_rig import VirtualRig
from tests.simulators.references import ideal

STEP_V = 20.0 / 2**16


@given(st.floats(-12.0, 12.0))
def test_quantised_voltage_is_a_code_within_half_a_step(volts: float) -> None:
    coded = quantise(volts, STEP_V, 10.0)
    assert coded / STEP_V == round(coded / STEP_V)
    assert -10.0 <= coded <= 10.0 - STEP_V
    if -10.0 <= volts <= 10.0 - STEP_V:
        assert abs(coded - volts) <= STEP_V / 2


def test_sixteen_bits_are_what_the_data_sheets_of_the_sensors_make_of_them() -> None:
    rig = VirtualRig.shipped("magnet-beam")
    per_bit = rig.converter.adc_step_v / rig.sensitivities_v_per_unit
    assert per_bit[:2] == pytest.approx([2.7e-3, 0.03], rel=0.02)
    assert rig.sensors[0].range_v / rig.sensors[0].sensitivity_v_per_unit == pytest.approx(44.5, rel=1e-3)
    assert rig.sensors[1].range_v / rig.sensors[1].sensitivity_v_per_unit == pytest.approx(50 * 9.80665, rel=1e-3)


@pytest.mark.parametrize("frequency_hz", [0.1, 0.3, 2.0, 24.4, 400.0])
def test_sensors_are_coupled_by_the_high_pass_that_was_asked_for(frequency_hz: float) -> None:
    corner_hz, rate_hz, n = 0.3, 5000.0, 150_000
    rig, _ = ideal(sensors=[_force_sensor() | {"high_pass_hz": corner_hz}]).build()
    omega = 2 * np.pi * frequency_hz / rate_hz
    filters, readings = np.zeros((2, 8)), np.tile(np.cos(omega * np.arange(n))[:, np.newaxis], 8)
    for k in range(n):
        condition(rig.conditioning, filters, np.zeros((0, 5, 8)), np.zeros((0, 2, 8)), readings[k])
    settled = slice(n - 50_000, n)
    phasor = 2 * np.mean(readings[settled, 0] * np.exp(-1j * omega * np.arange(n)[settled]))
    analogue = 1j * frequency_hz / (1j * frequency_hz + corner_hz)
    # A polygon has the spectrum of its sine but for (omega dt)^2 / 12.
    assert abs(phasor - analogue) < 1e-6 + omega**2 / 12 * corner_hz / frequency_hz


def test_constant_force_is_not_seen() -> None:
    run = Simulation(ideal(sensors=[_force_sensor() | {"high_pass_hz": 0.3}])).run(np.full(100_000, 1.0))
    assert abs(run.force_n[-1]) > 1e-3
    assert abs(run.measured["force"][-1]) < 1e-3 * abs(run.force_n[-1])


def test_sensor_beyond_its_range_clips_and_says_so() -> None:
    run = Simulation(ideal(sensors=[_force_sensor() | {"range_v": 2.0}])).run(np.full(200, 5.0))
    assert np.max(np.abs(run.measured["force"])) == 2.0
    clipped = (run.flags & Flag.SENSOR_CLIPPED) != 0
    assert np.array_equal(clipped, np.abs(run.force_n) > 2.0)
    assert clipped.any()


def test_converter_beyond_its_range_clips_and_says_so() -> None:
    converter = {"adc_bits": 16, "adc_range_v": 2.0}
    run = Simulation(ideal(sensors=[_force_sensor()], converter=converter)).run(np.full(200, 5.0))
    assert np.max(np.abs(run.measured["force"])) <= 2.0
    assert np.array_equal((run.flags & Flag.SENSOR_CLIPPED) != 0, np.abs(run.force_n) > 2.0)


@pytest.mark.parametrize(("voltage", "clipped"), [(9.9, False), (10.0, False), (10.1, True), (-np.inf, True)])
def test_voltage_beyond_the_converter_is_clipped_and_said_so(voltage: float, clipped: bool) -> None:
    rig, state = VirtualRig.shipped("magnet-beam").build()
    flags = sample(rig, state, voltage, np.empty(4))
    assert bool(flags & Flag.DAC_CLIPPED) is clipped
    assert abs(state.inputs[rig.plant["n_state"][0]]) <= 10.0


def test_voltage_that_is_no_number_becomes_zero_volts_and_is_flagged() -> None:
    rig, state = VirtualRig.shipped("magnet-beam").build()
    assert sample(rig, state, math.nan, np.empty(4)) & Flag.DAC_CLIPPED
    assert state.inputs[rig.plant["n_state"][0]] == 0.0


def test_output_is_quantised() -> None:
    rig, state = VirtualRig.shipped("magnet-beam").build()
    sample(rig, state, 0.123456, np.empty(4))
    held_v = state.inputs[rig.plant["n_state"][0]]
    assert held_v == STEP_V * round(0.123456 / STEP_V)


def test_state_that_is_not_finite_reads_nan_is_held_and_flagged() -> None:
    rig, state = VirtualRig.shipped("magnet-beam").build()
    state.inputs[0] = np.inf
    held = state.inputs.copy()
    out_v = np.empty((3, 4))
    assert run_open_loop(rig, state, np.ones(3), out_v) == Flag.DIVERGED
    assert np.all(np.isnan(out_v))
    assert np.array_equal(state.inputs, held)


def test_records_hold_what_the_kernels_read() -> None:
    rig, _ = VirtualRig.shipped("magnet-beam").build()
    assert rig.channels.dtype == CHANNEL
    assert rig.converter.dtype == CONVERTER


def _force_sensor() -> dict[str, object]:
    sensor = ideal().sensors[0]
    assert isinstance(sensor, Sensor)
    return sensor.model_dump()
