"""Bias by the images of the held output, against the rig settled in time."""

import numpy as np
import pytest

from simulators.analysis import frequency_response
from simulators.analysis.images import image_bias, image_shares
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


def test_shares_behind_a_filter_are_what_is_read_of_the_rig_settled_in_time() -> None:
    filtered = {
        "sample_rate_hz": RATE_HZ,
        "substeps": 8,
        "oversampling": 4,
        "anti_alias_hz": 800.0,
        "anti_alias_order": 2,
    }
    rig = one_mode(converter=filtered | {"adc_bits": 0, "dac_bits": 0})
    at_hz = np.array([FREQUENCY_HZ, 600.0])
    shares = image_shares(rig, at_hz)
    read = {}
    for hz in at_hz:
        theta = 2.0 * np.pi * hz / RATE_HZ * np.arange(round(SECONDS * RATE_HZ))
        run = Simulation(rig).run(0.1 * np.cos(theta))
        kept = slice(-5000, None)  # whole periods of both, at rest
        read[hz] = {name: np.mean(y[kept] * np.exp(-1j * theta[kept])) for name, y in run.measured.items()}
    exact = frequency_response(rig, at_hz).sensor_per_v
    for row, hz in enumerate(at_hz):  # hold and filter are common to both channels
        found = read[hz]["force"] / read[hz]["drive"] * exact["drive"][row] / exact["force"][row]
        assert abs(found - 1.0) > 1e-4
        assert found - 1.0 == pytest.approx((1.0 + shares["force"][row]) / (1.0 + shares["drive"][row]) - 1.0, rel=1e-3)
