"""Commands that several pages show are run once for all of them, where nothing but the command tells what they do."""

import hashlib
import shutil
from pathlib import Path

from tests.command import Ended, run_command
from tests.sharing import made_once, shared_folder


def run_shared(words: list[str]) -> Ended:
    """Run a command in the present folder, once for all pages where words and files tell all that it does.

    These are ``rig run PLAN -o FILE`` on a shipped bench, and ``rig identify``, ``plot``, ``export`` of recordings and models.
    """
    told = _told_by(words)
    if told is None or Path(words[-1]).exists():
        return run_command(*words)
    name = hashlib.sha256("\n".join([*words, *told]).encode()).hexdigest()[:24]
    try:
        folder = made_once(shared_folder() / "commands" / name, lambda folder: _run(words, folder))
    except _FailedError as failed:
        return failed.ended
    shutil.copy(folder / words[-1], words[-1])
    return Ended(0, *((folder / stream).read_text(encoding="utf-8") for stream in ("out", "err")))


def _told_by(words: list[str]) -> list[str] | None:
    """What the files of a command hold; None where it may depend on more than its words and these."""
    match words:
        case ["run", plan, "-o", _]:
            text = _plan_alone(plan)
            return None if text is None else [text]
        case ["identify" | "plot" | "export", *options, "-o", _] if not any(":" in one for one in options):
            files = [Path(one) for one in options if one.endswith(".h5") or Path(one).exists()]
            if not all(one.is_file() and one.suffix == ".h5" for one in files):
                return None  # whatever is said of it
            return [hashlib.sha256(one.read_bytes()).hexdigest() for one in files]
        case _:
            return None


def _plan_alone(plan: str) -> str | None:
    """The text of a plan in a file, empty for a shipped one; None where it names further files."""
    if not plan.endswith(".toml"):
        return ""
    lines = Path(plan).read_text(encoding="utf-8").splitlines()
    text = "\n".join(line for line in lines if not line.startswith("#"))
    return None if ".toml" in text or ":" in text else text


class _FailedError(Exception):
    """A command has ended with another status than 0, or has written another file than it was asked for."""

    def __init__(self, ended: Ended) -> None:
        super().__init__(ended.err)
        self.ended = ended


def _run(words: list[str], folder: Path) -> None:
    before = {Path(words[-1]), *Path().iterdir()}
    ended = run_command(*words)
    if ended.status or before != set(Path().iterdir()):
        raise _FailedError(ended)
    shutil.copy(words[-1], folder)
    for stream in ("out", "err"):
        (folder / stream).write_text(getattr(ended, stream), encoding="utf-8")
