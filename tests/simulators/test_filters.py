from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError
from scipy import signal

from simulators.analysis.frequency_responses import frequency_response
from simulators.layout import Flag, RigState
from simulators.sensing.filters import dc_delay, lagrange_taps, low_pass_sections
from simulators.sensing.kernels import condition, filter_output
from simulators.shipped import shipped_specimens
from simulators.simulation import Simulation
from simulators.stepping import run_open_loop
from simulators.virtual_rig import VirtualRig
from tests.refused import refused
from tests.simulators.references import UNFILTERED, ideal

SLOW = {"sample_rate_hz": 800.0, "oversampling": 10, "substeps": 20}
FILTERED = SLOW | {"anti_alias_hz": 320.0}
EVERYTHING = FILTERED | {"reconstruction_hz": 300.0, "adc_noise_v": 1e-3, "dac_noise_v": 1e-3}


def quickly_settling(**changes: Any) -> VirtualRig:
    """The linear specimen with so much damping that a transient is over within a second."""
    return ideal(friction=(), structure={"damping_ratio": [0.05] * 4}, **changes)


def phasor(values: np.ndarray, frequency_hz: float, rate_hz: float) -> complex:
    """Fundamental of the last half of ``values``, by least squares."""
    k = np.arange(values.size // 2, values.size)
    angle = 2 * np.pi * frequency_hz / rate_hz * k
    fit = np.column_stack([np.cos(angle), np.sin(angle), np.ones(k.size)])
    a, b, _ = np.linalg.lstsq(fit, values[k], rcond=None)[0]
    return complex(a, -b)


def plant_response(rig: VirtualRig, row: np.ndarray, frequency_hz: float) -> complex:
    """Output per volt of the linear plant, by solving its equations at one frequency."""
    n = rig.plant.dynamics.shape[0]
    state = np.linalg.solve(2j * np.pi * frequency_hz * np.eye(n) - rig.plant.dynamics, rig.plant.voltage_column)
    return complex(row[:n] @ state)


@pytest.mark.parametrize("order", range(1, 9))
@pytest.mark.parametrize("corner_hz", [10.0, 320.0, 3600.0])
def test_sections_have_the_poles_of_another_design_and_pass_0_hz(order: int, corner_hz: float) -> None:
    sections = low_pass_sections(order, corner_hz, 8000.0)
    other = signal.butter(order, corner_hz, fs=8000.0, output="sos")
    assert sections[:, 3:] == pytest.approx(other[:, 4:], abs=1e-12)
    assert sections[:, :3].sum(axis=1) == pytest.approx(1.0 + sections[:, 3:].sum(axis=1), rel=1e-9)
    assert (sections[:, 1] / sections[:, 0]).tolist() == pytest.approx([1.0] * (order % 2) + [2.0] * (order // 2))


@pytest.mark.parametrize(("order", "corner_hz"), [(1, 300.0), (2, 300.0), (4, 320.0), (7, 100.0)])
def test_filter_is_the_analogue_butterworth_filter(order: int, corner_hz: float) -> None:
    rate_hz = 8000.0
    sections = low_pass_sections(order, corner_hz, rate_hz)
    b, a = signal.butter(order, 2 * np.pi * corner_hz, analog=True)
    for frequency_hz in (20.0, 0.5 * corner_hz, corner_hz, 2 * corner_hz):
        memory = np.zeros((sections.shape[0], 2))
        values = np.cos(2 * np.pi * frequency_hz / rate_hz * np.arange(4000))
        filtered = np.array([filter_output(sections, memory, value) for value in values])
        _, (analogue,) = signal.freqs(b, a, [2 * np.pi * frequency_hz])
        # The stated shift of frequency, against a slope of the phase of up to 0.8 rad per corner and order.
        shift = max((np.pi * corner_hz / rate_hz) ** 2, (np.pi * frequency_hz / rate_hz) ** 2) / 3
        measured = phasor(filtered, frequency_hz, rate_hz)
        assert abs(measured - analogue) < 1e-6 + order * shift * frequency_hz / corner_hz * abs(analogue)


def test_every_channel_is_clipped_and_then_filtered_by_its_own_sections() -> None:
    n, rng = 16, np.random.default_rng(1)  # two vectors
    own = [signal.butter(3, corner, fs=8000.0, output="sos") for corner in np.linspace(100.0, 900.0, n)]
    sections = np.ascontiguousarray(np.moveaxis([sos[:, [0, 1, 2, 4, 5]] for sos in own], 0, -1))
    values, clipped = 3.0 * rng.standard_normal((200, n)), []
    coefficients = np.zeros((5, n))
    coefficients[3], coefficients[4] = np.linspace(0.5, 2.0, n), np.linspace(1.0, 20.0, n)
    volts = np.clip(coefficients[3] * values, -coefficients[4], coefficients[4])
    expected = np.stack([signal.sosfilt(sos, volts[:, c]) for c, sos in enumerate(own)], axis=1)
    filters, memory = np.zeros((2, n)), np.zeros((2, 2, n))
    for value in values:
        beyond = bool(np.any(np.abs(coefficients[3] * value) > coefficients[4]))
        clipped.append((condition(coefficients, filters, sections, memory, value) == Flag.SENSOR_CLIPPED) == beyond)
    assert all(clipped)
    np.testing.assert_allclose(values, expected, atol=1e-12)


@pytest.mark.parametrize("order", [1, 2, 3, 4, 8])
def test_delay_of_a_filter_is_its_group_delay_at_low_frequency(order: int) -> None:
    sections = low_pass_sections(order, 320.0, 8000.0)
    b, a = signal.butter(order, 320.0, fs=8000.0)
    w = 1e-2
    _, (response,) = signal.freqz(b, a, [w])
    assert dc_delay(sections[..., np.newaxis])[0] == pytest.approx(-np.angle(response) / w, rel=1e-3)


def test_converter_without_filters_delays_nothing() -> None:
    rig = VirtualRig.shipped("magnet-beam", converter=UNFILTERED)
    assert rig.filter_delay_samples == 0.0
    assert np.all(rig.channel_delays_samples == 0.0)


@pytest.mark.parametrize("specimen", shipped_specimens())
def test_every_shipped_rig_delays_all_channels_alike_by_its_filter(specimen: str) -> None:
    rig = VirtualRig.shipped(specimen)
    # A Butterworth low-pass of sixth order is late by 1 / (w_c sin 15 deg), w_c as the bilinear transform has it.
    internal_hz = rig.converter.internal_rate_hz
    corner_rad_s = 2 * internal_hz * np.tan(np.pi * 2000.0 / internal_hz)
    assert rig.filter_delay_samples == pytest.approx(5000.0 / (corner_rad_s * np.sin(np.pi / 12)), rel=1e-6)
    assert np.all(rig.channel_delays_samples == 0.0)


@pytest.mark.parametrize("converter", [{}, FILTERED, FILTERED | {"reconstruction_hz": 300.0}])
def test_latency_at_low_frequency_is_hold_and_filters(converter: dict[str, Any]) -> None:
    rig = quickly_settling(converter=converter)
    frequency_hz, rate_hz = 10.0, rig.converter.sample_rate_hz
    run = Simulation(rig).run(1e-4 * np.cos(2 * np.pi * frequency_hz / rate_hz * np.arange(3 * int(rate_hz))))
    expected = 1e-4 * plant_response(rig, rig.plant.force_row(), frequency_hz)
    late = -np.angle(phasor(run.measured["force"], frequency_hz, rate_hz) / expected)
    assert late / (2 * np.pi * frequency_hz / rate_hz) == pytest.approx(0.5 + rig.filter_delay_samples, abs=5e-3)


def test_images_of_the_held_output_are_kept_out_of_slow_readings() -> None:
    frequency_hz, errors = 30.0, {}
    fine = {"oversampling": 40, "substeps": 40}
    for name, converter in {"bare": SLOW | fine, "filtered": FILTERED | fine | {"anti_alias_order": 8}}.items():
        rig = quickly_settling(converter=converter)
        run = Simulation(rig).run(1e-4 * np.cos(2 * np.pi * frequency_hz / 800.0 * np.arange(4800)))
        expected = 1e-4 * plant_response(rig, rig.output_row(rig.sensors[1]), frequency_hz)
        expected *= np.sinc(frequency_hz / 800.0) * np.exp(-1j * np.pi * frequency_hz / 800.0)
        if name == "filtered":
            b, a = signal.butter(8, 2 * np.pi * 320.0, analog=True)
            expected *= signal.freqs(b, a, [2 * np.pi * frequency_hz])[1][0]
        errors[name] = abs(phasor(run.measured["drive"], frequency_hz, 800.0) / expected - 1.0)
    assert errors["filtered"] < 1e-3
    assert errors["filtered"] < 0.1 * errors["bare"], errors


@pytest.mark.parametrize(("specimen", "mode"), [("magnet-beam", 1), ("magnet-beam-symmetric", 1), ("friction-beam", 3)])
def test_filters_of_the_shipped_rigs_keep_images_out_at_the_resonance_that_has_most_of_them(
    specimen: str, mode: int
) -> None:
    converter = VirtualRig.shipped(specimen).converter
    errors = {}
    for name, filters in {"bare": {}, "shipped": {key: getattr(converter, key) for key in UNFILTERED}}.items():
        rig = ideal(specimen, friction=(), elements=(), converter=filters)
        frequency_hz = rig.linear_modes.frequency_hz[mode]
        run = Simulation(rig).run(1e-3 * np.cos(2 * np.pi * frequency_hz / 5000.0 * np.arange(120_000)))
        drive, force = (phasor(run.measured[channel], frequency_hz, 5000.0) for channel in ("drive", "force"))
        accelerance = frequency_response(rig, [frequency_hz]).accelerance_per_kg["drive"][0]
        errors[name] = abs(drive / force / accelerance - 1.0)
    assert errors["bare"] > 0.15
    assert errors["shipped"] < 0.015


def test_clipping_happens_before_the_filter_and_is_flagged_between_samples_too() -> None:
    sensors = [ideal().sensors[0].model_dump() | {"range_v": 2.0}]
    run = Simulation(ideal(sensors=sensors, converter=FILTERED)).run(np.repeat([0.0, 5.0], 50))
    assert np.max(np.abs(run.measured["force"])) <= 2.0
    beyond = np.abs(run.force_n) > 2.0
    assert np.all((run.flags[beyond] & Flag.SENSOR_CLIPPED) != 0)
    assert not np.any(run.flags[:50])


@pytest.mark.parametrize("skew", [0.0, 1.0, 5.0, 0.3, 2.5, 7.25])
@pytest.mark.parametrize("converter", [{}, SLOW | {"anti_alias_hz": 200.0, "anti_alias_order": 8}])
def test_skewed_channel_is_late_by_its_skew(skew: float, converter: dict[str, Any]) -> None:
    plain = quickly_settling(converter=converter)
    table = [sensor.model_dump() for sensor in plain.sensors]
    table[1]["skew_samples"] = skew
    skewed = quickly_settling(converter=converter, sensors=table)
    rate_hz = plain.converter.sample_rate_hz
    frequency_hz = 0.04 * rate_hz
    voltages = 1e-3 * np.cos(2 * np.pi * frequency_hz / rate_hz * np.arange(int(3 * rate_hz)))
    (there, here), (there_too, late) = (
        (run.measured["force"], run.measured["drive"])
        for run in (Simulation(plain).run(voltages), Simulation(skewed).run(voltages))
    )
    if skew.is_integer():
        assert np.array_equal(late[int(skew) :], here[: here.size - int(skew)])
    assert np.array_equal(there, there_too)
    w = 2 * np.pi * frequency_hz / rate_hz
    ratio = phasor(late, frequency_hz, rate_hz) / phasor(here, frequency_hz, rate_hz)
    assert abs(ratio - np.exp(-1j * w * skew)) < 0.024 * w**6 + 1e-4  # what is left of the images is not late alike


@pytest.mark.parametrize("delay", np.linspace(0.0, 12.0, 41))
@pytest.mark.parametrize("w", [0.1, 0.5, 1.0])
def test_interpolation_of_a_skewed_channel_is_as_good_as_it_says(delay: float, w: float) -> None:
    first, weights = lagrange_taps(delay)
    value = np.sum(weights * np.exp(-1j * w * (first + np.arange(weights.size))))
    assert abs(value - np.exp(-1j * w * delay)) <= (0.024 if delay < 2.0 else 0.005) * w**6 + 1e-12


def test_low_pass_of_a_sensor_delays_its_channel_alone() -> None:
    table = [sensor.model_dump() for sensor in ideal().sensors]
    table[1] |= {"low_pass_hz": 250.0, "skew_samples": 1.5}
    rig = quickly_settling(sensors=table)
    # A first-order low-pass is late by 1/w_c, but for the stated shift of frequency.
    late = 1.5 + 5000.0 / (2 * np.pi * 250.0)
    assert rig.channel_delays_samples == pytest.approx([0.0, late, 0.0, 0.0], rel=1e-2)
    frequency_hz = 12.5
    voltages = 1e-4 * np.cos(2 * np.pi * frequency_hz / 5000.0 * np.arange(20_000))
    with_it, without = (Simulation(r).run(voltages).measured["drive"] for r in (rig, quickly_settling()))
    ratio = phasor(with_it, frequency_hz, 5000.0) / phasor(without, frequency_hz, 5000.0)
    measured = -np.angle(ratio) / (2 * np.pi * frequency_hz / 5000.0)
    assert measured == pytest.approx(rig.channel_delays_samples[1], rel=2e-3)


def test_blocks_do_not_matter_with_every_filter_skew_and_noise() -> None:
    table = [s.model_dump() for s in VirtualRig.shipped("magnet-beam").sensors]
    for index, sensor in enumerate(table):
        sensor |= {"skew_samples": 0.7 * index, "low_pass_hz": 1000.0 if index == 2 else 0.0}
    rig, whole_state = VirtualRig.shipped("magnet-beam", sensors=table, converter=EVERYTHING).build(4)
    state = RigState(*(array.copy() for array in whole_state))
    voltages = np.sin(0.2 * np.arange(300))
    whole, blocks = np.empty((300, 4)), np.empty((300, 4))
    run_open_loop(rig, whole_state, voltages, whole)
    for first, last in pairwise([0, 1, 2, 7, 64, 65, 190, 300]):
        run_open_loop(rig, state, voltages[first:last], blocks[first:last])
    assert np.array_equal(whole, blocks)


def test_oversampling_without_filters_changes_no_reading() -> None:
    voltages = np.sin(0.03 * np.arange(400))
    runs = [
        Simulation(VirtualRig.shipped("magnet-beam", converter=UNFILTERED | {"substeps": 4, "oversampling": m})).run(
            voltages
        )
        for m in (1, 4)
    ]
    assert np.array_equal(runs[0].force_n, runs[1].force_n)
    step_n = 20.0 / 2**16 / 0.1124
    # The high-pass takes the values between samples for straight lines: finer ones differ by less than a code.
    assert np.max(np.abs(runs[0].measured["force"] - runs[1].measured["force"])) <= 1.01 * step_n


@pytest.mark.parametrize(
    ("converter", "message"),
    [
        (
            {"oversampling": 3, "substeps": 4},
            {"field": "substeps", "value": 4, "allowed": "a multiple of oversampling = 3"},
        ),
        (
            FILTERED | {"anti_alias_hz": 400.0},
            {"field": "anti_alias_hz", "value": 400.0, "allowed": "below 400, half the rate"},
        ),
        (
            FILTERED | {"reconstruction_hz": 5e3},
            {"field": "reconstruction_hz", "value": 5000.0, "allowed": "below 4000, half the internal rate"},
        ),
        (FILTERED | {"oversampling": 4}, {"field": "oversampling", "value": 4}),
        ({"oversampling": 1}, {"field": "oversampling", "value": 1}),
    ],
)
def test_converter_that_cannot_filter_is_refused(converter: dict[str, Any], message: dict[str, object]) -> None:
    with refused(ValidationError, **message):
        VirtualRig.shipped("magnet-beam", converter=converter)


def test_low_pass_beyond_the_internal_rate_is_refused() -> None:
    sensors = [ideal().sensors[0].model_dump() | {"low_pass_hz": 2500.0}]
    with refused(
        ValidationError, field="sensors[0].low_pass_hz", value=2500.0, allowed="below 2500, half the internal rate"
    ):
        ideal(sensors=sensors)
