"""Controlled harmonics of the stinger force: against the reference, the time domain, a pure sine, and by differences."""

from cmath import rect
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from simulators.analysis import (
    PeriodicResponses,
    constant_displacement_response,
    constant_force_response,
    forced_response,
    phase_resonance_backbone,
)
from simulators.analysis.balance import Balance
from simulators.analysis.condensed import CondensedRig
from simulators.analysis.conditions import Conditions
from simulators.analysis.force_control import ForceControl
from simulators.layout import Flag
from simulators.simulation import Simulation
from simulators.virtual_rig import VirtualRig
from tests.reference.harmonic_balance import backbone
from tests.reference.parameters import ONE_SIDED, SYMMETRIC
from tests.reference.time_integration import TimeDomain
from tests.refused import refused
from tests.simulators.analysis.rigs import every_site, one_mode
from tests.simulators.references import ideal
from vibrolock.errors import InputError

REFERENCES = {"magnet-beam": ONE_SIDED, "magnet-beam-symmetric": SYMMETRIC}
BOTH = pytest.mark.parametrize("specimen", list(REFERENCES))
LEVELS_N = np.geomspace(0.026, 0.56, 5)
ZERO = dict.fromkeys(range(2, 8), 0j)
OTHER_EXCITER = {2: rect(0.3, 0.7), 3: -0.2j, 5: 0.05}
"""Force of another exciter: amplitudes relative to the fundamental, and phases."""
WANTED = pytest.mark.parametrize("wanted", [ZERO, OTHER_EXCITER], ids=["zero", "another exciter"])
REACHED = 12
"""Harmonics compared with the time domain."""


