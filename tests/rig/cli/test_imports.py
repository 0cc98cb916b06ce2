"""What each command imports: no library that it has no use for. A new import of a heavy library must be listed here."""

import json
import os
import subprocess
import sys
from contextlib import chdir

import pytest

from tests.command import run_command
from tests.recorded import recorded_at
from tests.sharing import made_once, shared_folder

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
import json, os, sys, traceback
PARTS = {PARTS}

def loaded():
    own = {{"rig", "controller", "simulators", "identification", "vibrolock"}}
    tops = {{name.partition(".")[0] for name, module in sys.modules.items() if getattr(module, "__spec__", None)}}
    libraries = {{name for name in tops - own - set(sys.stdlib_module_names) if not name.startswith("_")}}
    scipy = {{".".join(name.split(".")[:2]) for name in sys.modules if name.startswith("scipy.")}}
    scipy = {{name for name in scipy if not name.startswith("scipy._") and hasattr(sys.modules[name], "__path__")}}
    return sorted(libraries | scipy | {{part for part in PARTS if part in sys.modules}})

def carried_out(code, words):
    if not (child := os.fork()):
        sys.argv, status, said = ["-c", *words], 1, os.open("said", os.O_CREAT | os.O_TRUNC | os.O_RDWR)
        os.dup2(said, 1), os.dup2(said, 2)
        try:
            exec(code, {{"__name__": "__main__"}})
            status = 0
        except SystemExit as end:
            status = int(end.code or 0)
        except BaseException:
            traceback.print_exc()
        json.dump(loaded(), file := open("loaded.json", "w"))
        for stream in (file, sys.stdout, sys.stderr):
            stream.flush()
        os._exit(status)
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    return dict(status=status, said=open("said").read()[-3000:], loaded=json.load(open("loaded.json")))

found = {{}}
for libraries, programs in json.load(sys.stdin):
    for library in libraries:
        __import__(library)
    for code, line in programs:
        found[code + line] = carried_out(code, line.split())
json.dump(found, open(sys.argv[1], "w"))
"""
"""Carries out programs, each in a fork of an interpreter that has loaded nothing but what all that still come may load."""

MAIN = "from rig.cli import main; main()"
STOPPING = f"import os; os.environ['VIBROLOCK_LIVE'] = 'nothing'; {MAIN}"
PACKAGES = ("rig", "controller", "simulators", "identification", "vibrolock")
DECLARING = (
    "rig.tick.kernels",
    "rig.tick.sequencer.kernels",
    "controller.law",
    "identification.models.pnlss.kernels",
    "rig.campaigns.plans",
)
USED = {
    "show run.h5": {"h5py", "numpy"},
    "plot run.h5 -o run.png": {"matplotlib"},
    "run plan.toml -o new.h5": {"numba", "rig.loop", "simulators"},
    "check --bench magnet-beam -o check.h5": {"scipy.linalg"},
}
"""What commands must have loaded; they, and packages that must load nothing, begin with nothing."""
STEPS = {"numpy": {"numpy"}, "pydantic": {"pydantic"}, "h5py": FILES, "numba": FILES | NUMBA}
"""Libraries that are loaded one after the other, and what a command must be allowed to be carried out behind each."""


def _programs():
    """Libraries that are loaded, and the programs that are carried out then."""
    bare = [(f"import {package}; dir({package})", "") for package in PACKAGES]
    bare += [(f"import {module}", "") for module in DECLARING] + [(STOPPING, "stop")]
    steps = [([], bare), *(([library], []) for library in STEPS)]
    for line, allowed in ALLOWED.items():
        behind = [number for number, needed in enumerate(STEPS.values(), 1) if needed <= allowed]
        steps[0 if line in USED or not behind else _unbroken(behind)][1].append((MAIN, line))
    return steps


def _unbroken(behind):
    """The last of the steps 1, 2, ... that are all there; 0 where the first is not."""
    return max((number for number in behind if behind[:number] == list(range(1, number + 1))), default=0)


@pytest.fixture(scope="module")
def found():
    """What each program came to, by its code and line, in a folder with a plan, a recording and a model."""

    def make(folder):
        (folder / "plan.toml").write_text(PLAN)
        recorded_at(folder / "run.h5", folder / "plan.toml")
        with chdir(folder):
            run_command("identify run.h5 -o mode.h5").succeeded()
        path = os.pathsep.join(sys.path)
        environment = {**os.environ, "PYTHONPATH": path, "COVERAGE_PROCESS_START": "", "XDG_STATE_HOME": str(folder)}
        asked = json.dumps(_programs())
        subprocess.run(
            [sys.executable, "-c", LOADED, "found.json"],
            cwd=folder,
            env=environment,
            input=asked,
            text=True,
            check=True,
        )

    return json.loads((made_once(shared_folder() / "imports", make) / "found.json").read_text())


def _loaded(found, code, line="", status=0):
    assert found[code + line]["status"] == status, found[code + line]["said"]
    return set(found[code + line]["loaded"])


@pytest.mark.parametrize("line", ALLOWED)
def test_a_command_loads_what_it_uses_and_nothing_else(found, line):
    assert _loaded(found, MAIN, line) - LIGHT - ALLOWED[line] == set()


def test_stopping_loads_next_to_nothing(found):
    assert _loaded(found, STOPPING, "stop", status=1) - LIGHT - {"numpy", "pydantic", "rig.monitor"} == set()


@pytest.mark.parametrize(("line", "used"), USED.items())
def test_what_a_command_uses_is_seen(found, line, used):
    assert used <= _loaded(found, MAIN, line)


@pytest.mark.parametrize("package", PACKAGES)
def test_importing_a_package_loads_no_library_and_leaves_its_names_to_their_use(found, package):
    assert _loaded(found, f"import {package}; dir({package})") - {"simulators"} == set()


@pytest.mark.parametrize("module", DECLARING)
def test_declaring_kernels_loads_no_compiler(found, module):
    assert "numba" not in _loaded(found, f"import {module}")
