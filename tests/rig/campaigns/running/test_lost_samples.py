"""Samples lost in transmission leave gaps, never zeros: in the tick, in the file, in the points, in what is exported."""

import math

import numpy as np
import pytest

import rig
from rig.bench import Bench
from rig.campaigns.evaluation.lost_samples import bridged, lost_objection, lost_rows, too_many_lost
from rig.campaigns.multisine.plan import MultisinePlan
from rig.campaigns.plans import load_plan
from rig.campaigns.sweep.plan import SweepPlan
from rig.errors import RecordingError
from rig.exchange.export import export_file
from rig.exchange.reading import import_file
from rig.loop.loop import Loop
from rig.measurements import point_rows, sweeps
from rig.tick.layout import SAMPLE_LOST, recorded_row
from rig.tick.safety.layout import EndReason
from tests.refused import refused
from tests.rig.campaigns.running.test_runs import plan_with
from tests.rig.lossy import lose
from tests.rig.rigs import bench_with

RATE_HZ = 5000
SCATTERED = [(k, k + 1) for k in range(997, 200_000, 1009)]  # one in a thousand
BURSTS = [(k, k + 60) for k in range(5003, 200_000, 6007)]  # 1 % in pieces of 12 ms, a third of a period
PLAN = {"levels_v": (0.6, 1.0), "record_periods": 30}


@pytest.fixture(scope="module")
def whole():
    with rig.run(plan_with(**PLAN), seed=1) as run:
        yield run.recording.points


@pytest.mark.parametrize("gaps", [SCATTERED, BURSTS], ids=["single samples", "bursts"])
@pytest.mark.parametrize("detector", ["two-phase", "adaptive"])
def test_a_point_with_lost_samples_is_the_point_without(monkeypatch, whole, gaps, detector):
    controller = {**plan_with().controller.model_dump(), "detector": detector}
    lose(monkeypatch, gaps)
    with rig.run(plan_with(**PLAN, controller=controller), seed=1) as run:
        points = run.recording.points
        assert run.complete
        for point, sound in zip(points, whole, strict=True):
            assert point["lost_samples"] > 0
            assert any("lost in transmission" in warning for warning in point["warnings"])
            assert point["frequency_hz"] == pytest.approx(sound["frequency_hz"], rel=1e-4)
            assert point["damping_ratio"] == pytest.approx(sound["damping_ratio"], rel=2e-3)
            assert point["amplitude_m"] == pytest.approx(sound["amplitude_m"], rel=1e-3)
            rows = point_rows(run.recording, point["number"])
            lost = lost_rows(rows)
            assert lost.sum() == point["lost_samples"]
            assert np.isnan(rows["inputs"][lost]).all()
            assert np.isfinite(rows["inputs"][~lost]).all()
            assert np.isfinite(rows["output_v"]).all()


def test_a_run_without_loss_says_so(whole):
    assert [point["lost_samples"] for point in whole] == [0, 0]


@pytest.mark.parametrize(("gap_s", "ends"), [(0.045, EndReason.COMPLETED), (0.055, EndReason.SAMPLES_LOST)])
def test_a_gap_is_ridden_out_up_to_its_limit_and_trips_beyond(monkeypatch, gap_s, ends):
    """In the middle of a vibration of 2 mm: integrated with a hole, its acceleration would pass for overtravel."""
    lose(monkeypatch, [(25_000, 25_000 + round(gap_s * RATE_HZ))])
    bench = bench_with({"limits": {"displacement_m": 0.0025}})
    with rig.run(plan_with(levels_v=(1.6,), record_periods=100), bench=bench, seed=1) as run:
        part = run.recording.parts[-1]
        assert part.end["reason"] == ends.name.lower(), part.end["text"]
        if ends is EndReason.SAMPLES_LOST:
            assert "limits.lost_s = 0.05" in part.end["text"]
            rows = part.read(0, part.n_rows)
            assert rows["output_v"][-1] == 0.0  # ramped down
            assert np.abs(np.diff(rows["output_v"].astype(float))).max() < 0.12  # and not dropped


def test_rows_without_the_flag_are_still_refused_where_they_are_no_numbers(monkeypatch):
    lose(monkeypatch, [(10_000, 10_001)])
    monkeypatch.setattr("tests.rig.lossy.LOST", 0)
    with rig.run(plan_with(levels_v=(0.8,)), seed=1) as run:
        assert run.recording.parts[-1].end["reason"] == "non_finite_input"


def test_gaps_are_bridged_by_the_periods_before_and_after():
    """A growing vibration with harmonics: a gap of a third of a period is met to a part in a thousand."""
    rows = np.zeros(2000, recorded_row(2))
    theta = 2 * math.pi * 24.3 / RATE_HZ * np.arange(2000)
    truth = (1 + 1e-4 * np.arange(2000)) * (np.cos(theta) + 0.1 * np.cos(3 * theta + 1))
    rows["theta_rad"] = np.mod(theta, 2 * math.pi)
    rows["inputs"] = truth[:, None]
    for first, end in ((0, 3), (900, 970), (1998, 2000)):
        rows["inputs"][first:end] = np.nan
        rows["flags"][first:end] = np.uint32(1 << 31)
    filled = bridged(rows)
    np.testing.assert_allclose(filled[900:970, 1], truth[900:970], atol=1e-3)
    np.testing.assert_allclose(filled[:3, 0], truth[:3], atol=0.03)
    np.testing.assert_array_equal(filled[3:900], rows["inputs"][3:900])


