"""Machine code is found by what goes into it: callees and constants of other files too, comments not."""

import os
import select
import subprocess
import sys

import pytest

CALLER = """
from {name}_callee import scaled
from vibrolock.compiled import kernel

@kernel
def caller(x):
    return scaled(x) + later(x)

@kernel
def later(x):
    return 0.0 * x

print(caller(1.0), sum(caller.stats.cache_hits.values()))
"""
CALLEE = """
from {name}_constants import FACTOR, LEVELS
from vibrolock.compiled import kernel

@kernel
def scaled(x):
    return FACTOR * x + LEVELS[1]
"""
CONSTANTS = "import numpy as np\nFACTOR = 2.0\nLEVELS = np.array([0.0, 0.5])\n"


@pytest.fixture
def answer(tmp_path):
    """Write three modules, with replacements, and call the kernel in a fresh process: its value, and hits of the cache."""
    for name, text in {"": CALLER, "_callee": CALLEE, "_constants": CONSTANTS}.items():
        (tmp_path / f"rescaled{name}.py").write_text(text.format(name="rescaled"))

    def ask(file="", old="", new=""):
        path = tmp_path / f"rescaled{file}.py"
        assert old in path.read_text()
        path.write_text(path.read_text().replace(old, new, 1))
        environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONDONTWRITEBYTECODE": "1"}
        environment["PYTHONPATH"] = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
        out = subprocess.run(
            [sys.executable, "-c", "import rescaled"], env=environment, capture_output=True, text=True, check=True
        )
        value, hits = out.stdout.split()
        return float(value), int(hits)

    return ask


@pytest.mark.slow
def test_what_goes_into_a_kernel_compiles_it_anew_and_a_comment_does_not(answer):
    assert answer() == (2.5, 0)
    assert answer() == (2.5, 1)
    for file, old, new, value in (
        ("_constants", "2.0", "3.0", 3.5),
        ("_constants", "LEVELS = np.array([0.0, 0.5])", "LEVELS = np.array([0.0, 0.75])", 3.75),
        ("_callee", "FACTOR * x", "FACTOR * x * x + x", 4.75),
        ("", "0.0 * x", "1.0 * x", 5.75),  # of a callee that is defined below
    ):
        assert answer(file, old, new) == (value, 0), new
    assert answer("_callee", "def scaled(x):", "def scaled(x):  # by a factor\n    # of two") == (5.75, 1)
    assert answer("_constants", "3.0", "2.0") == (4.75, 0)


