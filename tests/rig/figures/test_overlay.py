"""Recordings over one another: what is drawn, against what the files hold, and what is refused."""

import numpy as np
import pytest
from matplotlib.colors import to_rgba

from identification import IdentificationError
from rig.campaigns.evaluation.frequency_responses import recorded_frequency_responses
from rig.campaigns.multisine.points import recorded_spectra
from rig.drawing.curves import View
from rig.drawing.style import COLOURS
from rig.errors import RecordingError
from rig.figures.files import plot
from rig.figures.overlay import overlay
from rig.measurements import decays
from rig.recording.reader import Recording
from rig.results.files import save
from rig.results.identify import identify_model
from rig.results.nonlinear_mode.options import NonlinearModeOptions
from rig.show.summary import summarise
from tests.refused import refused
from tests.rig.figures.conftest import texts


def points(path, **scales):
    """Columns of the accepted points, as `rig show --json` gives them."""
    found = [point for point in summarise(path)["points"] if point["accepted"]]
    return [scale * np.array([point[key] for point in found]) for key, scale in scales.items()]


def harmonics(path):
    """Stored harmonics complex[n, channel, h] and frequencies of the points, and the names of the channels."""
    with Recording(path) as recording:
        rows = list(recording.latest.values())
        pairs = np.array([row["harmonics"] for row in rows])
        names = [channel["name"] for channel in recording.channels]
    return pairs[..., 0] + 1j * pairs[..., 1], np.array([row["frequency_hz"] for row in rows]), names


def curves(axis):
    """Data of the curves of a panel that have labels or points, without reference lines and error bars."""
    return [np.asarray(line.get_xydata()) for line in axis.get_lines() if len(line.get_xdata()) > 2]


def test_two_backbones_lie_where_their_points_are(recordings, drawn, tmp_path):
    one, other = recordings["continuous-backbone"], recordings["backbone"]
    page = drawn(overlay([one, other]))
    frequency, damping = page.axes[:2]
    for axis, key, scale in ((frequency, "modal_frequency_hz", 1.0), (damping, "damping_ratio", 100.0)):
        drawn_here = [np.asarray(line.get_xydata()) for line in axis.get_lines() if line.get_marker() in ("o", "s")]
        for path, data in zip((one, other), drawn_here, strict=True):
            amplitude, values = points(path, amplitude_m=1e3, **{key: scale})
            np.testing.assert_allclose(data, np.transpose([amplitude, values])[np.argsort(amplitude)], rtol=1e-9)
    half, *_ = (
        bars.get_segments()
        for bars in damping.collections
        if len(bars.get_segments()) == len(points(one, level=1.0)[0])
    )
    stored = 196.0 * points(one, damping_ratio_std=1.0)[0]
    np.testing.assert_allclose([0.5 * (high[1] - low[1]) for low, high in half], stored, rtol=0.1)
    said = texts(page)
    for text in ("continuous-backbone", "backbone", "modal frequency, Hz", "modal damping ratio, %"):
        assert text in said
    assert "displacement amplitude, mm" in said
    assert "magnet beam (one-sided): 2 backbones" in said


def test_a_model_lies_over_the_recording_that_it_was_made_of(recordings, drawn, tmp_path):
    path = recordings["continuous-backbone"]
    save(identify_model([path], NonlinearModeOptions()), tmp_path / "model.h5")
    page = drawn(overlay([path, tmp_path / "model.h5"], ["measured", "50 $ model"]))
    (measured,) = (line for line in page.axes[0].get_lines() if line.get_marker() == "o")
    (model,) = (line for line in page.axes[0].get_lines() if line.get_linestyle() == "-")
    assert (measured.get_linestyle(), model.get_marker()) == ("None", "")
    np.testing.assert_allclose(model.get_xydata(), measured.get_xydata(), rtol=1e-6)
    bands = [band for band in page.axes[0].collections if band.get_alpha() == 0.2]
    assert len(bands) == 1
    assert {"measured", "50 $ model"} <= set(texts(page))
    with refused(RecordingError, "model-channel-acc-magnet-the-file"):
        overlay([path, tmp_path / "model.h5"], view=View(channel="acc_magnet"))


def test_a_model_without_a_curve_is_left_out_and_the_title_says_why(recordings, drawn, tmp_path, monkeypatch):
    path = recordings["continuous-backbone"]
    save(identify_model([path], NonlinearModeOptions()), tmp_path / "model.h5")

    def fails(*_):
        raise IdentificationError("no solution found")

    monkeypatch.setattr("rig.results.nonlinear_mode.views.backbone_curves", fails)
    page = drawn(overlay([path, tmp_path / "model.h5"]))
    heading = "".join("".join(texts(page)).split())
    assert f"notdrawn:{tmp_path / 'model.h5'}" in heading
    assert "nosolutionfound" in heading
    assert sum(line.get_marker() in ("o", "s") for line in page.axes[0].get_lines()) == 1
    with refused(IdentificationError, where=str(tmp_path / "model.h5")):
        overlay([tmp_path / "model.h5"])


