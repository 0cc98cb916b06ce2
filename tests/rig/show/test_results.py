"""Results as tables for notebooks and terminals: well-formed, escaped, with the result's numbers."""

from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

import identification
import rig
from identification import FrequencyResponse, Transient
from rig.results.in_memory.kinds import KINDS
from rig.show import as_html, as_text
from tests.identification.rigs import CHANNELS, one_mode_point

VOID = {"br", "hr", "img"}


class Reader(HTMLParser):
    """Fails where a tag is closed that is not open; keeps the cells."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.cells: list[str] = []
        self.tags: set[str] = set()

    def handle_starttag(self, tag, attrs):
        assert not {name for name, _ in attrs} - {"class"}
        self.tags.add(tag)
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] in ("td", "th", "p"):
            self.cells.append(data)


def read(html: str) -> Reader:
    reader = Reader()
    reader.feed(html)
    assert not reader.open
    return reader


@pytest.fixture(autouse=True)
def pyplot():
    """Figures without a screen, closed after the test."""
    found = pytest.importorskip("matplotlib.pyplot")
    found.switch_backend("agg")
    yield found
    found.close("all")


@pytest.fixture(scope="module")
def mode():
    points = [one_mode_point(forces=(0.0, force)) for force in (0.1, 0.2, 0.3, 0.4)]
    return identification.nonlinear_mode(identification.Backbone(tuple(points), "beam", 1.7))


def test_a_mode_shows_every_point_with_units_and_intervals(mode):
    shown = read(mode._repr_html_())
    assert shown.tags == {"div", "p", "br", "table", "thead", "tbody", "tr", "th", "td"}
    assert {"modal frequency Hz", "+-", "damping %"} <= set(shown.cells)
    assert all(f"{value:.4f}" in shown.cells for value in mode.modal_frequency_hz)


def test_what_files_and_people_name_is_escaped(mode):
    html = replace(mode, specimen="<script>alert('x')</script> & co")._repr_html_()
    assert "<script>" not in html
    assert "&lt;script&gt;" in html
    assert read(html)


def test_text_has_the_same_cells(mode):
    words = as_text(mode).split()
    for cell in read(as_html(mode)).cells:
        assert set(cell.split()) <= set(words)


def test_long_tables_show_the_first_and_the_last_row_and_some_between():
    frequency = np.linspace(20.0, 30.0, 500)
    response = FrequencyResponse(frequency, np.ones(500), np.ones(500), "displacement", "force", 1.0)
    html = response._repr_html_()
    assert html.count("<tr>") == 21
    assert {"20.0000", "30.0000"} <= set(read(html).cells)


def test_a_run_shows_its_points_with_their_quality():
    plan = rig.load_plan("magnet-beam/backbone-short")
    with rig.run(plan.model_copy(update={"levels_m": plan.levels_m[3:5]})) as run:
        cells = read(run._repr_html_()).cells
        assert as_html(run.recording) == run._repr_html_()
        assert run.plot()
    assert {"quality", "frequency Hz"} <= set(cells)
    for point in run.recording.points:
        assert f"{point['frequency_hz']:.4f}" in cells


def test_an_analysis_of_a_bench_shows_its_modes_and_draws_them():
    from rig.analysis.modes import modes
    from rig.analysis.subject import subject_of

    found = modes(subject_of("magnet-beam"))
    cells = read(found._repr_html_()).cells
    assert all(f"{frequency:.4f}" in cells for frequency in found.structure.frequency_hz)
    curves = [line.get_ydata() for axis in found.plot() for line in axis.lines]
    assert any(np.allclose(np.abs(one).max(), shape, rtol=0.2) for one in curves for shape in found.point_shapes["tip"])


def test_a_sweep_shows_the_largest_of_every_channel_and_where():
    time = np.linspace(0.0, 1.0, 11)
    found = Transient(CHANNELS, time, 20.0 + time, np.array([np.full(11, 0.2 + 0j), (1.0 + time) * 1j]), 5)
    assert {"0.2", "2", "21.0000", "m/s2"} <= set(read(found._repr_html_()).cells)


def test_what_has_no_table_is_left_to_its_text():
    assert as_html(3) is None
    assert as_text((1, 2)) is None


def test_every_line_of_the_table_is_a_type_with_the_base_class():
    from vibrolock.results import Result

    for kind in KINDS:
        for one in kind.types:
            assert issubclass(one, Result), one


def test_a_terminal_prints_the_table_instead_of_arrays(mode):
    assert mode._repr_mimebundle_(include=None, exclude=None) == {
        "text/html": as_html(mode),
        "text/plain": as_text(mode),
    }


@pytest.mark.slow
def test_a_notebook_shows_table_and_figure(tmp_path):
    nbclient = pytest.importorskip("nbclient", reason="nbclient is not installed (pip install 'vibrolock[dev]')")
    nbformat = pytest.importorskip("nbformat", reason="nbformat is not installed (pip install 'vibrolock[dev]')")
    pytest.importorskip("ipykernel", reason="ipykernel is not installed (pip install 'vibrolock[dev]')")
    code = (
        "import numpy as np\nfrom identification import FrequencyResponse\n"
        "one = FrequencyResponse(np.linspace(20, 30, 5), np.ones(5), np.ones(5), 'displacement', 'force', 1.0)\none"
    )
    book = nbformat.v4.new_notebook(
        cells=[nbformat.v4.new_code_cell(code), nbformat.v4.new_code_cell("axes = one.plot()")]
    )
    nbclient.NotebookClient(book, timeout=120, resources={"metadata": {"path": str(tmp_path)}}).execute()
    table, figure = (cell.outputs for cell in book.cells)
    assert "<table>" in table[0].data["text/html"]
    assert "frequency Hz" in table[0].data["text/plain"]
    assert any("image/png" in output.get("data", {}) for output in figure)
