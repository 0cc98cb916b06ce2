"""Figures of models and predictions: what is drawn is what is in the file, every entry of a legend once, nothing empty."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from identification import FrequencyResponse, best_linear_approximation
from rig.drawing.nonlinear_mode import SHAPE_FLOOR, draw_mode
from rig.measurements import spectra
from rig.recording.reader import Recording
from rig.results.exciter.views import draw_exciter
from rig.results.files import load, save
from rig.results.frequency_response_matrix.views import draw_response_matrix
from rig.results.predict import predict_vibrations
from rig.results.predictions.figure import draw_predictions


def page_of(draw, thing, size=(12.0, 7.0)):
    page = Figure(figsize=size, layout="constrained")
    draw(page, thing)
    return page


def labels_of(page):
    return [axis.get_ylabel() for axis in page.axes]


def legend_of(page):
    """Texts of all legends, of the page and of its areas."""
    legends = (
        [axis.get_legend() for axis in page.axes] + page.legends + [one for a in page.subfigs for one in a.legends]
    )
    legends += [one for area in page.subfigs for inner in area.subfigs for one in inner.legends]
    return [text.get_text() for legend in legends if legend is not None for text in legend.get_texts()]


@pytest.fixture(scope="module")
def predicted(shelf):
    request = {
        "forces_n": (0.1, 0.15),
        "sweeps": (shelf / "sweep.h5",),
        "exciter": shelf / "EX.h5",
        "modes": shelf / "LIN.h5",
        "references": (shelf / "stepped.h5",),
    }
    return predict_vibrations(shelf / "NM.h5", request)


def test_a_shape_that_does_not_change_is_said_and_not_drawn(shelf):
    mode = load(shelf / "NM.h5")
    assert (1.0 - mode.mac).max() < 1e-5  # far below what sensors can tell
    page = page_of(draw_mode, mode)
    assert not [label for label in labels_of(page) if "MAC" in label]
    assert "1 - MAC below 0.0001" in page.get_suptitle().replace("\n", " ")
    assert all(axis.get_lines() for axis in page.axes)


def test_a_change_of_shape_is_drawn_over_what_sensors_can_tell(shelf):
    mode = load(shelf / "NM.h5")
    away = np.geomspace(1e-5, 0.1, mode.mac.size)
    page = page_of(draw_mode, replace(mode, mac=1.0 - away))
    (axis,) = [axis for axis in page.axes if "MAC" in axis.get_ylabel()]
    np.testing.assert_allclose(axis.get_lines()[0].get_ydata(), away)
    floor = axis.patches[0].get_y() + axis.patches[0].get_height()
    assert floor == pytest.approx(SHAPE_FLOOR)
    one, other = np.array([1.0, 1.0]), np.array([1.0, 1.02])  # what a sensor off by 2 % makes of equal components
    mac = (one @ other) ** 2 / (one @ one * (other @ other))
    assert pytest.approx(1.0 - mac, rel=0.03) == SHAPE_FLOOR


def test_without_harmonics_there_are_four_panels_and_none_is_empty(shelf):
    mode = load(shelf / "NM.h5")
    bare = replace(mode, mac=np.full(mode.mac.size, np.nan), force_purity=np.full(mode.mac.size, np.nan))
    page = page_of(draw_mode, bare)
    assert len(page.axes) == 4
    assert all(axis.has_data() for axis in page.axes)


@pytest.mark.slow
def test_references_can_be_told_from_curves_and_every_entry_is_there_once(predicted):
    page = page_of(draw_predictions, replace(predicted, sweeps=(), sweep_references=(), sweep_errors=()))
    texts = legend_of(page)
    assert len(texts) == len(set(texts))
    assert {"0.1 N, predicted", "0.15 N, predicted", "measured, curve 3"} < set(texts)
    size = page.axes[0]
    measured = next(line for line in size.get_lines() if line.get_label() == "measured, curve 3")
    np.testing.assert_allclose(measured.get_xdata(), predicted.steady_references[2].frequency_hz)
    curves = {to_rgb(line.get_color()) for line in size.get_lines() if "predicted" in str(line.get_label())}
    assert to_rgb(measured.get_markeredgecolor()) not in curves
    assert to_rgb(measured.get_markerfacecolor()) not in curves


def test_the_difference_of_a_sweep_is_the_one_that_its_error_is_made_of(predicted):
    alone = replace(predicted, steady=(), steady_references=(), steady_errors=(), steady_bands=())
    page = page_of(draw_predictions, alone)
    panels = [axis for axis in page.axes if axis.get_ylabel() == "difference, %"]
    assert len(panels) == len(predicted.sweeps) == 2
    for axis, error in zip(panels, predicted.sweep_errors, strict=True):
        drawn = next(
            line for line in axis.get_lines() if str(line.get_label()).startswith("difference of displacement")
        )
        values = np.asarray(drawn.get_ydata(), float) / 100.0
        assert np.sqrt(np.nanmean(values**2)) == pytest.approx(error.envelope_error, rel=1e-6)


def test_a_page_too_small_for_all_sweeps_says_so(predicted):
    page = page_of(draw_predictions, predicted)
    titles = [one.get_title().get_text() for area in page.subfigs for one in area.legends]
    assert "the first of 2 sweeps, for want of room" in titles


def test_a_response_that_was_asked_for_and_measured_is_predicted_once(shelf, tmp_path):
    mode = shelf / "NM.h5"
    (curve,) = predict_vibrations(mode, {"forces_n": (0.1,)}).steady
    every = slice(None, None, 20)
    held = FrequencyResponse(
        frequency_hz=curve.frequency_hz[every],
        force=curve.fundamental_n[every].astype(complex),
        response=curve.displacement_m[every, 0],
        kind="displacement",
        controlled="force",
        level=0.1,
        label="0.1 N",
    )
    save((held,), tmp_path / "held.h5")
    asked = {"forces_n": (0.1, 0.15), "references": (tmp_path / "held.h5",)}
    found = predict_vibrations(mode, asked)
    assert [one.name for one in found.steady] == ["0.15 N", "0.1 N"]
    assert [reference is None for reference in found.steady_references] == [True, False]
    np.testing.assert_array_equal(found.steady[1].frequency_hz, curve.frequency_hz)
    other = predict_vibrations(mode, asked | {"held": "rms"})  # RMS held is another curve than the fundamental held
    assert len(other.steady) == 3


def test_an_exciter_keeps_the_measured_lines_beside_which_it_is_drawn(shelf, tmp_path):
    exciter = load(shelf / "EX.h5")
    with Recording(shelf / "exciter.h5") as recording:
        (measured,) = spectra(recording).values()
    drive = next(channel.name for channel in measured.channels if channel.role == "drive")
    known = best_linear_approximation(measured, outputs=("force", drive), inputs=("voltage",))
    f = exciter.lines.frequency_hz
    np.testing.assert_allclose(f, known.frequency_hz)
    for name, kept in (("force", exciter.lines.force_per_volt), (drive, exciter.lines.acceleration_per_volt)):
        np.testing.assert_allclose(kept, known.path(name), atol=1e-3 * np.abs(known.path(name)).max())
    save(exciter, tmp_path / "again.h5")
    np.testing.assert_array_equal(load(tmp_path / "again.h5").lines.noise, exciter.lines.noise)
    page = page_of(draw_exciter, exciter)
    drawn = {str(line.get_label()): line for line in page.axes[0].get_lines()}
    np.testing.assert_allclose(drawn["measured"].get_ydata(), np.abs(exciter.lines.force_per_volt))
    residual = np.asarray(drawn["residual"].get_ydata()) / exciter.lines.noise
    assert np.sqrt(np.mean(residual**2)) == pytest.approx(exciter.fit_residual, rel=0.1)


def test_an_exciter_of_an_earlier_file_is_drawn_without_lines(shelf):
    page = page_of(draw_exciter, replace(load(shelf / "EX.h5"), lines=None))
    assert len(page.axes) == 4
    assert "no measured lines" in page.get_suptitle().replace("\n", " ")


def test_the_phase_of_a_response_has_no_line_where_it_wraps(shelf):
    matrix = load(shelf / "LIN.h5").responses
    page = page_of(draw_response_matrix, matrix)
    for line in page.axes[1].get_lines():
        steps = np.abs(np.diff(np.asarray(line.get_ydata(), float)))
        assert np.nanmax(steps) <= 180.0
    assert len(page.axes[0].get_lines()) == 2 * len(matrix.outputs) + 1


@pytest.mark.parametrize("size", [(3.35, 6.0), (13.3, 7.5)])
def test_pages_of_any_width_are_laid_out(size, predicted, shelf, recwarn):
    things = ((draw_mode, load(shelf / "NM.h5")), (draw_exciter, load(shelf / "EX.h5")))
    for draw, thing in things:
        page_of(draw, thing, size).canvas.draw()
    assert not [one for one in recwarn if "constrained_layout" in str(one.message)]
