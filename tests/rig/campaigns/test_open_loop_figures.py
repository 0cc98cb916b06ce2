import io
from dataclasses import replace

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

from identification import (
    Channel,
    FrequencyResponse,
    MultisineDesign,
    PeriodicSpectra,
    demodulate,
    force_drop_out,
    periodic_spectra,
)
from rig.campaigns.multisine.figure import draw_multisine
from rig.campaigns.stepped_sine.figure import draw_stepped_sine
from rig.campaigns.sweep.figure import draw_sweep
from rig.drawing.style import STYLE

CHANNELS = (
    Channel("voltage", "monitor", "V"),
    Channel("force", "force", "N"),
    Channel("drive", "drive", "m/s2"),
)
RATE_HZ = 2000.0


@pytest.fixture
def page() -> Figure:
    with mpl.rc_context(STYLE):
        return Figure(figsize=(9.0, 9.0), layout="constrained")


def rendered(page: Figure) -> list[str]:
    """All texts of the page, after drawing it once with warnings as errors."""
    with mpl.rc_context(STYLE):
        page.savefig(io.BytesIO(), format="png", dpi=40)
    return [text.get_text() for text in page.findobj(Text) if text.get_visible()]


def lines(axis: mpl.axes.Axes) -> dict[str, np.ndarray]:
    return {str(line.get_label()): np.asarray(line.get_xydata()) for line in axis.get_lines()}


def test_a_sweep_shows_signals_envelopes_and_the_drop_out(page: Figure) -> None:
    time = np.arange(int(6 * RATE_HZ)) / RATE_HZ
    theta = 2 * np.pi * (10.0 * time + 2.5 * time**2)
    force = 4.0 - 3.6 * np.exp(-2.0 * (time - 3.0) ** 2)
    samples = np.array([np.cos(theta), force * np.cos(theta), 9.0 * np.exp(-((time - 3.2) ** 2)) * np.sin(theta)])
    sweep = demodulate(theta, samples, CHANNELS, sample_rate_hz=RATE_HZ)
    drop_out = force_drop_out(sweep)
    draw_sweep(page, sweep, samples, RATE_HZ, drop_out=drop_out, title="a beam: linear sweep")
    texts = rendered(page)
    assert len(page.axes) == 4
    envelope = lines(page.axes[1])["fundamental"]
    np.testing.assert_allclose(envelope[:, 1], np.interp(envelope[:, 0], time, force), atol=0.05)
    marked = [line.get_xydata()[0] for line in page.axes[1].get_lines() if line.get_marker() == "v"]
    assert marked == [pytest.approx([3.0, 0.4], abs=0.05)]
    np.testing.assert_allclose(lines(page.axes[3])["voltage"][:, 1], 10.0 + 5.0 * sweep.time_s, atol=1e-3)
    for text in ("a beam: linear sweep", "voltage, V", "force, N", "response (drive), m/s²", "time, s"):
        assert text in texts


def test_the_range_of_a_signal_has_no_gaps_between_its_oscillations(page: Figure) -> None:
    time = np.arange(int(4 * RATE_HZ)) / RATE_HZ
    theta = 2 * np.pi * 100.0 * time
    samples = np.cos(theta)[None, :] * np.array([[1.0], [2.0], [3.0]])
    draw_sweep(page, demodulate(theta, samples, CHANNELS, sample_rate_hz=RATE_HZ), samples, RATE_HZ)
    outline = page.axes[1].collections[0].get_paths()[0].vertices
    inside = (outline[:, 0] > 0.01) & (outline[:, 0] < 3.99) & (outline[:, 1] > 0.0)  # ends see less than a period
    assert inside.sum() > 1000
    assert outline[inside, 1].min() == pytest.approx(2.0, rel=1e-6)


def test_stepped_sines_show_accelerance_whatever_was_measured(page: Figure) -> None:
    frequency = np.linspace(20.0, 30.0, 11)
    omega = 2 * np.pi * frequency
    force = np.full(11, 2.0 + 0j)
    response = FrequencyResponse(frequency, force, 3e-3 * force / omega**2, "displacement", "voltage", 0.5)
    faster = replace(response, response=4e-3 * force, kind="acceleration", level=1.5)
    draw_stepped_sine(page, [response, faster], title="a beam: stepped sine")
    texts = rendered(page)
    accelerance = [line.get_ydata() for line in page.axes[3].get_lines()]
    np.testing.assert_allclose(accelerance, [np.full(11, 3e-3), np.full(11, 4e-3)], rtol=1e-12)
    for text in ("fundamental force, N", "displacement amplitude, µm", "accelerance, (m/s²)/N", "0.5 V", "1.5 V"):
        assert text in texts


