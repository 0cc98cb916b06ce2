"""What of a force is no harmonic, against sums of sines whose shares are known, and in the points under a lock."""

import math

import numpy as np
import pytest

import rig
from rig.campaigns.evaluation.nonharmonic_force import FEWEST_PERIODS, nonharmonic_force
from rig.campaigns.evaluation.vibration_quality import PURITY_COLUMNS
from rig.campaigns.kinds import KINDS
from rig.campaigns.plans import load_plan
from rig.tick.layout import recorded_row
from tests.rig.rigs import bench_with

BENCH = bench_with()
RATE_HZ = BENCH.sample_rate_hz
LOCKED = ("backbone", "stepped-phase", "continuous-backbone", "response-controlled")


def rows_of(force, theta):
    rows = np.zeros(theta.size, recorded_row(len(BENCH.channels)))
    rows["theta_rad"] = np.angle(np.exp(1j * theta))
    rows["inputs"][:, BENCH.index_of("force")] = force
    return rows


def record(periods, frequency_hz=149.0, strange_hz=544.0, strange=0.0, noise=0.0, growth=0.0, chirp=0.0, seed=0):
    """A force of 1 N with 20 % of a third and 10 % of a ninth harmonic, and what is strange in it."""
    time = np.arange(round(periods * RATE_HZ / frequency_hz) + 1) / RATE_HZ
    theta = 2 * math.pi * frequency_hz * (time + 0.5 * chirp * time**2 / time[-1])
    force = np.exp(growth * time / time[-1]) * (np.cos(theta) + 0.2 * np.cos(3 * theta) + 0.1 * np.cos(9 * theta))
    force += strange * np.cos(2 * math.pi * strange_hz * time)
    return rows_of(0.5 + force + noise * np.random.default_rng(seed).standard_normal(time.size), theta)


@pytest.mark.parametrize("frequency_hz", [149.0, 24.37])
@pytest.mark.parametrize("strange", [0.05, 0.3, 2.0])
def test_a_strange_tone_counts_with_its_share_of_the_rms(strange, frequency_hz):
    share = strange / math.sqrt(1.05 + strange**2)
    rows = record(20, frequency_hz, strange_hz=3.65 * frequency_hz, strange=strange, noise=1e-3)
    assert nonharmonic_force(BENCH, [rows]) == pytest.approx(share, rel=0.02)


@pytest.mark.parametrize("noise", [1e-4, 0.03, 0.3, 1.0])
def test_noise_is_no_stranger_however_loud(noise):
    found = [nonharmonic_force(BENCH, [record(20, noise=noise, seed=seed)]) for seed in range(200)]
    assert max(found) < 0.1


def test_a_tone_is_found_in_noise_as_loud_as_the_force():
    assert nonharmonic_force(BENCH, [record(20, strange=1.0, noise=0.7)]) == pytest.approx(
        math.sqrt(0.5 / 1.515), abs=0.05
    )


def test_a_force_that_grows_and_whose_frequency_moves_is_its_own():
    assert nonharmonic_force(BENCH, [record(20, growth=1.0, chirp=0.005, noise=1e-4)]) < 0.01


def test_pieces_count_together_and_short_ones_not_at_all():
    pure, strange = record(20, noise=1e-3), record(20, strange=1.0, noise=1e-3)
    both = nonharmonic_force(BENCH, [pure, strange, record(FEWEST_PERIODS // 2)])
    assert both == pytest.approx(math.sqrt(0.5 / (0.5 + 2 * 0.525)), rel=0.03)
    assert math.isnan(nonharmonic_force(BENCH, [record(FEWEST_PERIODS // 2)]))
    assert math.isnan(nonharmonic_force(BENCH, [strange[:0]]))


@pytest.mark.parametrize("kind", LOCKED)
def test_every_campaign_under_a_lock_shows_purity_last(kind):
    assert KINDS[kind].columns[-len(PURITY_COLUMNS) :] == PURITY_COLUMNS


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("backbone", {"levels_v": (0.2,)}),
        ("backbone-short", {"levels_m": (1e-4,)}),
        ("continuous-backbone", {"levels_m": (1e-4, 3e-4), "lock_periods": 20.0, "sweep_periods": 40.0}),
        ("stepped-phase-fast", {"levels_n": (0.25,), "start_deg": None, "stop_deg": None, "phase_lags_deg": (-90.0,)}),
        ("response-controlled", {"levels_m": (5e-4,), "phase_lags_deg": (-90.0,)}),
    ],
)
def test_every_campaign_under_a_lock_refuses_points_with_more_than_is_accepted(name, change):
    plan = load_plan(f"magnet-beam/{name}")
    coarse = bench_with({"output_resolution_v": 20.0 / 4096.0}, converter={"dac_bits": 12})  # its rounding makes lines
    with rig.run(plan.model_copy(update=change | {"accepted_nonharmonic_force": 1e-6}), bench=coarse, seed=3) as run:
        points = list(run.recording.latest.values())
        skipped = run.recording.parts[-1].end["skipped"]
    for point in points:
        assert 1e-6 < point["nonharmonic_force"] < 0.1
        assert "accepted up to 0.0001 %" in point["reason"]
        assert point["quality"] == "rejected"
    assert skipped.startswith(f"{len(points)} of {len(points)} points skipped: rejected")


def test_of_a_long_record_stretches_of_equal_length_are_evaluated_as_records_of_their_own(monkeypatch):
    """Two equal halves, each long enough by itself, the thirds of the whole are not; every line is in one bin."""
    samples, periods = 40 * (FEWEST_PERIODS + 1), FEWEST_PERIODS + 1
    theta = 2.0 * math.pi * periods * np.arange(samples) / samples
    noise = 0.01 * np.random.default_rng(3).standard_normal(samples)
    half = rows_of(np.cos(theta) + 0.3 * np.cos(3.6 * theta) + noise, theta)
    whole = np.concatenate([half, half])
    alone = nonharmonic_force(BENCH, [half])
    assert alone == pytest.approx(0.3 / math.sqrt(1.09), rel=0.02)
    monkeypatch.setattr("rig.campaigns.evaluation.nonharmonic_force.LONGEST", whole.size - 1)
    assert nonharmonic_force(BENCH, [whole]) == pytest.approx(alone, rel=1e-12)
    assert nonharmonic_force(BENCH, [whole, half[:100]]) == pytest.approx(alone, rel=1e-12)
