"""Reading and importing a CSV file of 60 MB: processor time and memory, beside ``numpy.loadtxt`` and a plain loop.

    python -m benchmarks.tables [--json]

Each way reads the file in a process of its own: with pandas, without it, and as ``rig import`` does, which reads in a child and
writes HDF5. The loop tells how fast the machine is at the moment.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import typer

ROWS = 833_000
"""Rows of the file: 60 MB with four columns of 15 digits."""
_READ = "from pathlib import Path; from rig.exchange.tables.reading import read_table; read_table(Path(sys.argv[1]))"
_IMPORT = (
    "from rig.cli import main; path = sys.argv[1]; sys.argv[1:] = ['import', path, '-o', path + '.h5', '--overwrite']"
)
WAYS = {
    "20 million steps": "import sys\nfor _ in range(20_000_000): pass",
    "numpy.loadtxt": "import sys, numpy; numpy.loadtxt(sys.argv[1], delimiter=',', skiprows=2)",
    "with pandas": f"import sys; {_READ}",
    "rig import": f"import sys; {_IMPORT}; sys.argv += ['--mapping', path + '.toml']\ntry: main()\nexcept SystemExit: pass",
    "without pandas": f"import sys; sys.modules['pandas'] = None; {_READ}",
}
"""What each process does with the file."""


def write(path: Path) -> None:
    """Write instants, a force and two accelerations, with a row of units."""
    random = np.random.default_rng(1)
    columns = np.column_stack([np.arange(ROWS) / 2048.0, random.normal(size=(ROWS, 3))])
    channels = "".join(
        f'[[channels]]\nname = "{name}"\nrole = "{role}"\nunit = "{unit}"\nvalue = "{name}"\n'
        for name, role, unit in (("F", "force", "N"), ("a", "drive", "m/s2"), ("b", "response", "m/s2"))
    )
    Path(f"{path}.toml").write_text(f'kind = "time-data"\ntime = "t"\n{channels}')
    np.savetxt(path, columns, fmt="%.15g", delimiter=",", header="t,F,a,b\ns,N,m/s2,m/s2", comments="")


def measured(code: str, path: Path) -> dict[str, float]:
    """Processor time, s, and largest memory, bytes, of a process that runs the code, and of its children."""
    asked = "import resource as r; used = [r.getrusage(of) for of in (r.RUSAGE_SELF, r.RUSAGE_CHILDREN)]"
    told = "print(sum(one.ru_utime + one.ru_stime for one in used), max(one.ru_maxrss for one in used) * 1024)"
    answer = subprocess.run(
        [sys.executable, "-c", f"{code}\n{asked}\n{told}", path], check=True, capture_output=True, text=True
    )
    seconds, memory = map(float, answer.stdout.split()[-2:])
    return {"processor_s": seconds, "memory_bytes": memory}


def main(as_json: bool = typer.Option(False, "--json")) -> None:
    """Measure every way, and print what it takes."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "table.csv"
        write(path)
        found = {name: measured(code, path) for name, code in WAYS.items()}
    if as_json:
        print(json.dumps(found))
        return
    for name, one in found.items():
        print(f"{name:<16} {one['processor_s']:6.2f} s  {one['memory_bytes'] / 1e6:6.0f} MB")


if __name__ == "__main__":
    typer.run(main)
