"""The compiled tick: its header against numpy, its arithmetic, in QEMU and on this computer, against the loop's own."""

import copy
import importlib
import pickle
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from rig.errors import ConfigurationError, RecordingError
from rig.firmware import machine_code
from rig.firmware.build import HEADER, build_tick
from rig.firmware.header import header
from rig.firmware.machine_code import kernels_digest
from rig.firmware.signature import example
from rig.firmware.targets import TARGETS, target_named
from rig.tick.kernels import tick_block
from tests.firmware.building import FOLDER, do_without, need
from tests.refused import refused
from tests.sharing import made_once, shared_folder
from vibrolock.compiled import compiled_text

MODULES = ("images", "captures")
WINDOWS = [(0, 150), (2500, 150), (4500, 150)]
"""Samples of a run of which each is compared: before the lock, at the first level, at the second."""
ROUNDING = 1e-13
"""Of a field's size, what functions of another libm may change within a window."""
COMPILERS = {"cc": [], "arm-none-eabi-gcc": ["-mcpu=cortex-m7", "-mthumb"]}


@pytest.fixture(scope="module")
def checks() -> Iterator[SimpleNamespace]:
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(FOLDER / "checks" / "tick"))
        for name in MODULES:
            patch.delitem(sys.modules, name, raising=False)
        yield SimpleNamespace(**{name: importlib.import_module(name) for name in MODULES})
        for name in MODULES:
            del sys.modules[name]


@pytest.fixture(scope="module")
def captured(checks: SimpleNamespace) -> list:
    """Windows of two tests on the virtual rig, and one of voltages as no converter gives them."""

    def make(folder: Path) -> None:
        found = [one for law in ("voltage", "harmonics") for one in checks.captures.captured(law, WINDOWS)]
        found.append(checks.captures.at_the_edges(found[1].samples))
        (folder / "windows").write_bytes(pickle.dumps([tuple(one) for one in found]))

    folder = made_once(shared_folder() / "tick-windows", make)
    return [checks.captures.Captured(*one) for one in pickle.loads((folder / "windows").read_bytes())]


def _built(target: str) -> Path:
    """The folder with a target's object; skips or fails as `need` does where its program could not be linked and run."""
    need(*(("cc",) if target == "host" else ("arm-none-eabi-gcc", "newlib", "qemu-system-arm")))
    try:
        target_named(target).machine()
    except ConfigurationError as error:
        do_without(str(error))
    return made_once(shared_folder() / f"tick-{target}", lambda folder: build_tick(target, folder) and None)


def _ran(checks: SimpleNamespace, captured: list, *targets: str, one_libm: bool = False) -> list:
    """What the program of the last of these targets, run one after the other in one folder, made of the windows."""
    built = [_built(target) for target in targets]

    def make(folder: Path) -> None:
        for target, of in zip(targets, built, strict=True):
            program = checks.images.program(target, of, folder, one_libm=one_libm)
            done = checks.images.ticked(program, folder, [one.samples for one in captured])
        (folder / "ticked").write_bytes(pickle.dumps([tuple(one) for one in done]))

    folder = made_once(shared_folder() / f"ticked-{'-'.join(targets)}", make)
    return [checks.images.Ticked(*one) for one in pickle.loads((folder / "ticked").read_bytes())]


@pytest.fixture(scope="module")
def on_m7(checks: SimpleNamespace, captured: list) -> list:
    return _ran(checks, captured, "cortex-m7")


ON_LINUX = pytest.mark.skipif(sys.platform != "linux", reason="object files of this system are no ELF files")


@ON_LINUX
def test_the_object_for_the_host_makes_of_every_sample_what_the_loop_makes(checks, captured):
    for expected, found in zip(captured, _ran(checks, captured, "host"), strict=True):
        assert checks.captures.differences(expected, found) == {}


@ON_LINUX
def test_on_a_cortex_m7_all_numbers_are_equal_to_the_bit_where_its_libm_returns_what_the_hosts_does(checks, captured):
    for expected, found in zip(captured, _ran(checks, captured, "host", "cortex-m7", one_libm=True), strict=True):
        assert checks.captures.differences(expected, found) == {}


