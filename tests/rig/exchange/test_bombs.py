"""Small files that claim much: a line says so, and the process that was asked stays small, for a child does the reading."""

import json
import re
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the peak of a process's memory is read from /proc")

N = 2**27
MEASURED = (
    "import sys, contextlib\n"
    "from rig.cli import main\n"
    "with contextlib.suppress(SystemExit):\n"
    "    main()\n"
    "with open('/proc/self/status') as file:\n"
    "    print([line.split()[1] for line in file if line.startswith('VmHWM')][0])\n"
)
MAPPING = """kind = "time-data"
specimen = "bomb"
sample_rate_hz = 1000.0
[[channels]]
name = "force"
value = "F"
role = "force"
unit = "N"
[[channels]]
name = "acc"
value = "a"
role = "drive"
unit = "m/s2"
"""


def unwritten(path, userblock=0, **attributes):
    """Chunks that were never written: all are the fill value."""
    with h5py.File(path, "w", userblock_size=userblock) as file:
        for name in "Fa":
            item = file.create_dataset(name, (N,), "f4", chunks=(2**20,), fillvalue=1.0)
            item.attrs.update(attributes)


def called_mat(path):
    """Write the header of a MAT file of version 7.3."""
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\0\2IM")


def unwritten_mat(path):
    unwritten(path, 512, MATLAB_class=np.bytes_("single"))
    called_mat(path)


def compressed(path):
    with h5py.File(path, "w") as file:
        for name in "Fa":
            file.create_dataset(name, data=np.zeros(N // 4, "f4"), chunks=(2**22,), compression="gzip")


def texts(path):
    with h5py.File(path, "w") as file:
        file.create_dataset("F", (N // 4,), "S1", chunks=(2**20,))
        file.create_dataset("a", (N // 16,), h5py.string_dtype(), chunks=(2**20,))


def lists(path):
    with h5py.File(path, "w") as file:
        file.create_dataset("F", (N // 4,), h5py.vlen_dtype("f8"), chunks=(2**20,))
        file.create_dataset("a", (N // 4,), h5py.ref_dtype, chunks=(2**20,))


def table(path):
    with h5py.File(path, "w") as file:
        file.create_dataset("F", (N // 32,), [(f"c{n}", "f8") for n in range(16)], chunks=(2**14,))


def names_of_one(path):
    with h5py.File(path, "w") as file:
        one = file.create_dataset("F", (2**20,), "f8", chunks=(2**20,), fillvalue=1.0)
        for number in range(200):
            file[f"a{number}"] = one


def old_mat(path):
    scipy.io.savemat(path, {"F": np.zeros(N // 4), "a": np.zeros(N // 4)}, do_compression=True)


def cells_mat(path):
    with h5py.File(path, "w", userblock_size=512) as file:
        file["x"] = np.zeros(2**18)
        cells = file.create_dataset("F", (2000,), h5py.ref_dtype)
        cells.attrs["MATLAB_class"] = np.bytes_("cell")
        cells[:] = [file["x"].ref] * 2000
    called_mat(path)


def csv_table(path):
    path.write_text("F,a\n" + "1,2\n" * 2**21)


def series(path):
    path.write_text(json.dumps([{"data": [0] * 2**21, "name": name, "unit_str": "N", "fs": 1000} for name in "Fa"]))


BOMBS = {
    "unwritten.h5": unwritten,
    "compressed.h5": compressed,
    "texts.h5": texts,
    "lists.h5": lists,
    "table.h5": table,
    "names.h5": names_of_one,
    "unwritten.mat": unwritten_mat,
    "old.mat": old_mat,
    "cells.mat": cells_mat,
    "table.csv": csv_table,
    "series.json": series,
}


def run_measured(folder, *words):
    """Return status, printed lines, error lines and the largest resident memory (bytes) of a command, without its children."""
    done = subprocess.run(
        [sys.executable, "-P", "-c", MEASURED, *map(str, words)],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=300,
    )
    *lines, peak = done.stdout.splitlines()
    said = [line for line in done.stderr.splitlines() if not re.match(r"\[\d+ s\] ", line)]  # what is waited for
    return lines, said, 1024 * int(peak)


@pytest.mark.slow
@pytest.mark.parametrize("name", BOMBS)
def test_a_mapping_is_proposed_or_refused_by_a_child(tmp_path, name):
    BOMBS[name](tmp_path / name)
    lines, errors, peak = run_measured(tmp_path, "new", "mapping", name, "-o", "m.toml")
    print(name, (tmp_path / name).stat().st_size, peak, lines, errors)
    assert len(lines) + len(errors) == 1
    assert "unexpected" not in "".join(errors)
    assert peak < 150e6


@pytest.mark.slow
@pytest.mark.parametrize("name", BOMBS)
def test_an_import_takes_memory_as_the_file_has_bytes(tmp_path, name):
    BOMBS[name](tmp_path / name)
    Path(tmp_path, "m.toml").write_text(MAPPING)
    size = Path(tmp_path, name).stat().st_size
    lines, errors, peak = run_measured(tmp_path, "import", name, "--mapping", "m.toml", "-o", "out.h5")
    print(name, size, peak, lines[:2], errors)
    assert len(errors) <= 1
    assert "unexpected" not in "".join(errors)
    assert peak < 350e6 + 40 * size