def test_a_multisine_leaves_the_periods_with_gaps_out(monkeypatch):
    plan = MultisinePlan.model_validate(
        {
            "bench": "magnet-beam",
            "levels_rms_v": [0.3],
            "lowest_hz": 15.0,
            "highest_hz": 40.0,
            "resolution_hz": 1.0,
            "realisations": 2,
            "periods": 4,
            "transient_periods": 2,
        }
    )
    with rig.run(plan, seed=1) as run:
        first = [point["first_sample"] for point in run.recording.points]
        sound = run.spectra()[0.3]
    lose(monkeypatch, [(first[1] + 5000 + 7, first[1] + 5000 + 9)])
    with rig.run(plan, seed=1) as run:
        points = run.recording.points
        assert [point["lost_samples"] for point in points] == [0, 2]
        assert all(point["accepted"] for point in points)
        assert "1 of 4 periods are left out" in points[1]["warnings"]
        found = run.spectra()[0.3]
    assert found.spectra.shape[:2] == (2, 3)
    np.testing.assert_allclose(found.spectra[1], sound.spectra[1][[0, 2, 3]], rtol=0, atol=1e-9)


def test_a_sweep_has_no_instants_where_samples_were_lost(monkeypatch):
    plan = SweepPlan.model_validate(
        {"bench": "magnet-beam", "start_hz": 20.0, "stop_hz": 30.0, "rate_hz_per_s": 2.0, "levels_v": [0.4]}
    )
    with rig.run(plan, seed=1) as run:
        sound = run.sweeps()[0]
        first = run.recording.points[0]["first_sample"]
    gap = (first + 8000, first + 8020)
    lose(monkeypatch, [gap])
    with rig.run(plan, seed=1) as run:
        found, point = run.sweeps()[0], run.recording.points[0]
    inside = np.abs(found.time_s - 8010 / RATE_HZ) < 0.9 / 25.0
    assert not inside.any()
    assert found.time_s.size > 0.97 * sound.time_s.size
    assert any("not measured at 23." in warning for warning in point["warnings"])
    force = np.interp(found.time_s, sound.time_s, np.abs(sound.force))
    np.testing.assert_allclose(np.abs(found.force), force, rtol=1e-3, atol=1e-4)


@pytest.mark.parametrize("suffix", ["csv", "mat"])
def test_exported_samples_keep_their_gaps(monkeypatch, tmp_path, suffix):
    lose(monkeypatch, [(k, k + 1) for k in range(997, 100_000, 101)])
    with rig.run(plan_with(levels_v=(0.8,), record_periods=10), output=tmp_path / "run.h5", seed=1) as run:
        rows = point_rows(run.recording, 0)
    lost = lost_rows(rows)
    assert lost.any()
    target = tmp_path / f"samples.{suffix}"
    export_file(tmp_path / "run.h5", target, suffix, data="time")
    force = import_file(target).samples[0]
    np.testing.assert_array_equal(np.isnan(force), lost)
    np.testing.assert_allclose(force[~lost], rows["inputs"][~lost, 0], rtol=1e-5)


def test_universal_files_say_that_they_cannot_hold_gaps(monkeypatch, tmp_path):
    lose(monkeypatch, [(k, k + 1) for k in range(997, 100_000, 101)])
    with rig.run(plan_with(levels_v=(0.8,), record_periods=10), output=tmp_path / "run.h5", seed=1):
        pass
    with refused(RecordingError, "not-finite-which-universal-files-cannot"):
        export_file(tmp_path / "run.h5", tmp_path / "samples.uff", "uff", data="time")


def test_too_many_lost_samples_refuse_the_point(monkeypatch):
    lose(monkeypatch, [(k, k + 1) for k in range(1, 200_000, 10)])
    with rig.run(plan_with(levels_v=(0.8,)), seed=1) as run:
        point = run.recording.points[0]
    assert not point["accepted"]
    assert "were lost in transmission" in point["reason"]
    assert "allowed is up to 5%" in point["reason"]


SLOW_FLOWS = {"backbone-short": {"levels_m": (6.965e-4, 1.066e-3)}, "continuous-backbone": {}}


@pytest.fixture(scope="module")
def slow_flows():
    out = {}
    for name, changed in SLOW_FLOWS.items():
        with rig.run(shipped_plan(name, **changed), seed=1) as run:
            out[name] = run.recording.points
    return out


def shipped_plan(name: str, **changed: object):
    return load_plan(f"magnet-beam/{name}").model_copy(update=changed)


