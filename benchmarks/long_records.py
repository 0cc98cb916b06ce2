"""How a long and wide record grows: ``python -m benchmarks.long_records [SECONDS] [CHANNELS]``; 3600 s of 32 by default.

One level of the shipped magnet beam is recorded for so long, all channels of which beyond four are further accelerometers, and
evaluated, stored, shown and drawn, each in a process of its own: seconds of wall and processor, peak memory, size of the file.
"""

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from rig.bench import Bench, load_bench
from rig.campaigns.backbone.plan import BackbonePlan
from rig.campaigns.plans import load_plan
from rig.drivers import make_daq
from rig.drivers.virtual.driver import VirtualDAQ

FREQUENCY_HZ = 24.4


def wide(n_channels: int) -> Bench:
    """The magnet beam with so many channels."""
    bench = load_bench("magnet-beam")
    daq = make_daq(bench)
    assert isinstance(daq, VirtualDAQ)
    table, sensors = bench.model_dump(mode="json"), daq.rig.model_dump(mode="json")["sensors"]
    for number in range(len(sensors), n_channels):
        name = f"acc_{number}"
        table["channels"].append({**table["channels"][-1], "name": name})
        sensors.append({**sensors[-1], "name": name})
    table["driver"]["options"]["sensors"] = sensors
    return Bench.model_validate(table)


def long_plan(seconds: float) -> BackbonePlan:
    """One level that is recorded for so long."""
    plan = load_plan("magnet-beam/backbone")
    table = plan.model_dump(mode="json")
    table.update(levels_v=[0.5], record_periods=int(seconds * FREQUENCY_HZ))
    return BackbonePlan.model_validate(table)


def record(path: Path, seconds: float, n_channels: int) -> dict[str, Any]:
    """Carry out the plan; what its loop says of itself and its points."""
    import rig

    with rig.run(long_plan(seconds), bench=wide(n_channels), output=path) as run:
        loop = run.recording.parts[-1].end or {}
        points = [(point["quality"], point.get("frequency_hz")) for point in run.recording.points]
        return {"rows": run.recording.n_rows, "loop_s": loop["loop"]["busy_s"], "points": points}


def _measured(*command: str) -> dict[str, Any]:
    began = time.perf_counter()
    done = subprocess.run([sys.executable, *command], check=True, capture_output=True, text=True)
    wall_s = time.perf_counter() - began
    used = json.loads(done.stderr.splitlines()[-1])
    told = json.loads(done.stdout) if done.stdout.startswith("{") else {}
    return {"wall_s": wall_s, **used, **told}


REPORT = (
    "import atexit, json, resource, sys\n"
    "def told():\n"
    "    used = resource.getrusage(resource.RUSAGE_SELF)\n"
    "    mine = {'processor_s': used.ru_utime + used.ru_stime, 'peak_mb': used.ru_maxrss / 1024}\n"
    "    print(json.dumps(mine), file=sys.stderr)\n"
    "atexit.register(told)\n"
)
RECORD = REPORT + (
    "from pathlib import Path\nfrom benchmarks.long_records import record\n"
    "print(json.dumps(record(Path(sys.argv[1]), float(sys.argv[2]), int(sys.argv[3]))))"
)
COMMAND = REPORT + "from rig.cli import main\nsys.argv = ['rig', *sys.argv[1:]]\nmain()"


def measure(seconds: float, n_channels: int) -> dict[str, dict[str, Any]]:
    """All numbers of one record."""
    with tempfile.TemporaryDirectory() as folder:
        file, figure = Path(folder) / "run.h5", Path(folder) / "run.png"
        out = {"run": _measured("-c", RECORD, str(file), str(seconds), str(n_channels))}
        out["run"]["file_mb"] = file.stat().st_size / 1e6
        out["show"] = _measured("-c", COMMAND, "show", str(file))
        out["plot"] = _measured("-c", COMMAND, "plot", str(file), "-o", str(figure))
        return out


if __name__ == "__main__":
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 3600.0
    n_channels = int(sys.argv[2]) if len(sys.argv) > 2 else 32
    for command, numbers in measure(seconds, n_channels).items():
        print(command, {key: round(value, 2) if isinstance(value, float) else value for key, value in numbers.items()})
