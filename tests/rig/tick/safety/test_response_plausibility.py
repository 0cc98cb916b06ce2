"""Force and motion must follow the output, as the plant, known or just measured, says; else the run trips in time."""

import cmath
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, strategies as st

from controller.kernels import FORCE, PERIOD, RESPONSE
from controller.tuning import PlantModel
from rig.campaigns.plans import bench_of, load_plan
from rig.drivers.virtual import VirtualDAQ
from rig.loop.loop import Loop
from rig.tick.safety.expected import expected_record
from rig.tick.safety.layout import EndReason
from rig.tick.safety.limits import describe_end
from rig.tick.safety.response_plausibility import (
    CREEP,
    LARGEST_RISE,
    OUT_OF_BAND_PERIODS,
    PLAUSIBILITY,
    check_held_level,
    contradicts_exciter,
    evaluate_exciter,
    permitted_level,
    set_reference,
)
from rig.tick.tick import TickSettings
from tests.rig.rigs import bench_with

FORCE_CHANNEL, DRIVE_CHANNEL = 0, 1
BLOCK = 10
PLANT = load_plan("magnet-beam/continuous-backbone").known_plant


def _period(output_v, force_n, drive_m_s2):
    """Means of a period in which the force is held, of whatever law."""
    period = np.zeros(1, PERIOD)
    period["output_v"], period["held"] = output_v, force_n
    period["force_n"], period["drive_m_s2"] = force_n, drive_m_s2
    return period[0]


class Spoilt(VirtualDAQ):
    """A virtual rig whose sensor or amplifier fails at a sample; what is true stays known."""

    run_fused = None

    def __init__(self, bench, from_sample, readings=None, output=None):
        super().__init__(bench, 0)
        self.from_sample, self.readings, self.output = from_sample, readings, output
        self.voltages, self.forces = [], []
        self._volts_per_newton = bench.channels[bench.index_of("force")].sensitivity_v_per_unit

    def _exchange(self, voltages, inputs):
        spoilt = self._first >= self.from_sample
        sent = voltages if self.output is None or not spoilt else self.output(voltages)
        super()._exchange(sent, inputs)
        self.voltages.append(float(np.abs(voltages).max()))
        self.forces.append(float(np.abs(inputs[:, FORCE_CHANNEL]).max() / self._volts_per_newton))
        if spoilt and self.readings is not None:
            self.readings(inputs)

    def peaks_v(self):
        """Peak output before the fault, over its last period, and from then on."""
        at = self.from_sample // BLOCK
        return max(self.voltages[max(at - 25, 0) : at], default=0.0), max(self.voltages[at:])


def _noise_of(channel):
    noise = np.random.default_rng(0)

    def spoil(inputs):
        inputs[:, channel] = noise.normal(0.0, 2e-4, len(inputs))

    return spoil


def _times(channel, factor):
    def spoil(inputs):
        inputs[:, channel] *= factor

    return spoil


def _run(name, at_s, *, seconds=60.0, **fault):
    """A shipped plan on a rig that fails at a time; stopped some time after."""
    plan = load_plan(name)
    bench = bench_of(plan, name).model_copy(update={"block": BLOCK})
    daq = Spoilt(bench, round(at_s * bench.sample_rate_hz), **fault)
    with daq:
        daq.start(BLOCK)
        settings = TickSettings(
            bench,
            plan.law,
            plan.amplitude_law,
            plan.settle_rule,
            plan.segments(bench.sample_rate_hz),
            exciter=plan.known_plant,
        )
        loop = Loop(daq, settings.build(daq.latency_samples), fused=False)
        for _ in loop.run():
            if loop.tick.sample > (at_s + seconds) * bench.sample_rate_hz:
                loop.request_stop()
    return daq, loop.tick, bench


def _periods_to_the_trip(daq, tick, bench):
    late = int(tick.guard["sample"][0]) - daq.from_sample
    return late / bench.sample_rate_hz * bench.specimen.linear_frequency_hz


HELD = ["magnet-beam/stepped-phase-paper", "magnet-beam/stepped-phase-fast", "magnet-beam/stepped-sine-up"]


