"""Faults of the matrix, with the loop on the device: every sample, lock and trip is that of the loop in Python, to the bit."""

import numpy as np
import pytest

from rig.tick.safety.layout import EndReason, GuardMode
from tests.firmware.loop_client import WatchedPlant, bench_for_loop, loop_host, run_in_python, settings_for, tick_for
from tests.reliability.faults.devices import BrokenPlant
from tests.reliability.faults.table import FAULTS, Fault, fault_named

LEVEL_V, MIDDLE, SAMPLES = 0.5, 4000, 8000
ALL = [fault for fault in FAULTS if fault.part != "driver" and "emulated" in fault.devices]
SOME = {
    "force-stuck-middle": EndReason.SENSOR_STUCK,
    "force-over-range-middle": EndReason.FORCE_LIMIT,
    "response-x10-middle": EndReason.DISPLACEMENT_LIMIT,
    "drive-dropouts-middle": EndReason.NONE,
}
"""Faults, and the trips of the first samples of this plan."""


class WatchedBrokenPlant(WatchedPlant, BrokenPlant):
    """A structure that breaks."""


def broken(fault: Fault) -> WatchedBrokenPlant:
    return WatchedBrokenPlant(bench_for_loop(), 2, fault, MIDDLE if fault.onset == "middle" else 0, LEVEL_V)


def reason_with(fault: Fault) -> EndReason:
    """Why the loop on the device ended; all rows are those of the loop in Python."""
    settings = settings_for(LEVEL_V)
    with loop_host("host", plant=broken(fault)) as host:
        host.begin(tick_for(settings, host.plant).arrays)
        readings, rows = host.run_to(SAMPLES)
    plant = broken(fault)
    tick = tick_for(settings, plant)
    expected, expected_rows = run_in_python(tick, plant, len(rows))
    for name in rows.dtype.names or ():
        np.testing.assert_array_equal(rows[name], expected_rows[name], name)
    np.testing.assert_array_equal(readings, expected)
    over = np.flatnonzero(rows["guard"] == GuardMode.OFF)
    assert not any(host.plant.volts[over[0] + 1 : len(rows)] if over.size else ())
    return EndReason(int(tick.guard["reason"][0]))


@pytest.mark.parametrize("name", SOME)
def test_a_fault_trips_at_the_sample_at_which_it_trips_in_python(name: str) -> None:
    assert reason_with(fault_named(name)) == SOME[name]


@pytest.mark.slow
@pytest.mark.parametrize("kind", sorted({fault.kind for fault in ALL}))
def test_every_fault_of_the_matrix_is_seen_as_in_python(kind: str) -> None:
    for fault in ALL:
        if fault.kind == kind:
            reason_with(fault)
