import numpy as np
import pytest
from scipy.signal import lfilter

from identification import (
    Channel,
    IdentificationError,
    MultisineDesign,
    PeriodicSpectra,
    best_linear_approximation,
    distortion_levels,
    periodic_spectra,
)
from tests.refused import refused

CHANNELS = (
    Channel("voltage", "monitor", "V"),
    Channel("force", "force", "N"),
    Channel("drive", "drive", "m/s2"),
)
N = 1024
DESIGN = MultisineDesign(1024.0, N, 20.0, 120.0, "odd-random")
FORCE_FILTER = ([0.5, 0.3], [1.0, -0.4])  # voltage -> force


def measured(
    cubic: float = 0.0,
    quadratic: float = 0.0,
    *,
    noise: float = 0.0,
    shaker: float = 0.0,
    realisations: int = 4,
    periods: int = 3,
    design: MultisineDesign = DESIGN,
) -> PeriodicSpectra:
    """Force x by a filter (and a cube of the voltage, ``shaker``), response x + cubic x^3 + quadratic x^2, white noise."""
    random = np.random.default_rng(3)
    records = []
    for index in range(realisations):
        voltage = np.tile(design.realisation(0, index), periods + 1)
        force = lfilter(*FORCE_FILTER, voltage + shaker * voltage**3)
        drive = force + cubic * force**3 + quadratic * force**2
        rows = np.array([voltage, force, drive])
        rows[1:] += noise * random.normal(size=rows[1:].shape)
        records.append(rows)
    return periodic_spectra(records, CHANNELS, design, transient_periods=1)