@pytest.mark.parametrize("plan", [*HELD, "friction-beam/stepped-phase-fast"])
@pytest.mark.parametrize("fault", [_noise_of(FORCE_CHANNEL), _times(FORCE_CHANNEL, 0.1)], ids=["dead", "a tenth"])
def test_a_load_cell_that_dies_under_force_control_trips_before_the_output_has_doubled(plan, fault):
    daq, tick, bench = _run(plan, 20.0 if plan.startswith("magnet") else 4.0, readings=fault)
    before_v, peak_v = daq.peaks_v()
    reason = EndReason(int(tick.guard["reason"][0]))
    # noise instead of a force has no phase either: a lock may be lost before the level is missed; and behind a slow filter the
    # output over the force may have changed before the output has risen
    assert reason in (EndReason.LEVEL_NOT_FOLLOWED, EndReason.GAIN_CHANGED, EndReason.LOST_LOCK)
    assert peak_v <= LARGEST_RISE * CREEP**3 * before_v
    assert _periods_to_the_trip(daq, tick, bench) < 60.0
    if reason is EndReason.LEVEL_NOT_FOLLOWED:
        assert "did not follow on channel force" in describe_end(tick.guard, bench)


@pytest.mark.parametrize("fault", [_noise_of(DRIVE_CHANNEL), _times(DRIVE_CHANNEL, 0.1)], ids=["dead", "a tenth"])
def test_a_drive_sensor_that_dies_while_the_response_is_held_trips_before_the_output_has_doubled(fault):
    daq, tick, bench = _run("magnet-beam/response-controlled", 20.0, readings=fault)
    before_v, peak_v = daq.peaks_v()
    assert EndReason(int(tick.guard["reason"][0])).is_trip
    assert peak_v <= LARGEST_RISE * CREEP**3 * before_v
    assert _periods_to_the_trip(daq, tick, bench) < 60.0


@pytest.mark.parametrize("plan", HELD)
def test_an_amplifier_that_falls_out_trips_before_the_output_has_doubled(plan):
    daq, tick, _ = _run(plan, 20.0, output=np.zeros_like)
    before_v, peak_v = daq.peaks_v()
    assert EndReason(int(tick.guard["reason"][0])).is_trip
    assert peak_v <= LARGEST_RISE * CREEP**3 * before_v


@pytest.mark.parametrize("plan", ["magnet-beam/stepped-phase-paper", "magnet-beam/stepped-phase-fast"])
def test_with_a_load_cell_that_is_dead_from_the_start_the_output_stays_near_the_floor(plan):
    daq, tick, _ = _run(plan, 0.0, readings=_noise_of(FORCE_CHANNEL))
    floor_v = float(tick.arrays.expected["floor_v"][0])
    assert EndReason(int(tick.guard["reason"][0])) is not EndReason.STOP_REQUESTED
    assert daq.peaks_v()[1] <= LARGEST_RISE * 1.02 * max(floor_v, load_plan(plan).start_v or 0.0)


@pytest.mark.parametrize("factor", [0.1, 10.0])
def test_an_amplifier_of_another_gain_than_the_known_plants_trips_in_the_first_gentle_ramp(factor):
    daq, tick, bench = _run("magnet-beam/continuous-backbone", 0.0, output=lambda volts: factor * volts)
    assert EndReason(int(tick.guard["reason"][0])) is EndReason.PLANT_CONTRADICTED
    ramp_periods = 10.0
    assert _periods_to_the_trip(daq, tick, bench) < ramp_periods
    assert max(daq.forces) < 0.05 * bench.limits.force_n
    assert "known plant" in describe_end(tick.guard, bench)


