"""For which processor kernels are compiled: any with AVX2, unless the environment names another."""

import numba
import pytest

from vibrolock import content_cache

HAS = dict.fromkeys(content_cache.LEVEL_3, True)
NAMES = ("NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES")


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
