"""The core as ARM machine code: the image for the board mps2-an386, in QEMU."""

import subprocess
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import rig
from rig.bench import Bench, load_bench
from rig.conformance import with_loopback
from rig.drivers import make_daq
from rig.emulator.emulated import emulated
from tests.contract.test_wire import OverAPort, Reached
from tests.firmware.building import FOLDER, built, need
from tests.recorded import changed
from tests.rig.rigs import bench_with

QEMU = "qemu-system-arm"
BOARD = "boards/mps2-an386"
FIRST_LEVELS_M = [1.144e-4, 1.678e-4]
"""The first of the plan's levels: the machine in software runs at a twentieth of the speed of this one."""


@pytest.fixture(scope="module")
def image() -> Path:
    """The image, where QEMU is there to run it; skips or fails as `built` does."""
    path = built("mps2-an386")
    need(QEMU)
    return path


def answers(bench: Bench, block: int) -> np.ndarray:
    """What a sine of 0.1 V gives, open loop."""
    voltages = 0.1 * np.sin(0.06 * np.arange(400))
    with make_daq(bench) as daq:
        daq.start(block)
        return np.vstack([daq.exchange(part.copy()) for part in voltages.reshape(-1, block)])


@pytest.mark.parametrize("block", [1, 10])
def test_the_same_outputs_give_the_samples_of_the_emulator_bit_for_bit(image: Path, block: int) -> None:
    with emulated(bench_with(), "serial", firmware=image) as bench:
        on_arm = answers(bench, block)
    with emulated(bench_with(), "serial") as bench:
        np.testing.assert_array_equal(on_arm, answers(bench, block))
    assert np.abs(on_arm).max() > 0.01


FAULT = """
#include "board.h"
#include "semihosting.h"
#include "uart.h"
int main(void);
void board_output(int32_t count) { semihosting(SEMIHOSTING_WRITE, count == 0 ? "0 V" : "more"); }
void uart_interrupt(void) {}
int main(void) { WHAT; return 3; }
"""


@pytest.mark.parametrize(
    "what", ['__asm__("udf #0")', "*(volatile int *)0xF0000000u = 1", "((void (*)(void))0x20000000u)()"]
)
def test_a_fault_brings_the_output_to_0_v_and_ends_the_program(image: Path, tmp_path: Path, what: str) -> None:
    (tmp_path / "fault.c").write_text(FAULT.replace("WHAT", what))
    compiler = [
        "arm-none-eabi-gcc",
        "-mcpu=cortex-m4",
        "-mthumb",
        "-nostartfiles",
        "--specs=nano.specs",
        "-Icore",
        f"-I{BOARD}",
    ]
    program = [tmp_path / "fault.c", f"{BOARD}/startup.c", f"-T{BOARD}/memory.ld", "-o", tmp_path / "fault.elf"]
    subprocess.run([*compiler, *program], check=True, cwd=FOLDER)
    run = [QEMU, "-M", "mps2-an386", "-nographic", "-monitor", "none", "-serial", "none", "-semihosting"]
    done = subprocess.run([*run, "-kernel", tmp_path / "fault.elf"], check=False, capture_output=True, timeout=60)
    assert (done.returncode, done.stderr) == (1, b"0 V")


class TestConformance(OverAPort):
    """The contract of drivers, with the device in QEMU, a twentieth as fast as the same code on the host's processor.

    What takes many blocks is looked at there (`tests.firmware.test_conformance`).
    """

    blocks = (1, 10)
    long_run_blocks = 400

    @pytest.fixture(autouse=True, scope="class")
    @classmethod
    def _reached(cls, image: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
        log = tmp_path_factory.mktemp("arm") / "log"
        virtual = with_loopback(bench_with())
        with emulated(virtual, "serial", log_output=log, firmware=image) as bench:
            cls.reached = Reached(bench, log, virtual)
            yield


del OverAPort


@pytest.mark.slow
def test_a_backbone_of_short_points_is_that_of_the_virtual_rig_to_rounding(image: Path, tmp_path: Path) -> None:
    plan, bench = changed("magnet-beam/backbone-short", levels_m=FIRST_LEVELS_M), load_bench("magnet-beam")
    with emulated(bench, "serial", firmware=image) as far:
        rig.run(plan, bench=far, output=tmp_path / "arm.h5").close()
    options = {**bench.driver.options, "queue_blocks": 1}
    near = bench.model_copy(update={"driver": bench.driver.model_copy(update={"options": options})})
    rig.run(plan, bench=near, output=tmp_path / "virtual.h5").close()
    with rig.Recording(tmp_path / "arm.h5") as arm, rig.Recording(tmp_path / "virtual.h5") as virtual:
        assert arm.complete
        assert len(arm.parts) == len(virtual.parts)
        for one, other in zip(arm.parts, virtual.parts, strict=True):
            rows, expected = one.read(0, one.n_rows), other.read(0, other.n_rows)
            for field in expected.dtype.names or ():
                # Fused with the rig or not, a kernel may round the last bit of a number in another way.
                np.testing.assert_allclose(rows[field], expected[field], rtol=1e-6, err_msg=field)
        assert arm.n_rows > 4_000
