"""A command that several pages show is run once where words and files tell all that it does, and only there."""

from pathlib import Path

import pytest

from tests.command import Ended
from tests.docs import shared_commands

PLAN = 'kind = "backbone"\nlevels_v = [0.4]\n'


@pytest.fixture
def reader(tmp_path, monkeypatch):
    """A reader of pages: runs a command in a folder of its own beside some files, and says which commands have been run."""
    run, folders = [], iter(range(99))

    def run_command(*words):
        run.append(" ".join(words))
        Path(words[-1]).write_text(f"made {len(run)}")
        if "twice" in words[-1]:
            Path("beside").touch()
        return Ended(0, "out", "err")

    def read(line, files):
        folder = tmp_path / f"page {next(folders)}"
        folder.mkdir()
        for name, text in files.items():
            (folder / name).write_text(text)
        monkeypatch.chdir(folder)
        words = line.split()
        assert shared_commands.run_shared(words) == (0, "out", "err")
        assert Path(words[-1]).read_text().startswith("made")
        return len(run)

    monkeypatch.setattr(shared_commands, "run_command", run_command)
    monkeypatch.setattr(shared_commands, "shared_folder", lambda: tmp_path / "shared")
    return read


@pytest.mark.parametrize(
    ("line", "files", "others"),
    [
        ("run plan.toml -o run.h5", {"plan.toml": PLAN}, {"plan.toml": PLAN.replace("0.4", "0.5")}),
        ("identify run.h5 -o m.h5", {"run.h5": "one"}, {"run.h5": "other"}),
        ("plot run.h5 --size 85x60 -o run.png", {"run.h5": "one"}, {"run.h5": "other"}),
        ("export run.h5 -o run.uff", {"run.h5": "one"}, {"run.h5": "other"}),
    ],
)
def test_it_is_run_once_for_the_same_files_and_again_for_others(reader, line, files, others):
    assert [reader(line, given) for given in (files, files, others, others, files)] == [1, 1, 2, 2, 2]


def test_what_a_plan_says_in_comments_is_no_matter(reader):
    assert [reader("run plan.toml -o run.h5", {"plan.toml": head + PLAN}) for head in ("", "# file: plan.toml\n")] == [
        1,
        1,
    ]


@pytest.mark.parametrize(
    ("line", "files"),
    [
        ("run plan.toml -o run.h5", {"plan.toml": PLAN + 'bench = "own.toml"\n'}),
        ("plot run.h5 --style own.mplstyle -o run.png", {"run.h5": "one", "own.mplstyle": ""}),
        ("identify run.h5 --function own:law -o m.h5", {"run.h5": "one"}),
        ("export run.h5 -o twice.csv", {"run.h5": "one"}),
        ("predict run.h5 -o p.h5", {"run.h5": "one"}),
    ],
)
def test_what_depends_on_more_is_run_by_each(reader, line, files):
    assert [reader(line, files) for _ in range(3)] == [1, 2, 3]
