import xml.etree.ElementTree as ET
from collections.abc import Iterator
from itertools import combinations
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.image import imread

from rig.drawing.axes import DAMPING_SPAN, widen
from rig.drawing.page import grid, page_for
from rig.drawing.style import COLOURS, REJECTED, STYLE, height_is_free, page_in, restyle, shade, title, unit_text
from rig.errors import RecordingError
from tests.refused import refused

LIKE_SRGB = 2.4
DEUTERANOPIA = np.array(
    [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
)
PROTANOPIA = np.array(
    [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
)


@pytest.fixture(autouse=True)
def afterwards_as_before() -> Iterator[None]:
    yield
    restyle()


def linear(colour: object) -> np.ndarray:
    """Linear RGB of a colour (IEC 61966-2-1)."""
    value = np.array(to_rgb(colour))
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** LIKE_SRGB)


def lab(rgb: np.ndarray) -> np.ndarray:
    """CIE L*a*b* (D65) of linear RGB."""
    xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]) @ np.clip(rgb, 0, 1)
    f = np.cbrt(xyz / [0.9505, 1.0, 1.089])
    f = np.where(f**3 > 0.008856, f, (903.3 * f**3 + 16) / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


@pytest.mark.parametrize("eye", [np.eye(3), DEUTERANOPIA, PROTANOPIA], ids=["normal", "deuteranopia", "protanopia"])
def test_colours_differ_for_every_eye(eye: np.ndarray) -> None:
    # Matrices of Machado, Oliveira and Fernandes, IEEE Trans. Vis. Comput. Graph. 15 (2009), severity 1.
    seen = [lab(eye @ linear(colour)) for colour in COLOURS]
    assert min(np.linalg.norm(one - other) for one, other in combinations(seen, 2)) > 12.0


def test_grey_can_be_read_as_text() -> None:
    luminance = linear(REJECTED) @ [0.2126, 0.7152, 0.0722]
    assert 1.05 / (luminance + 0.05) >= 4.5


def test_shades_get_lighter_in_their_order() -> None:
    lightness = [lab(linear(shade(n, 6)[:3]))[0] for n in range(6)]
    assert np.all(np.diff(lightness) > 5.0)
    assert lightness[-1] < 85.0
    assert shade(0, 1) == shade(0, 6)


@pytest.mark.parametrize(
    ("preset", "size_mm", "pixels"),
    [
        ("screen", None, (1350, 960)),
        ("slide", None, (1920, 1080)),
        ("paper", None, (2007, round(85.0 / 25.4 * 6.4 / 9.0 * 600))),
        ("paper", (85.0, 60.0), (2007, 1417)),
        ("screen", (254.0, 127.0), (1500, 750)),
    ],
)
def test_a_page_has_the_size_of_its_purpose(
    tmp_path: Path, preset: str, size_mm: tuple[float, float] | None, pixels: tuple[int, int]
) -> None:
    restyle(preset, size_mm=size_mm)
    with page_for(tmp_path / "figure.png", (9.0, 6.4)) as page:
        page.subplots().plot([0, 1])
    height, width = imread(tmp_path / "figure.png").shape[:2]
    assert (width, height) == pytest.approx(pixels, abs=1)


def test_restyle_lays_settings_over_a_preset_and_goes_back() -> None:
    first = dict(STYLE)
    restyle("slide", {"font.family": ["serif"], "font.size": 20.0})
    assert (STYLE["font.size"], STYLE["font.family"], STYLE["legend.fontsize"]) == (20.0, ["serif"], 13.0)
    assert page_in((9.0, 6.4)) == pytest.approx((13.3333, 7.5), abs=1e-3)
    restyle()
    assert first == STYLE
    assert page_in((9.0, 6.4)) == (9.0, 6.4)
    assert not height_is_free()


def test_a_style_sheet_of_matplotlib_is_laid_over_the_first_style(tmp_path: Path) -> None:
    (tmp_path / "house.mplstyle").write_text("font.size: 12\nlines.linewidth: 3\n")
    restyle(tmp_path / "house.mplstyle")
    assert (STYLE["font.size"], STYLE["lines.linewidth"], STYLE["axes.grid"]) == (12.0, 3.0, True)


@pytest.mark.parametrize(
    ("preset", "rc", "size_mm", "said"),
    [
        ("papr", {}, None, "`style` papr: is none of screen, paper, slide and no style sheet (.mplstyle)"),
        ("none.mplstyle", {}, None, "none.mplstyle: cannot be read: No such file or directory"),
        ("paper", {"font.sise": 3}, None, "font.sise"),
        ("paper", {"font.size": "huge letters"}, None, "font.size"),
        ("paper", {}, (0.0, 10.0), "`size` 0 x 10 mm: each side of a page is 10 to 2000 mm long"),
        ("paper", {}, (float("nan"), None), "`size` nan mm"),
    ],
)
def test_what_is_no_style_is_refused_in_a_line_and_changes_nothing(
    preset: str, rc: dict[str, object], size_mm: tuple[float, float | None] | None, said: str
) -> None:
    before = dict(STYLE)
    with pytest.raises(RecordingError) as caught:
        restyle(preset, rc, size_mm=size_mm)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
    assert before == STYLE


def test_a_page_without_room_for_its_axes_is_refused_in_a_line(tmp_path: Path) -> None:
    with (
        refused(RecordingError, "size-mm-has-no-room-for"),
        page_for(tmp_path / "small.png", (1.0, 1.0)) as page,
    ):
        page.subplots(3, 3)[1, 1].set_ylabel("a label")
    assert not (tmp_path / "small.png").exists()


def arranged(file: Path, rows: int, columns: int) -> tuple[tuple[float, float], list[tuple[float, float]]]:
    """Size of the page, and left and upper end of each panel, row by row."""
    with page_for(file, (9.0, 6.4)) as page:
        axes = grid(page, rows, columns)
        assert axes.shape == (rows, columns)
        page.canvas.draw()
        boxes = [axis.get_position() for axis in axes.ravel()]
    return (page.get_figwidth(), page.get_figheight()), [(round(box.x0, 2), round(box.y1, 2)) for box in boxes]


def test_panels_stand_below_one_another_on_a_column_and_side_by_side_on_a_slide(tmp_path: Path) -> None:
    file = tmp_path / "figure.svg"
    _, screen = arranged(file, 3, 2)
    assert len({x for x, _ in screen}) == 2
    assert len({y for _, y in screen}) == 3
    restyle("paper")
    (width, height), column = arranged(file, 2, 2)
    assert (width, height) == pytest.approx((85.0 / 25.4, 4 * 1.6 + 0.3))
    assert len({x for x, _ in column}) == 1
    assert [y for _, y in column] == sorted((y for _, y in column), reverse=True)
    restyle("paper", size_mm=(85.0, 100.0))
    assert arranged(file, 2, 2)[0][1] == pytest.approx(100.0 / 25.4)
    restyle("slide")
    _, slide = arranged(file, 3, 2)
    assert len({x for x, _ in slide}) == 3
    assert slide[0][0] == slide[1][0]


def test_text_stays_text_in_vector_files(tmp_path: Path) -> None:
    with page_for(tmp_path / "figure.svg", (4.0, 3.0)) as page:
        page.subplots().set_xlabel("frequency, Hz")
        title(page, "a beam")
    written = "".join(ET.parse(tmp_path / "figure.svg").getroot().itertext())
    assert "frequency, Hz" in written
    assert "a beam" in written
    assert mpl.rcParams["svg.fonttype"] == "path"  # outside of our pages nothing is changed


def test_a_long_title_takes_more_lines_and_stays_on_the_page(tmp_path: Path) -> None:
    restyle("paper")
    with page_for(tmp_path / "figure.png", (9.0, 6.4)) as page:
        axis = page.subplots()
        title(page, "a beam with a very long name: continuous-backbone test, 13 points, 4 not accepted, 2 not measured")
    box = page.get_suptitle() and page._suptitle.get_window_extent()
    assert box.x1 <= page.bbox.width
    assert box.y0 >= axis.get_window_extent().y1


@pytest.mark.parametrize("ylabel", ["x", "a label\nin two lines"])
@pytest.mark.parametrize("size_in", [(9.0, 6.4), (3.35, 3.0)])
def test_a_title_begins_at_the_left_edge_of_the_axes(tmp_path: Path, ylabel: str, size_in: tuple[float, float]) -> None:
    with page_for(tmp_path / "figure.png", size_in) as page:
        axes = page.subplots(1, 2)
        axes[0].set_ylabel(ylabel)
        title(page, "a beam")
    heading = page._suptitle
    assert heading is not None
    assert heading.get_window_extent().x0 == pytest.approx(axes[0].bbox.x0, abs=0.02 * page.bbox.width)
    assert axes[0].bbox.x0 > 0.05 * page.bbox.width  # not the edge of the page


@pytest.mark.parametrize(("change", "least", "most"), [(0.025, 0.5, 1.0), (0.2, 0.85, 1.0), (0.001, 0.0, 0.05)])
def test_an_axis_of_damping_is_neither_padded_nor_shows_scatter_as_a_trend(
    change: float, least: float, most: float
) -> None:
    axis = Figure().subplots()
    axis.plot([1.0, 2.0], [0.4, 0.4 * (1.0 + change)])
    widen(axis, DAMPING_SPAN)
    low, high = axis.get_ylim()
    assert least < 0.4 * change / (high - low) < most


@pytest.mark.parametrize(
    ("unit", "written"), [("m/s2", "m/s²"), ("m/s^2/N", "(m/s²)/N"), ("m/s2/N", "(m/s²)/N"), ("N/V", "N/V"), ("V", "V")]
)
def test_units_are_written_as_at_an_axis(unit: str, written: str) -> None:
    assert unit_text(unit) == written
