"""Files that an earlier version has written are still read, and say what that version said of them.

In ``written_by_0_1`` lies a file of every kind (compressed by xz), a plan and a bench, as commit 44fd4b3a wrote them on
2026-11-27, and beside each the JSON document that ``rig show --json`` of that commit printed, or what it read. A file of a new
kind is added once a version with it has been released; none is ever written anew.
"""

import json
import lzma
from pathlib import Path
from typing import Any

import pytest

import rig

WRITTEN = Path(__file__).parent / "written_by_0_1"
FILES = sorted(path.name.removesuffix(".h5.xz") for path in WRITTEN.glob("*.h5.xz"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("written")
    for name in FILES:
        (folder / f"{name}.h5").write_bytes(lzma.decompress((WRITTEN / f"{name}.h5.xz").read_bytes()))
    return folder


def expected(name: str) -> Any:
    return json.loads((WRITTEN / f"{name}.json").read_text())


def assert_says(found: Any, said: Any, where: str = "") -> None:
    """Everything that was said is said: further keys may have come, numbers may differ by rounding."""
    if isinstance(said, dict):
        assert said.keys() <= found.keys(), where
        for key, value in said.items():
            assert_says(found[key], value, f"{where}.{key}")
    elif isinstance(said, list):
        assert len(found) == len(said), where
        for index, value in enumerate(said):
            assert_says(found[index], value, f"{where}[{index}]")
    elif isinstance(said, float):
        assert found == pytest.approx(said, rel=1e-6, abs=1e-12), where  # a standard deviation may be rounding alone
    else:
        assert found == said, where


@pytest.mark.parametrize("name", FILES)
def test_a_file_says_what_it_said(name, folder, command):
    assert_says(json.loads(command("show", folder / f"{name}.h5", "--json").succeeded().out), expected(name))


@pytest.mark.parametrize("name", FILES)
def test_a_file_is_drawn(name, folder, command, tmp_path):
    command("plot", folder / f"{name}.h5", "-o", tmp_path / "figure.png").succeeded()
    assert (tmp_path / "figure.png").stat().st_size > 10_000


def test_a_recording_becomes_a_model(folder, command, tmp_path):
    command("identify", folder / "recording.h5", "-o", tmp_path / "mode.h5").succeeded()
    found = json.loads(command("show", tmp_path / "mode.h5", "--json").succeeded().out)
    point = expected("recording")["points"][0]
    assert found["points"][0]["modal_frequency_hz"] == pytest.approx(point["frequency_hz"], rel=1e-3)


def test_a_plan_and_a_bench_are_read_as_they_were():
    plan, bench = rig.load_plan(str(WRITTEN / "plan.toml")), rig.load_bench(str(WRITTEN / "bench.toml"))
    assert_says(plan.model_dump(mode="json"), expected("plan"))
    assert_says(bench.model_dump(mode="json"), expected("bench"))
