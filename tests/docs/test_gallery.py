"""Every example of the gallery runs as a script and draws at least one figure."""

import runpy
from pathlib import Path

import pytest
from joblib.externals.loky import get_reusable_executor

from tests.docs.pages import ROOT

EXAMPLES = sorted((ROOT / "docs" / "examples").glob("*/plot_*.py"))
LIBRARIES = {"plot_dask.py": "distributed"}  # optional ones that an example uses


@pytest.fixture(autouse=True)
def figures(monkeypatch):
    """Figures go nowhere; no worker process outlives its example."""
    pyplot = pytest.importorskip("matplotlib.pyplot")
    monkeypatch.setattr(pyplot, "show", lambda: None)
    pyplot.switch_backend("agg")
    yield pyplot
    pyplot.close("all")
    get_reusable_executor().shutdown()


def test_the_gallery_has_twenty_examples_and_more():
    assert len(EXAMPLES) >= 20


@pytest.mark.slow
@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_runs_and_draws(example: Path, figures, tmp_path, monkeypatch):
    if example.name in LIBRARIES:
        library = LIBRARIES[example.name]
        pytest.importorskip(library, reason=f"{library} is not installed (pip install 'vibrolock[docs]')")
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(example), run_name="__main__")
    assert figures.get_fignums()
    for number in figures.get_fignums():
        assert any(axis.has_data() for axis in figures.figure(number).axes)
        figures.figure(number).canvas.draw()
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_begins_with_a_title_and_is_short(example: Path):
    lines = example.read_text(encoding="utf-8").splitlines()
    assert lines[0] == '"""'
    assert len(lines[1]) == len(lines[2])
    assert set(lines[2]) == {"="}
    assert len(lines) <= 90
