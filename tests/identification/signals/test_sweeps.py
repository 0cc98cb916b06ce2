from dataclasses import replace

import numpy as np
import pytest

from identification import Channel, IdentificationError, Transient, demodulate, force_drop_out
from simulators import Simulation, VirtualRig
from tests.refused import refused

CHANNELS = (
    Channel("voltage", "monitor", "V"),
    Channel("force", "force", "N"),
    Channel("drive", "drive", "m/s2"),
)


def written_down() -> Transient:
    """Ten newtons, a notch down to one at 20 Hz, 12 N at 24 Hz; a response that peaks at 21 Hz."""
    frequency = np.linspace(10.0, 30.0, 2001)
    force = 10.0 - 9.0 * np.exp(-((frequency - 20.0) ** 2)) + 2.0 * np.exp(-((frequency - 24.0) ** 2))
    response = 5.0 * np.exp(-((frequency - 21.0) ** 2)) * (frequency / 21.0) ** 2  # a displacement largest at 21 Hz
    turn = np.exp(1j * frequency)
    return Transient(CHANNELS, 2.0 * frequency - 20.0, frequency, np.array([turn, turn * force, turn * response]), 2)


def test_minimum_overshoot_and_peak_are_found_where_they_are() -> None:
    result = force_drop_out(written_down())
    assert result.off_resonance_n == pytest.approx(10.0, rel=1e-6)
    assert result.off_resonance_hz == ((10.0, 13.0),)
    assert result.minimum_ratio == pytest.approx(0.1, rel=1e-3)
    assert (result.minimum_frequency_hz, result.minimum_time_s) == pytest.approx((20.0, 20.0))
    assert result.overshoot_ratio == pytest.approx(1.2, rel=1e-3)
    assert (result.overshoot_frequency_hz, result.overshoot_time_s) == pytest.approx((24.0, 28.0))
    assert result.peak == pytest.approx(5.0)
    assert result.peak_m == pytest.approx(5.0 / (2 * np.pi * 21.0) ** 2)
    assert (result.peak_frequency_hz, result.peak_channel, result.peak_unit) == (pytest.approx(21.0), "drive", "m/s2")


@pytest.mark.parametrize("unit", ["m", "m/s", "m/s^2"])
def test_the_largest_displacement_is_not_where_the_acceleration_is_largest(unit: str) -> None:
    sweep = written_down()
    omega = 2.0 * np.pi * sweep.frequency_hz
    displacement_m = 1e-3 / np.sqrt(
        (1.0 - (sweep.frequency_hz / 20.0) ** 2) ** 2 + (0.1 * sweep.frequency_hz / 20.0) ** 2
    )
    order = {"m": 0, "m/s": 1, "m/s^2": 2}[unit]
    channels = (*CHANNELS[:2], Channel("drive", "drive", unit))
    values = np.array([*sweep.fundamentals[:2], displacement_m * omega**order])
    result = force_drop_out(replace(sweep, channels=channels, fundamentals=values))
    resonance_hz = 20.0 * np.sqrt(1.0 - 2.0 * 0.05**2)  # of a damped oscillator's displacement
    assert result.peak_frequency_hz == pytest.approx(resonance_hz, abs=0.006)
    assert result.peak_m == pytest.approx(displacement_m.max(), rel=1e-12)
    assert result.peak == pytest.approx(result.peak_m * (2.0 * np.pi * result.peak_frequency_hz) ** order)
    assert np.interp(result.peak_time_s, sweep.time_s, sweep.frequency_hz) == pytest.approx(result.peak_frequency_hz)


def test_a_sweep_downwards_overshoots_on_the_other_side() -> None:
    up = written_down()
    down = replace(up, frequency_hz=up.frequency_hz[::-1], fundamentals=up.fundamentals[:, ::-1])
    result = force_drop_out(down)
    assert result.off_resonance_hz == ((27.0, 30.0),)
    assert result.minimum_frequency_hz == pytest.approx(20.0)
    # 24 Hz is passed before the minimum: what follows only returns to 10 N.
    assert result.overshoot_ratio == pytest.approx(1.0, rel=1e-3)


def test_bands_off_resonance_are_averaged_with_equal_weight() -> None:
    result = force_drop_out(written_down(), off_resonance_hz=[(23.99, 24.01), (10.0, 17.0)])
    assert result.off_resonance_n == pytest.approx(11.0, rel=1e-4)


def test_bands_outside_the_sweep_and_missing_channels_are_named() -> None:
    with refused(IdentificationError, "to-hz-the-sweep-covers-to", field="off_resonance_hz"):
        force_drop_out(written_down(), off_resonance_hz=[(40.0, 50.0)])
    with refused(IdentificationError, "no-channel-tip-channels-voltage-force"):
        force_drop_out(written_down(), response="tip")


@pytest.mark.parametrize(
    ("voltage_v", "rate_hz_s", "periods", "off_n", "minimum", "tolerance"),
    [(1.5305, 0.25, 1, 4.3, 0.061, 0.001), (2.3225, 7.5, 4, 6.5, 0.17, 0.005)],
)
def test_magnet_beam_drops_its_force_as_documented(
    voltage_v: float, rate_hz_s: float, periods: int, off_n: float, minimum: float, tolerance: float
) -> None:
    time = np.arange(int(30.0 / rate_hz_s * 5000.0)) / 5000.0
    theta = 2 * np.pi * (10.0 * time + 0.5 * rate_hz_s * time**2)
    run = Simulation(VirtualRig.shipped("magnet-beam")).run(voltage_v * np.cos(theta))
    samples = [run.voltage_v, run.measured["force"], run.measured["drive"]]
    sweep = demodulate(theta, samples, CHANNELS, sample_rate_hz=5000.0, periods=periods)
    result = force_drop_out(sweep)
    assert result.off_resonance_n == pytest.approx(off_n, rel=0.02)
    assert result.minimum_ratio == pytest.approx(minimum, abs=tolerance)
    assert result.minimum_frequency_hz < result.peak_frequency_hz
