"""Bias by the images of the held output, against the rig settled in time."""

import numpy as np
import pytest

from simulators.analysis.images import image_bias
from simulators.simulation import Simulation
from tests.simulators.analysis.rigs import DAMPING_RATIO, FREQUENCY_HZ, SHAPE, one_mode

RATE_HZ = 2000.0
SECONDS = 10.0


def test_the_bias_is_what_a_phase_resonance_test_of_the_rig_finds() -> None:
    rig = one_mode(converter={"sample_rate_hz": RATE_HZ, "substeps": 8})
    theta = 2.0 * np.pi * FREQUENCY_HZ / RATE_HZ * np.arange(round(SECONDS * RATE_HZ))
    run = Simulation(rig).run(0.1 * np.cos(theta))
    kept = slice(-100 * round(RATE_HZ / FREQUENCY_HZ), None)  # whole periods, at rest
    force, drive = (
        2.0 * np.mean(y[kept] * np.exp(-1j * theta[kept])) for y in (run.force_n, run.displacement_m["drive"])
    )
    omega = 2.0 * np.pi * FREQUENCY_HZ
    square = omega**2 + (SHAPE**2 * force / drive).real
    found_hz = np.sqrt(square) / (2.0 * np.pi)
    damping = (SHAPE**2 * force / drive).imag / (2.0 * omega * np.sqrt(square))
    bias = image_bias(rig, FREQUENCY_HZ, force="force", drive="drive")
    assert abs(bias.damping) > 0.01
    assert damping / DAMPING_RATIO - 1.0 == pytest.approx(bias.damping, rel=0.03)
    assert found_hz / FREQUENCY_HZ - 1.0 == pytest.approx(bias.frequency, rel=0.03)
    ahead = force / drive / abs(force / drive)
    wrong = bias.force_n_per_v * 0.1 / abs(force)
    assert wrong.real / ahead.imag == pytest.approx(1.0 - DAMPING_RATIO / damping, rel=0.03)
    assert -damping * wrong.imag / ahead.imag == pytest.approx(bias.frequency, rel=0.03)
