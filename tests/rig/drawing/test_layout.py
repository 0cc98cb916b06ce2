import pickle

from matplotlib.figure import Figure

from rig.drawing.layout import page_layout


def test_a_page_can_be_pickled_with_its_layout():
    page = Figure(layout=page_layout())
    page.subplots()
    page.suptitle("a page")
    found = pickle.loads(pickle.dumps(page))
    assert type(found.get_layout_engine()) is type(page.get_layout_engine())
    found.draw_without_rendering()
    assert found.get_suptitle() == "a page"
    assert found._suptitle.get_position()[0] * found.bbox.width == found.axes[0].bbox.x0
