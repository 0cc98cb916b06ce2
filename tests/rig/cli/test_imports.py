"""What each command imports: no library that it has no use for. A new import of a heavy library must be listed here."""

import json
import os
import subprocess
import sys
from functools import cache

import pytest

from tests.recorded import recorded_at

PLAN = """
kind = "backbone"
bench = "magnet-beam"
levels_v = [0.4, 0.8, 1.2]
record_periods = 20

[controller]
low_pass_rad_s = 6.283185307179586
k1 = 2.0
k2 = 6.283185307179586
centre_frequency_hz = 24.0
frequency_window_hz = [21.933, 26.807]
"""

LIGHT = {
    *("typer", "shellingham", "annotated_doc", "click"),
    *("typing_extensions", "typing_inspection", "annotated_types", "pydantic_core", "threadpoolctl"),
}
"""Libraries of other libraries that take no time."""

MATPLOTLIB = {
    *("matplotlib", "mpl_toolkits", "PIL", "contourpy", "cycler", "dateutil", "fontTools", "kiwisolver", "packaging"),
    *("pyparsing", "six"),
}
NUMBA = {"numba", "llvmlite", "scipy", "cffi", "pycparser", "yaml", "charset_normalizer"}
"""Numba, and what it and numpy load where it is installed: the last four."""
OPTIMIZE = {f"scipy.{name}" for name in ("optimize", "linalg", "sparse", "spatial", "special", "fft", "constants")}
FILES = {"numpy", "pydantic", "h5py"}
CAN = {
    "can",
    "cantools",
    "bitstruct",
    "textparser",
    "crccheck",
    "argparse_addons",
    "wrapt",
    "msgpack",
    "packaging",
    "asyncio",
}
DRIVERS = {"numpy", "pydantic", "simulators", "serial", "cobs"} | CAN | NUMBA  # whose options a schema describes

ALLOWED = {
    "--help": set(),
    "list": {"numpy", "pydantic", "scipy", "simulators"},
    "list beam": {"numpy", "pydantic", "scipy", "simulators"},
    "schema backbone": {"numpy", "pydantic"},
    "schema bench": DRIVERS,
    "new plan -o new-plan.toml": {"numpy", "pydantic"},
    "new driver -o box": DRIVERS,
    "show run.h5": FILES,
    "show mode.h5": FILES,
    "show --json run.h5": FILES,
    "plot run.h5 -o run.png": FILES | MATPLOTLIB,
    "plot mode.h5 -o mode.svg": FILES | MATPLOTLIB,
    "report run.h5 mode.h5 -o report.html": FILES | MATPLOTLIB | {"jinja2", "markupsafe"},
    "identify run.h5 -o again.h5": FILES,
    "export run.h5 -o run.csv": FILES | {"identification.models.pnlss"},
    "analyse modes --bench magnet-beam": {"numpy", "pydantic", "simulators"} | NUMBA,
    "doctor": {"numpy", "pydantic", "serial", "rig.loop", "multiprocessing"},
    "run plan.toml -o new.h5": FILES | NUMBA | {"simulators", "rig.loop", "multiprocessing"},
    "run plan.toml -o monitored.h5 --monitor": FILES | NUMBA | {"simulators", "rig.loop", "multiprocessing"},
    "replay run.h5 --terminal --speed 1000": FILES | {"rig.monitor"},
    "check --bench magnet-beam -o check.h5": FILES | NUMBA | OPTIMIZE | {"simulators", "rig.loop", "multiprocessing"},
}
"""What a command may load beyond Python and what is `LIGHT`: libraries, subpackages of scipy, and the heavy ones of `PARTS`."""

PARTS = (
    "simulators",
    "rig.loop",
    "rig.rehearsal.rehearsal",
    "identification.models.pnlss",
    "multiprocessing",
    "asyncio",
    "rig.monitor",
)
"""Packages of the distribution and of Python that take long and of which few commands have use."""

LOADED = f"""
import atexit, json, sys
PARTS = {PARTS}

def loaded():
    own = {{"rig", "controller", "simulators", "identification", "vibrolock"}}
    tops = {{name.partition(".")[0] for name, module in sys.modules.items() if getattr(module, "__spec__", None)}}
    libraries = {{name for name in tops - own - set(sys.stdlib_module_names) if not name.startswith("_")}}
    scipy = {{".".join(name.split(".")[:2]) for name in sys.modules if name.startswith("scipy.")}}
    scipy = {{name for name in scipy if not name.startswith("scipy._") and hasattr(sys.modules[name], "__path__")}}
    return sorted(libraries | scipy | {{part for part in PARTS if part in sys.modules}})

atexit.register(lambda: print(json.dumps(loaded()), file=open("loaded.json", "w")))
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a plan, a recording and a model."""
    folder = tmp_path_factory.mktemp("imports")
    (folder / "plan.toml").write_text(PLAN)
    recorded_at(folder / "run.h5", folder / "plan.toml")
    _loaded(folder, "import sys; from rig.cli import main; main()", *["identify", "run.h5", "-o", "mode.h5"])
    return folder


def _loaded(folder, code, *arguments, status=0):
    path = os.pathsep.join(sys.path)
    environment = {**os.environ, "PYTHONPATH": path, "COVERAGE_PROCESS_START": "", "XDG_STATE_HOME": str(folder)}
    command = [sys.executable, "-c", LOADED + code, *arguments]
    out = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert out.returncode == status, out.stderr
    return set(json.loads((folder / "loaded.json").read_text()))


@cache
def _loaded_by(folder, line):
    """What a command that succeeds loads; two tests ask for some of them."""
    return _loaded(folder, "from rig.cli import main; main()", *line.split())


@pytest.mark.parametrize("line", ALLOWED)
def test_a_command_loads_what_it_uses_and_nothing_else(folder, line):
    loaded = _loaded_by(folder, line)
    assert loaded - LIGHT - ALLOWED[line] == set()


def test_stopping_loads_next_to_nothing(folder, monkeypatch):
    monkeypatch.setenv("VIBROLOCK_LIVE", str(folder / "nothing"))
    loaded = _loaded(folder, "from rig.cli import main; main()", "stop", status=1)
    assert loaded - LIGHT - {"numpy", "pydantic", "rig.monitor"} == set()


@pytest.mark.parametrize(
    ("line", "used"),
    [
        ("show run.h5", {"h5py", "numpy"}),
        ("plot run.h5 -o run.png", {"matplotlib"}),
        ("run plan.toml -o new.h5", {"numba", "rig.loop", "simulators"}),
        ("check --bench magnet-beam -o check.h5", {"scipy.linalg"}),
    ],
)
def test_what_a_command_uses_is_seen(folder, line, used):
    assert used <= _loaded_by(folder, line)


@pytest.mark.parametrize("package", ["rig", "controller", "simulators", "identification", "vibrolock"])
def test_importing_a_package_loads_no_library_and_leaves_its_names_to_their_use(folder, package):
    assert _loaded(folder, f"import {package}; dir({package})") - {"simulators"} == set()


@pytest.mark.parametrize(
    "module",
    [
        "rig.tick.kernels",
        "rig.tick.sequencer.kernels",
        "controller.law",
        "identification.models.pnlss.kernels",
        "rig.campaigns.plans",
    ],
)
def test_declaring_kernels_loads_no_compiler(folder, module):
    assert "numba" not in _loaded(folder, f"import {module}")
