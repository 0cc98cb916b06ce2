"""Child process that reads a file of another program (`rig.exchange.child_reading`)."""

import json
import sys
from pathlib import Path
from pkgutil import resolve_name

from identification import IdentificationError
from rig.errors import RigError
from rig.exchange.child_reading import NAMES
from rig.exchange.child_values import most_bytes, reason, write_values
from rig.system.child import confine

_READERS = {
    "mat": "rig.exchange.mat:parsed_mat",
    "hdf5": "rig.exchange.foreign.hdf5:read_hdf5",
    "wav": "rig.exchange.foreign.channels:read_wav",
    "tdms": "rig.exchange.foreign.channels:read_tdms",
    "mdf4": "rig.exchange.foreign.channels:read_mdf4",
    "lvm": "rig.exchange.foreign.labview:read_lvm",
    "npz": "rig.exchange.foreign.arrays:read_npz",
    "xlsx": "rig.exchange.foreign.arrays:read_workbook",
    "csv": "rig.exchange.csv:columns_in",
    "table of ours": "rig.exchange.csv:stored_table",
    "uff": "rig.exchange.uff.reading:datasets_in",
    "sep005": "rig.exchange.sep005:series_in",
    "proposal": "rig.exchange.proposal.proposal:proposed",
}
"""Readers by name; each takes the path, and the options by name."""


def main(reader: str, options: dict[str, object], path: Path, folder: Path) -> str:
    """Read ``path`` into ``folder``; return why it cannot be read, or an empty text."""
    try:
        write_values(resolve_name(_READERS[reader])(path, **options), folder, most_bytes(path))
    except (RigError, IdentificationError) as error:
        return str(error)
    except ImportError as error:
        return f"needs the package {error.name}; install the extra: pip install 'vibrolock[formats]'"
    except Exception as error:  # parsers raise many unrelated exceptions on damaged bytes
        return reason(error, NAMES.get(reader, "file of measurements"))
    return ""


if __name__ == "__main__":
    confine(float(sys.argv[5]))
    reason_given = main(sys.argv[1], json.loads(sys.argv[2]), Path(sys.argv[3]), Path(sys.argv[4]))
    sys.stdout.buffer.write(reason_given.encode("utf-8", "backslashreplace"))