def relative(force: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Harmonics over the fundamental's amplitude, at the instant at which the fundamental is at its maximum."""
    orders = np.arange(force.size)
    return np.asarray(force / abs(force[1]) * np.exp(-1j * orders * np.angle(force[1])))


@WANTED
@BOTH
def test_the_backbone_is_that_of_the_reference(specimen: str, wanted: Mapping[int, complex]) -> None:
    rig = VirtualRig.shipped(specimen)
    found = phase_resonance_backbone(rig, forces_n=LEVELS_N, force_harmonics=wanted, samples=256)
    truth = backbone(REFERENCES[specimen], LEVELS_N.tolist(), force_ratios=wanted)
    np.testing.assert_allclose(found.frequency_hz, [one.frequency_hz for one in truth], rtol=1e-7)
    np.testing.assert_allclose(found.damping_ratio, [one.damping_ratio for one in truth], rtol=1e-7)
    np.testing.assert_allclose(found.amplitude_m, [abs(one.drive_m[1]) for one in truth], rtol=1e-7)
    assert found.voltage_harmonics_v is not None
    for k, one in enumerate(truth):
        np.testing.assert_allclose(found.force_harmonics_n[k], one.force_n, atol=2e-7 * LEVELS_N[k])
        np.testing.assert_allclose(found.voltage_harmonics_v[k], one.voltages_v, atol=2e-7 * one.voltage_v)


@pytest.mark.parametrize("lag_deg", [-150.0, -120.0, -60.0, -30.0])
def test_both_branches_of_the_stepped_phase_are_those_of_the_reference(lag_deg: float) -> None:
    rig = VirtualRig.shipped("magnet-beam")
    found = constant_force_response(rig, 0.55, [lag_deg], force_harmonics=7, samples=256)
    truth = backbone(ONE_SIDED, [0.55], lag_deg, ZERO)[0]
    assert found.phase_lag_deg[0] == pytest.approx(lag_deg, abs=1e-6)
    assert found.force_n[0] == pytest.approx(0.55, rel=1e-8)
    assert found.frequency_hz[0] == pytest.approx(truth.frequency_hz, rel=1e-7)
    assert found.amplitude_m[0] == pytest.approx(abs(truth.drive_m[1]), rel=1e-6)
    assert found.voltage_harmonics_v is not None
    np.testing.assert_allclose(found.voltage_harmonics_v[0], truth.voltages_v, atol=1e-6 * truth.voltage_v)


@pytest.mark.parametrize(
    ("specimen", "force_n", "lag_deg", "wanted"),
    [
        ("magnet-beam", 0.1, -90.0, OTHER_EXCITER),
        ("magnet-beam", 0.55, -90.0, ZERO),
        ("magnet-beam", 0.55, -60.0, ZERO),
        ("magnet-beam-symmetric", 0.55, -90.0, OTHER_EXCITER),
    ],
)
def test_dop853_under_the_voltages_settles_at_the_prescribed_force(
    specimen: str, force_n: float, lag_deg: float, wanted: Mapping[int, complex]
) -> None:
    rig = ideal(specimen, friction=[])
    found = constant_force_response(rig, force_n, [lag_deg], force_harmonics=wanted, harmonics=21)
    assert found.voltage_harmonics_v is not None
    omega = 2 * np.pi * float(found.frequency_hz[0])
    run = TimeDomain(REFERENCES[specimen].without_friction(), found.voltage_harmonics_v[0], omega)
    states = run.without_friction(60)
    force, drive = run.harmonics(run.force_n(states)), run.harmonics(states @ run.drive_row)
    for order, ratio in wanted.items():
        assert relative(force)[order] == pytest.approx(ratio, abs=2e-6)
    np.testing.assert_allclose(force[:REACHED], found.force_harmonics_n[0, :REACHED], atol=1e-5 * force_n)
    np.testing.assert_allclose(drive[:REACHED], found.drive_harmonics_m[0, :REACHED], atol=1e-6 * found.amplitude_m[0])


def settled(rig: VirtualRig, found: PeriodicResponses, rise_periods: int) -> NDArray[np.complex128]:
    """Harmonics of the stinger force, sampled, under the voltages of the first point, held between samples."""
    assert found.voltage_harmonics_v is not None
    voltages, at_hz, rate = found.voltage_harmonics_v[0], found.frequency_hz[0], rig.converter.sample_rate_hz
    orders, theta = np.arange(voltages.size), 2 * np.pi * at_hz / rate * np.arange(round(6.0 * rate))
    rise = np.minimum(theta / (2 * np.pi * rise_periods), 1.0)
    held = voltages / np.sinc(orders * at_hz / rate)
    run = Simulation(rig).run(rise * np.real(np.exp(1j * np.outer(theta, orders)) @ held))
    last = theta > theta[-1] - 40 * np.pi
    waves = np.exp(1j * np.outer(theta[last], orders))
    fit = np.linalg.lstsq(np.hstack([waves.real, -waves.imag[:, 1:]]), run.force_n[last], rcond=None)[0]
    return np.asarray(fit[: orders.size] + 1j * np.append(0.0, fit[orders.size :]))


NONLINEAR_EXCITER = {"suspension_cubic_n_m3": 2e9, "droop_per_m": -20.0, "droop_per_m2": -3e4}


@pytest.mark.parametrize(
    ("specimen", "force_n", "changes"),
    [
        ("magnet-beam", 0.026, {}),
        ("magnet-beam", 0.55, {}),
        ("magnet-beam-symmetric", 0.55, {}),
        ("friction-beam", 0.5, {}),
        ("friction-beam", 15.0, {}),
        ("magnet-beam", 0.3, {"exciter": NONLINEAR_EXCITER}),
    ],
    ids=str,
)
@WANTED
def test_the_rig_settles_at_the_prescribed_force(
    specimen: str, force_n: float, changes: dict[str, Any], wanted: Mapping[int, complex]
) -> None:
    rig = ideal(specimen, converter={"sample_rate_hz": 20000.0, "substeps": 2}, **changes)
    found = phase_resonance_backbone(rig, forces_n=[force_n], force_harmonics=wanted, harmonics=23, samples=1024)
    force = settled(rig, found, 100 if specimen == "friction-beam" else 20)
    assert abs(force[1]) == pytest.approx(force_n, rel=2e-4)
    for order, ratio in wanted.items():
        assert relative(force)[order] == pytest.approx(ratio, abs=2e-4)
    np.testing.assert_allclose(relative(force)[:REACHED], relative(found.force_harmonics_n[0])[:REACHED], atol=3e-4)


def test_the_exciters_own_nonlinearity_is_in_the_voltages() -> None:
    plain, bent = ideal(), ideal(exciter=NONLINEAR_EXCITER)
    one, other = (phase_resonance_backbone(rig, forces_n=[0.3], force_harmonics=15) for rig in (plain, bent))
    assert one.voltage_harmonics_v is not None
    assert other.voltage_harmonics_v is not None
    change = other.voltage_harmonics_v / other.voltage_v - one.voltage_harmonics_v / one.voltage_v
    assert np.max(np.abs(change)) > 1e-3


@pytest.mark.parametrize(
    ("specimen", "levels_n", "changes", "tolerance"),
    [
        ("magnet-beam", [0.1, 0.5], {"friction": []}, 1e-9),
        ("magnet-beam-symmetric", [0.1, 0.5], {"friction": []}, 1e-9),
        # friction is sampled at other instants: the period starts with the voltage, not with the force
        ("magnet-beam", [0.1, 0.5], {}, 2e-6),
        ("friction-beam", [1.0, 15.0], {}, 2e-6),
    ],
    ids=str,
)
def test_all_harmonics_at_zero_without_a_suspension_are_a_pure_sine(
    specimen: str, levels_n: list[float], changes: dict[str, Any], tolerance: float
) -> None:
    rig = ideal(specimen, exciter={"suspension_stiffness_n_m": 0.0}, **changes)
    found = phase_resonance_backbone(rig, forces_n=levels_n, force_harmonics=15)
    pure = phase_resonance_backbone(rig, forces_n=levels_n, excitation="pure-sine")
    np.testing.assert_allclose(found.force_harmonics_n[:, 0], 0.0, atol=1e-9 * levels_n[0])
    np.testing.assert_allclose(found.frequency_hz, pure.frequency_hz, rtol=tolerance)
    np.testing.assert_allclose(found.damping_ratio, pure.damping_ratio, rtol=20 * tolerance)
    drive = [np.abs(one.drive_harmonics_m) for one in (found, pure)]
    np.testing.assert_allclose(*drive, atol=20 * tolerance * pure.amplitude_m[0])


def test_the_static_force_of_the_suspension_stays_and_only_where_the_specimen_is_one_sided() -> None:
    found = {
        specimen: phase_resonance_backbone(VirtualRig.shipped(specimen), forces_n=[0.56], force_harmonics=7)
        for specimen in REFERENCES
    }
    static = {specimen: one.force_harmonics_n[0, 0].real for specimen, one in found.items()}
    assert static["magnet-beam"] == pytest.approx(1.35, abs=0.01)
    assert static["magnet-beam-symmetric"] == pytest.approx(0.0, abs=1e-12)
    rig = VirtualRig.shipped("magnet-beam")
    series = 1.0 / (1.0 / rig.exciter.suspension_stiffness_n_m + 1.0 / rig.stinger.stiffness_n_m)
    drive = found["magnet-beam"].drive_harmonics_m[0, 0].real
    assert static["magnet-beam"] == pytest.approx(-series * drive, rel=1e-9)


def test_both_damping_curves_are_one_where_the_force_is_a_sine() -> None:
    found = phase_resonance_backbone(VirtualRig.shipped("magnet-beam"), forces_n=LEVELS_N, force_harmonics=7)
    np.testing.assert_allclose(found.damping_ratio, found.damping_ratio_total_power, rtol=1e-6)


@pytest.mark.parametrize(
    "conditions", [Conditions("force", 0.4, "lag", -1.5), Conditions("force-rms", 0.4, "frequency", 150.0)]
)
def test_jacobian_agrees_with_finite_differences(conditions: Conditions) -> None:
    balance = Balance(every_site(), 5, 128, control=ForceControl.of({2: rect(0.8, 0.7), 3: 0.0, 5: -0.3j}, 5))
    y = balance.linear_start(Conditions("force", 0.3, "lag", -np.pi / 2), 153.0)
    y[:-2] += 1e-5 * np.random.default_rng(1).standard_normal(y.size - 2)
    jacobian = balance.residual(y, conditions)[1]
    for column in range(y.size):
        step = np.zeros_like(y)
        step[column] = 1e-9 if column < y.size - 2 else 1e-6 * abs(y[column])
        ahead, back = (balance.residual(y + sign * step, conditions)[0] for sign in (1, -1))
        difference = (ahead - back) / (2 * step[column])
        np.testing.assert_allclose(jacobian[:, column], difference, atol=2e-5 * max(np.max(np.abs(difference)), 1e-12))


def test_the_derivative_of_the_driven_transfer_by_the_frequency_agrees_with_differences() -> None:
    linear, control, orders = CondensedRig(every_site()), ForceControl.of(5, 6), np.arange(7)
    omega, step = 150.0, 1e-3
    value, slope = control.driven(*linear.transfer(omega, orders))
    ahead, back = (control.driven(*linear.transfer(omega + sign * step, orders))[0] for sign in (1, -1))
    scale = np.maximum(np.abs(slope), 1e-3 * np.abs(value) / omega)
    assert np.max(np.abs((ahead - back) / (2 * step) - slope) / np.where(scale > 0.0, scale, 1.0)) < 1e-4


def test_every_analysis_finds_the_same_vibration() -> None:
    rig = VirtualRig.shipped("magnet-beam")
    truth = constant_force_response(rig, 0.4, [-120.0], force_harmonics=OTHER_EXCITER)
    amplitude, at_hz, voltage = truth.amplitude_m[0], truth.frequency_hz[0], truth.voltage_v[0]
    assert truth.voltage_harmonics_v is not None
    for found in (
        constant_displacement_response(rig, amplitude, [-120.0], force_harmonics=OTHER_EXCITER),
        forced_response(rig, voltage, [at_hz], force_harmonics=OTHER_EXCITER),
        phase_resonance_backbone(
            rig, forces_n=truth.force_rms_n, quantity="rms", phase_lag_deg=-120.0, force_harmonics=OTHER_EXCITER
        ),
        phase_resonance_backbone(rig, voltages_v=[voltage], phase_lag_deg=-120.0, force_harmonics=OTHER_EXCITER),
    ):
        assert found.force_n[0] == pytest.approx(0.4, rel=1e-6)
        assert found.frequency_hz[0] == pytest.approx(at_hz, rel=1e-7)
        np.testing.assert_allclose(found.voltage_harmonics_v, truth.voltage_harmonics_v, atol=1e-6 * voltage)


def test_a_voltage_without_control_is_a_sine_and_an_imposed_force_has_none() -> None:
    rig = VirtualRig.shipped("magnet-beam")
    found = phase_resonance_backbone(rig, forces_n=[0.1, 0.3])
    assert found.voltage_harmonics_v is not None
    np.testing.assert_array_equal(found.voltage_harmonics_v[:, 1], found.voltage_v)
    assert np.count_nonzero(found.voltage_harmonics_v) == 2
    assert phase_resonance_backbone(rig, forces_n=[0.1], excitation="pure-sine").voltage_harmonics_v is None


def test_the_peak_of_the_whole_voltage_is_what_clips() -> None:
    free = phase_resonance_backbone(ideal(), forces_n=[0.4], force_harmonics={2: 3.0})
    fundamental, theta = free.voltage_v[0], 2 * np.pi * np.arange(512) / 512
    assert free.voltage_harmonics_v is not None
    peak = np.max(np.abs(np.real(np.exp(1j * np.outer(theta, np.arange(16))) @ free.voltage_harmonics_v[0])))
    assert peak > 1.1 * fundamental
    narrow = ideal(converter={"dac_range_v": 0.5 * (peak + fundamental)})
    found = phase_resonance_backbone(narrow, forces_n=[0.4], force_harmonics={2: 3.0})
    assert Flag(int(found.flags[0])) == Flag.DAC_CLIPPED


@pytest.mark.parametrize(
    ("wanted", "parts"),
    [
        (1, {"field": "force_harmonics", "value": 1, "allowed": "2 to 15, the highest harmonic computed"}),
        (16, {"field": "force_harmonics", "value": 16}),
        (2.5, {"field": "force_harmonics", "value": 2.5}),
        (True, {"field": "force_harmonics", "value": True}),
        ({1: 0.5}, {"field": "force_harmonics: harmonic", "value": 1}),
        ({"2": 0.5}, {"field": "force_harmonics: harmonic", "value": "2"}),
        ({2: np.nan}, {"field": "force_harmonics[2]", "allowed": "a finite number, real or complex"}),
        ({3: "much"}, {"field": "force_harmonics[3]", "value": "much"}),
    ],
)
def test_bad_values_are_named(wanted: Any, parts: dict[str, Any]) -> None:
    with refused(InputError, **parts):
        phase_resonance_backbone(one_mode(), forces_n=[0.1], force_harmonics=wanted)


def test_a_pure_sine_is_given_no_harmonics() -> None:
    with refused(InputError, field="force_harmonics", allowed="with excitation = 'exciter', a pure sine has none"):
        phase_resonance_backbone(one_mode(), forces_n=[0.1], force_harmonics=7, excitation="pure-sine")
