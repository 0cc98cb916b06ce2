"""Reading of a file of another program in a child process, because parsers crash, hang or take all memory."""

import json
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TypeVar

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
    "lvm": "LabVIEW measurement file",
    "npz": "NumPy archive",
    "xlsx": "Excel workbook",
    "csv": "CSV file",
    "uff": "universal file",
    "sep005": "JSON file",
}
"""Name of a file of each format, as messages have it."""

PROPOSAL = "say by `mapping` what is where in it; `rig new mapping` proposes one for time data"
"""Advice where a file needs a mapping."""
NOT_OURS = f"was not written by this package; {PROPOSAL}"  # reason against reading a file without a mapping
_TIMEOUT_S, _SLOWEST_BYTES_S = 60.0, 5e6
"""Time that reading may take, s, and further bytes per second of time; chosen: far slower than any reader."""
T = TypeVar("T")  # what a reader returns


class ImportFailed(RigError):  # noqa: N818 (says what happened)
    """A file of measurements cannot be read, or does not contain what its mapping says. The message names both."""


def read_in_child(reader: str, path: Path, what: str, returns: type[T], **options: object) -> T:
    """Return what ``reader`` of `rig.exchange.process` finds in a file; raise `ImportFailed` if it finds nothing.

    SciPy's parser of MAT files crashes on some damaged files, and others are no safer; small files can declare gigabytes.
    Therefore a child process reads the file, with at most 4 GiB of memory, for at most 60 s and 1 s per 5 MB, and hands over
    no more than `rig.exchange.child_values.most_bytes`. ``what`` names in messages what the file should be, ``returns`` is
    the type of what the reader returns.
    """
    if not path.is_file():
        read_bytes(path, 0, ImportFailed)
    with TemporaryDirectory(prefix="vibrolock-") as folder:
        timeout_s = _TIMEOUT_S + path.stat().st_size / _SLOWEST_BYTES_S
        try:
            answer = ask_child(
                "rig.exchange.process", reader, json.dumps(options), str(path), folder, timeout_s=timeout_s
            )
        except ChildFailed as error:
            raise ImportFailed(f"{path}: is no {what}, or a damaged one (reading it {error})") from None
        if why := answer.decode():
            raise ImportFailed(why if why.startswith(str(path)) else f"{path}: {why}")
        found = read_values(Path(folder))
    if not isinstance(found, returns):
        raise ImportFailed(f"{path}: is no {what}, or a damaged one (it holds a {type(found).__name__})")
    return found
