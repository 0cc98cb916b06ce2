"""Figures for a browser: numbers and texts in the file against what was drawn; nothing but its own scripts runs."""

import base64
import hashlib
import json
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from rig.drawing.interactive.shapes import MOST, thinned
from rig.drawing.page import page_for
from rig.drawing.style import title
from rig.errors import RecordingError
from rig.figures.files import plot
from rig.show.summary import summarise
from tests.rig.report.conftest import HOSTILE

AMPLITUDE = "displacement amplitude, mm"


class Elements(HTMLParser):
    """Elements of a page with their attributes, and the text in each script."""

    def __init__(self, text):
        super().__init__()
        self.found, self.scripts, self._inside = [], [], False
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.found.append((tag, dict(attrs)))
        self._inside = tag == "script"
        if self._inside:
            self.scripts.append("")

    def handle_endtag(self, tag):
        self._inside = False

    def handle_data(self, data):
        if self._inside:
            self.scripts[-1] += data


def contents(path):
    return json.loads(Elements(path.read_text(encoding="utf-8")).scripts[0])


def lines(panel, **looks):
    """Lines of a panel with points, those with these looks."""
    found = [shape for shape in panel["shapes"] if shape["kind"] == "line" and shape["inX"] and shape["inY"]]
    return [one for one in found if not one["silent"] and all(one.get(key) == value for key, value in looks.items())]


@pytest.fixture
def drawn(tmp_path):
    """Draw on a page, and return what its file holds."""

    def contents_of(draw, size_in=(9.0, 6.4)):
        with page_for(tmp_path / "figure.html", size_in) as page:
            draw(page)
        return contents(tmp_path / "figure.html")

    return contents_of


def test_a_backbone_has_the_values_intervals_and_quality_of_its_points(recordings, tmp_path):
    plot(recordings["backbone"], tmp_path / "b.html")
    found = contents(tmp_path / "b.html")
    frequency, damping, history, error = found["panels"]
    points = sorted(summarise(recordings["backbone"])["points"], key=lambda point: point["amplitude_m"])
    for panel, key, scale, label in (
        (frequency, "modal_frequency_hz", 1.0, "modal frequency, Hz"),
        (damping, "damping_ratio", 100.0, "modal damping, %"),
    ):
        line = lines(panel)[0]
        np.testing.assert_allclose(line["x"], [1e3 * point["amplitude_m"] for point in points], rtol=1e-6)
        np.testing.assert_allclose(line["y"], [scale * point[key] for point in points], rtol=1e-6)
        assert (panel["x"]["label"], panel["y"][0]["label"]) == (AMPLITUDE, label)
        assert len(line["half"]) == len(points)
        assert np.all(np.array(line["half"]) > 0.0)
        for note, point in zip(line["notes"], points, strict=True):
            assert note.startswith(f"point {point['number'] + 1}: {point['quality']}")
            assert all(warning.partition(":")[0] in note for warning in point["warnings"])
    assert [y["label"] for y in history["y"]] == ["oscillator frequency, Hz", "output amplitude, V"]
    assert {shape["on"] for shape in history["shapes"]} == {0, 1}
    assert [entry["text"] for entry in error["legend"]] == ["detector", "recorded points", "ramp-down"]
    assert found["title"] == "magnet beam (one-sided): backbone test, 2 points"
    assert found["columns"] == 2


def test_files_over_one_another_have_their_names_and_qualities(recordings, tmp_path):
    plot([recordings["stepped-phase"], recordings["stepped-sine"]], tmp_path / "o.html", labels=["one", "other"])
    found = contents(tmp_path / "o.html")
    for name, kind in (("one", "stepped-phase"), ("other", "stepped-sine")):
        (line,) = [one for one in lines(found["panels"][0]) if one.get("name", "").startswith(name)]
        known = [f"point {point['number'] + 1}" for point in summarise(recordings[kind])["points"] if point["accepted"]]
        assert [note.partition(":")[0] for note in line["notes"] if note] == known
    assert [entry["text"] for entry in found["legend"]][:2] == ["one", "other"]


@pytest.mark.slow
def test_every_kind_of_recording_has_a_figure_for_a_browser(recordings, tmp_path):
    for kind, path in recordings.items():
        plot(path, tmp_path / f"{kind}.html")
        found = contents(tmp_path / f"{kind}.html")
        assert found["panels"], kind
        assert all(panel["shapes"] and "picture" not in panel for panel in found["panels"]), kind
        told = [note for panel in found["panels"] for line in lines(panel) for note in line.get("notes", [])]
        told += [line.get("name", "") for panel in found["panels"] for line in lines(panel)]
        said = [re.search(r"point \d+: (good|warned)", note) for note in told]
        assert any(said), kind
        assert (tmp_path / f"{kind}.html").stat().st_size < 1_500_000, kind