def force_lines(design: MultisineDesign = DESIGN) -> tuple[np.ndarray, float]:
    """Two-sided |X_k|^2 of the force over k = -N/2 ... N/2, and its variance."""
    z = np.exp(2j * np.pi * design.lines / design.period_samples)
    gain = np.polyval(FORCE_FILTER[0], z) / np.polyval(FORCE_FILTER[1], z)
    powers = np.zeros(design.period_samples + 1)
    for sign in (1, -1):
        powers[design.period_samples // 2 + sign * design.lines] = np.abs(0.5 * gain * design.amplitudes) ** 2
    return powers, float(powers.sum())


def power_of_the_cube(powers: np.ndarray, m: int) -> float:
    """E|Y_m|^2 of y = x^3 over random phases, without what is linear in X_m, exactly.

    Triples i + j + l = m stand in 6, 3 or 1 orders, and so much adds up in phase; those with a pair i, -i are linear.
    """
    numbers = np.arange(-(N // 2), N // 2 + 1)
    of = dict(zip(numbers.tolist(), powers, strict=True))
    ordered = np.convolve(np.convolve(powers, powers), powers)[N:-N][N // 2 + m]
    linear = of[m] * (6.0 * np.sum(powers[numbers > 0] ** 2) - 3.0 * of[m] ** 2)
    twice = sum(of[i] ** 2 * of.get(m - 2 * i, 0.0) for i in of if 3 * i != m and i != m)
    thrice = of[m // 3] ** 3 if m % 3 == 0 else 0.0
    return float(6.0 * (ordered - linear) - 9.0 * twice - 5.0 * thrice)


def test_the_best_linear_approximation_of_a_cube_is_three_times_the_variance() -> None:
    # Over random phases exactly 3 sigma^2 - 3/4 A_k^2 at line k; the second part goes with the number of lines.
    spectra = measured(cubic=1.0, realisations=300, periods=2)
    found = best_linear_approximation(spectra)
    powers, variance = force_lines()
    expected = 1.0 + 3.0 * variance - 3.0 * powers[N // 2 + DESIGN.lines]
    deviation = np.abs(found.value[:, 0, 0] - expected) / found.total_std[:, 0, 0]
    assert np.sqrt(np.mean(deviation**2)) == pytest.approx(1.0, abs=0.25)
    assert np.mean(found.value.real) == pytest.approx(1.0 + 3.0 * variance, rel=0.02)


def test_a_square_adds_nothing_to_the_best_linear_approximation_of_an_odd_grid() -> None:
    found = best_linear_approximation(measured(quadratic=1.0))
    np.testing.assert_allclose(found.value, 1.0, atol=1e-9)


def test_a_square_is_heard_on_even_lines_with_the_power_of_its_pairs() -> None:
    spectra = measured(quadratic=0.3, realisations=200, periods=2)
    levels = distortion_levels(spectra, input="force")
    powers, _ = force_lines()
    pairs = np.convolve(powers, powers)[N // 2 : -N // 2]
    lines = np.round(levels.frequency_hz).astype(int)
    even = levels.select("even")
    # Ordered pairs i + j = m, each twice: E|Y_m|^2 = 2 sum |X_i|^2 |X_m-i|^2, but once for i = j; peak amplitudes are doubled.
    half = powers[N // 2 + lines[even] // 2] ** 2
    expected = 0.3**2 * 4.0 * (2.0 * pairs[N // 2 + lines[even]] - half)
    assert np.mean(levels.distortion[0, even]) == pytest.approx(np.mean(expected), rel=0.05)
    np.testing.assert_allclose(levels.distortion[0, even], expected, rtol=0.6)
    assert levels.ratio("drive", "odd") < 1e-9
    assert levels.ratio("drive", "excited") < 1e-6


def test_a_cube_is_heard_on_odd_lines_and_in_the_scatter_with_the_power_of_its_triples() -> None:
    spectra = measured(cubic=0.1, realisations=200, periods=2)
    levels = distortion_levels(spectra, input="force")
    powers, _ = force_lines()
    expected = 0.1**2 * 4.0 * np.array([power_of_the_cube(powers, round(line)) for line in levels.frequency_hz])
    for chosen in ("odd", "excited"):
        where = levels.select(chosen)
        assert np.mean(levels.distortion[0, where]) == pytest.approx(np.mean(expected[where]), rel=0.05)
    assert levels.ratio("drive", "even") < 1e-9


def test_noise_is_taken_out_of_the_levels() -> None:
    quiet = distortion_levels(measured(cubic=0.05, quadratic=0.05, realisations=60))
    noisy = distortion_levels(measured(cubic=0.05, quadratic=0.05, noise=0.3, realisations=60))
    expected = 4 * 0.3**2 / N / 3  # power of white noise at a line, mean over three periods
    assert np.mean(noisy.noise) == pytest.approx(expected, rel=0.05)
    for lines in ("odd", "even", "excited"):
        assert noisy.ratio("drive", lines) == pytest.approx(quiet.ratio("drive", lines), rel=0.15)
    silent = distortion_levels(measured(noise=0.3, realisations=60))
    for lines in ("odd", "even", "excited"):
        mean = np.mean(silent.distortion[:, silent.select(lines)])
        assert abs(mean) < 0.1 * expected


def test_distortion_of_the_shaker_is_the_rig_s_and_not_the_structure_s() -> None:
    spectra = measured(shaker=0.05)
    rig = distortion_levels(spectra)
    assert [channel.name for channel in rig.channels] == ["force", "drive"]
    assert rig.ratio("drive", "odd") == pytest.approx(rig.ratio("force", "odd"), rel=1e-6)
    assert rig.ratio("force", "odd") > 0.04
    structure = distortion_levels(spectra, input="force")
    assert [channel.name for channel in structure.channels] == ["drive"]
    assert structure.ratio("drive", "odd") < 1e-9
    assert structure.ratio("drive", "excited") < 1e-6


def test_the_full_grid_has_the_scatter_only_and_one_realisation_not_even_that() -> None:
    full = MultisineDesign(1024.0, N, 20.0, 120.0)
    levels = distortion_levels(measured(cubic=0.1, design=full))
    assert np.isnan(levels.ratio("drive", "odd"))
    assert levels.ratio("drive", "excited") > 0.05
    one = distortion_levels(measured(cubic=0.1, realisations=1))
    assert np.isnan(one.ratio("drive", "excited"))
    assert one.ratio("drive", "odd") > 0.05
    frequency_hz, amplitude = one.amplitude("drive", "odd")
    assert np.array_equal(frequency_hz, DESIGN.detection_lines_odd * 1.0)
    assert np.all(amplitude > 0.0)


def test_what_cannot_be_told_is_refused() -> None:
    with refused(IdentificationError, field="periods", value=1, allowed="2 or more to tell noise from distortion"):
        distortion_levels(measured(periods=1))
    other = MultisineDesign(1024.0, N, 20.0, 120.0, "odd-random", grid_seed=1)
    records = [np.tile(np.array([DESIGN.realisation(0, 0)] * 3), 2)]
    with refused(IdentificationError, "line-that-the-design-does-not"):
        distortion_levels(periodic_spectra(records, CHANNELS, other))
    with refused(IdentificationError, field="lines", value="all", allowed="excited, odd, even"):
        distortion_levels(measured()).ratio("drive", "all")
