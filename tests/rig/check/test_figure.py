"""Figure of a check: what was read if it ended early, findings that belong together in one line, no empty frames."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from rig.arming.run_options import RunOptions
from rig.check.figure import draw_check
from rig.check.run import check
from tests.rig.check.rewired import column, flipped, noise_only, rewire, scaled
from tests.rig.rigs import bench_with


@pytest.fixture
def drawn(tmp_path, monkeypatch):
    def of(rewiring, size=(9.0, 6.4)):
        rewire(monkeypatch, rewiring)
        found = check(bench_with({"block": 50}), tmp_path / "check.h5", RunOptions(seed=2, overwrite=True))
        page = Figure(figsize=size, layout="constrained")
        draw_check(page, found)
        return found, page

    return of


def texts_of(page):
    return [text.get_text() for axis in page.axes for text in axis.texts]


def test_a_check_that_ended_early_shows_how_near_the_channels_came_to_their_limits(drawn):
    def high(volts, bench):
        volts[:, column(bench, "drive")] = 9.9

    found, page = drawn(high)
    assert "not played to its end" in page.get_suptitle().replace("\n", " ")
    bars = page.axes[0]
    names = [label.get_text() for label in bars.get_yticklabels()]
    limits, drive = found.bench.limits, found.bench.channels[names.index("drive")]
    wanted = 100.0 * 9.9 / drive.sensitivity_v_per_unit / limits.acceleration_m_s2
    widths = [bar.get_width() for bar in bars.patches]
    assert widths[names.index("drive")] == pytest.approx(wanted, rel=1e-3)
    assert max(width for name, width in zip(names, widths, strict=True) if name != "drive") < 1.0
    assert all(axis.has_data() or axis.texts or not axis.axison for axis in page.axes)


def test_a_channel_without_numbers_is_said_to_have_none(drawn):
    def lost(volts, bench):
        volts[:, column(bench, "acc_drive")] = np.nan

    _, page = drawn(lost)
    assert "  no number" in texts_of(page)


def test_with_a_dead_force_channel_responses_are_drawn_per_volt(drawn):
    found, page = drawn(noise_only("force"))
    size = page.axes[0]
    assert size.get_ylabel() == "acceleration, (m/s²)/V"
    np.testing.assert_allclose(size.get_lines()[0].get_ydata(), np.abs(found.responses.per_volt[1]))


def test_the_same_finding_on_several_channels_is_one_entry(drawn):
    _, page = drawn(scaled("force", 0.5))
    assert any(text.startswith("fail: size drive, acc_drive, acc_magnet") for text in texts_of(page))


@pytest.mark.parametrize("size", [(3.35, 6.6), (13.3, 7.5)])
def test_findings_stay_on_the_page(size, drawn):
    _, page = drawn(flipped("drive"), size)
    page.canvas.draw()
    inside = page.bbox
    for axis in page.axes:
        for text in axis.texts:
            box = text.get_window_extent()
            assert inside.x0 <= box.x0
            assert box.x1 <= inside.x1
