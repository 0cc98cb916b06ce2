"""Harmonic balance of structured models against finite differences, closed forms and long simulations."""

import numpy as np
import pytest

from identification import IdentificationError, harmonic_response, steady_state
from identification.harmonic_balance.basis import Basis
from identification.harmonic_balance.drives import Coupled, Sine
from identification.models.structured.balance import StructuredBalance, along_period
from identification.models.structured.model import workspace_for
from identification.models.structured.steps import run
from tests.identification.models.pnlss.steady.oscillators import shaker
from tests.identification.models.structured.steady.beams import beam, friction, hysteresis, settled, smooth
from tests.refused import refused

RATE_HZ = 16000.0


@pytest.mark.parametrize(
    "model",
    [smooth(), smooth(support_n_m=3e5), friction(), hysteresis()],
    ids=["smooth", "bounded", "friction", "hysteresis"],
)
@pytest.mark.parametrize("held", ["sine", "fundamental", "rms", "voltage"])
def test_the_jacobian_agrees_with_finite_differences(model, held):
    basis, at_hz, level = Basis(3, 64), 24.0, 0.8
    drive = Sine(2.0, 0, 1) if held == "sine" else Coupled(shaker(), 2.0, held, 0, 2, 0, 1, basis.size)
    balance = StructuredBalance(model, drive, basis)
    rng = np.random.default_rng(1)
    z = np.concatenate([1e-3 * rng.standard_normal(2 * basis.size), rng.standard_normal(drive.size)])
    _, by_z, by_hz, by_level = balance.evaluated(z, at_hz, level)
    steps = np.concatenate([np.full(2 * basis.size, 1e-9), np.full(drive.size, 1e-6)])
    for column, step in enumerate(steps):
        nudge = np.where(np.arange(z.size) == column, step, 0.0)
        ends = [balance.evaluated(z + sign * nudge, at_hz, level)[0] for sign in (1, -1)]
        size = np.max(np.abs(by_z[:, column]))
        np.testing.assert_allclose((ends[0] - ends[1]) / (2 * step), by_z[:, column], atol=1e-6 * size)
    for exact, ends in (
        (by_hz, [balance.evaluated(z, at_hz + d, level)[0] for d in (1e-3, -1e-3)]),
        (by_level, [balance.evaluated(z, at_hz, level + d)[0] for d in (1e-3, -1e-3)]),
    ):
        np.testing.assert_allclose((ends[0] - ends[1]) / 2e-3, exact, atol=1e-6 * np.max(np.abs(exact)))


def test_without_elements_the_response_is_that_of_the_modes_and_the_support():
    model = beam(support_n_m=800.0)
    found = harmonic_response(model, 0.01, support=True, harmonics=1, band_hz=(20.0, 30.0), largest_range_use=3.0)
    s = 2j * np.pi * found.points.frequency_hz[:, None]
    b = model.input_shapes[:, 0]
    modes = 1.0 / (model.omega**2 + 2.0 * model.damping_ratio * model.omega * s + s**2)
    filtered = 800.0 / (1.0 + s / (2.0 * np.pi * model.support_corner_hz)) ** 2
    receptance = modes @ b**2
    share = 1.0 / (1.0 + filtered[:, 0] * receptance)  # of the force, beside the support
    exact = 0.01 * ((s**model.motions) * ((modes * b) @ model.output_shapes.T) * share[:, None] + model.direct[:, 0])
    np.testing.assert_allclose(found.points.outputs[:, 1], exact, rtol=1e-6)
    assert found.points.stable.all()
    poles = model.omega * (-model.damping_ratio + 1j * np.sqrt(1.0 - model.damping_ratio**2))
    bare = harmonic_response(beam(), 0.01, harmonics=3, band_hz=(20.0, 30.0), largest_range_use=3.0)
    for at_hz, each in zip(bare.points.frequency_hz[::20], bare.points.multipliers[::20], strict=True):
        exact = np.exp(poles / at_hz)
        np.testing.assert_allclose(np.sort_complex(each), np.sort_complex([*exact, *exact.conj()]), rtol=1e-9)


@pytest.mark.parametrize("samples", [640, 610])
@pytest.mark.parametrize("make", [smooth, friction, hysteresis])
def test_a_settled_simulation_has_the_harmonics_of_the_balance(make, samples):
    simulated, change = settled(make(rate_hz=RATE_HZ, steps=1), 1.0, samples, 300)
    found = steady_state(make(), RATE_HZ / samples, 1.0, support=True, harmonics=13, largest_range_use=3.0)
    assert change < 1e-8
    size = np.abs(simulated).max(axis=0)
    np.testing.assert_allclose(found.outputs[0] / size, simulated[:14] / size, atol=1e-4)
    assert np.abs(simulated[3, 0]) > 5e-4 * size[0]
    if make is smooth:
        assert np.abs(simulated[0, 2]) > 1e-3 * size[2]  # the mean position, which spring, stop and support balance