def test_digests_are_the_same_in_every_process():
    code = (
        "import rig.drivers.virtual.kernels as one, identification.models.pnlss.kernels as two;"
        "import vibrolock.content_digest as c;"
        "print([c.content_digest(k) for m in (one, two) for k in vars(m).values() if hasattr(k, 'py_func')])"
    )
    answers = {
        subprocess.run(
            [sys.executable, "-c", code],
            env={**os.environ, "PYTHONHASHSEED": seed},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for seed in ("1", "2")
    }
    assert len(answers) == 1
    assert len(answers.pop()) > 500


@pytest.mark.slow
def test_a_type_of_argument_that_stands_in_another_module_now_compiles_anew(tmp_path):
    (tmp_path / "summing.py").write_text(
        "from vibrolock.compiled import kernel\n\n@kernel\ndef total(pair):\n    return pair.a + pair.b\n"
    )
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONDONTWRITEBYTECODE": "1"}
    environment["PYTHONPATH"] = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    for module in ("here", "there"):
        (tmp_path / f"{module}.py").write_text("from collections import namedtuple\nPair = namedtuple('Pair', 'a b')\n")
        code = f"import summing, {module}; print(summing.total({module}.Pair(1.0, 2.0)))"
        out = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
        assert out.stdout == "3.0\n"
        (tmp_path / f"{module}.py").unlink()


CODE = """
import pickle, sys, threading
from vibrolock.compiled import kernel

@kernel
def half(x: float) -> float:
    \"\"\"Half of x.\"\"\"
    return 0.5 * x

@kernel
def quarter(x: float) -> float:
    return half(half(x))

@kernel
def applied(f, x: float) -> float:
    return f(x)
"""


def run(code, **environment):
    out = subprocess.run(
        [sys.executable, "-c", CODE + code],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=True,
    )
    return out.stdout.split()


def test_the_compiler_is_loaded_by_the_first_call():
    assert run("print('numba' in sys.modules); quarter(1.0); print('numba' in sys.modules)") == ["False", "True"]


def test_a_declared_kernel_looks_like_its_function_is_pickled_by_name_and_passed_to_kernels():
    code = (
        "print(half.__doc__.split()[0], half.__name__, pickle.loads(pickle.dumps(half)) is half, applied(quarter, 4.0))"
    )
    assert run(code) == ["Half", "half", "True", "1.0"]


def test_threads_that_call_a_kernel_first_at_once_share_its_machine_code():
    code = """
made = set()
threads = [threading.Thread(target=lambda: made.add((id(quarter._made()), quarter(2.0)))) for _ in range(8)]
[thread.start() for thread in threads]
[thread.join() for thread in threads]
print(len(made), len(quarter.signatures))
"""
    assert run(code) == ["1", "1"]


def test_without_a_compiler_kernels_are_plain_functions():
    assert run("print(quarter(1.0), hasattr(quarter, 'signatures'))", NUMBA_DISABLE_JIT="1") == ["0.25", "False"]


BOUND = """
import numpy as np
from typing import NamedTuple
from vibrolock.compiled import bound

class Pair(NamedTuple):
    first: np.ndarray
    second: np.ndarray

@kernel
def add(pair, factor):
    pair.first[0] += factor * pair.second[0]

pair = Pair(np.ones(1), np.ones(1))
fast = bound(add, pair, 2.0)
print(pair.first[0])
fast(Pair(pair.first, np.full(1, 3.0)), 2.0)
print(pair.first[0], len(getattr(add, "signatures", "1")))
"""


@pytest.mark.parametrize("told", ["0", "1"])
def test_a_bound_kernel_is_made_but_not_run_and_then_does_what_the_kernel_does(told):
    assert run(BOUND, NUMBA_DISABLE_JIT=told) == ["1.0", "7.0", "1"]


def test_a_bound_kernel_refuses_what_is_no_array_and_items_of_another_size():
    code = """
for wrong in ([1.0], np.ones(1, np.float32)):
    try:
        fast(Pair(pair.first, wrong), 2.0)
    except TypeError:
        print("refused")
"""
    assert run(BOUND + code)[3:] == ["refused"] * 2


def test_a_kernel_called_by_kernels_is_compiled_once_for_all_constants_and_told(tmp_path):
    code = """
from vibrolock.compiling import on_compiling
told = []
on_compiling.append(told.append)

@kernel
def power(x: float, n: int) -> float:
    return x**n

@kernel
def cubes(x: float) -> float:
    return power(x, 3) + power(x, 2) + power(x, 1)

print(cubes(2.0), ",".join(told))
told.clear()
print(power(2.0, 3), ",".join(told))
"""
    cold = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    assert run(code, **cold) == ["14.0", "cubes,power", "8.0", "power"]  # the second for Python
    assert run(code, **cold) == ["14.0", "8.0"]


@pytest.mark.slow
def test_what_is_compiled_for_kernels_after_a_call_from_python_is_not_taken_for_what_python_calls(tmp_path):
    cold = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    assert run("print(half(2), quarter(2.0))", **cold) == [
        "1.0",
        "0.5",
    ]  # half: integers for Python, floats for quarter
    assert run("print(half(2.0))", **cold) == ["1.0"]


CALLBACK = """
from vibrolock.compiling import on_compiling
from vibrolock.foreign_calls import DOUBLE, compiled_for_c
told = []
on_compiling.append(told.append)

@kernel
def factor() -> float:
    return {factor}

def scaled(x):
    return factor() * x

print(compiled_for_c(scaled, DOUBLE, DOUBLE).ctypes(3.0), ",".join(told))
"""


@pytest.mark.slow
def test_what_code_of_others_calls_is_stored_and_compiled_anew_with_what_it_calls(tmp_path):
    cold = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    assert run(CALLBACK.format(factor=2.0), **cold) == ["6.0", "scaled,factor"]
    assert run(CALLBACK.format(factor=2.0), **cold) == ["6.0"]
    assert run(CALLBACK.format(factor=5.0), **cold) == ["15.0", "scaled,factor"]


@pytest.mark.slow
def test_what_only_kernels_call_is_text_and_becomes_machine_code_within_what_python_calls(tmp_path):
    shown = """
def kept(library):
    try:
        return len(library._get_compiled_object()) > 0
    except RuntimeError:  # none was made
        return False

for made in (half._inner, quarter._dispatcher):
    print([kept(one.library) for one in made.overloads.values()])
"""
    cold = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    assert run(f"print(quarter(1.0)){shown}", **cold) == ["0.25", "[False]", "[True]"]
    other = """
@kernel
def eighth(x: float) -> float:
    return half(half(half(x)))

print(eighth(1.0), sum(half._inner.stats.cache_hits.values()))
"""
    assert run(other, **cold) == ["0.125", "1"]  # of stored text


SLOW = """
import sys
from vibrolock.compiling import on_compiling

def told(name):
    print("compiles", name, flush=True)
    sys.stdin.readline()  # as long as the test wants

on_compiling.append(told)
print("calls", flush=True)
print(half(3.0), flush=True)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="no locks on Windows")
def test_of_two_processes_that_miss_a_kernel_one_compiles_it_and_the_other_loads_it(tmp_path):
    def started():
        environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
        command = [sys.executable, "-c", CODE + SLOW]
        return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment, text=True)

    with started() as first:
        assert [first.stdout.readline() for _ in range(2)] == ["calls\n", "compiles half\n"]
        with started() as second:
            assert second.stdout.readline() == "calls\n"
            compiles, _, _ = select.select([second.stdout], [], [], 1.0)  # it would within milliseconds
            assert not compiles
            assert first.communicate("\n")[0] == "1.5\n"
            assert second.communicate("\n")[0] == "1.5\n"


def test_a_c_function_is_loaded_without_what_numba_needs_to_compile(tmp_path):
    (tmp_path / "forces_of_mine.py").write_text(
        "from vibrolock.content_cache import c_function\n\n"
        '@c_function("float64(float64, CPointer(float64))")\n'
        "def spring(x, parameters):\n    return -parameters[0] * x\n"
    )
    code = f"""
import ctypes
sys.path.insert(0, {str(tmp_path)!r})
from forces_of_mine import spring
print(spring.ctypes(2.0, (ctypes.c_double * 1)(3.0)), 'numba.np.arraymath' in sys.modules)
"""
    cold = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    assert run(code, **cold) == ["-6.0", "True"]
    assert run(code, **cold) == ["-6.0", "False"]
