"""What tests share: it is made once, it is there whole or not at all, and a change of the code makes it anew."""

import multiprocessing
import os
import shutil
from pathlib import Path
from typing import NamedTuple

import pytest

import rig
import tests.recorded as store
from rig.campaigns.running.runner import run_plan
from rig.recording.reader import Recording
from tests.recorded import SHORT, changed, recorded, recorded_at, recorded_run
from tests.refused import refused
from tests.running import WAITING, in_order
from tests.sharing import made_once, shared_folder


def note(folder: Path) -> None:
    """Make the folder, slowly, and note by whom."""
    import time

    with (folder.parent / "made-by").open("a") as file:
        file.write(f"{os.getpid()}\n")
    time.sleep(0.2)
    (folder / "file").write_text("whole")


def ask(folder: Path) -> None:
    assert (made_once(folder, note) / "file").read_text() == "whole"


@pytest.mark.slow
def test_of_several_processes_that_ask_at_once_one_makes_the_folder(tmp_path):
    spawn = multiprocessing.get_context("spawn")
    asking = [spawn.Process(target=ask, args=(tmp_path / "folder",)) for _ in range(3)]
    for process in asking:
        process.start()
    for process in asking:
        process.join()
    assert [process.exitcode for process in asking] == [0, 0, 0]
    assert len((tmp_path / "made-by").read_text().splitlines()) == 1


def test_what_could_not_be_finished_is_not_there_and_is_made_anew(tmp_path):
    def fail(folder):
        (folder / "half").write_text("")
        raise RuntimeError("in the middle")

    with refused(RuntimeError, "in-the-middle"):
        made_once(tmp_path / "folder", fail)
    assert not (tmp_path / "folder").exists()
    ask(tmp_path / "folder")
    assert not (tmp_path / "folder" / "half").exists()


def test_all_workers_of_a_run_share_one_folder():
    assert Path(os.environ["VIBROLOCK_TESTS_SHARE"]) == shared_folder()
    assert shared_folder().is_dir()


def test_a_recording_is_what_a_run_gives_and_is_made_once(tmp_path):
    path = recorded("magnet-beam/backbone", seed=3, **SHORT)
    assert recorded("magnet-beam/backbone", seed=3, **SHORT) == path
    assert recorded("magnet-beam/backbone", seed=4, **SHORT) != path
    assert recorded("magnet-beam/backbone", seed=3, **SHORT | {"record_periods": 9}) != path
    with (
        rig.run(changed("magnet-beam/backbone", **SHORT), seed=3) as run,
        recorded_run("magnet-beam/backbone", seed=3, **SHORT) as kept,
    ):
        made, found = (one.recording.parts[0].read(0, one.recording.n_rows) for one in (run, kept))
        assert made.tobytes() == found.tobytes()


def test_a_recording_of_a_run_that_was_stopped_is_not_kept(tmp_path, monkeypatch):
    def stopped(*given):
        recording = run_plan(*given)
        recording.parts[-1].end["reason"] = "stop_requested"
        return recording

    monkeypatch.setattr(store, "run_plan", stopped)
    monkeypatch.setattr(store, "_state_folder", lambda: tmp_path)
    with pytest.raises(InterruptedError):
        recorded("magnet-beam/backbone", **SHORT)
    assert [one.suffix for one in tmp_path.iterdir() if one.is_dir()] == [".unfinished"]


def test_a_recording_is_read_only_and_a_copy_of_it_is_not(tmp_path):
    assert not recorded("magnet-beam/backbone", **SHORT).stat().st_mode & 0o222
    copy = recorded_at(tmp_path / "mine.h5", changed("magnet-beam/backbone", **SHORT))
    assert copy.stat().st_mode & 0o200
    with Recording(copy) as recording:
        assert recording.complete


@pytest.fixture
def code(tmp_path, monkeypatch):
    """A copy of the product, whose state the store tells."""
    for name in ("rig", "controller", "simulators", "identification", "vibrolock"):
        shutil.copytree(store.ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__", "site"))
    shutil.copy(store.ROOT / "pyproject.toml", tmp_path)
    monkeypatch.setattr(store, "ROOT", tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    ("file", "counts"),
    [
        *((name, True) for name in ("controller/detector.py", "simulators/specimens/magnet-beam.toml", "rig/daq.py")),
        *((name, True) for name in ("rig/campaigns/backbone/points.py", "identification/signals/fourier.py")),
        *((name, False) for name in ("rig/cli/run.py", "rig/monitor/server.py", "rig/show/summary.py")),
    ],
)
def test_a_change_of_what_a_run_depends_on_is_another_state_of_the_code(code, file, counts):
    before = store.state_of_the_code.__wrapped__()
    with (code / file).open("a") as changing:
        changing.write("\n# another line\n")
    assert (store.state_of_the_code.__wrapped__() != before) is counts


def test_tests_that_wait_begin_classes_stay_together_and_all_others_in_their_order():
    names = [
        "show/test_a.py::x",
        "live/test_b.py::A::x",
        "live/test_b.py::B::x",
        "live/test_b.py::A::y",
        "test_c.py::z",
    ]
    items = [_Item(f"tests/rig/{name}") for name in names]
    in_order(items)
    assert [item.nodeid.removeprefix("tests/rig/") for item in items] == [names[k] for k in (1, 3, 2, 0, 4)]


class _Item(NamedTuple):
    nodeid: str

    def getparent(self, of):
        assert of is pytest.Class
        file, *within = self.nodeid.split("::")
        return _Item(f"{file}::{within[0]}") if len(within) > 1 else None


@pytest.mark.parametrize("place", WAITING)
def test_what_is_said_to_wait_is_there(place):
    assert (store.ROOT / place).exists()
