"""Reading a CSV file of 60 MB: processor time and memory, over those of ``numpy.loadtxt`` on the same file.

    python -m benchmarks.tables [--json]

Each way reads the file in a process of its own: with pandas, and without it.
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
WAYS = {
    "numpy.loadtxt": "import sys, numpy; numpy.loadtxt(sys.argv[1], delimiter=',', skiprows=2)",
    "with pandas": f"import sys; {_READ}",
    "without pandas": f"import sys; sys.modules['pandas'] = None; {_READ}",
}
"""What each process does with the file."""


def write(path: Path) -> None:
    """Write instants, a force and two accelerations, with a row of units."""
    random = np.random.default_rng(1)
    columns = np.column_stack([np.arange(ROWS) / 2048.0, random.normal(size=(ROWS, 3))])
    np.savetxt(path, columns, fmt="%.15g", delimiter=",", header="t,F,a,b\ns,N,m/s2,m/s2", comments="")


def measured(code: str, path: Path) -> dict[str, float]:
    """Processor time, s, and largest memory, bytes, of a process that runs the code."""
    asked = f"{code}; import resource; used = resource.getrusage(resource.RUSAGE_SELF)"
    told = "print(used.ru_utime + used.ru_stime, used.ru_maxrss * 1024)"
    answer = subprocess.run(
        [sys.executable, "-c", f"{asked}; {told}", path], check=True, capture_output=True, text=True
    )
    seconds, memory = map(float, answer.stdout.split())
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
        print(f"{name:<15} {one['processor_s']:6.2f} s  {one['memory_bytes'] / 1e6:6.0f} MB")


if __name__ == "__main__":
    typer.run(main)
