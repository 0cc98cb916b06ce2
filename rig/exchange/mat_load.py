"""Read a MAT file and write its values into a folder: the child process of `rig.exchange.mat`."""

import sys
from pathlib import Path

from rig.exchange.mat_values import write_values
from rig.system.child import MEMORY_BYTES, confine

__all__ = ["main"]


def main(path: Path, folder: Path) -> str:
    """Read ``path`` into ``folder``; return why it cannot be read, or an empty text."""
    from scipy.io import loadmat

    try:
        write_values(loadmat(str(path), simplify_cells=True, appendmat=False), folder)
    except NotImplementedError:
        return "is a MAT file of version 7.3; save it in MATLAB with save(..., '-v7')"
    except OSError as error:
        return f"cannot be read ({error.strerror or error})"
    except MemoryError:
        return f"takes more than {MEMORY_BYTES / 2**30:g} GiB of memory, or is damaged"
    except Exception as error:  # the parser fails on damaged bytes in many ways, of no common class
        return f"is no MAT file, or a damaged one ({' '.join(str(error).split())})"
    return ""


if __name__ == "__main__":
    confine(float(sys.argv[3]))
    sys.stdout.buffer.write(main(Path(sys.argv[1]), Path(sys.argv[2])).encode("utf-8", "backslashreplace"))