@pytest.mark.parametrize("every", [500, 100])
@pytest.mark.parametrize("name", SLOW_FLOWS)
def test_a_slow_flow_with_scattered_lost_samples_is_the_one_without(monkeypatch, slow_flows, name, every):
    lose(monkeypatch, [(k, k + 1) for k in range(every // 2, 200_000, every)])
    with rig.run(shipped_plan(name, **SLOW_FLOWS[name]), seed=1) as run:
        for point, sound in zip(run.recording.points, slow_flows[name], strict=True):
            assert point["accepted"], point["reason"]
            assert point["lost_samples"] > 0
            assert point["modal_frequency_hz"] == pytest.approx(sound["modal_frequency_hz"], rel=1e-4)
            assert point["damping_ratio"] == pytest.approx(sound["damping_ratio"], rel=1e-2)


def test_too_many_lost_samples_refuse_a_point_of_a_slow_flow(monkeypatch):
    lose(monkeypatch, [(k, k + 1) for k in range(1, 200_000, 19)])
    with rig.run(shipped_plan("backbone-short", levels_m=(6.965e-4,), retries=0), seed=1) as run:
        point = run.recording.points[0]
    assert not point["accepted"]
    assert (
        point["reason"]
        == f"{point['lost_samples']} of {rows_of(point)} samples were lost in transmission, allowed is up to 5%"
    )


def rows_of(point) -> int:
    return point["end_sample"] - point["first_sample"]


def test_windows_of_which_more_than_2_percent_are_lost_are_told():
    lost = np.zeros(1000, bool)
    lost[[100, 101, 500]] = True
    first, end = np.array([0, 0, 100, 400, 450, 501]), np.array([100, 101, 200, 500, 500, 502])
    assert too_many_lost(lost, first, end).tolist() == [False] * 6
    assert too_many_lost(lost, np.array([100, 100, 499]), np.array([199, 102, 501])).tolist() == [True, True, True]
    assert lost_objection(50, 1000) == ""
    assert lost_objection(51, 1000) == "51 of 1000 samples were lost in transmission, allowed is up to 5%"


def test_a_sweep_with_scattered_lost_samples_has_all_its_instants_and_the_channels_that_are_wanted(monkeypatch):
    plan = SweepPlan.model_validate(
        {"bench": "magnet-beam", "start_hz": 22.0, "stop_hz": 27.0, "rate_hz_per_s": 2.0, "levels_v": [0.4]}
    )
    with rig.run(plan, seed=1) as run:
        sound = run.sweeps()[0]
        two = sweeps(run.recording, roles=("force", "drive"))[0]
    assert [channel.role for channel in two.channels] == ["force", "drive"]
    np.testing.assert_allclose(two.fundamentals, sound.fundamentals[:2], rtol=1e-12)
    lose(monkeypatch, [(k, k + 1) for k in range(50, 100_000, 100)])
    with rig.run(plan, seed=1) as run:
        found, point = run.sweeps()[0], run.recording.points[0]
    assert point["accepted"]
    np.testing.assert_array_equal(found.time_s, sound.time_s)
    np.testing.assert_allclose(np.abs(found.force), np.abs(sound.force), rtol=3e-3, atol=3e-4)


def test_another_driver_than_the_bases_begins_without_its_options(tmp_path):
    other = tmp_path / "serial.toml"
    other.write_text('base = "magnet-beam"\n[driver]\nname = "serial"\noptions.port = "/dev/ttyX"\n')
    same = tmp_path / "same.toml"
    same.write_text('base = "magnet-beam"\n[driver]\noptions.queue_blocks = 1\n')
    assert _options(other) == {"port": "/dev/ttyX"}
    assert _options(same) == {"specimen": "magnet-beam", "queue_blocks": 1}


def _options(path) -> dict:
    from rig.bench import load_bench

    bench: Bench = load_bench(path)
    return bench.driver.options


class LosingRows(Loop):
    """A loop that has lost nothing; the rows of its first run are lost on the way to the campaign, as of a loop on a device."""

    gap = slice(0)
    runs = 0

    def run(self):
        LosingRows.runs += 1
        first, is_first = 0, LosingRows.runs == 1
        for rows in super().run():
            begin, end = (min(max(at - first, 0), rows.size) for at in (self.gap.start, self.gap.stop))
            if is_first and end > begin:
                rows["inputs"][begin:end] = np.nan
                rows["flags"][begin:end] |= SAMPLE_LOST
            first += rows.size
            yield rows


def test_a_point_whose_rows_were_lost_on_the_way_from_the_device_is_measured_again(monkeypatch, whole):
    point = whole[1]
    LosingRows.gap, LosingRows.runs = slice(point["first_sample"], point["end_sample"]), 0
    monkeypatch.setattr("rig.loop.session.Loop", LosingRows)
    with rig.run(plan_with(**PLAN), seed=1) as run:
        assert run.complete
        assert LosingRows.runs == len(run.recording.parts) == 2
        again = run.recording.points[-1]
        assert again["accepted"]
        assert "samples were lost in transmission" in again["refused_before"][0]["reason"]
        assert again["frequency_hz"] == pytest.approx(whole[1]["frequency_hz"], rel=1e-4)
