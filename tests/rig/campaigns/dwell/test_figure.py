"""What the figure of a dwell shows: its marks, against the course and the limits that they stand for."""

from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure

from rig.campaigns.dwell import figure
from rig.campaigns.dwell.points import DwellResult
from rig.campaigns.evaluation.point import Quality
from tests.rig.campaigns.made_points import made_point

COURSE = SimpleNamespace(
    cycles=np.array([100.0, 300.0, 500.0]),
    modal_frequency_hz=np.array([50.0, 49.9, 49.7]),
    damping_ratio=np.array([0.004, 0.0041, 0.0044]),
    amplitude_m=np.array([1.0e-3, 1.1e-3, 1.2e-3]),
    force_n=np.array([2.0, 1.9, 1.8]),
)


@pytest.fixture
def drawn(monkeypatch):
    """The axes of a dwell with this course, one more mean that was refused, and these limits."""
    refused = made_point(quality=Quality.REJECTED, result=DwellResult(cycles=400.0))
    monkeypatch.setattr(figure, "recorded_course", lambda recording: COURSE)
    accepted = made_point(result=DwellResult())
    monkeypatch.setattr(figure, "points_of", lambda recording, kind: [refused, accepted])
    monkeypatch.setattr(figure, "accepted_points", lambda recording, kind: [accepted] * COURSE.cycles.size)
    monkeypatch.setattr(figure, "heading", lambda page, recording: None)

    def of(alarm=None, abort=None, **plan):
        page = Figure(layout="constrained")
        recording = SimpleNamespace(configuration={"plan": {"alarm": alarm or {}, "abort": abort or {}} | plan})
        figure.draw(page, recording)
        return {axis.get_ylabel(): axis for axis in page.axes}

    return of


def limits_in(axis):
    """Heights of the dashed lines of an axis, by label."""
    return {line.get_label(): line.get_ydata()[0] for line in axis.get_lines() if line.get_linestyle() == "--"}


def test_every_panel_has_its_quantity_over_the_cycles_and_refused_means_at_the_bottom(drawn):
    axes = drawn()
    wanted = {
        "modal frequency, Hz": COURSE.modal_frequency_hz,
        "modal damping ratio, %": [0.4, 0.41, 0.44],
        "displacement amplitude, mm": [1.0, 1.1, 1.2],
        "fundamental force, N": COURSE.force_n,
    }
    assert list(axes) == list(wanted)
    for label, values in wanted.items():
        course, refused = axes[label].get_lines()
        np.testing.assert_allclose(course.get_xdata(), [100.0, 300.0, 500.0])
        np.testing.assert_allclose(course.get_ydata(), values, rtol=1e-12)
        np.testing.assert_array_equal(refused.get_xdata(), [400.0])
        assert refused.get_label() == "not accepted"
        low, high = axes[label].get_ylim()
        y = axes[label].transAxes.inverted().transform(refused.get_transform().transform((400.0, *refused.get_ydata())))
        assert 0.0 < y[1] < 0.05
        assert low < min(values) < max(values) < high


def test_limits_stand_on_the_side_to_which_the_quantity_has_gone(drawn):
    limits = {"frequency": 0.01, "damping": 0.2, "amplitude": 0.5}
    axes = drawn(alarm=limits, abort={"frequency": 0.02})
    assert limits_in(axes["modal frequency, Hz"]) == {
        "alarm.frequency": pytest.approx(49.5),
        "abort.frequency": pytest.approx(49.0),
    }
    assert limits_in(axes["modal damping ratio, %"]) == {"alarm.damping": pytest.approx(0.48)}
    assert limits_in(axes["displacement amplitude, mm"]) == {"alarm.amplitude": pytest.approx(1.5)}
    assert limits_in(axes["fundamental force, N"]) == {}


def test_where_the_displacement_is_held_the_limit_is_that_of_the_force(drawn):
    axes = drawn(abort={"amplitude": 0.25}, levels_m=[1e-3])
    assert limits_in(axes["displacement amplitude, mm"]) == {}
    assert limits_in(axes["fundamental force, N"]) == {"abort.amplitude": pytest.approx(1.5)}


@pytest.mark.parametrize(("limit", "shown"), [(0.029, True), (0.031, False)])
def test_a_limit_is_shown_once_a_fifth_of_it_is_used(drawn, limit, shown):
    axes = drawn(alarm={"frequency": limit, "damping": None})  # the frequency has fallen by 0.6 %
    assert bool(limits_in(axes["modal frequency, Hz"])) is shown
    assert limits_in(axes["modal damping ratio, %"]) == {}
