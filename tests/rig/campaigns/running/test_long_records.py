"""Records too long for memory wait in files, and their evaluation takes no more memory however long they are."""

import errno
import os
import tracemalloc

import numpy as np
import pytest

from rig.bench import load_bench
from rig.campaigns.evaluation.acceptance import settled_point
from rig.campaigns.evaluation.lost_samples import lost_rows
from rig.campaigns.evaluation.rows import LongRows, Spool, mean_of, phases, std_of, stretches, turned_rad
from rig.campaigns.evaluation.stored_point import stored
from rig.campaigns.evaluation.transient_disturbance import has_transient_disturbance
from rig.campaigns.evaluation.vibrations import frequency_scatter, recorded_vibration, within_periods
from rig.campaigns.plans import load_plan
from rig.campaigns.running.device_remarks import with_device_remarks
from rig.campaigns.running.row_buffer import RowBuffer
from rig.errors import RecordingError
from rig.tick.layout import recorded_row
from tests.refused import refused

BENCH, PLAN = load_bench("magnet-beam"), load_plan("magnet-beam/backbone")
TARGET = PLAN.targets()[0]
ROW = recorded_row(len(BENCH.channels))
FREQUENCY_HZ = 24.4


def rows_of(first, end):
    """Rows of a steady vibration with noise that depends on the sample alone."""
    theta = 2.0 * np.pi * FREQUENCY_HZ / BENCH.sample_rate_hz * np.arange(first, end)
    rows = np.zeros(end - first, ROW)
    rows["theta_rad"] = np.mod(theta, 2.0 * np.pi)
    noise = np.random.default_rng(first).standard_normal((end - first, len(BENCH.channels)))
    rows["inputs"] = 0.001 * noise
    for number, size in enumerate((0.3, 5.0, 5.5, 8.0)):
        phase = theta if number == 0 else theta + 0.5 * np.pi
        rows["inputs"][:, number] += size * np.cos(phase)
    rows["command_v"], rows["frequency_hz"] = 1.0, FREQUENCY_HZ
    rows["phase_error_rad"] = 0.01 * noise[:, 0]
    return rows


def spooled(n, folder):
    spool = Spool(ROW, folder)
    for first in range(0, n, 50_000):
        spool.add(rows_of(first, min(first + 50_000, n)))
    return LongRows(spool, 0, n)


def evaluated(rows):
    vibration = recorded_vibration(BENCH, rows, PLAN.harmonics)
    point = settled_point(PLAN, TARGET, BENCH, vibration, rows)
    assert not has_transient_disturbance(BENCH, rows)
    return with_device_remarks(point, rows, ())


def test_rows_in_files_are_evaluated_as_those_in_memory(tmp_path):
    rows = spooled(150_000, tmp_path)
    assert not list(tmp_path.iterdir())  # the files have no names: a killed process leaves none
    assert stored(evaluated(rows)) == stored(evaluated(rows.whole()))
    assert np.array_equal(rows[70_000:70_010].whole(), rows.whole()[70_000:70_010])


def peak_of_evaluation(n, folder):
    rows = spooled(n, folder)
    tracemalloc.start()
    try:
        point = evaluated(rows)
        return point, tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_memory_does_not_grow_with_the_length_of_a_record(tmp_path):
    _, short = peak_of_evaluation(300_000, tmp_path)
    point, long = peak_of_evaluation(900_000, tmp_path)
    assert point.accepted, point.reason
    assert long < 1.1 * short
    assert long < 60e6  # one column of the inputs in double precision alone is 29 MB


@pytest.mark.parametrize("in_memory_bytes", [1 << 25, 10_000])
def test_rows_that_were_dropped_before_their_point_was_known_count_as_lost(tmp_path, in_memory_bytes):
    buffer = RowBuffer(ROW, tmp_path, in_memory_bytes=in_memory_bytes)
    whole = rows_of(0, 400)
    buffer.add(0, whole[:100])
    buffer.drop_before(100)
    for first in (100, 200, 300):
        buffer.add(first, whole[first : first + 100])
    taken = buffer.take(40, 250)
    np.testing.assert_array_equal(lost_rows(taken), np.arange(40, 250) < 100)
    assert taken[60:].tobytes() == whole[100:250].tobytes()
    assert buffer.take(250, 400)[:].tobytes() == whole[250:].tobytes()


def test_a_buffer_keeps_few_rows_in_memory_and_gives_back_what_it_was_given(tmp_path):
    whole = rows_of(0, 40_000)
    buffer = RowBuffer(ROW, tmp_path, in_memory_bytes=10_000 * ROW.itemsize)
    for first in range(0, 30_000, 2500):
        buffer.add(first, whole[first : first + 2500])
    taken = buffer.take(1200, 28_000)
    assert isinstance(taken, LongRows)
    for first in range(30_000, 35_000, 2500):  # while the first point is evaluated
        buffer.add(first, whole[first : first + 2500])
    again = buffer.take(28_000, 34_000)
    assert isinstance(again, np.ndarray)
    assert np.array_equal(again, whole[28_000:34_000])
    assert np.array_equal(taken.whole(), whole[1200:28_000])


def test_rows_that_nobody_waits_for_leave_the_buffer(tmp_path):
    buffer = RowBuffer(ROW, tmp_path, in_memory_bytes=1000 * ROW.itemsize)
    for first in range(0, 10_000, 500):
        buffer.add(first, rows_of(first, first + 500))
        buffer.drop_before(first + 500)
    buffer.add(10_000, rows_of(10_000, 10_500))
    assert np.array_equal(buffer.take(10_000, 10_500), rows_of(10_000, 10_500))


def test_a_full_disk_is_told_in_one_line_that_names_the_folder(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Spool, "add", full)
    buffer = RowBuffer(ROW, tmp_path, in_memory_bytes=1000)
    with refused(RecordingError, "no-space-left", where=str(tmp_path)):
        buffer.add(0, rows_of(0, 1000))


def test_whole_periods_angle_and_scatter_of_many_stretches_are_those_of_the_phase():
    rows = np.concatenate([rows_of(first, first + 50_000) for first in range(0, 200_000, 50_000)])
    period = BENCH.sample_rate_hz / FREQUENCY_HZ
    assert turned_rad(rows) == pytest.approx(2.0 * np.pi * (rows.size - 1) / period)
    assert within_periods(rows, 900).stop == int(np.ceil(900 * period)) + 1
    assert frequency_scatter(rows) < 1e-6
    assert [start for start, _ in phases(rows)] == [0, 65_535, 131_071, 196_607]


def test_moments_of_stretches_are_those_of_all_values():
    values = np.random.default_rng(0).normal(3.0, 2.0, 10_001)
    parts = np.split(values, [0, 17, 5000])
    assert mean_of(parts) == pytest.approx(values.mean(), rel=1e-13)
    assert std_of(parts) == pytest.approx(values.std(), rel=1e-13)
    assert (mean_of([values]), std_of([values])) == (values.mean(), values.std())
    assert np.isnan(std_of([]))
    assert sum(stretch.size for stretch in stretches(values)) == values.size
