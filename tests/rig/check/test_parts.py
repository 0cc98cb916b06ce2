"""The parts of a check against closed forms."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import freqs

from rig.campaigns.evaluation.point import RowRange
from rig.campaigns.evaluation.stored_point import stored
from rig.campaigns.running.level_search import share_of_limits
from rig.check.findings import graded
from rig.check.judging import best_assignment, by_magnitude
from rig.check.responses import fit_mode
from rig.check.run import SEARCH, seen_in
from rig.check.silence import hum, silent_findings
from rig.tick.layout import recorded_row
from tests.rig.campaigns.made_points import made_point
from tests.rig.rigs import bench_with

RATE_HZ = 5000.0


def two_modes(frequency_hz, shapes, f1_hz=50.0, zeta=0.01, f2_hz=140.0):
    """Accelerance of two normal modes at several points, from scipy's transfer functions."""
    omega, out = 2.0 * np.pi * frequency_hz, []
    for first, second in shapes:
        parts = []
        for product, f_hz in ((first, f1_hz), (second, f2_hz)):
            w = 2.0 * np.pi * f_hz
            parts.append(freqs([product, 0.0, 0.0], [1.0, 2.0 * zeta * w, w**2], omega)[1])
        out.append(sum(parts))
    return np.array(out)


@pytest.mark.parametrize("near_hz", [46.0, 50.0, 54.0])
def test_the_mode_is_found_beside_another_one(near_hz):
    frequency = np.arange(20.0, 125.0, 0.5)
    mode = fit_mode(frequency, two_modes(frequency, [(0.8, 0.5), (-1.3, 0.9), (0.1, -0.4)]), near_hz)
    assert mode.frequency_hz == pytest.approx(50.0, rel=1e-3)
    assert mode.damping_ratio == pytest.approx(0.01, rel=0.02)
    np.testing.assert_allclose(mode.residue.real, [0.8, -1.3, 0.1], rtol=0.02)


def test_a_delay_turns_the_residue():
    frequency = np.arange(20.0, 125.0, 0.5)
    late_s = 1e-4
    values = two_modes(frequency, [(0.8, 0.5)]) * np.exp(-2j * np.pi * frequency * late_s)
    mode = fit_mode(frequency, values, 50.0)
    assert np.angle(mode.residue[0]) == pytest.approx(-2.0 * np.pi * 50.0 * late_s, rel=0.02)


@pytest.mark.parametrize("disturbance", [0.0, 1e-15, 1e-9, 1e-3, 0.05])
def test_where_no_mode_is_none_is_found_whatever_the_rounding_and_the_noise(disturbance):
    frequency = np.arange(20.0, 125.0, 0.5)
    rigid = two_modes(frequency, [(0.0, 0.5)]) + 2.0 * frequency**2 / 140.0**2
    generator = np.random.default_rng(4)
    for values in (np.full((1, frequency.size), 2.0 + 0.0j) * frequency**2, rigid):
        for _ in range(20):
            noise = 1.0 + disturbance * generator.standard_normal(values.shape)
            assert fit_mode(frequency, values * noise, 50.0) is None


def test_too_few_lines_give_no_mode():
    frequency = np.arange(20.0, 125.0, 0.5)
    assert fit_mode(frequency[:5], two_modes(frequency[:5], [(1.0, 0.0)]), 50.0) is None


def test_as_long_as_the_wiring_fits_no_other_is_proposed():
    expected = np.array([1.0, 1.1, 1.6])
    assert best_assignment(by_magnitude(expected * 1.03, expected)) is None
    assert best_assignment(by_magnitude(expected[[0, 2, 1]] * 1.02, expected)) == (0, 2, 1)
    assert best_assignment(by_magnitude(expected * 2.0, expected)) is None  # a gain, not a place


def test_hum_is_measured_with_its_harmonics_and_noise_is_none():
    time = np.arange(15000) / RATE_HZ
    noise = 0.1 * np.random.default_rng(3).standard_normal(time.size)
    assert hum(noise, 50.0, RATE_HZ) == 0.0
    tones = 0.3 * np.cos(2 * np.pi * 50.0 * time + 0.4) + 0.1 * np.sin(2 * np.pi * 150.0 * time)
    assert hum(noise + tones, 50.0, RATE_HZ) == pytest.approx(np.sqrt((0.3**2 + 0.1**2) / 2.0), rel=0.02)
    assert hum(noise + tones, 60.0, RATE_HZ) == 0.0


