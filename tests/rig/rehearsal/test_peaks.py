"""Peaks of limited quantities are those of whole records, whatever the chunks."""

import numpy as np
import pytest
import scipy

import rig
from rig.rehearsal.peaks import Peaks
from rig.tick.layout import recorded_row
from rig.tick.safety.limits import limits_record


def test_peaks_of_chunks_are_those_of_the_whole_record_with_lost_samples_as_zeros():
    bench = rig.load_bench("magnet-beam")
    limits = limits_record(bench)
    rows = np.zeros(4000, recorded_row(len(bench.channels)))
    rows["inputs"] = np.random.default_rng(0).normal(size=(4000, len(bench.channels))).cumsum(axis=0)
    rows["output_v"] = np.sin(np.arange(4000))
    rows["inputs"][1234] = np.nan
    peaks = Peaks(bench, limits)
    for part in np.array_split(rows, 7):
        peaks.update(part)
    shares = peaks.shares()
    inputs = np.nan_to_num(rows["inputs"].astype(float))
    assert shares["voltage"] == pytest.approx(np.abs(rows["output_v"]).max() / bench.limits.voltage_v)
    gain, keep = limits["integrator_gain"][0], 1.0 - limits["integrator_leak"][0]
    for index, channel in enumerate(bench.channels):
        most = np.abs(inputs[:, index]).max()
        assert shares[f"range {channel.name}"] == pytest.approx(most / channel.range_in_unit)
        if channel.role in ("drive", "response"):
            once = scipy.signal.lfilter([gain], [1.0, -keep], inputs[:, index])
            motion = scipy.signal.lfilter([gain], [1.0, -keep], once)
            expected = np.abs(motion).max() / bench.limits.displacement_m
            assert shares[f"displacement {channel.name}"] == pytest.approx(expected, rel=1e-9)