@pytest.mark.parametrize(
    "name",
    [
        "magnet-beam/stepped-phase-fast",
        "magnet-beam/stepped-sine-up",
        "magnet-beam/continuous-backbone",
        "friction-beam/stepped-sine-down",
        "friction-beam/continuous-backbone",
    ],
)
def test_a_sound_rig_never_comes_near_the_trip_past_force_drops_and_turning_points(name):
    plan = load_plan(name)
    bench = bench_of(plan, name)
    with VirtualDAQ(bench, 5) as daq:
        daq.start(1)
        segments = plan.segments(bench.sample_rate_hz)
        settings = TickSettings(
            bench, plan.law, plan.amplitude_law, plan.settle_rule, segments, exciter=plan.known_plant
        )
        loop = Loop(daq, settings.build(daq.latency_samples))
        assert all(True for _ in loop.run())
    plausibility = loop.tick.arrays.plausibility[0]
    assert EndReason(int(loop.tick.guard["reason"][0])) is EndReason.COMPLETED
    assert plausibility["most_periods"] <= OUT_OF_BAND_PERIODS // 2
    assert plausibility["most_unlike_s"] < 0.5 / bench.specimen.linear_frequency_hz


def _fresh(plant=None, bench=None):
    expected = expected_record(bench or bench_with(), 0.001, 0.01, plant)[0]
    plausibility = np.zeros(1, PLAUSIBILITY)[0]
    set_reference(expected, plausibility, 1.0, 0.0, 0.0)
    return expected, plausibility


@pytest.mark.slow
@given(
    rate=st.floats(-5.0, 5.0),
    turn=st.floats(-10.0, 10.0),
    ratio=st.complex_numbers(min_magnitude=0.1, max_magnitude=10.0, allow_nan=False, allow_infinity=False),
)
def test_the_exciter_is_held_against_amplitudes_that_grow_and_turn(rate, turn, ratio):
    """``u = alpha(s) F + beta(s) A`` is exact for ``exp(s t)``: what the watch finds is that, to the second order of s."""
    omega, dt, gain = PLANT.frequency_rad_s, 2e-4, 1.0 - math.exp(-200.0 * 2e-4)
    s = complex(rate, omega + turn)
    alpha, beta = (complex(value) for value in PLANT.exciter(s))
    expected, plausibility = _fresh(PLANT)
    evaluate_exciter(expected, plausibility, omega)
    force, drive = 1.0 + 0.0j, 20.0 * ratio
    for step in range(1500):
        growth = cmath.exp((s - 1j * omega) * step * dt)
        # What a detector shows of an amplitude that grows at a rate is the amplitude behind its low-pass.
        shown = growth * gain / (1.0 - (1.0 - gain) * cmath.exp(-(s - 1j * omega) * dt))
        sent = growth * (alpha * force + beta * drive)
        contradicts_exciter(expected, plausibility, sent, shown * force, shown * drive, gain, dt)
    terms = max(abs(alpha * force), abs(beta * drive)) * abs(growth)
    missed = complex(plausibility["needed"]) - complex(plausibility["late_sent"])
    behind = complex(plausibility["late_force"])  # of a force of 1 N: both filters, and the growth
    remainder = sum(_of_second_order(part, omega, s) * size for part, size in ((0, force), (1, drive)))
    assert abs(missed - remainder * behind) < 2e-3 * terms


def _of_second_order(part, omega, s):
    """What a straight line through the exciter's alpha (0) or beta (1) at ``i omega`` is above its value at s."""
    at, step = 1j * omega, 1e-3
    here, ahead, back, there = (complex(PLANT.exciter(z)[part]) for z in (at, at + step, at - step, s))
    return here + (ahead - back) / (2.0 * step) * (s - at) - there


@pytest.mark.slow
@given(factor=st.floats(2.0, 50.0), periods=st.integers(1, 40))
def test_the_output_of_a_held_level_at_most_doubles_within_a_period(factor, periods):
    expected, plausibility = _fresh()
    amplitude = 1.0
    for _ in range(periods):
        allowed = permitted_level(plausibility, factor * amplitude)
        assert allowed <= LARGEST_RISE * max(amplitude, float(expected["floor_v"]))
        amplitude = allowed
        assert not check_held_level(
            expected, plausibility, _period(amplitude, amplitude, 10.0), amplitude, FORCE, False, False
        )


