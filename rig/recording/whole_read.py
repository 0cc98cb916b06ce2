"""Read an HDF5 file from beginning to end and print a verdict: the child process of `rig.recording.integrity`."""

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from rig.errors import RecordingError
from rig.recording.examination import objects_in
from rig.recording.layout import open_unchecked, reading
from rig.system.child import confine

if TYPE_CHECKING:
    import h5py

_AT_ONCE = 2**22  # bytes that are read at a time; chosen


def main(path: Path) -> dict[str, str | bool | int]:
    """Read the whole file.

    Returns:
        ``refused``: why the file is refused, or an empty text; ``memory``: whether because memory did not suffice; ``schema``
        of the file, 0 if it could not be read.
    """
    verdict: dict[str, str | bool | int] = {"refused": "", "memory": False, "schema": 0}
    try:
        with open_unchecked(path) as file, reading(path):
            verdict["schema"] = int(file.attrs["schema"])
            for name, _ in objects_in(file):
                item = file[name]
                dict(item.attrs)
                if hasattr(item, "shape"):
                    _read_all(item)
    except RecordingError as error:
        verdict["memory"] = isinstance(error.__cause__, MemoryError)
        verdict["refused"] = str(error)
    return verdict


def _read_all(dataset: "h5py.Dataset") -> None:
    """Read a dataset chunk by chunk, or by rows of some megabytes."""
    if dataset.shape == () or 0 in dataset.shape:
        dataset[()]
        return
    step = max(1, _AT_ONCE // max(1, dataset.nbytes // dataset.shape[0]))
    step = step if dataset.chunks is None else dataset.chunks[0]
    for first in range(0, dataset.shape[0], step):
        dataset[first : first + step]


if __name__ == "__main__":
    confine(float(sys.argv[2]))
    print(json.dumps(main(Path(sys.argv[1]))))