def measured_multisine(grid: str) -> PeriodicSpectra:
    design = MultisineDesign(1000.0, 200, 50.0, 100.0, grid)  # line distance 5 Hz
    random = np.random.default_rng(0)
    records = []
    for index in range(3):
        voltage = np.tile(design.realisation(0, index), 4)
        noisy = 2.0 * voltage + 0.01 * random.normal(size=voltage.size)
        records.append(np.array([voltage, noisy, 3.0 * noisy + 0.5 * voltage**2]))
    return periodic_spectra(records, CHANNELS, design)


@pytest.mark.parametrize("grid", ["full", "odd", "odd-random"])
def test_a_multisine_shows_lines_noise_and_frequency_response(page: Figure, grid: str) -> None:
    spectra = measured_multisine(grid)
    draw_multisine(page, spectra, title="a beam: multisine")
    texts = rendered(page)
    voltage, size, force, phase, drive, linear = page.axes
    excited = {"full": 11, "odd": 5, "odd-random": 4}[grid]
    np.testing.assert_allclose(lines(voltage)["excited lines"][:, 1], np.sqrt(2 / excited), rtol=1e-9)
    assert set(lines(voltage)) == {"excited lines"}  # what is commanded has no noise
    expected_noise = 2 * 0.01 / np.sqrt(200 * 4)
    assert np.mean(lines(force)["noise"][:, 1]) == pytest.approx(expected_noise, rel=0.3)
    np.testing.assert_allclose(lines(size)["drive over force"][:, 1], 3.0, rtol=0.5)
    assert np.max(np.abs(phase.get_lines()[0].get_ydata())) < 90.0
    assert ("even lines, not excited" in lines(drive)) == (grid != "full")
    assert ("odd lines, not excited" in lines(drive)) == (grid == "odd-random")
    u, y = (spectra.spectra[:, :, row][..., spectra.excited].reshape(12, -1) for row in (1, 2))
    cross = np.abs(np.sum(y * np.conj(u), axis=0)) ** 2
    expected = cross / np.sum(np.abs(u) ** 2, axis=0) / np.sum(np.abs(y) ** 2, axis=0)
    np.testing.assert_allclose(linear.get_lines()[0].get_ydata(), expected, rtol=1e-9)
    assert (expected.min() < 1.0 - 1e-9) == (grid == "full")  # an even distortion is not on odd lines
    for text in ("a beam: multisine", "drive over force, (m/s²)/N", "coherence, drive–force"):
        assert text in texts


def test_a_coherence_of_a_single_period_is_not_shown(page: Figure) -> None:
    design = MultisineDesign(1000.0, 200, 50.0, 100.0, "full")
    voltage = design.realisation(0, 0)
    spectra = periodic_spectra([np.array([voltage, 2.0 * voltage, 3.0 * voltage])], CHANNELS, design)
    draw_multisine(page, spectra)
    assert "coherence needs more\nthan one period" in rendered(page)
    assert not page.axes[5].get_lines()


def test_points_of_a_stepped_sine_that_a_jump_parts_are_joined_by_dots(page: Figure) -> None:
    frequency = np.array([24.0, 24.1, 24.2, 24.3])
    motion = 1e-3 * np.array([1.0, 1.2, 0.3, 0.25]) + 0j
    measured = FrequencyResponse(frequency, np.full(4, 0.5 + 0j), motion, "displacement", "force", 0.5, "0.5 N", "beam")
    draw_stepped_sine(page, [measured])
    assert "0.5 N" in rendered(page)
    for axis in page.axes:
        dots = [np.asarray(line.get_xdata()) for line in axis.get_lines() if line.get_linestyle() == ":"]
        dots = [dotted for dotted in dots if dotted.size]  # one stands in the legend
        np.testing.assert_array_equal(dots, [[24.1, 24.2]])
    drawn = np.asarray(page.axes[1].get_lines()[0].get_ydata())
    np.testing.assert_allclose(drawn, [1.0, 1.2, np.nan, 0.3, 0.25])
