"""What the core takes on a Cortex-M4, by the measures of firmware/checks/arm."""

import importlib
import re
import sys
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from tests.firmware.building import FOLDER
from tests.firmware.test_arm import image  # noqa: F401 (fixture: skips or fails where programs are missing)
from tests.refused import refused

MODULES = ("tools", "sizes", "stack", "execution", "instructions")
BLOCK = 5


@pytest.fixture(scope="module")
def measures(image: Path) -> Iterator[SimpleNamespace]:  # noqa: F811
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(FOLDER / "checks" / "arm"))
        for name in MODULES:
            patch.delitem(sys.modules, name, raising=False)
        yield SimpleNamespace(**{name: importlib.import_module(name) for name in MODULES})
        for name in MODULES:
            del sys.modules[name]


@pytest.fixture(scope="module")
def build(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One folder for all, where the core is compiled once for each optimisation."""
    return tmp_path_factory.mktemp("build")


@pytest.fixture(scope="module")
def traced(measures: SimpleNamespace, build: Path) -> Callable[[str], Any]:
    """What a run over a wire has executed; a run is traced once, which takes some ten seconds."""
    return cache(lambda wire: measures.execution.traced(measures.tools.load(build, wire, "-O2", BLOCK)))


FROM_OUTSIDE = re.compile(r"board_\w+|mem(cpy|set|move|cmp)|strlen|__aeabi_\w+")


def test_the_core_asks_for_nothing_but_a_board_and_memory_functions(measures: SimpleNamespace, build: Path) -> None:
    """No heap, no files, no text: what its objects leave open is named like a function of the board or of the compiler."""
    objects = measures.tools.objects(build, "-O2")
    symbols = [line.split() for line in measures.tools.output_of("arm-none-eabi-nm", *objects).splitlines()]
    defined = {words[2] for words in symbols if len(words) == 3}
    asked = {words[1] for words in symbols if len(words) == 2 and words[0] == "U"} - defined
    assert {"board_lock", "memcpy"} <= asked
    assert not {name for name in asked if not FROM_OUTSIDE.fullmatch(name)}


def test_the_core_with_one_wire_fits_a_small_chip(measures: SimpleNamespace, build: Path) -> None:
    found = {
        wire: (flash + of_libraries, ram) for wire, _, flash, of_libraries, ram in measures.sizes.rows(build, "-Os")
    }
    assert set(found) == {"serial", "CAN", "CAN FD"}
    for flash, ram in found.values():
        assert 4000 < flash < 32 * 1024
        assert 16 * 1024 < ram < 64 * 1024


@pytest.mark.parametrize("wire", ["serial", "CAN FD"])
def test_a_painted_stack_is_used_no_deeper_than_the_longest_path(
    measures: SimpleNamespace, wire: str, build: Path
) -> None:
    graph = measures.stack.graph_of(build, "-O2", wire)
    longest, way = graph.path("vl_serve")
    _, used = measures.tools.said(measures.tools.load(build, wire, "-O2"))
    assert 0.75 * longest <= used <= longest, way
    assert longest + graph.path("vl_output")[0] < 1024


def test_the_stack_of_a_painted_memory_ends_where_the_paint_does(measures: SimpleNamespace) -> None:
    memory = b"data" + 100 * measures.stack.PAINT + b"used" + measures.stack.PAINT + b"used"
    assert measures.stack.painted(memory) == 12


def test_machine_code_shows_the_frame_of_a_function(measures: SimpleNamespace) -> None:
    body = "push\t{r4, r5, lr}\n sub\tsp, #20\n strd\tip, lr, [sp, #-16]!\n stmdb\tsp!, {r6, r7}\n add\tsp, #20\n"
    assert measures.stack.frame_in(body) == 12 + 20 + 16 + 8


def test_functions_that_call_themselves_have_no_longest_path(measures: SimpleNamespace) -> None:
    graph = measures.stack.Graph({"a": 8, "b": 16, "c": 100}, {"a": {"b", "c"}, "b": set(), "c": set()})
    assert graph.path("a") == (108, ["a", "c"])
    graph.calls["c"] = {"a"}
    with refused(RuntimeError, "calls-itself"):
        graph.path("a")


@pytest.mark.slow
@pytest.mark.parametrize("wire", ["serial", "CAN FD"])
def test_trace_and_timer_count_the_same_and_a_sample_takes_a_part_of_its_time(
    measures: SimpleNamespace, wire: str, build: Path, traced: Callable[[str], Any]
) -> None:
    instructions, counts = measures.instructions, traced(wire)
    ticks, _ = measures.tools.said(measures.tools.load(build, wire, "-O2", BLOCK))
    assert abs(counts.steady - instructions.TIMER_TICK * ticks) <= instructions.TIMER_TICK
    samples = len(counts.calls["steady", "vl_output"])
    assert samples == len(counts.calls["steady", "vl_serve"]) == 600
    whole = sum(sum(counts.calls["steady", name]) for name in instructions.CALLED)
    assert whole / samples < 0.25 * instructions.CLOCK_HZ / instructions.RATE_HZ
    assert 0 < counts.locked < 500
    assert max(counts.calls["ramp", "vl_output"]) > max(counts.calls["steady", "vl_output"])


def test_an_output_that_is_continued_takes_a_part_of_a_sample_s_time(
    measures: SimpleNamespace, traced: Callable[[str], Any]
) -> None:
    """The first of a source looks for its extremes, by pieces; those behind it do not."""
    instructions, counts = measures.instructions, traced("serial")
    _, short, of_short, longest, of_longest = instructions.where_outputs_are_missing("serial", "-O2", counts)
    assert of_short < of_longest < short < longest < 0.2 * instructions.CLOCK_HZ / instructions.RATE_HZ
    assert of_longest < 5 * max(counts.calls["steady", "vl_output"])
