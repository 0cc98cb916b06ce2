"""Parts of a recording's figure by name; a paper's column has the backbone alone; its legends stay on the page."""

import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from rig.drawing.style import restyle
from rig.errors import RecordingError
from rig.figures.files import drawing_of
from tests.recorded import SHORT, recorded


@pytest.fixture(scope="module")
def backbone():
    return recorded("magnet-beam/backbone", **SHORT)


def labels_of(source, width_in=9.0, **options):
    size_in, draw = drawing_of([source], **options)
    page = Figure(figsize=(width_in, size_in[1]), layout="constrained")
    FigureCanvasAgg(page)
    draw(page)
    page.canvas.draw()
    return page, [axis.get_ylabel().replace("\n", " ") for axis in page.axes]


BACKBONE = ["modal frequency, Hz", "modal damping, %"]
HISTORY = ["oscillator frequency, Hz", "phase error, deg", "output amplitude, V"]


@pytest.mark.parametrize(
    ("width_in", "panels", "labels"),
    [
        (9.0, (), BACKBONE + HISTORY),
        (9.0, ("backbone",), BACKBONE),
        (9.0, ("history",), HISTORY),
        (3.35, (), BACKBONE),
        (3.35, ("history", "backbone"), BACKBONE + HISTORY),
    ],
)
def test_panels_are_drawn_by_name_and_a_column_has_the_backbone_alone(backbone, width_in, panels, labels):
    assert labels_of(backbone, width_in, panels=panels)[1] == labels


def test_the_legend_of_the_phase_error_stays_on_a_column(backbone):
    restyle("paper")
    try:
        page, _ = labels_of(backbone, 3.35, panels=("history",))
        legends = [axis.get_legend() for axis in page.axes if axis.get_legend() is not None]
        assert legends
        for legend in legends:
            assert legend.get_window_extent().x1 <= page.bbox.x1
    finally:
        restyle()


def test_a_panel_that_is_none_is_refused_with_those_that_there_are(backbone, tmp_path):
    with pytest.raises(RecordingError, match=r"allowed: backbone, history$"):
        drawing_of([backbone], panels=["loop"])
    with pytest.raises(RecordingError, match="without labels"):
        drawing_of([backbone, backbone], panels=["backbone"])
