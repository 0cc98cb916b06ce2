"""Read a file of somebody else in a child process, because parsers crash, hang or take all memory."""

import json
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from rig.errors import RigError
from rig.exchange.child_values import read_values
from rig.system.child import ChildFailed, ask_child
from rig.system.text_files import read_bytes

NAMES = {
    "mat": "MAT file",
    "hdf5": "HDF5 file",
    "wav": "WAV file",
    "tdms": "TDMS file",
    "mdf4": "MDF 4 file",
    "csv": "CSV file",
    "uff": "universal file",
    "sep005": "JSON file",
}
"""What a file of each format is called."""

_PATIENCE_S, _SLOWEST_BYTES_S = 60.0, 5e6


class ImportFailed(RigError):  # noqa: N818 (says what happened)
    """A file of measurements cannot be read, or does not contain what its mapping says. The message names both."""


def read_in_child(reader: str, path: Path, what: str, **options: Any) -> Any:
    """Return what ``reader`` of `rig.exchange.process` finds in a file; raise `ImportFailed` if it finds nothing.

    SciPy's parser of MAT files crashes on some damaged files, and others are no safer; small files can declare gigabytes.
    Therefore a child process reads the file, with at most 4 GiB of memory, for at most 60 s and 1 s per 5 MB, and hands over
    no more than `rig.exchange.child_values.most_bytes`. ``what`` says in messages what the file should be.
    """
    if not path.is_file():
        read_bytes(path, 0, ImportFailed)
    with TemporaryDirectory(prefix="vibrolock-") as folder:
        timeout_s = _PATIENCE_S + path.stat().st_size / _SLOWEST_BYTES_S
        try:
            told = ask_child(
                "rig.exchange.process", reader, json.dumps(options), str(path), folder, timeout_s=timeout_s
            )
        except ChildFailed as error:
            raise ImportFailed(f"{path}: is no {what}, or a damaged one (reading it {error})") from None
        if why := told.decode():
            raise ImportFailed(why if why.startswith(str(path)) else f"{path}: {why}")
        return read_values(Path(folder))
