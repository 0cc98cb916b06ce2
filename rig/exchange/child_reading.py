"""Read a file of somebody else in a child process, because parsers of binary formats crash, hang or take all memory."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from rig.errors import RigError
from rig.exchange.child_values import read_values
from rig.system.child import ChildFailed, ask_child

__all__ = ["ImportFailed", "read_in_child"]

_PATIENCE_S, _SLOWEST_BYTES_S = 60.0, 5e6


class ImportFailed(RigError):  # noqa: N818 (says what happened)
    """A file of measurements cannot be read, or does not contain what its mapping says. The message names both."""


def read_in_child(module: str, path: Path, what: str, *arguments: str) -> dict[str, Any]:
    """Return what ``python -m MODULE ARGUMENTS PATH FOLDER TIMEOUT_S`` reads; raise `ImportFailed` if it reads nothing.

    SciPy's parser of MAT files crashes on some damaged files, and others are no safer. Therefore a child process reads the
    file, with at most 4 GiB of memory, for at most 60 s and 1 s per 5 MB. ``what`` says in messages what the file should be.
    """
    if not path.is_file():
        raise ImportFailed(f"{path}: there is no such file")
    with TemporaryDirectory(prefix="vibrolock-") as folder:
        timeout_s = _PATIENCE_S + path.stat().st_size / _SLOWEST_BYTES_S
        try:
            why = ask_child(module, *arguments, str(path.absolute()), folder, timeout_s=timeout_s)
        except ChildFailed as error:
            raise ImportFailed(f"{path}: is no {what}, or a damaged one (reading it {error})") from None
        if why:
            raise ImportFailed(f"{path}: {why.decode()}")
        data: dict[str, Any] = read_values(Path(folder))
    return data