def _is_close(checks, captured, found):
    for expected, one in zip(captured, found, strict=True):
        assert max(checks.captures.differences(expected, one).values(), default=0.0) < ROUNDING


def test_on_a_cortex_m7_whole_numbers_are_equal_and_others_to_the_rounding_of_its_libm(checks, captured, on_m7):
    _is_close(checks, captured, on_m7)


@pytest.mark.slow
def test_on_a_cortex_m33_whole_numbers_are_equal_and_others_to_the_rounding_of_its_libm(checks, captured):
    _is_close(checks, captured, _ran(checks, captured, "cortex-m33"))


def test_the_windows_show_a_loop_at_work_and_what_is_compared_can_differ(checks, captured, on_m7):
    assert len({int(one.after.progress["segment"][0]) for one in captured}) >= 3
    assert np.abs(captured[-2].rows["output_v"]).max() > 0.1
    other = copy.deepcopy(on_m7[1])
    other.after.control["vibration"]["force"] *= 1.0 + 1e-9
    found = checks.captures.differences(captured[1], other)
    assert found["control.vibration.force"] > ROUNDING


def test_numbers_below_the_normal_ones_and_those_that_are_none_come_through_as_on_the_host(captured, on_m7):
    expected, found = captured[-1].readings, on_m7[-1].readings
    tiny = np.abs(expected)
    assert np.isnan(expected).any()
    assert ((tiny > 0) & (tiny < np.finfo(np.float32).tiny)).any()
    np.testing.assert_array_equal(found, expected)


def test_a_sample_takes_some_thousand_instructions_and_two_kilobytes_of_stack(on_m7):
    with_harmonics = np.concatenate([one.instructions for one in on_m7[3:6]])
    assert 2000 < with_harmonics.mean() < 6000
    cycles = 2 * with_harmonics.max()
    assert cycles < 0.5 * 480e6 / 10e3  # half of a sample at 10 kHz and 480 MHz
    assert 1000 < on_m7[0].stack < 3000


def test_the_object_tells_the_digest_that_its_header_and_this_loop_have(on_m7):
    assert {one.digest for one in on_m7} == {kernels_digest()}
    assert f'"{kernels_digest()}"' in (shared_folder() / "tick-cortex-m7" / HEADER).read_text()