def test_a_decay_lies_over_a_backbone_as_a_line(recordings, drawn, tmp_path):
    with Recording(recordings["decay"]) as recording:
        (found,) = decays(recording).values()
    save(found, tmp_path / "decay.h5")
    frequency, damping = drawn(overlay([recordings["backbone"], tmp_path / "decay.h5"])).axes
    mode = found.mode()
    for axis, values in ((frequency, mode.modal_frequency_hz), (damping, 100.0 * mode.damping_ratio)):
        (line,) = [one for one in axis.get_lines() if one.get_linestyle() == "-"]
        order = np.argsort(mode.amplitude_m)
        np.testing.assert_allclose(line.get_xydata().T, [1e3 * mode.amplitude_m[order], values[order]], rtol=1e-9)


def test_responses_from_elsewhere_lie_over_a_stepped_sine(recordings, drawn, tmp_path):
    path = recordings["stepped-sine"]
    with Recording(path) as recording:
        save(recorded_frequency_responses(recording), tmp_path / "elsewhere.h5")
    page = drawn(overlay([path, tmp_path / "elsewhere.h5"]))
    for axis in page.axes[:2]:
        here, elsewhere = (line.get_xydata() for line in axis.get_lines() if line.get_marker() in ("o", "s"))
        np.testing.assert_allclose(here[np.isfinite(here[:, 1])], elsewhere, rtol=1e-9)


@pytest.mark.parametrize(("channel", "harmonic"), [("", 1), ("acc_magnet", 1), ("acc_magnet", 3), ("force", 2)])
def test_channel_and_harmonic_are_those_that_were_recorded(recordings, drawn, channel, harmonic):
    path = recordings["stepped-phase"]
    values, frequency, names = harmonics(path)
    expected = np.abs(values[:, names.index(channel or "drive"), harmonic])
    if channel != "force":
        expected = expected / (2.0 * np.pi * harmonic * frequency) ** 2
    for amplitude, scaled in (("dB", 20.0 * np.log10(expected)), ("linear", expected)):
        page = drawn(overlay([path], view=View(amplitude, channel, harmonic)))
        line = page.axes[0].get_lines()[0].get_xydata()
        np.testing.assert_allclose(line[:, 0], frequency, rtol=1e-12)
        factor = 1.0 if amplitude == "dB" else line[0, 1] / scaled[0]
        assert any(factor == pytest.approx(unit, rel=1e-9) for unit in (1.0, 1e3, 1e6))
        np.testing.assert_allclose(line[:, 1], factor * scaled, rtol=1e-9)
        label = page.axes[0].get_ylabel()
        assert ("dB re 1" in label) == (amplitude == "dB")
        assert (f"harmonic {harmonic}" in label) == (harmonic > 1)
        assert channel in label
    assert len(page.axes) == (2 if harmonic == 1 and channel != "force" else 1)  # a harmonic has no lag


def test_a_logarithmic_axis_is_one(recordings, drawn):
    path = recordings["stepped-sine"]
    assert drawn(overlay([path], view=View("log"))).axes[0].get_yscale() == "log"
    assert drawn(overlay([path])).axes[0].get_yscale() == "linear"
    backbone = drawn(overlay([recordings["backbone"]], view=View("log"))).axes
    assert [axis.get_xscale() for axis in backbone] == ["log", "log"]
    assert [axis.get_yscale() for axis in backbone] == ["linear", "linear"]


def test_multisines_show_the_ratio_of_their_spectra(recordings, drawn):
    path = recordings["multisine"]
    with Recording(path) as recording:
        (spectra,) = recorded_spectra(recording).values()
    response = spectra.frequency_response("acc_magnet", instrument="voltage")
    page = drawn(overlay([path, path], ["one", "other"], View(channel="acc_magnet")))
    size, phase = page.axes[:2]
    np.testing.assert_allclose(curves(size)[0][:, 1], np.abs(response.value), rtol=1e-9)
    turned = np.exp(1j * np.radians(curves(phase)[0][:, 1]))
    np.testing.assert_allclose(turned, response.value / np.abs(response.value), atol=1e-9)
    assert size.get_ylabel() == "acc_magnet over force, (m/s²)/N"
    assert size.get_yscale() == "log"


def test_a_jump_of_a_stepped_sine_is_no_line(recordings, drawn):
    path = recordings["stepped-sine"]
    (amplitude,) = points(path, amplitude_m=1.0)
    jumps = np.flatnonzero(np.abs(np.diff(np.log(amplitude))) > np.log(1.5)) + 1
    assert jumps.size
    for axis in drawn(overlay([path], view=View("log"))).axes:
        at = np.flatnonzero(np.isnan(axis.get_lines()[0].get_ydata()))
        np.testing.assert_array_equal(at, jumps + np.arange(jumps.size))


