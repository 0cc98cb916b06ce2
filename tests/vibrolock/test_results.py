"""Results are drawn and shown by what is registered for it, and say what is missing where nothing is."""

from importlib.metadata import EntryPoint

import pytest

from tests.refused import refused
from vibrolock import results
from vibrolock.results import GROUP, Result


def registered(monkeypatch, **addresses):
    def entry_points(*, group, name):
        assert group == GROUP
        return [EntryPoint(name, addresses[name], group)] if name in addresses else []

    monkeypatch.setattr(results, "entry_points", entry_points)


@pytest.mark.parametrize("addresses", [{}, {"plot": "no_such_bench:plot", "html": "no_such_bench:html"}])
def test_without_the_bench_a_result_says_in_one_line_what_is_missing(monkeypatch, addresses):
    registered(monkeypatch, **addresses)
    with refused(ImportError, "plot-nothing-that-draws-a-result"):
        Result().plot()
    assert Result()._repr_html_() is None
    assert Result()._repr_mimebundle_() == {}


def test_a_result_is_drawn_and_shown_by_what_is_registered(monkeypatch):
    registered(monkeypatch, plot="builtins:repr", html="builtins:str", text="builtins:repr")
    one = Result()
    assert one.plot() == repr(one)
    assert one._repr_mimebundle_() == {"text/html": str(one), "text/plain": repr(one)}


def test_the_bench_registers_drawing_and_tables():
    assert results._registered("plot").__module__ == "rig.figures.results"
    assert results._registered("html").__module__ == results._registered("text").__module__ == "rig.show.results"
