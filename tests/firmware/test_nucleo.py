"""The image for the NUCLEO-H743ZI2: it is linked so that the chip can start it. It has not run on one."""

import subprocess

import numpy as np
import pytest

from tests.firmware.building import built, built_with_loop

FLASH, TIGHTLY_COUPLED, REACHED_BY_DMA = (
    range(0x08000000, 0x08200000),
    range(0x20000000, 0x20020000),
    range(0x24000000, 0x24080000),
)
CONVERTERS_INTERRUPT = 16 + 11  # of DMA1 stream 0: RM0433 19.1.2


@pytest.fixture(scope="module")
def image():
    return built("nucleo-h743zi2")


def symbols_of(image):
    listed = subprocess.run(["arm-none-eabi-nm", image], capture_output=True, text=True, check=True).stdout
    return {
        name: int(at, 16) for at, _, name in (line.split() for line in listed.splitlines() if len(line.split()) == 3)
    }


@pytest.fixture(scope="module")
def symbols(image):
    return symbols_of(image)


def test_the_chip_finds_stack_reset_and_the_interrupt_of_the_converters(image, symbols, tmp_path):
    binary = tmp_path / "image.bin"
    subprocess.run(["arm-none-eabi-objcopy", "-O", "binary", image, binary], check=True)
    vectors = np.frombuffer(binary.read_bytes()[: 4 * 166], "<u4")
    assert vectors[0] == TIGHTLY_COUPLED.stop
    assert vectors[1] == symbols["reset"] | 1
    assert vectors[CONVERTERS_INTERRUPT] == symbols["converters_interrupt"] | 1
    others = np.delete(vectors[2:], CONVERTERS_INTERRUPT - 2)
    assert set(others.tolist()) == {symbols["fault"] | 1}
    assert binary.stat().st_size < len(FLASH)


def test_what_the_dma_fills_lies_where_it_reaches_and_the_stack_has_room(symbols):
    for name in ("counts_in", "ring", "sending"):
        assert symbols[name] in REACHED_BY_DMA, name
    assert TIGHTLY_COUPLED.stop - symbols["bss_end"] >= 8192


@pytest.mark.parametrize("make", [built, built_with_loop], ids=["alone", "with the loop"])
def test_over_can_fd_it_is_linked_with_that_wire_alone_and_the_stack_has_room(make):
    symbols = symbols_of(make("nucleo-h743zi2-can"))
    assert "vl_can_fd" in symbols
    assert "vl_serial" not in symbols
    assert ("vibrolock_tick_digest" in symbols) == (make is built_with_loop)
    assert TIGHTLY_COUPLED.stop - symbols["bss_end"] >= 8192
