"""Child process that reads a MAT file (`rig.exchange.child_reading`)."""

import sys
from pathlib import Path

from rig.exchange.child_values import reason, write_values
from rig.system.child import confine

__all__ = ["main"]


def main(path: Path, folder: Path) -> str:
    """Read ``path`` into ``folder``; return why it cannot be read, or an empty text."""
    from scipy.io import loadmat

    try:
        try:
            found = loadmat(str(path), simplify_cells=True, appendmat=False)
        except NotImplementedError:  # version 7.3
            from rig.exchange.foreign.matlab_hdf5 import read_matlab_hdf5

            found = read_matlab_hdf5(path)
        write_values(found, folder)
    except Exception as error:  # the parser raises many unrelated exceptions on damaged bytes
        return reason(error, "MAT file")
    return ""


if __name__ == "__main__":
    confine(float(sys.argv[3]))
    sys.stdout.buffer.write(main(Path(sys.argv[1]), Path(sys.argv[2])).encode("utf-8", "backslashreplace"))
