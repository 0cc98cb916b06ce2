"""Where a bench wants the loop to run, and how long a device that runs it does without the computer."""

import pytest

from rig.drivers import make_daq
from rig.drivers.nidaqmx.options import NiDaqmxOptions
from rig.drivers.sound.options import SoundOptions
from rig.drivers.wire import WireOptions
from rig.drivers.wire.options import LONGEST_LOOP_S, LOOP_S, loop_watchdog_s
from rig.errors import DaqRefused
from rig.loop.on_device import RunsLoops
from tests.refused import refused
from tests.rig.rigs import bench_with


@pytest.mark.parametrize(("name", "where_it_is"), [("serial", {"port": "/dev/null"}), ("can", {"channel": "can0"})])
def test_a_bench_on_a_wire_says_where_the_loop_runs(name, where_it_is):
    for where in ("computer", "device", "auto"):
        daq = make_daq(bench_with({"driver": {"name": name, "options": {**where_it_is, "loop": where}}}))
        assert isinstance(daq, RunsLoops)
        assert daq.loop == where


@pytest.mark.parametrize("options", [NiDaqmxOptions, SoundOptions])
def test_what_cannot_carry_the_loop_does_not_take_the_option(options):
    assert "loop" not in options.model_fields


@pytest.mark.parametrize(
    ("given_s", "device_s", "moves", "wanted_s"),
    [
        (None, (0.002, 4000.0), True, LOOP_S),
        (None, (0.002, 2.0), True, 2.0),
        (5.0, (0.002, 4000.0), True, 5.0),
        (2 * LONGEST_LOOP_S, (0.002, 4000.0), False, 2 * LONGEST_LOOP_S),
    ],
)
def test_the_watchdog_of_a_loop_on_the_device_is_long(given_s, device_s, moves, wanted_s):
    assert loop_watchdog_s(WireOptions(watchdog_s=given_s), device_s, moves=moves) == wanted_s


@pytest.mark.parametrize(("given_s", "longest_s"), [(0.1, 4000.0), (None, 0.5), (2 * LONGEST_LOOP_S, 4000.0)])
def test_a_watchdog_that_pings_cannot_feed_or_that_is_too_long_is_refused(given_s, longest_s):
    with refused(DaqRefused, "where-the-device-runs-the-loop"):
        loop_watchdog_s(WireOptions(watchdog_s=given_s), (0.002, longest_s), moves=True)