def test_frequency_limits_end_the_axis_and_the_curves(recordings, drawn):
    page = drawn(overlay([recordings["sweep"]], view=View(frequency_hz=(20.0, 30.0))))
    for axis in page.axes:
        assert axis.get_xlim() == (20.0, 30.0)
        x = axis.get_lines()[0].get_xdata()
        assert 19.9 < np.nanmin(x) < 20.1 < 29.9 < np.nanmax(x) < 30.1
    page = drawn(overlay([recordings["backbone"]], view=View(frequency_hz=(24.0, 24.5))))
    assert page.axes[0].get_ylim() == (24.0, 24.5)


def test_files_differ_in_colour_and_marker(recordings, drawn):
    path = recordings["stepped-phase"]
    page = drawn(overlay([path, path, path], ["a", "b", "c"]))
    lines = [line for line in page.axes[0].get_lines() if line.get_marker() != "None"]
    assert [to_rgba(line.get_color()) for line in lines] == [to_rgba(colour) for colour in COLOURS[:3]]
    assert len({line.get_marker() for line in lines}) == 3


def test_what_is_not_drawn_is_said(recordings, drawn, monkeypatch):
    monkeypatch.setattr("rig.figures.curves_of_files.refused", lambda points: "2 not accepted (lost-lock)")
    page = drawn(overlay([recordings["stepped-sine"]], ["x"]))
    assert page.get_suptitle() == "magnet beam (one-sided): x; not drawn of x: 2 not accepted (lost-lock)"


@pytest.mark.parametrize(
    ("kinds", "options", "said"),
    [
        (["backbone", "sweep"], {}, "backbones and sweeps have no common axes; draw them apart"),
        (["stepped-sine", "response-controlled"], {}, "have no common axes"),
        (
            ["dwell"],
            {},
            "is of kind dwell, which has no curves to lay over others or over axes of your own; plot it alone",
        ),
        (["backbone"], {"labels": ["a", "b"]}, "`label`: 2 for 1 files"),
        (["backbone"], {"view": View(channel="drve")}, "`channel` drve: there are force, drive, "),
        (["backbone"], {"view": View(harmonic=99)}, "`harmonic` 99: recorded are 1 to 7"),
        (["backbone"], {"view": View(harmonic=0)}, "`harmonic` 0: recorded are 1 to 7"),
        (["sweep"], {"view": View(harmonic=3)}, "`harmonic` 3: sweeps are evaluated at their fundamental"),
        (["multisine"], {"view": View(harmonic=3)}, "`harmonic` 3: a frequency response has no harmonics"),
        (["multisine"], {"view": View(channel="force")}, "`channel` force: there are drive, acc_drive, acc_magnet"),
        (["stepped-sine"], {"view": View(frequency_hz=(1.0, 2.0))}, "`frequency` 1:2: "),
        (["response-controlled"], {"view": View(channel="nose")}, "`channel` nose"),
    ],
)
def test_what_cannot_be_drawn_is_refused_in_one_line(recordings, kinds, options, said):
    with pytest.raises(RecordingError) as caught:
        overlay([recordings[kind] for kind in kinds], options.get("labels", ()), options.get("view"))
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"amplitude": "cubic"}, {"says": "amplitude-cubic-allowed"}),
        ({"frequency_hz": (3.0, 2.0)}, {"says": "frequency-must-rise"}),
    ],
)
def test_a_view_that_makes_no_sense_is_refused(fields, said):
    with refused(RecordingError, **said):
        View(**fields)


def test_the_command_lays_recordings_over_one_another(command, recordings, tmp_path):
    one, other = recordings["stepped-phase"], recordings["stepped-sine"]
    done = command(
        "plot", one, other, "-o", "both.pdf", "--label", "a", "--label", "b", "--style", "paper", "--size", "85x70"
    )
    assert (done.status, done.err) == (0, "")
    assert b"/MediaBox [ 0 0 240.9" in (tmp_path / "both.pdf").read_bytes()
    for words, said in (
        ((one, recordings["backbone"], "-o", "x.png"), "frequency responses and backbones have no common axes"),
        ((one, "-o", "x.png", "--harmonic", "44"), "--harmonic 44: recorded are 1 to 7"),
        ((one, "-o", "x.png", "--frequency", "24-25"), "--frequency 24-25: write both ends in Hz, such as 24:25.5"),
        ((one, "-o", "x.png", "--size", "wide"), "--size wide: write width and height in mm"),
        ((one, "-o", "x.png", "--style", "poster"), "--style poster: is none of screen, paper, slide"),
        ((one, "-o", "x.html", "--style", "paper"), "--style paper: is for .png, .pdf and .svg; x.html fits itself"),
        ((one, "-o", "x.html", "--size", "85"), "--size 85: is for .png, .pdf and .svg"),
        ((one, other, "-o", "x.png", "--lateness"), "--lateness: is drawn of one recording"),
    ):
        done = command("plot", *words)
        assert done.status == 1
        assert said in done.err
        assert done.err.count("\n") == 1
    assert not (tmp_path / "x.png").exists()


def test_a_figure_does_not_replace_what_it_shows(recordings):
    with refused(RecordingError, "figures-are-written-as"):
        plot([recordings["backbone"]], recordings["backbone"])
