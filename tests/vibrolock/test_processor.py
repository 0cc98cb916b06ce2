"""For which processor kernels are compiled: any with AVX2, unless the environment names another."""

import os
import subprocess
import sys

import numba
import pytest

from vibrolock import content_cache

HAS = dict.fromkeys(content_cache.LEVEL_3, True)
NAMES = ("NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES")
COMPILED_BEFORE = """
import numba
from numba.core.registry import cpu_target

one_more = numba.njit(lambda x: x + 1)
assert one_more(1.0) == 2.0
own = cpu_target.target_context.codegen().magic_tuple()
from vibrolock import content_cache
print(own == cpu_target.target_context.codegen().magic_tuple(), *cpu_target.target_context.codegen().magic_tuple()[1:])
assert one_more(1) == 2
assert numba.njit(lambda x: one_more(x) ** 2)(2.0) == 9.0
"""


@pytest.fixture
def chosen(monkeypatch):
    """Choose with these variables on such a machine; the name and the features that numba is told."""

    def choose(variables, machine="x86_64", features=HAS):
        for name in NAMES:
            monkeypatch.delenv(name, raising=False)
        for name, value in variables.items():
            monkeypatch.setenv(name, value)
        monkeypatch.setattr(content_cache.llvmlite.binding, "get_host_cpu_features", lambda: features)
        monkeypatch.setattr(content_cache.platform, "machine", lambda: machine)
        monkeypatch.setattr(numba.config, "CPU_NAME", "numba's own", raising=False)
        monkeypatch.setattr(numba.config, "CPU_FEATURES", "numba's own", raising=False)
        content_cache._choose_processor()
        return numba.config.CPU_NAME, numba.config.CPU_FEATURES

    return choose


@pytest.mark.parametrize("machine", ["x86_64", "AMD64"])
def test_a_processor_with_avx2_is_taken_for_any_of_them(chosen, machine):
    assert chosen({}, machine) == ("x86-64-v3", "")


@pytest.mark.parametrize("variables", [{NAMES[0]: "generic"}, {NAMES[1]: "+sse2"}, dict.fromkeys(NAMES, "x")])
def test_what_the_environment_names_is_left_to_numba(chosen, variables):
    assert chosen(variables) == ("numba's own", "numba's own")


def test_another_processor_is_left_to_numba(chosen):
    assert chosen({}, "aarch64") == ("numba's own", "numba's own")
    for name in content_cache.LEVEL_3:
        without = {other: True for other in content_cache.LEVEL_3 if other != name}
        assert chosen({}, features=without) == ("numba's own", "numba's own")
        assert chosen({}, features=without | {name: False}) == ("numba's own", "numba's own")


def test_what_has_compiled_before_changes_no_kernel():
    features = content_cache.llvmlite.binding.get_host_cpu_features()
    if not all(features.get(name, False) for name in content_cache.LEVEL_3):
        pytest.skip("numba decides for this processor")
    cleared = {key: value for key, value in os.environ.items() if key not in NAMES}
    program = [sys.executable, "-c", COMPILED_BEFORE]
    done = subprocess.run(program, env=cleared, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "x86-64-v3"]
