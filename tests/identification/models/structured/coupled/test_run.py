"""Structured models simulated with an exciter, against harmonic balance and a rigid attachment that is known exactly."""

from dataclasses import replace

import numpy as np
import pytest

from identification import Channel, Exciter, IdentificationError, coupled_run, steady_state
from identification.models.structured.elements import NonlinearElement
from identification.models.structured.laws import PolynomialDamper
from tests.identification.models.pnlss.steady.oscillators import shaker
from tests.identification.models.structured.steady.beams import beam, friction, hysteresis, smooth
from tests.refused import refused

RATE_HZ, LOWEST_HZ = 2000.0, 10.0


def last_harmonics(values, samples, harmonics=5):
    found = np.fft.rfft(values[..., -samples:], axis=-1).T / samples
    found[1:] *= 2.0
    return found[: harmonics + 1]


@pytest.mark.parametrize(("make", "voltage_v"), [(smooth, 0.5), (friction, 2.0), (hysteresis, 2.0)])
def test_a_run_settles_on_the_harmonic_balance_of_the_pair(make, voltage_v):
    samples, periods = 80, 400
    model = make(rate_hz=RATE_HZ, steps=4)
    voltage = voltage_v * np.cos(2.0 * np.pi * np.arange(samples * periods) / samples)
    run = coupled_run(model, shaker(), voltage, lowest_hz=LOWEST_HZ)
    assert run.change < 1e-6
    assert run.unsolved_steps == 0
    exact = steady_state(
        model, RATE_HZ / samples, voltage_v=voltage_v, exciter=shaker(), harmonics=11, largest_range_use=3.0
    )
    assert exact.stable[0]
    outputs = last_harmonics(run.outputs, samples)
    size = np.abs(outputs).max(axis=0)
    np.testing.assert_allclose(outputs[1:] / size, exact.outputs[0, 1:6] / size, atol=2e-3)
    force = last_harmonics(run.force_n, samples)
    np.testing.assert_allclose(force[1:], exact.force_n[0, 1:6], atol=2e-3 * np.abs(force[1]))


def test_a_massless_exciter_on_a_velocity_is_a_damper_at_the_drive_point():
    velocity = (Channel("drive", "drive", "m/s"), *beam().outputs[1:])
    model = replace(smooth(rate_hz=RATE_HZ, support_n_m=0.0), outputs=velocity, direct=np.zeros((3, 1)))
    massless = Exciter(
        force_per_volt_n_v=4.0,
        coil_time_constant_s=0.0,
        moving_mass_kg=0.0,
        suspension_damping_n_s_m=30.0,
        suspension_stiffness_n_m=0.0,
        back_emf_damping_n_s_m=0.0,
    )
    lines = np.zeros(2001, dtype=complex)
    lines[40:300] = np.exp(2j * np.pi * np.random.default_rng(1).random(260))  # 20 to 150 Hz
    voltage = 100.0 * np.fft.irfft(lines, 4000) * np.hanning(4000)
    found = coupled_run(model, massless, voltage, lowest_hz=LOWEST_HZ)

    class Constant(PolynomialDamper):
        def damping(self, x):
            return np.full_like(x, 30.0)

    dashpot = NonlinearElement(direction=model.input_shapes[:, 0], scale_m=1e-3, laws=(Constant(),))
    inside = replace(model, elements=(*model.elements, dashpot)).simulate(4.0 * voltage[None])
    size = np.abs(inside.outputs).max(axis=1)[:, None]
    np.testing.assert_allclose(found.outputs / size, inside.outputs / size, atol=2e-3)
    assert np.max(np.abs(found.force_n - 4.0 * voltage)) > 0.1 * np.max(np.abs(found.force_n))


def test_what_cannot_be_coupled_is_named():
    model, voltage = smooth(), np.zeros(100)
    with refused(IdentificationError, field="voltage_v", allowed="finite"):
        coupled_run(model, shaker(), [0.0, np.nan])
    with refused(IdentificationError, field="lowest_hz", value=490.0, allowed="well below half of 1000 Hz"):
        coupled_run(model, shaker(), voltage, lowest_hz=490.0)
