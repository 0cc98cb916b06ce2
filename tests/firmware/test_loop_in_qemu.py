"""The firmware as ARM machine code for a Cortex-M7 runs a plan in QEMU: its rows are those of the loop in Python."""

import numpy as np
import pytest

from rig.tick.tick import TickSettings
from tests.firmware.building import built_with_loop, need
from tests.firmware.loop_client import loop_host_of_image, tick_for
from tests.firmware.test_loop_on_device import all_kinds, in_python, with_levels_in_newtons

ROUNDING = 1e-5
"""Of a column's largest value: what functions of another libm may change in single precision."""


def require_as_in_python(settings: TickSettings, samples: int | None = None) -> int:
    """Whole numbers of all rows are equal, and others to the rounding of a libm; returns how many rows there were."""
    need("qemu-system-arm")
    with loop_host_of_image(built_with_loop("mps2-an500")) as host:
        host.begin(tick_for(settings, host.plant).arrays)
        found = host.run_until_off() if samples is None else host.run_to(samples)
    expected = in_python(settings, len(found[1]))
    for name in ("segment", "lock", "guard", "flags"):
        np.testing.assert_array_equal(found[1][name], expected[1][name], name)
    for name in ("output_v", "frequency_hz", "theta_rad", "command_v", "phase_error_rad"):
        largest = np.nanmax(np.abs(expected[1][name]))
        np.testing.assert_allclose(found[1][name], expected[1][name], rtol=0.0, atol=ROUNDING * largest, err_msg=name)
    return len(found[1])


@pytest.mark.slow
def test_the_first_samples_of_a_plan_are_those_of_the_loop_in_python():
    assert require_as_in_python(all_kinds(), 400) >= 400


@pytest.mark.slow
@pytest.mark.parametrize("plan", [all_kinds, with_levels_in_newtons])
def test_a_whole_plan_decides_at_every_sample_what_the_loop_in_python_does(plan):
    assert require_as_in_python(plan()) > 5000


@pytest.mark.slow
def test_the_image_for_the_nucleo_links_with_the_loop():
    assert built_with_loop("nucleo-h743zi2").is_file()
