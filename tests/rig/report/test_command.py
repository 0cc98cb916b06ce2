"""`rig report` as it is typed: what it writes, and one line for every mistake."""

import errno
from pathlib import Path

import pytest

from tests.rig.report.page import read


def test_a_report_is_written_and_kept_unless_it_may_be_replaced(command, recordings):
    path = recordings["backbone"]
    done = command("report", path, "-o", "report.html")
    assert (done.status, done.out, done.err) == (0, "report: report.html\n", "")
    first = Path("report.html").read_text(encoding="utf-8")
    again = command("report", path, "-o", "report.html")
    assert again.status == 1
    assert again.err == "rig: report.html: exists already; choose another name, or --overwrite\n"
    assert Path("report.html").read_text(encoding="utf-8") == first
    assert command("report", path, "-o", "report.html", "--overwrite", "--title", "For the customer").status == 0
    assert "For the customer" in read(Path("report.html")).text


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["missing.h5", "-o", "r.html"], "missing.h5: cannot be read (No such file or directory)"),
        (["text.h5", "-o", "r.html"], "text.h5: not a file of vibrolock, but a text file"),
        (
            ["folder", "-o", "r.html"],
            "folder: is a folder without study.json; allowed is a file, or a folder of rig reproduce",
        ),
        (["begun", "-o", "r.html"], "begun: holds no results yet; the same rig reproduce again takes it up"),
        (["RUN", "-o", "nowhere/r.html"], "nowhere/r.html: there is no folder nowhere"),
        (["RUN", "-o", "r.pdf"], "r.pdf: reports are written as .html"),
        (["RUN", "RUN", "-o", "r.html"], "RUN: is given twice"),
        (["RUN", "text.h5", "-o", "r.html"], "text.h5: not a file of vibrolock, but a text file"),
    ],
)
def test_every_mistake_is_one_line_and_leaves_no_file(command, recordings, words, said):
    Path("text.h5").write_text("hello")
    Path("folder").mkdir()
    Path("begun").mkdir()
    Path("begun/study.json").write_text("{}")
    run = str(recordings["backbone"])
    done = command("report", *(run if word == "RUN" else word for word in words))
    assert done.status == 1
    assert done.err == f"rig: {said.replace('RUN', run)}\n"
    assert not list(Path().glob("**/r.*"))


def test_a_full_disk_leaves_what_was_there(command, recordings, monkeypatch):
    Path("report.html").write_text("before")
    written = Path.write_text

    def full(path, text, **options):
        if path.name.startswith("report.html"):
            raise OSError(errno.ENOSPC, "No space left on device")
        return written(path, text, **options)

    monkeypatch.setattr(Path, "write_text", full)
    done = command("report", recordings["backbone"], "-o", "report.html", "--overwrite")
    assert done.status == 1
    assert done.err == "rig: report.html: cannot be written (No space left on device); nothing was changed\n"
    assert Path("report.html").read_text() == "before"
    assert list(Path().iterdir()) == [Path("report.html")]
