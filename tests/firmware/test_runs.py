"""Whole runs over the firmware are those of the virtual driver, bit for bit where the emulator's are."""

import numpy as np
import pytest

from tests.closed_loop.test_wires import require_points_of_the_virtual_rig, without_wire  # noqa: F401 (fixture)
from tests.firmware.building import built
from tests.rig.emulator.test_campaign import require_rows_of_the_virtual_driver, virtual  # noqa: F401 (fixture)


@pytest.mark.slow
@pytest.mark.parametrize("wire", ["serial", "can"])
def test_every_recorded_row_is_that_of_the_virtual_driver(wire: str, virtual: np.ndarray) -> None:  # noqa: F811
    require_rows_of_the_virtual_driver(wire, virtual, firmware=built("host"))


@pytest.mark.slow
def test_points_over_classical_can_are_those_of_the_virtual_rig(without_wire) -> None:  # noqa: F811
    require_points_of_the_virtual_rig("can", "1 kHz", without_wire, fd=False, firmware=built("host"))
