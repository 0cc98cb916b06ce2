"""What has changed, in repositories that are made up."""

import os
import shutil
import subprocess

import pytest

from tests.changed.git import changed_files, find_base
from tests.refused import refused

pytestmark = pytest.mark.skipif(shutil.which("git") is None, reason="git is not installed")


@pytest.fixture
def repository(tmp_path, monkeypatch):
    """A repository with two files on `main`, and a function that calls git in it."""
    for name in [name for name in os.environ if name.startswith("GIT_")]:
        monkeypatch.delenv(name)

    def git(*arguments):
        who = ("-c", "user.name=A", "-c", "user.email=a@example.org", "-c", "commit.gpgsign=false")
        subprocess.run(["git", *who, *arguments], cwd=tmp_path, check=True, capture_output=True)

    git("init", "-b", "main")
    (tmp_path / ".gitignore").write_text("*.h5\n")
    for name in ("a.py", "b.py"):
        (tmp_path / name).write_text(f"# {name}\n" * 9)
    git("add", ".")
    git("commit", "-m", "one")
    return tmp_path, git


def changed(folder, asked=""):
    base = find_base(folder, asked)
    return base.name, changed_files(folder, base)


def test_commits_of_the_branch_the_working_tree_and_untracked_files_count(repository):
    folder, git = repository
    git("checkout", "-b", "branch")
    assert changed(folder) == ("main", [])
    git("mv", "a.py", "ä.py")
    git("commit", "-m", "two")
    (folder / "b.py").write_text("")
    (folder / "new").mkdir()
    (folder / "new" / "c d.py").write_text("")
    (folder / "run.h5").write_text("")
    assert changed(folder) == ("main", ["a.py", "b.py", "new/c d.py", "ä.py"])
    assert changed(folder, "HEAD") == ("HEAD", ["b.py", "new/c d.py"])


def test_what_others_did_on_main_since_does_not_count(repository):
    folder, git = repository
    git("checkout", "-b", "branch")
    (folder / "b.py").write_text("")
    git("commit", "-am", "mine")
    git("checkout", "main")
    (folder / "a.py").write_text("")
    git("commit", "-am", "theirs")
    git("checkout", "branch")
    assert changed(folder) == ("main", ["b.py"])


def test_main_is_compared_with_the_remote_one_where_there_is_one(repository):
    folder, git = repository
    (folder / "a.py").write_text("")
    git("commit", "-am", "two")
    assert changed(folder) == ("main", [])
    git("update-ref", "refs/remotes/origin/main", "HEAD~1")
    assert changed(folder) == ("origin/main", ["a.py"])


def test_a_branch_that_is_not_there_is_an_error_in_one_line(repository, tmp_path_factory):
    folder, _ = repository
    with refused(pytest.UsageError, "changed-nothing-to-compare-with-nowhere"):
        find_base(folder, "nowhere")
    (folder / "tests").mkdir()
    with refused(pytest.UsageError, "files-and-folders-come-before-changed"):
        find_base(folder, "tests")
