"""What a disk, a folder, a name, a locale or a clock may do to a run; each scene says what was wrong."""

import os
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from rig.recording.journal import journal_path
from rig.recording.reader import Recording
from tests.reliability.places.running import Ended, command, objections, run_command, write_plan
from tests.waiting import wait_until

_LIMITED = """
import resource, signal, sys
sys.dont_write_bytecode = True  # which a full disk cuts short
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, ({0}, resource.RLIM_INFINITY))
"""
FULL_AFTER_BYTES = (0, 1, 40, 5000, 40_000, 100_000, 300_000, 1_000_000)
NAMES = (
    "with blank.h5",
    "Größe µ.h5",
    "-o.h5",
    "a'b\"c.h5",
    "line\nend.h5",
    "\u202eright-to-left.h5",
    "no-ending",
    os.fsdecode(b"not-utf8-\xff.h5"),
    "x" * 200 + ".h5",
)


def full_disk(folder: Path, after_bytes: int) -> list[str]:
    """No file may grow beyond so many bytes; once there is room, the run is finished."""
    output, plan = folder / "run.h5", write_plan(folder)
    ended = run_command("run", plan, "-o", output, before=_LIMITED.format(after_bytes))
    wrong = objections(ended, output, succeeds=False)
    kept = b""
    if journal_path(output).exists():
        with Recording(output) as recording:
            kept = b"".join(part.read(0, part.n_rows).tobytes() for part in recording.parts)
    if kept:
        again = run_command("resume", output)
    else:
        again = run_command("run", plan, "-o", output, "--overwrite")
    wrong += objections(again, output, succeeds=True)
    with Recording(output) as recording:
        rows = b"".join(part.read(0, part.n_rows).tobytes() for part in recording.parts)
    return wrong if rows.startswith(kept) else [*wrong, "rows of the first attempt are lost"]


def name(folder: Path, called: str) -> list[str]:
    """An output of an unusual name."""
    output = folder / called
    ended = run_command("run", write_plan(folder), "-o", output)
    wrong = objections(ended, output, succeeds=True)
    shown = run_command("show", output)
    if shown.status != 0 or not shown.output:
        wrong.append(f"cannot be shown: {shown.complaint}")
    return wrong


def too_long_a_name(folder: Path) -> list[str]:
    """A name that no file can have."""
    output = folder / ("x" * 252 + ".h5")
    ended = run_command("run", write_plan(folder), "-o", output)
    return objections(ended, folder / "none.h5", succeeds=False)


def locale(folder: Path, note: str = "a note", **environment: str) -> list[str]:
    """Other locales and encodings."""
    output = folder / "run.h5"
    ended = run_command("run", write_plan(folder), "-o", output, "--note", note, **environment)
    shown = run_command("show", output, **environment)
    return objections(ended, output, succeeds=True) + (
        [] if shown.status == 0 else [f"cannot be shown: {shown.complaint}"]
    )


def unwritable(folder: Path, what: str) -> list[str]:
    """A home, cache and state that cannot be made: files stand where folders should."""
    blocked = folder / "blocked"
    blocked.write_text("no folder")
    inside = str(blocked / "inside")
    output = folder / "run.h5"
    ended = run_command("run", write_plan(folder), "-o", output, **dict.fromkeys(what.split(), inside))
    return objections(ended, output, succeeds=True)


def no_folder(folder: Path) -> list[str]:
    """An output in a folder that is not there, and one that is a folder."""
    plan = write_plan(folder)
    ended = run_command("run", plan, "-o", folder / "nowhere" / "run.h5")
    (folder / "run.h5").mkdir()
    other = run_command("run", plan, "-o", folder / "run.h5")
    return objections(ended, folder / "none.h5", succeeds=False) + objections(other, folder / "none.h5", succeeds=False)


def working_folder_gone(folder: Path) -> list[str]:
    """The working folder was removed before the command came to it."""
    output, plan, here = folder / "run.h5", write_plan(folder), folder / "here"
    here.mkdir()
    ended = run_command("run", plan, "-o", output, before=f"import os; os.rmdir({str(here)!r})", cwd=here)
    return objections(ended, output, succeeds=True)


