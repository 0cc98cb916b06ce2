"""Figures of recordings: what is drawn, against what the files hold; what is missing is said."""

import itertools
from itertools import pairwise

import numpy as np
import pytest

from rig.campaigns.plans import load_plan
from rig.drawing.style import restyle
from rig.figures.files import drawing
from rig.recording.reader import Recording
from tests.recorded import recorded_at
from tests.rig.figures.conftest import texts

NARROW = [24.0, 24.38]
"""Window that holds the resonance of the magnet beam at low level only."""


def run(path, name, **changes):
    """Carry out a shipped plan with changes."""
    plan = load_plan(name)
    table = plan.model_dump(exclude_none=True)
    table["controller"] |= changes.pop("controller", {})
    return recorded_at(path, type(plan).model_validate(table | changes))


@pytest.fixture(scope="module")
def none(tmp_path_factory):
    """A backbone without a single accepted point."""
    window = {"frequency_window_hz": NARROW, "centre_frequency_hz": 24.2}
    return run(tmp_path_factory.mktemp("none") / "none.h5", "magnet-beam/backbone", levels_v=[2.0], controller=window)


def line_called(axis, label):
    return next(line for line in axis.get_lines() if line.get_label() == label)


def test_the_phase_error_is_drawn_while_the_plan_runs_and_stays_on_its_axis(recordings, drawn):
    path = recordings["backbone"]
    error = drawn(drawing(path)).axes[3]
    detector = line_called(error, "detector")
    low, high = error.get_ylim()
    shown = detector.get_ydata()[np.isfinite(detector.get_ydata())]
    assert low < shown.min() < shown.max() < high
    with Recording(path) as recording:
        (part,) = recording.parts
        running = part.rows("segment") >= 0
        rate = float(recording.configuration["bench"]["sample_rate_hz"])
        points = [point["phase_error_deg"] for point in part.points]
    end_s = np.flatnonzero(running)[-1] / rate
    assert detector.get_xdata()[np.isfinite(detector.get_ydata())].max() == pytest.approx(end_s, abs=0.05)
    (ramp,) = (patch for patch in error.patches if patch.get_label() == "ramp-down")
    assert ramp.get_x() == pytest.approx(end_s, abs=0.05)
    assert ramp.get_x() + ramp.get_width() == pytest.approx(running.size / rate, abs=0.05)
    np.testing.assert_allclose(line_called(error, "recorded points").get_ydata(), points)


def test_a_continuous_backbone_shows_how_far_off_resonance_its_levels_were_passed(recordings, drawn):
    path = recordings["continuous-backbone"]
    page = drawn(drawing(path))
    (detuning,) = (axis for axis in page.axes if axis.get_ylabel() == "largest detuning, %")
    with Recording(path) as recording:
        rows = sorted(recording.latest.values(), key=lambda row: row["amplitude_m"])
        limit = 100.0 * recording.configuration["plan"]["accepted_detuning"]
    shown = next(line for line in detuning.get_lines() if line.get_marker() == "o").get_ydata()
    expected = [100.0 * np.tan(np.radians(row["phase_error_deg"])) * row["damping_ratio"] for row in rows]
    np.testing.assert_allclose(shown, expected, rtol=1e-9)
    assert np.max(np.abs(shown)) < limit  # instants beyond are left out, and are not told of
    assert not any("phase error" in text for text in texts(page))


def test_the_friction_beam_is_off_resonance_within_what_is_accepted(tmp_path):
    path = run(tmp_path / "friction.h5", "friction-beam/continuous-backbone")
    with Recording(path) as recording:
        limit = recording.configuration["plan"]["accepted_detuning"]
        rows = [row for row in recording.latest.values() if row["quality"] in ("good", "warned")]
    assert len(rows) > 10
    for row in rows:
        assert abs(np.tan(np.radians(row["phase_error_deg"])) * row["damping_ratio"]) < limit


