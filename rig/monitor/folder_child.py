"""Reads files for the page in a process of its own: kinds as JSON, a figure as PNG, a table as text, on standard output.

Called as ``python -m rig.monitor.folder_child WHAT FILE... TIMEOUT_S``. Ends with status 1 and one line if it cannot be done.
"""

import contextlib
import io
import json
import os
import sys
import tempfile
from pathlib import Path

from rig.errors import RigError
from rig.recording.journal import journal_path
from rig.recording.journal_blocks import JournalBlocks
from rig.recording.layout import kind_in, open_unchecked, reading
from rig.system.child import confine
from vibrolock.printable import one_line, printable


def _kind(path: Path) -> dict[str, str]:
    """Return kind and a few words. The file is not checked from end to end: in here a damaged one may do what it likes."""
    from rig.results.kinds import KINDS

    try:
        if not path.exists():
            header = JournalBlocks(journal_path(path)).header
            summary = f"recording of {printable(header.started)}, not finished"
            return {"kind": printable(header.kind), "summary": summary}
        with open_unchecked(path) as file, reading(path):
            kind, started = kind_in(file), str(file.attrs.get("started", ""))
    except (RigError, OSError) as error:
        return {"kind": "unreadable", "summary": one_line(str(error))}
    summary = "model or measurement" if kind in KINDS else f"recording of {printable(started)}"
    return {"kind": printable(kind), "summary": summary}


def _figure(path: Path) -> bytes:
    from rig.figures.files import plot

    with tempfile.TemporaryDirectory() as folder:
        figure = Path(folder) / "figure.png"
        plot(path, figure)
        return figure.read_bytes()


def _table(path: Path) -> bytes:
    from rig.results.files import understood
    from rig.show.summary import summarise
    from rig.show.tables import print_summary

    summary = summarise(path)
    with contextlib.redirect_stdout(io.StringIO()) as text, understood(path, summary["kind"]):
        print_summary(summary)
    return text.getvalue().encode()


def _main() -> int:
    what, *names, timeout_s = sys.argv[1:]
    confine(float(timeout_s))
    paths = [Path(name) for name in names]
    out = os.dup(sys.stdout.fileno())
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # whatever a library prints is no answer
    try:
        if what == "kinds":
            answer = json.dumps([_kind(path) for path in paths]).encode()
        else:
            answer = {"figure": _figure, "table": _table}[what](paths[0])
        status = 0
    except (RigError, OSError) as error:
        answer, status = one_line(str(error)).encode(), 1
    with os.fdopen(out, "wb") as stream:
        stream.write(answer)
    return status


if __name__ == "__main__":
    sys.exit(_main())