@pytest.mark.parametrize("law", [FORCE, RESPONSE])
def test_what_does_not_follow_goes_astray_after_the_stated_number_of_periods(law):
    expected, plausibility = _fresh()
    assert not check_held_level(expected, plausibility, _period(1.0, 1.0, 1.0), 1.0, law, False, False)
    found = [
        check_held_level(expected, plausibility, _period(1.6, 0.6, 0.6), 1.0, law, False, False)
        for _ in range(OUT_OF_BAND_PERIODS)
    ]
    assert found == [False] * (OUT_OF_BAND_PERIODS - 1) + [True]


def test_a_force_that_drops_while_the_vibration_jumps_follows():
    expected, plausibility = _fresh()
    assert not check_held_level(expected, plausibility, _period(1.0, 1.0, 1.0), 1.0, FORCE, False, True)
    for step in range(3 * OUT_OF_BAND_PERIODS):
        period = _period(1.0 + 0.02 * step, 0.3, 1.0 + 0.2 * step)
        assert not check_held_level(expected, plausibility, period, 1.0, FORCE, False, True)


FORCE_SOURCE = PlantModel(
    frequency_rad_s=157.0,
    damping_ratio=0.005,
    drive_shape=1.0,
    residual_per_kg=(0.0, 0.0),
    force_v_n=(0.5, 0.0, 0.0, 0.0),
    acceleration_v_s2_m=(0.0, 0.0, 0.0, 0.0),
    centre_rad_s=157.0,
    band_hz=(15.0, 40.0),
    fit_error=0.0,
    sample_rate_hz=5000.0,
    latency_samples=11.0,
)


def _told_wrongly(part, std=None):
    """A plant with the responses of the force source, whose force is put down to a tuned mass."""
    return replace(
        FORCE_SOURCE,
        force_v_n=(0.5 - part, 0.0, 0.0, 0.0),
        acceleration_v_s2_m=(part, 2.0 * FORCE_SOURCE.damping_ratio * part, part, 0.0),
        force_v_n_std=std,
    )


def test_the_plant_that_is_told_wrongly_has_the_same_responses():
    s = 1j * np.linspace(100.0, 220.0, 200)
    np.testing.assert_allclose(_told_wrongly(0.486).force_per_v(s), FORCE_SOURCE.force_per_v(s), rtol=1e-9)


def _contradicted(plant, hardened, amplifier=1.0):
    """Whether a force source on an oscillator that has hardened by this factor contradicts a plant; at phase resonance."""
    expected, plausibility = _fresh(plant)
    omega = hardened * FORCE_SOURCE.frequency_rad_s
    evaluate_exciter(expected, plausibility, omega)
    drive = 1j * omega / (2.0 * FORCE_SOURCE.damping_ratio * FORCE_SOURCE.frequency_rad_s)  # of 1 N, phi_d = 1
    sent = complex(0.5 / amplifier)
    return any(contradicts_exciter(expected, plausibility, sent, 1.0, drive, 0.05, 2e-4) for _ in range(3000))


@pytest.mark.parametrize("hardened", [1.0, 1.005, 1.01])
def test_an_exciter_that_was_not_told_from_the_structure_contradicts_no_sound_rig(hardened):
    assert not _contradicted(_told_wrongly(0.486, std=0.2), hardened)


def test_the_same_exciter_taken_for_known_contradicts_a_sound_rig_at_a_hardening_of_one_percent():
    assert _contradicted(_told_wrongly(0.486), 1.01)


@pytest.mark.parametrize("amplifier", [0.1, 10.0])
def test_an_amplifier_of_another_gain_still_contradicts_it_where_the_structure_is_linear(amplifier):
    assert _contradicted(_told_wrongly(0.486, std=0.2), 1.0, amplifier)


def test_frequencies_outside_the_band_of_the_known_plant_are_not_judged():
    expected, plausibility = _fresh(PLANT)
    evaluate_exciter(expected, plausibility, 2.0 * 2.0 * math.pi * PLANT.band_hz[1])
    assert plausibility["alpha"] == 0.0
    assert not any(contradicts_exciter(expected, plausibility, 1.0, 0.0, 0.0, 0.1, 1e-3) for _ in range(1000))
