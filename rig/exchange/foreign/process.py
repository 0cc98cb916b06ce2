"""Child process that reads a file of a binary format of others, as `rig.exchange.mat_process` reads MAT files."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rig.exchange.child_values import reason, write_values
from rig.exchange.foreign.hdf5 import read_hdf5
from rig.exchange.foreign.mdf4 import read_mdf4
from rig.exchange.foreign.tdms import read_tdms
from rig.exchange.foreign.wav import read_wav
from rig.system.child import confine

__all__ = ["NAMES", "main"]

_READERS: dict[str, Callable[[Path], dict[str, Any]]] = {
    "hdf5": read_hdf5,
    "wav": read_wav,
    "tdms": read_tdms,
    "mdf4": read_mdf4,
}
NAMES = {"hdf5": "HDF5 file", "wav": "WAV file", "tdms": "TDMS file", "mdf4": "MDF 4 file"}
"""What a file of each format is called."""


def main(format_: str, path: Path, folder: Path) -> str:
    """Read ``path`` into ``folder``; return why it cannot be read, or an empty text."""
    try:
        write_values(_READERS[format_](path), folder)
    except ImportError as error:
        return f"needs the package {error.name}; install the extra: pip install 'vibrolock[formats]'"
    except Exception as error:  # parsers raise many unrelated exceptions on damaged bytes
        return reason(error, NAMES[format_])
    return ""


if __name__ == "__main__":
    confine(float(sys.argv[4]))
    sys.stdout.buffer.write(main(sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3])).encode("utf-8", "backslashreplace"))
