"""A folder on the page: its recordings and models, each with figure and table, and nothing from outside."""

import json
import os

import pytest

from rig.monitor import folder as module
from tests.command import run_command
from tests.recorded import recorded_at
from tests.rig.monitor.scripted import Scripted
from tests.rig.monitor.visitor import Visitor, served

PLAN = """
kind = "backbone"
bench = "magnet-beam"
levels_v = [0.4, 0.8, 1.2]
record_periods = 20

[controller]
low_pass_rad_s = 6.283185307179586
k1 = 2.0
k2 = 6.283185307179586
centre_frequency_hz = 24.0
frequency_window_hz = [21.933, 26.807]
"""


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """A recording, and its bytes."""
    path = tmp_path_factory.mktemp("recorded") / "run.h5"
    path.with_name("plan.toml").write_text(PLAN)
    recorded_at(path, path.with_name("plan.toml"))
    return path


@pytest.fixture
def folder(tmp_path, recording):
    """A folder with a recording, a model, a damaged file, a text, a link to the outside and a folder."""
    folder = tmp_path / "folder"
    folder.mkdir()
    (folder / "run.h5").write_bytes(recording.read_bytes())
    (folder / "damaged <b>.h5").write_bytes(recording.read_bytes()[:5000])
    (folder / "notes.txt").write_text("root:")
    (folder / "inner.h5").mkdir()
    (folder / "passwd.h5").symlink_to("/etc/passwd")
    (folder / "elsewhere.h5").symlink_to(recording)
    run_command("identify", recording, "-o", folder / "model.h5").succeeded()
    return folder


@pytest.fixture
def inside(folder):
    with served(Scripted(), folder=folder) as server:
        yield Visitor(server.url).enter()


def listed(inside):
    answer = inside.get("/folder")
    assert answer.status == 200
    return {entry["name"]: entry for entry in json.loads(answer.text)["entries"]}


def test_recordings_and_models_are_listed_and_nothing_else(inside, folder):
    found = listed(inside)
    assert set(found) == {"run.h5", "model.h5", "damaged <b>.h5"}
    assert found["run.h5"]["kind"] == "backbone"
    assert found["model.h5"]["kind"] == "nonlinear-mode"
    assert found["damaged <b>.h5"]["kind"] == "unreadable"
    assert found["run.h5"]["size"] == (folder / "run.h5").stat().st_size


@pytest.mark.slow
def test_each_has_its_figure_and_its_table(inside):
    for name, word in (("run.h5", "backbone of magnet beam"), ("model.h5", "nonlinear-mode")):
        n = listed(inside)[name]["n"]
        figure = inside.get(f"/folder/{n}/figure.png")
        assert figure.headers["content-type"] == "image/png"
        assert figure.body.startswith(b"\x89PNG")
        table = inside.get(f"/folder/{n}/table.txt")
        assert table.headers["content-type"] == "text/plain; charset=utf-8"
        assert word in table.text


@pytest.mark.slow
def test_a_damaged_file_says_so_and_spoils_nothing(inside):
    n = listed(inside)["damaged <b>.h5"]["n"]
    for what in ("figure.png", "table.txt"):
        answer = inside.get(f"/folder/{n}/{what}")
        assert answer.status == 422
        assert "damaged &lt;b&gt;.h5" in answer.text
    assert inside.get("/").status == 200


def test_numbers_stay_when_files_come_and_go(inside, folder):
    before = listed(inside)
    (folder / "another.h5").write_bytes((folder / "run.h5").read_bytes())
    after = listed(inside)
    assert all(after[name]["n"] == before[name]["n"] for name in before)
    (folder / "run.h5").unlink()
    assert inside.get(f"/folder/{before['run.h5']['n']}/table.txt").status == 404
    assert "run.h5" not in listed(inside)


def test_what_is_no_number_of_a_file_is_not_found(inside):
    listed(inside)
    for n in ("99", "-1", "run.h5", "..", "0x1", "1e0", "9" * 400):
        assert inside.get(f"/folder/{n}/figure.png").status == 404


def test_a_file_that_becomes_a_link_is_not_followed(inside, folder):
    n = listed(inside)["run.h5"]["n"]
    (folder / "run.h5").unlink()
    (folder / "run.h5").symlink_to("/etc/passwd")
    assert inside.get(f"/folder/{n}/table.txt").status == 404


@pytest.mark.slow
def test_a_figure_is_made_once(inside, folder, monkeypatch):
    asked = []

    async def counted(what, *arguments):
        asked.append(what)
        return await ask(what, *arguments)

    ask = module._ask
    monkeypatch.setattr(module, "_ask", counted)
    n = listed(inside)["run.h5"]["n"]
    first, second = (inside.get(f"/folder/{n}/figure.png") for _ in range(2))
    assert first.body == second.body
    assert asked.count("figure") == 1
    stat = (folder / "run.h5").stat()
    os.utime(folder / "run.h5", ns=(stat.st_atime_ns, stat.st_mtime_ns + 10**9))
    inside.get(f"/folder/{n}/figure.png")
    assert asked.count("figure") == 2


def test_a_reader_that_hangs_is_given_up(inside, monkeypatch):
    n = listed(inside)["run.h5"]["n"]
    monkeypatch.setitem(module.TIMEOUT_S, "figure", 0.01)
    answer = inside.get(f"/folder/{n}/figure.png")
    assert answer.status == 422
    assert "takes more than" in answer.text


def test_a_folder_that_vanishes_is_empty(inside, folder):
    folder.rename(folder.with_name("moved"))
    assert listed(inside) == {}


def test_without_a_folder_there_is_none():
    with served(Scripted()) as server:
        assert Visitor(server.url).enter().get("/folder").status == 404
