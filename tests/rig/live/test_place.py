"""Of a folder that a user names nothing is removed or changed but what this program has made there."""

import os
import sys
from pathlib import Path

import pytest

from rig.errors import RecordingError
from rig.live.place import base_folder, new_folder, runs
from rig.monitor.opening import open_in_browser
from tests.refused import refused

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="locks of files of dead processes")

FACTS = b'{"channels": []}'
DEAD = "4194305-0123456789abcdef"


@pytest.fixture
def users(monkeypatch, tmp_path):
    """A folder of the user's own, for others to read, that runs are told to use."""
    folder = tmp_path / "users"
    folder.mkdir()
    folder.chmod(0o755)
    monkeypatch.setenv("VIBROLOCK_LIVE", str(folder))
    return folder


def filled(folder, **files):
    folder.mkdir(parents=True)
    for name, text in files.items():
        (folder / name.replace("_", ".")).write_text(text)
    return folder


def everything_in(folder):
    return {
        path.relative_to(folder): (path.lstat().st_mode, None if path.is_dir() else path.read_bytes())
        for path in sorted(folder.rglob("*"))
    }


def a_run():
    folder, descriptor = new_folder(FACTS)
    os.close(descriptor)
    return folder


def test_what_a_user_has_in_the_folder_stays_as_it_was(users):
    filled(users / "thesis", chapter_tex="years of work")
    filled(users / "empty")
    filled(users / ".hidden", lock="", facts_json='{"channels": []}')
    filled(users / DEAD, lock="", facts_json='{"channels": []}')  # nothing is made here, so nothing is removed
    (users / "notes.txt").write_text("notes")
    os.utime(users / ".hidden", (1e9, 1e9))
    mode, before = users.stat().st_mode, everything_in(users)
    made = a_run()
    after = everything_in(users)
    assert users.stat().st_mode == mode
    assert {path: after.get(path) for path in before} == before
    assert made.parent == base_folder()
    assert made.parent.parent == users


@pytest.mark.parametrize(
    ("name", "files"),
    [
        ("thesis", {"lock": "", "facts_json": '{"channels": []}'}),
        ("2026-0123456789abcdef0", {"lock": "", "facts_json": '{"channels": []}'}),
        (DEAD, {"chapter_tex": "years of work"}),
        (DEAD, {"lock": ""}),
        (DEAD, {"lock": "", "facts_json": "of another program"}),
        (DEAD, {"lock": "", "facts_json": "[1]"}),
        (DEAD, {"lock": "of a door", "facts_json": '{"channels": []}'}),
        (DEAD, {"lock": "", "facts_json": '{"channels": []}', "chapter_tex": "years of work"}),
        (f".{DEAD}", {"lock": "", "chapter_tex": "years of work"}),
        (".thesis", {"lock": ""}),
    ],
)
def test_a_folder_among_those_of_runs_that_no_run_has_made_stays(users, name, files):
    folder = filled(base_folder() / name, **files)
    os.utime(folder, (1e9, 1e9))
    before = everything_in(folder)
    a_run()
    assert everything_in(folder) == before


def test_links_are_neither_followed_nor_removed(users, tmp_path):
    elsewhere = filled(tmp_path / "elsewhere", lock="", facts_json='{"channels": []}')
    (base_folder() / DEAD).symlink_to(elsewhere)
    inside = filled(base_folder() / "1-fedcba9876543210", lock="")
    (inside / "facts.json").symlink_to(elsewhere / "facts.json")
    before = everything_in(elsewhere)
    a_run()
    assert everything_in(elsewhere) == before
    assert (base_folder() / DEAD).is_symlink()
    assert (inside / "facts.json").is_symlink()


def test_what_dead_runs_have_left_is_removed_whether_whole_half_made_or_half_removed(users):
    whole = filled(base_folder() / DEAD, lock="", facts_json='{"channels": []}', frame="", lines_jsonl="", stop="")
    (whole / ".stop-0123456789abcdef").touch()
    halves = [filled(base_folder() / f".{n}-0123456789abcdef", **files) for n, files in enumerate(({}, {"lock": ""}))]
    for half in halves:
        os.utime(half, (1e9, 1e9))
    made = a_run()
    assert list(base_folder().iterdir()) == [made]


def test_a_folder_that_two_runs_clean_at_once_costs_neither_its_start(users, monkeypatch):
    filled(base_folder() / DEAD, lock="", facts_json='{"channels": []}')
    rename = Path.rename

    def beaten(path, target):
        if path.name == DEAD:
            rename(path, target)  # the other was quicker
        return rename(path, target)

    monkeypatch.setattr(Path, "rename", beaten)
    made = a_run()
    monkeypatch.undo()
    assert made.is_dir()


def test_the_mode_of_a_folder_that_others_may_use_is_named_and_not_changed(users):
    base_folder().chmod(0o755)
    with refused(RecordingError, "others-may-use-it-chmod"):
        base_folder()
    (folder,) = users.iterdir()
    assert folder.stat().st_mode & 0o777 == 0o755
    assert runs() == []


def test_files_for_a_browser_are_removed_by_name_and_content(users, monkeypatch):
    monkeypatch.setattr("webbrowser.open", lambda uri: True)
    left = open_in_browser("http://127.0.0.1:1/", print)
    letter, other = base_folder() / "open-letter.html", base_folder() / "open-0123456789abcdef.html"
    for path in (letter, other):
        path.write_text("<p>Dear editor")
    for path in (left, letter, other):
        os.utime(path, (1e9, 1e9))
    open_in_browser("http://127.0.0.1:1/", print)
    assert not left.exists()
    assert letter.exists()
    assert other.exists()