def _slow_run(folder: Path, points: int = 2) -> "subprocess.Popen[str]":
    """A run by the wall clock, of which some rows are written."""
    output, plan = folder / "run.h5", write_plan(folder)
    plan.write_text(plan.read_text().replace("[0.4, 0.6]", str([0.4 + 0.01 * k for k in range(points)])))
    process = subprocess.Popen(
        command("run", plan, "-o", output, "--realtime"),
        env={**os.environ},
        cwd=Path(__file__).parents[3],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    wait_until(lambda: process.poll() is not None or _size(journal_path(output)) > 200_000, "rows of a run")
    return process


def _size(path: Path) -> int:
    return path.stat().st_size if path.exists() else 0


def _ended(process: "subprocess.Popen[str]") -> Ended:
    output, complaint = process.communicate()
    return Ended(process.returncode, output, complaint)


def removed(folder: Path, what: str) -> list[str]:
    """The journal, or its whole folder, is removed during the run."""
    inside = folder / "results"
    inside.mkdir()
    process = _slow_run(inside)
    journal = journal_path(inside / "run.h5")
    if what == "journal":
        journal.unlink()
    else:
        for path in (journal, inside / "plan.toml"):
            path.unlink()
        inside.rmdir()
    ended = _ended(process)
    wrong = objections(ended, folder / "none.h5", succeeds=False)
    if "was removed or renamed while it was written" not in ended.complaint:
        wrong.append(f"not noticed: {ended.complaint[-300:]}")
    if what == "journal" and not journal.exists():
        wrong.append("not written again")
    if "written again to " in ended.complaint:
        place = Path(ended.complaint.split("written again to ")[1].split()[0].rstrip(";"))
        if place.parent != inside:
            place.unlink()
            place.parent.rmdir()
    return wrong


def stopped_and_continued(folder: Path) -> list[str]:
    """SIGSTOP for two seconds, in a run that nothing waits for."""
    process = _slow_run(folder)
    process.send_signal(signal.SIGSTOP)
    time.sleep(2.0)
    process.send_signal(signal.SIGCONT)
    return objections(_ended(process), folder / "run.h5", succeeds=True)


def two_runs_to_one_output(folder: Path) -> list[str]:
    """A second run, and a resumption, while the first is writing."""
    process = _slow_run(folder, points=500)
    output = folder / "run.h5"
    wrong = []
    for arguments in (("run", folder / "plan.toml", "-o", output, "--overwrite"), ("resume", output)):
        ended = run_command(*arguments)
        wrong += objections(ended, folder / "none.h5", succeeds=False)
        if "is being written by another process" not in ended.complaint:
            wrong.append(f"no word on the other run: {ended.complaint[-300:]}")
    process.send_signal(signal.SIGTERM)
    return wrong + objections(_ended(process), output, succeeds=False)


def clock_that_jumps(folder: Path) -> list[str]:
    """The calendar clock goes back an hour and forth a day in the middle of a run."""
    jumping = """
import time
real, calls = time.time, [0]
def jumping():
    calls[0] += 1
    return real() + (0.0, -3600.0, 86400.0)[calls[0] // 3 % 3]
time.time = jumping
"""
    output = folder / "run.h5"
    ended = run_command("run", write_plan(folder), "-o", output, before=jumping)
    return objections(ended, output, succeeds=True)


def yesterdays_file(folder: Path) -> list[str]:
    """A recording whose rows were all lost on the way to the disk: a file of nothing."""
    output = folder / "run.h5"
    output.write_bytes(b"")
    ended = run_command("show", output)
    return objections(ended, folder / "none.h5", succeeds=False)


def _scenes() -> Iterator[tuple[str, Callable[[Path], list[str]]]]:
    for after in FULL_AFTER_BYTES:
        yield f"full disk after {after} bytes", lambda folder, after=after: full_disk(folder, after)
    for called in NAMES:
        yield f"output called {ascii(called)[:40]}", lambda folder, called=called: name(folder, called)
    yield "name too long", too_long_a_name
    yield "locale C", lambda folder: locale(folder, LC_ALL="C", PYTHONUTF8="0", PYTHONCOERCECLOCALE="0")
    yield (
        "locale POSIX, ASCII output",
        lambda folder: locale(folder, "µ = 3 Ω", LC_ALL="POSIX", PYTHONIOENCODING="ascii"),
    )
    yield "another time zone", lambda folder: locale(folder, TZ="Pacific/Kiritimati")
    yield "no home", lambda folder: unwritable(folder, "HOME")
    yield "no state", lambda folder: unwritable(folder, "XDG_STATE_HOME XDG_CACHE_HOME XDG_CONFIG_HOME")
    yield "no cache of kernels", lambda folder: unwritable(folder, "NUMBA_CACHE_DIR MPLCONFIGDIR")
    yield "no folder", no_folder
    yield "working folder gone", working_folder_gone
    yield "journal removed", lambda folder: removed(folder, "journal")
    yield "folder removed", lambda folder: removed(folder, "folder")
    yield "stopped and continued", stopped_and_continued
    yield "two runs to one output", two_runs_to_one_output
    yield "clock that jumps", clock_that_jumps
    yield "empty file", yesterdays_file


SCENES: dict[str, Callable[[Path], list[str]]] = dict(_scenes())
"""By name; each is given a folder of its own and returns what was wrong."""