def test_looks_are_those_of_the_printed_figure(drawn):
    def draw(page):
        axis = page.subplots()
        axis.plot([1.0, 2.0], [3.0, np.nan], ls=(0, (1.5, 2.5)), lw=2.0, color="#d55e00", label="dotted")
        axis.plot([1.0, 2.0], [3.0, 4.0], "s", mfc="none", ms=6.0, color="#0072b2", alpha=0.5)
        axis.axvline(1.5)
        axis.fill_between([1.0, 2.0], [1.0, 1.0], [2.0, 3.0], color="#009e73", alpha=0.2)
        axis.set(yscale="log", xlim=(3.0, 0.0), ylabel="shape, kg$^{-1/2}$")
        axis.legend()

    (panel,) = drawn(draw)["panels"]
    dotted, squares = lines(panel)
    width = 2.0 * 96.0 / 72.0
    assert dotted["dash"] == pytest.approx([1.5 * width, 2.5 * width])
    assert (dotted["y"], dotted["colour"], dotted["name"]) == ([3.0, None], "#d55e00ff", "dotted")
    assert (squares["marker"], squares["fill"], squares["size"]) == ("s", "none", 8.0)
    assert "width" not in squares
    assert squares["edge"] == "#0072b280"
    (across,) = [shape for shape in panel["shapes"] if not shape.get("inY", True)]
    assert (across["x"], across["y"]) == ([1.5, 1.5], [0.0, 1.0])
    (area,) = [shape for shape in panel["shapes"] if shape["kind"] == "area"]
    assert {(x, y) for x, y in zip(*area["rings"][0], strict=True)} >= {(1.0, 1.0), (2.0, 1.0), (2.0, 3.0), (1.0, 2.0)}
    assert panel["y"][0]["log"]
    assert panel["x"]["limits"] == [3.0, 0.0]
    assert panel["y"][0]["label"] == "shape, kg⁻¹ᐟ²"
    assert panel["legend"][0]["looks"]["dash"] == dotted["dash"]


def test_long_lines_keep_their_extremes_and_gaps():
    x = np.arange(100_001.0)
    y = np.sin(1e-4 * x)
    y[[12_345, 67_890]] = 5.0, -5.0
    y[50_000] = np.nan
    few, values = thinned(x, y)
    assert few.size <= MOST
    assert {5.0, -5.0} <= set(values)
    assert np.isnan(values).any()
    good = np.isfinite(values) & (np.abs(values) < 2.0)
    np.testing.assert_allclose(values[good], np.sin(1e-4 * few[good]), rtol=1e-12)
    assert np.diff(few).max() < 200.0


def test_panels_that_share_an_axis_are_zoomed_together_and_are_labelled(drawn):
    def draw(page):
        above, below = page.subplots(2, 1, sharex=True)
        above.plot([1.0, 2.0], [3.0, 4.0])
        below.plot([1.0, 2.0], [3.0, 4.0])
        below.set(xlabel="time, s")

    above, below = drawn(draw)["panels"]
    assert above["group"] is not None
    assert above["group"] == below["group"]
    assert above["x"]["label"] == below["x"]["label"] == "time, s"


def test_what_is_no_line_is_a_picture(drawn):
    def draw(page):
        image, scale, line = page.subplots(1, 3)
        image.imshow(np.eye(3))
        scale.plot([-1.0, 1.0], [-1.0, 1.0])
        scale.set_yscale("symlog")
        line.plot([1.0, 2.0], [3.0, 4.0])

    panels = drawn(draw)["panels"]
    assert ["picture" in panel for panel in panels] == [True, True, False]
    picture = base64.b64decode(panels[0]["picture"].removeprefix("data:image/png;base64,"))
    assert picture.startswith(b"\x89PNG")


def test_text_of_a_recording_is_data(hostile, tmp_path):
    plot(hostile, tmp_path / "h.html")
    text = (tmp_path / "h.html").read_text(encoding="utf-8")
    page = Elements(text)
    assert HOSTILE not in text
    assert "<b>" not in text
    assert len(page.scripts) == 3
    assert contents(tmp_path / "h.html")["title"].startswith(HOSTILE)
    assert not [
        tag for tag, _ in page.found if tag in ("b", "i", "a", "img", "iframe", "object", "link", "base", "form")
    ]
    assert not [
        attrs for _, attrs in page.found if any(name.startswith("on") or name in ("src", "href") for name in attrs)
    ]


def test_the_policy_allows_the_scripts_of_the_file_alone(drawn, tmp_path):
    drawn(lambda page: (page.subplots().plot([1.0, 2.0]), title(page, "a beam")))
    text = (tmp_path / "figure.html").read_text(encoding="utf-8")
    page = Elements(text)
    (policy,) = [attrs["content"] for _, attrs in page.found if attrs.get("http-equiv") == "Content-Security-Policy"]
    rules = dict(rule.split(" ", 1) for rule in policy.split("; "))
    digests = {base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in page.scripts[1:]}
    assert set(re.findall(r"'sha256-([^']+)'", rules["script-src"])) == digests
    assert rules["default-src"] == "'none'"
    assert rules["img-src"] == "data:"
    assert "unsafe" not in rules["script-src"]
    assert not re.search(r"@import|url\(", text)


def test_a_file_of_others_is_not_replaced(recordings, tmp_path):
    figure = tmp_path / "mine.html"
    figure.write_text("<p>notes</p>")
    with pytest.raises(RecordingError, match="exists already and is not a figure of this program"):
        plot(recordings["backbone"], figure)
    assert figure.read_text() == "<p>notes</p>"
    plot(recordings["backbone"], figure, overwrite=True)
    first = figure.read_bytes()
    plot(recordings["backbone"], figure)  # one of this program
    assert figure.read_bytes() == first
    with pytest.raises(RecordingError, match="cannot be written: No such file"):
        plot(recordings["backbone"], Path(tmp_path / "nowhere" / "x.html"))
