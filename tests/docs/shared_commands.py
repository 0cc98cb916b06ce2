"""Commands that several pages show are run once for all of them, where nothing but the command tells what they do."""

import hashlib
import shutil
from pathlib import Path

from tests.command import Ended, run_command
from tests.sharing import made_once, shared_folder


def run_shared(words: list[str]) -> Ended:
    """Run a command in the present folder; what ``rig run PLAN -o FILE`` makes of a plan on a shipped bench is made once."""
    match words:
        case ["run", plan, "-o", output] if (text := _plan_alone(plan)) is not None and not Path(output).exists():
            name = hashlib.sha256("\n".join([plan, output, text]).encode()).hexdigest()[:24]
            try:
                folder = made_once(shared_folder() / "commands" / name, lambda folder: _run(words, folder))
            except _FailedError as failed:
                return failed.ended
            shutil.copy(folder / output, output)
            return Ended(0, *((folder / stream).read_text(encoding="utf-8") for stream in ("out", "err")))
        case _:
            return run_command(*words)


def _plan_alone(plan: str) -> str | None:
    """The text of a plan in a file, empty for a shipped one; None where it names further files."""
    if not plan.endswith(".toml"):
        return ""
    text = Path(plan).read_text(encoding="utf-8")
    return None if ".toml" in text or ":" in text else text


class _FailedError(Exception):
    """A command has ended with another status than 0."""

    def __init__(self, ended: Ended) -> None:
        super().__init__(ended.err)
        self.ended = ended


def _run(words: list[str], folder: Path) -> None:
    ended = run_command(*words)
    if ended.status:
        raise _FailedError(ended)
    shutil.copy(words[-1], folder)
    for stream in ("out", "err"):
        (folder / stream).write_text(getattr(ended, stream), encoding="utf-8")