def test_stepped_phase_dots_the_branch_that_folds_back(tmp_path, drawn):
    lags = {"start_deg": -150.0, "stop_deg": -60.0, "step_deg": 15.0}
    path = run(tmp_path / "phase.h5", "magnet-beam/stepped-phase-fast", levels_n=[0.55], **lags)
    page = drawn(drawing(path))
    amplitude = page.axes[0]
    solid, dotted = (
        next(line for line in amplitude.get_lines() if line.get_linestyle() == style) for style in ("-", ":")
    )
    with Recording(path) as recording:
        frequency = np.array([row["frequency_hz"] for row in recording.latest.values()])
    falling = np.diff(frequency) < 0.0  # the plan's lag rises
    assert 0 < falling.sum() < falling.size

    def pieces(line):
        x = line.get_xdata()
        return {(a, b) for a, b in itertools.pairwise(x) if np.isfinite(a + b)}

    ends = list(itertools.pairwise(frequency))
    assert pieces(dotted) == {ends[n] for n in np.flatnonzero(falling)}
    assert pieces(solid) == {ends[n] for n in np.flatnonzero(~falling)}
    assert "folds back: unstable at this force without the loop" in texts(page)


def test_a_held_sweep_shows_no_drop_out(recordings, drawn, tmp_path):
    free = texts(drawn(drawing(recordings["sweep"])))
    assert any("% of" in text and "N at" in text for text in free)
    speed = {"rate_hz_per_s": 0.05, "levels_n": [0.1], "start_hz": 24.0, "stop_hz": 24.3}
    held = texts(drawn(drawing(run(tmp_path / "held.h5", "magnet-beam/controlled-sweep-up", **speed))))
    assert not any("N at" in text for text in held)
    assert any("% of the level" in text for text in held)


@pytest.mark.parametrize("look", ["screen", "paper", "slide"])
def test_a_recording_without_an_accepted_point_says_why(none, drawn, look):
    restyle(look)
    page = drawn(drawing(none))
    said = " ".join(" ".join(texts(page)).split())
    assert "backbone test, 1 point, 1 not accepted (outside-window)" in said
    assert "Nothing else to draw: no point was accepted; the first: " in said
    with Recording(none) as recording:
        (row,) = recording.latest.values()
    assert " ".join(row["reason"].split()) in said
    assert "; the run ended: no lock at the start voltage" in said
    assert len(page.axes[0].get_lines()) == 1  # the frequency is drawn all the same
    for text in (page.get_suptitle(), *texts(page)):
        assert text


def outside(page):
    """Texts of panels and legends that leave the page, or vertical labels that leave their panel."""
    width, height = page.bbox.width, page.bbox.height
    found = []
    for axis in page.axes:
        for label in (
            axis.xaxis.label,
            axis.yaxis.label,
            *(axis.get_legend().get_texts() if axis.get_legend() else ()),
        ):
            box = label.get_window_extent()
            if label.get_text() and not (
                box.x0 >= -1 and box.x1 <= width + 1 and box.y0 >= -1 and box.y1 <= height + 1
            ):
                found.append(label.get_text())
    return found


@pytest.mark.parametrize("look", ["screen", "paper", "slide"])
@pytest.mark.parametrize(
    "kind", ["backbone", "continuous-backbone", "stepped-phase", "stepped-sine", "sweep", "multisine", "dwell"]
)
def test_no_text_leaves_the_page_at_any_size(recordings, drawn, kind, look):
    restyle(look, {"figure.dpi": 60})
    page = drawn(drawing(recordings[kind]))
    assert outside(page) == []
    for axis in page.axes:
        assert axis.get_ylabel()
        assert axis.bbox.height > 0.5 * 60  # half an inch at the least
        low, high = sorted(axis.get_xlim())
        numbers = [text for text in axis.get_xticklabels() if text.get_text() and low <= text.get_position()[0] <= high]
        boxes = [text.get_window_extent() for text in numbers if text.get_visible()]
        assert all(one.x1 < other.x0 for one, other in pairwise(boxes))
