"""Readings near a limit: which are, and what they count for."""

import numpy as np
import pytest

from rig.bench import load_bench
from rig.tick.safety.kernels import watch_limit, watch_motion
from rig.tick.safety.limits import guard_record, input_records, limits_record, watch_records


@pytest.mark.parametrize("share", [0.5, 0.9])
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("name", ["force", "acc_drive"])
def test_a_reading_beyond_the_share_of_its_limit_is_near_and_one_below_is_not(name, share, sign):
    bench = load_bench("magnet-beam")
    index = next(k for k, channel in enumerate(bench.channels) if channel.name == name)
    limit = bench.limits.force_n if bench.channels[index].role == "force" else bench.limits.acceleration_m_s2
    records = input_records(bench, share)
    assert records["alarm_v"][index] <= share * limit * abs(
        bench.channels[index].sensitivity_v_per_unit
    )  # it is examined
    for part, near in ((0.999 * share, 0), (1.001 * share, 1)):
        guard = guard_record(True)
        watch_limit(guard[0], records[index], index, sign * part * limit, 1)
        assert (guard["near"][0], guard["reason"][0]) == (near, 0)


def test_a_displacement_beyond_the_share_of_its_limit_is_near():
    bench = load_bench("magnet-beam")
    limits = limits_record(bench, 0.9)
    for part, near in ((0.89, 0), (0.91, 1)):
        guard, watch = guard_record(True), watch_records(1)
        watch["displacement"] = part * bench.limits.displacement_m
        watch_motion(guard[0], limits[0], watch[0], 0.0, 0, 1)
        assert (guard["near"][0], guard["reason"][0]) == (near, 0)


def test_by_default_nothing_is_near_before_it_trips():
    bench = load_bench("magnet-beam")
    records = input_records(bench)
    assert np.all(records["near"] == records["limit"])
    assert limits_record(bench)["near_m"] == bench.limits.displacement_m
