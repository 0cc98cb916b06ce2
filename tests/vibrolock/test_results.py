"""Results are drawn and shown by what is registered for it, and say what is missing where nothing is."""

import sys
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
    registered(monkeypatch, plot="builtins:repr", html="builtins:ascii", text="builtins:repr")
    one = Result()
    assert one.plot() == repr(one)
    assert one._repr_mimebundle_() == {"text/html": ascii(one), "text/plain": repr(one)}
    assert str(one) == repr(one)


def test_a_result_without_a_table_is_printed_as_its_repr_and_is_no_data_frame(monkeypatch):
    registered(monkeypatch)
    one = Result()
    assert str(one) == repr(one)
    with pytest.raises(TypeError, match=r"^to_pandas: a Result has no table of its own; `print` shows what there is$"):
        one.to_pandas()


class Tabled(Result):
    def table(self):
        return [{"frequency_hz": 24.0, "force_n": 1.0}, {"frequency_hz": 25.0, "force_n": None}]


def test_a_table_becomes_a_data_frame_or_one_line_says_what_is_missing(monkeypatch):
    frame = Tabled().to_pandas()
    assert list(frame.columns) == ["frequency_hz", "force_n"]
    assert frame["frequency_hz"].tolist() == [24.0, 25.0]
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ImportError, match=r"^to_pandas: needs pandas; install vibrolock\[tables\], or use table\(\)$"):
        Tabled().to_pandas()


def test_the_bench_registers_drawing_and_tables():
    assert results._registered("plot").__module__ == "rig.figures.results"
    assert results._registered("html").__module__ == results._registered("text").__module__ == "rig.show.results"