def test_the_text_beside_the_object_names_its_size_and_what_must_be_linked(on_m7):
    text = (shared_folder() / "tick-cortex-m7" / "tick-cortex-m7.txt").read_text()
    facts = dict(line.split(": ", 1) for line in text.splitlines())
    listed = subprocess.run(
        ["arm-none-eabi-nm", "-u", shared_folder() / "tick-cortex-m7" / "tick-cortex-m7.o"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert facts["undefined"].split() == sorted(listed.stdout.replace("U ", "").split())
    assert {"sin", "cos", "atan2"} <= set(facts["undefined"].split())
    assert 20_000 < int(facts["code"].split()[0]) < 80_000
    assert facts["data"] == "0 bytes"


def test_nothing_in_the_kernels_lets_a_compiler_change_the_order_of_arithmetic():
    text, _ = compiled_text(tick_block, *example())
    assert " fmul double" in text
    assert not re.search(r"\bf(?:add|sub|mul|div|cmp)\b[^%]*\b(?:fast|contract|reassoc|nnan|ninf|nsz|arcp|afn)\b", text)
    assert "llvm.fmuladd" not in text


def _places(dtype: np.dtype, before: str = "", at: int = 0) -> Iterator[tuple[str, int]]:
    for name in dtype.names:
        kind, offset = dtype.fields[name][:2]
        yield f"{before}{name}", at + offset
        if kind.base.names:
            for index in range(int(np.prod(kind.shape, dtype=int))):
                item = f"[{index}]" if kind.shape else ""
                yield from _places(kind.base, f"{before}{name}{item}.", at + offset + index * kind.base.itemsize)


@pytest.mark.parametrize("compiler", COMPILERS)
def test_a_compiler_places_every_field_where_numpy_does(compiler, tmp_path):
    need(compiler)
    places = [
        (f"offsetof(struct tick_{name}, {path})", offset)
        for name, array in example().by_name().items()
        if array.dtype.names
        for path, offset in _places(array.dtype)
    ]
    (tmp_path / HEADER).write_text(header(example(), "0" * 64))
    listed = ",".join(expression for expression, _ in places)
    (tmp_path / "places.c").write_text(f'#include "{HEADER}"\nconst uint32_t places[] = {{{listed}}};\n')
    subprocess.run([compiler, *COMPILERS[compiler], "-c", "places.c"], cwd=tmp_path, check=True)
    objcopy = "objcopy" if compiler == "cc" else "arm-none-eabi-objcopy"
    subprocess.run([objcopy, "-O", "binary", "-j", ".rodata", "places.o", "places"], cwd=tmp_path, check=True)
    found = np.frombuffer((tmp_path / "places").read_bytes(), np.uint32)
    assert found.tolist() == [offset for _, offset in places]
    assert len(places) > 800


@pytest.mark.parametrize("compiler", COMPILERS)
def test_a_header_of_other_records_does_not_compile(compiler, tmp_path):
    need(compiler)
    text = header(example(), "0" * 64)
    (tmp_path / HEADER).write_text(text.replace("    int64_t delay_whole;\n", ""))
    (tmp_path / "one.c").write_text(f'#include "{HEADER}"\n')
    done = subprocess.run(
        [compiler, *COMPILERS[compiler], "-c", "one.c"], cwd=tmp_path, check=False, capture_output=True, text=True
    )
    assert done.returncode != 0
    assert "has another size" in done.stderr


def test_a_target_that_there_is_not_is_refused(command, tmp_path):
    done = command("firmware", "tick", "--target", "z80", "-o", tmp_path / "build")
    assert done.status == 1
    assert done.err == "rig: --target = 'z80'; allowed: cortex-m7, cortex-m33, host\n"
    assert not (tmp_path / "build").exists()


def test_a_back_end_that_llvmlite_has_not_is_named(monkeypatch):
    import llvmlite.binding as llvm

    def without(triple: str) -> None:
        raise RuntimeError(f"No available targets are compatible with triple {triple}")

    monkeypatch.setattr(llvm.Target, "from_triple", without)
    with refused(ConfigurationError, field="target", value="cortex-m7"):
        TARGETS["cortex-m7"].machine()


def test_kernels_that_are_not_compiled_have_no_text(monkeypatch):
    monkeypatch.setattr("numba.config.DISABLE_JIT", 1)
    machine_code._text.cache_clear()
    with refused(ConfigurationError):
        machine_code.object_file(TARGETS["cortex-m7"])


def test_a_folder_that_cannot_be_made_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    with refused(ConfigurationError, field="output"):
        build_tick("cortex-m7", tmp_path / "file" / "build")


def test_files_of_another_content_stay_and_nothing_is_written_beside_them(tmp_path, monkeypatch):
    monkeypatch.setattr("rig.firmware.build.object_file", lambda target: _object_of_something(tmp_path))
    (tmp_path / "build").mkdir()
    (tmp_path / "build" / HEADER).write_text("mine")
    with refused(RecordingError):
        build_tick("cortex-m7", tmp_path / "build")
    assert _names(tmp_path / "build") == [HEADER]
    built = build_tick("cortex-m7", tmp_path / "build", overwrite=True)
    assert _names(tmp_path / "build") == ["tick-cortex-m7.o", "tick-cortex-m7.txt", HEADER]
    assert built.facts.undefined == ("asked",)
    assert build_tick("cortex-m7", tmp_path / "build") == built


def _names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def _object_of_something(folder: Path) -> bytes:
    need("cc")
    (folder / "some.c").write_text("int asked(int); int some(void) { return asked(3); }\n")
    subprocess.run(["cc", "-c", "-fno-pic", "some.c"], cwd=folder, check=True)
    return (folder / "some.o").read_bytes()