def test_a_slider_loses_the_energy_of_its_loop():
    model, basis = friction(), Basis(1, 4000)
    system = model.system
    stiffness, strength = system.tables.sliders[0]
    coefficients = np.zeros((3, 2))
    amplitude = 5.0 * strength / stiffness
    coefficients[1, 0] = amplitude
    x = np.ascontiguousarray((basis.to_time @ coefficients).T)
    force, damping, by = np.empty((2, 4000)), np.empty((2, 4000)), np.empty((2, 4000, 3))
    rows = np.empty((2, 3))
    along_period(system, x, np.zeros_like(x), basis.to_time, np.zeros_like(basis.to_time), rows, force, damping, by)
    middle = 0.5 * (force[0] + np.roll(force[0], -1))
    lost = float(np.sum(middle * (np.roll(x[0], -1) - x[0])))
    assert lost == pytest.approx(4.0 * strength * (amplitude - strength / stiffness), rel=1e-5)


@pytest.mark.parametrize("make", [smooth, friction])
def test_the_work_of_the_force_is_what_dampers_and_sliders_lose(make):
    model = make()
    force_n = 8.0
    found = steady_state(model, 25.3, force_n, support=True, harmonics=13, largest_range_use=3.0)
    w, at = 2.0 * np.pi * 25.3, found.states[0]
    h, phase = np.arange(14)[:, None], 2.0 * np.pi * np.arange(4000) / 4000
    turning = np.exp(1j * h * phase)
    q, v = (np.real(each.T @ turning) for each in (at, 1j * h * w * at))
    given = np.mean(force_n * np.cos(phase) * (model.input_shapes[:, 0] @ v))
    lost = np.mean(2.0 * (model.damping_ratio * model.omega) @ v**2)
    by_modes = lost
    for element in model.elements:
        x, rate = element.phi @ q, element.phi @ v
        damping = element.damper(element.laws)
        lost += np.mean(np.interp(x, element.nodes, damping) * rate**2)
        for stiffness, strength in element.sliders(element.laws):
            r, work = 0.0, 0.0
            for repeat in range(2):
                for k in range(x.size):
                    before, r = r, float(np.clip(r + stiffness * (x[k] - x[k - 1]), -strength, strength))
                    work += repeat * 0.5 * (before + r) * (x[k] - x[k - 1])
            lost += work * w / (2.0 * np.pi)
    low_pass = 1.0 / (1.0 + 1j * h[:, 0] * w / (2.0 * np.pi * model.support_corner_hz)) ** 2
    there = at @ model.input_shapes[:, 0]
    support = 0.5 * np.sum(np.real(model.support_n_m * low_pass * there * np.conj(1j * h[:, 0] * w * there)))
    assert by_modes < 0.97 * given
    assert lost + support == pytest.approx(given, rel=2e-4)


def test_multipliers_are_those_of_a_simulated_period():
    model, samples = smooth(rate_hz=RATE_HZ, steps=1, support_n_m=0.0), 560
    found = steady_state(model, RATE_HZ / samples, 1.5, harmonics=15, largest_range_use=3.0)
    h = np.arange(16)[:, None]
    w = 2.0 * np.pi * RATE_HZ / samples
    begin = np.concatenate([np.sum(found.states[0], axis=0).real, np.sum(1j * h * w * found.states[0], axis=0).real])
    u = 1.5 * np.cos(2.0 * np.pi * np.arange(samples + 1) / samples)[:, None]

    def after(state):
        system, full = model.system, np.zeros(model.system.size)
        full[:4] = state
        run(system, workspace_for(system), u, full, np.zeros((samples, 3, 2)))
        return full[:4]

    units = np.array([1.0, 1.0, w, w])
    np.testing.assert_allclose(after(begin) / units, begin / units, atol=1e-3 * np.max(np.abs(begin / units)))
    nudges = 1e-8 * np.diag(units)
    matrix = np.array([(after(begin + nudge) - after(begin - nudge)) / 2e-8 for nudge in nudges]).T
    exact = np.linalg.eigvals(matrix / units[:, None])
    np.testing.assert_allclose(np.sort_complex(found.multipliers[0]), np.sort_complex(exact), atol=2e-3)


def test_unknown_settings_are_refused_in_a_line():
    for options, message in (
        ({"harmonics": 0}, {"field": "harmonics", "value": 0, "allowed": "1 and above"}),
        ({"samples": 10}, {"field": "samples", "value": 10, "allowed": "at least 15 for 7 harmonics"}),
        ({"force": "fundamental"}, {"says": "fundamental-of-model-driven-by-force", "field": "force"}),
        (
            {"exciter": shaker(), "force": "pure-sine"},
            {
                "says": "makes-harmonics-of-the-force-leave",
                "field": "exciter",
                "hint": "leave it out for 'pure-sine'",
            },
        ),
        ({"band_hz": (30.0, 20.0)}, {"field": "band_hz", "allowed": lambda text: text.startswith("rising")}),
    ):
        with refused(IdentificationError, **message):
            harmonic_response(smooth(), 1.0, **options)


def test_harmonics_are_not_limited_by_the_sample_rate():
    slow, fast = (steady_state(smooth(rate_hz=rate), 24.0, 1.0, largest_range_use=3.0) for rate in (300.0, 3000.0))
    np.testing.assert_allclose(slow.outputs, fast.outputs, rtol=1e-6, atol=1e-6)