def verdicts(readings):
    bench = bench_with()
    return {f.label: f.verdict for f in silent_findings(bench, readings)}


def test_silence_tells_of_offset_hum_noise_and_a_channel_that_stands_still():
    generator = np.random.default_rng(8)
    readings = np.column_stack([0.0005 * generator.standard_normal(15000), *np.zeros((3, 15000))])
    assert set(verdicts(readings).values()) == {"ok"}
    time = np.arange(15000) / RATE_HZ
    hummed = readings.copy()
    hummed[:, 1] += 0.5 * np.cos(2 * np.pi * 50.0 * time)
    found = verdicts(hummed)
    assert (found["mains hum drive"], found["noise drive"]) == ("warn", "warn")
    off = readings.copy()
    off[:, 2] += 100.0  # 1.02 of 5 V
    assert verdicts(off)["offset acc_drive"] == "warn"
    off[:, 2] += 400.0
    assert verdicts(off)["offset acc_drive"] == "fail"


def test_a_load_cell_that_should_make_noise_and_does_not_is_doubted():
    channels = list(bench_with().model_dump()["channels"])
    channels[0]["noise_rms"] = 0.01  # more than two bits
    bench = bench_with({"channels": channels})
    found = {f.label: f.verdict for f in silent_findings(bench, np.zeros((15000, 4)))}
    assert found["noise force"] == "warn"


def test_a_number_that_is_none_fails():
    assert graded(float("nan"), (0.0, 1.0), (0.0, 2.0)) == "fail"
    assert graded(1.5, (0.0, 1.0), (0.0, 2.0)) == "warn"


def recorded_with(bench, inputs):
    """A recording of one point that holds these inputs, and 0.1 V at the output."""
    rows = np.zeros(len(inputs), recorded_row(len(bench.channels)))
    rows["inputs"], rows["output_v"] = inputs, 0.1
    part = SimpleNamespace(read=lambda first, end: rows[first:end], end={"reason": "completed"})
    point = made_point(rows=RowRange(first_sample=0, end_sample=len(rows)))
    return SimpleNamespace(parts=[part], latest={0: stored(point)})


def test_lost_samples_do_not_hide_how_near_a_limit_the_others_were():
    bench = bench_with()
    inputs = np.zeros((100, len(bench.channels)))
    inputs[::2, 0], inputs[1::2, 0] = 30.6, -30.6  # of 34 N
    inputs[10:14] = np.nan
    rows = recorded_with(bench, inputs).parts[-1].read(0, 100)
    share = share_of_limits(bench, rows, lambda name, acceleration_m_s2: 0.0)
    assert share == pytest.approx(30.6 / bench.limits.force_n, rel=1e-6)


def test_a_channel_of_which_nothing_was_seen_gives_no_higher_level(monkeypatch):
    bench = bench_with()
    unclear = SimpleNamespace(coherence=np.full(len(bench.channels), 0.9))
    monkeypatch.setattr("rig.check.run.responses_in", lambda recorded: unclear)
    inputs = np.zeros((100, len(bench.channels)))
    higher = SEARCH.next_level(0.01, seen_in(bench, recorded_with(bench, inputs)))
    assert higher == pytest.approx(0.04)  # four times, the most
    inputs[:, -1] = np.nan
    assert SEARCH.next_level(0.01, seen_in(bench, recorded_with(bench, inputs))) is None


@pytest.mark.parametrize(("lowest_hz", "deciding_hz"), [(5.0, 0.4 * 24.37), (20.0, 20.0)])
def test_a_displacement_is_taken_to_be_at_the_lowest_frequency_that_was_played(monkeypatch, lowest_hz, deciding_hz):
    """All of an acceleration a at the frequency f would be a displacement of ``a / (2 pi f)^2``."""
    bench = bench_with({"limits": {"frequency_hz": (lowest_hz, 200.0), "displacement_m": 1e-4}})
    assert bench.specimen.linear_frequency_hz == 24.37
    clear = SimpleNamespace(coherence=np.full(len(bench.channels), 1.0))
    monkeypatch.setattr("rig.check.run.responses_in", lambda recorded: clear)
    inputs = np.zeros((100, len(bench.channels)))
    inputs[::2, 1], inputs[1::2, 1] = 0.5, -0.5  # m/s2
    seen = seen_in(bench, recorded_with(bench, inputs))
    assert seen.enough
    assert seen.share_of_limits == pytest.approx(0.5 / (2.0 * np.pi * deciding_hz) ** 2 / 1e-4, rel=1e-6)
