"""Models and predictions over recordings: lines over markers, at the values of their files; pairs without common axes."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure

from identification.models import as_recorded
from rig.drawing.curves import View
from rig.drawing.style import COLOURS
from rig.errors import RecordingError
from rig.figures.overlay import overlay
from rig.results.files import load, save
from rig.results.predict import predict_vibrations

MICRO = 1e6
"""Micrometres in a metre: amplitudes of the shelf are below half a millimetre."""


@pytest.fixture(scope="module")
def files(shelf):
    """The shelf, with predictions of frequency responses and of a sweep beside their references."""
    steady = predict_vibrations(shelf / "NM.h5", {"forces_n": (0.1,), "references": (shelf / "stepped.h5",)})
    save(steady, shelf / "steady.h5")
    shifted = tuple(replace(one, frequency_hz=1.01 * one.frequency_hz) for one in steady.steady)
    save(replace(steady, steady=shifted), shelf / "other.h5")
    swept = predict_vibrations(shelf / "NM.h5", {"sweeps": (shelf / "sweep.h5",)})
    save(swept, shelf / "swept.h5")
    none = (None,) * len(steady.steady)
    both = replace(swept, steady=steady.steady, steady_references=none, steady_errors=none, steady_bands=none)
    save(both, shelf / "both.h5")
    return shelf


def drawn(*sources, **options):
    (width, height), draw = overlay(list(sources), **options)
    page = Figure(figsize=(width, height), layout="constrained")
    draw(page)
    return page


def lines(axis, *, markers):
    """Lines with points, those with or without markers."""
    found = [line for line in axis.get_lines() if len(line.get_xdata()) > 2]
    return [line for line in found if (line.get_marker() not in ("", "None")) is markers]


def legend(page):
    return [text.get_text() for one in page.legends for text in one.get_texts()]


def joined(axis, colour):
    """Points of all parts of a curve of a colour, without gaps, by frequency and value."""
    parts = [line.get_xydata() for line in lines(axis, markers=False) if to_rgba(line.get_color()) == to_rgba(colour)]
    points = np.unique(np.concatenate(parts).round(12), axis=0)
    return points[np.isfinite(points).all(axis=1)]


@pytest.mark.slow
def test_predictions_are_lines_over_recordings_as_markers(files):
    page = drawn(files / "steady.h5", files / "other.h5", files / "stepped.h5")
    size, phase = page.axes
    for colour, name in zip(COLOURS, ("steady.h5", "other.h5"), strict=False):
        found = load(files / name).steady
        for axis, values in ((size, [MICRO * one.amplitude_m() for one in found]), (phase, None)):
            values = values or [(one.phase_lag_deg() + 90.0) % 360.0 - 90.0 for one in found]
            every = np.transpose([np.concatenate([one.frequency_hz for one in found]), np.concatenate(values)])
            np.testing.assert_allclose(joined(axis, colour), np.unique(every.round(12), axis=0), rtol=1e-9)
    marks = lines(size, markers=True)
    assert {to_rgba(line.get_color()) for line in marks} == {
        to_rgba(COLOURS[2])
    }  # not what the predictions hold as well
    assert {line.get_linestyle() for line in marks} == {"None"}
    assert {line.get_markerfacecolor() for line in marks} == {"none"}
    assert legend(page)[:3] == ["steady", "other", "stepped"]
    measured = np.concatenate([line.get_xdata() for line in marks])
    low, high = size.get_xlim()
    np.testing.assert_allclose(
        [low, high], np.array([-0.15, 0.15]) * np.ptp(measured) + [measured.min(), measured.max()]
    )


def test_a_prediction_shows_its_reference_where_no_recording_does(files):
    page = drawn(files / "steady.h5", files / "other.h5")
    (mark,) = lines(page.axes[0], markers=True)  # once, though both files hold it
    (reference,) = [one for one in load(files / "steady.h5").steady_references if one is not None]
    np.testing.assert_allclose(mark.get_xydata().T, [reference.frequency_hz, MICRO * reference.amplitude_m], rtol=1e-9)
    assert "measured" in legend(page)
    assert not lines(drawn(files / "steady.h5", view=View(channel="drive")).axes[0], markers=True)


def test_a_predicted_sweep_lies_over_the_recorded_one(files):
    size, force = drawn(files / "swept.h5", files / "sweep.h5").axes
    predictions = load(files / "swept.h5")
    pairs = zip(predictions.sweeps, predictions.sweep_references, strict=True)
    expected = [as_recorded(sweep, recorded)[1:] for sweep, recorded in pairs]
    for n, axis in enumerate((size, force)):
        shown = [one for one in axis.get_lines() if to_rgba(one.get_color()) == to_rgba(COLOURS[0])]
        behind = [one for one in axis.get_lines() if to_rgba(one.get_color()) == to_rgba(COLOURS[1])]
        assert len(shown) == len(behind) == len(expected)
        for line, pale, values in zip(shown, behind, expected, strict=True):
            scale = np.nanmax(line.get_ydata()) / values[n].max()
            assert any(scale == pytest.approx(unit) for unit in (1.0, 1e3, 1e6))
            np.testing.assert_allclose(line.get_ydata(), scale * values[n], rtol=1e-9)
            assert pale.get_linewidth() > 2.0 * line.get_linewidth()
            assert pale.get_zorder() < line.get_zorder()


def test_linear_modes_lie_over_their_multisine(files):
    size, phase = drawn(files / "LIN.h5", files / "modal.h5", view=View(channel="acc_drive")).axes
    found = load(files / "LIN.h5")
    line = next(one for one in size.get_lines() if to_rgba(one.get_color()) == to_rgba(COLOURS[0]))
    expected = found.modes.response_matrix(line.get_xdata()).path("acc_drive")
    np.testing.assert_allclose(line.get_ydata(), np.abs(expected), rtol=1e-9)
    assert size.get_ylabel().startswith("acc_drive over force")
    assert phase.get_ylabel() == "phase, deg"


def test_files_with_two_families_take_the_one_they_share(files):
    assert drawn(files / "both.h5", files / "sweep.h5").axes[1].get_ylabel() == "fundamental force, N"
    page = drawn(files / "both.h5", files / "stepped.h5")
    assert page.axes[1].get_ylabel() == "phase lag of displacement, deg"
    assert f"not drawn of both: {len(load(files / 'both.h5').sweeps)} predicted sweeps" in page.get_suptitle().replace(
        "\n", " "
    )


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (("NM", "stepped"), "have no common axes; draw them apart, or predict first (rig predict "),
        (("sweep", "NM"), "NM.h5 --sweep "),
        (("backbone", "stepped"), "backbones and frequency responses have no common axes; draw them apart"),
        (("steady", "sweep"), "frequency responses and sweeps have no common axes; draw them apart"),
        (("NM", "both"), "backbones and frequency responses and sweeps have no common axes; draw them apart"),
        (("EX", "exciter"), "EX.h5: is of kind exciter, which has no curves to lay over others"),
    ],
)  # fmt: skip
def test_other_pairs_are_refused_in_one_line(files, names, said):
    with pytest.raises(RecordingError) as caught:
        overlay([files / f"{name}.h5" for name in names])
    text = str(caught.value)
    assert said in text
    assert "\n" not in text
    assert ("predict first" in text) == ("NM" in names and "both" not in names)
