"""Resolution of the multisine of a tuning: what follows where the lines of the search show no resonance."""

from types import SimpleNamespace

import pytest

from rig.tuning import linear_test
from rig.tuning.linear_test import AFTER_TRIP, LINES, REFINEMENT, SEARCH, _ended_well, _Runs
from rig.tuning.plant import TuningError
from tests.rig.rigs import bench_with


@pytest.fixture
def runs(monkeypatch):
    monkeypatch.setattr(linear_test, "voltage_responses", lambda bench, measured: measured)
    bench, played = bench_with({"specimen": {"linear_frequency_hz": 25.0}}), []

    def at(level_rms_v, resolution_hz, realisations):
        played.append((level_rms_v, resolution_hz, realisations))
        return "finer"

    return SimpleNamespace(bench=bench, measured="coarse", lead_samples=2.0, at=at, played=played)


def test_a_resonance_between_two_lines_of_the_search_is_looked_for_with_finer_ones(runs):
    def damping_of(responses, lead_samples):
        if responses == "coarse":
            raise TuningError("no mode")
        return 3e-4

    assert linear_test._level_with_a_mode(runs, (0.01, 0.02), damping_of) == (0.02, 3e-4)
    [(level, resolution, realisations)] = runs.played
    assert (level, realisations) == (0.02, 1)
    assert resolution == pytest.approx(25.0 / LINES / REFINEMENT, rel=1e-3)


def test_where_the_search_shows_the_resonance_nothing_further_is_played(runs):
    assert linear_test._level_with_a_mode(runs, (0.01, 0.02), lambda responses, lead: 0.01) == (0.02, 0.01)
    assert runs.played == []


def test_a_rig_without_a_mode_is_refused_after_the_finer_lines(runs):
    def damping_of(responses, lead_samples):
        raise TuningError("no mode")

    with pytest.raises(TuningError, match=r"^no mode$"):
        linear_test._level_with_a_mode(runs, (0.02,), damping_of)
    assert len(runs.played) == 1


def test_a_lower_level_of_the_search_is_taken_where_higher_ones_show_no_mode(runs):
    """The search tripped at 0.04 V, which is not played again."""

    def damping_of(responses, lead_samples):
        if not runs.played or runs.played[-1][0] > 0.01:
            raise TuningError("no mode")
        return 3e-4

    found = linear_test._level_with_a_mode(runs, (0.04, 0.01, 0.015, 0.02), damping_of)
    assert found == (0.01, 3e-4)
    assert [level for level, _, _ in runs.played] == [0.02, 0.015, 0.01]


def _ended(reason):
    return SimpleNamespace(parts=[SimpleNamespace(end={"reason": reason, "text": "it tripped"})], path="test.h5")


def test_a_level_that_trips_at_a_limit_is_lowered_once(monkeypatch):
    runs, played = _Runs(SimpleNamespace(bench=bench_with()), "magnet-beam", None), []

    def at(level_rms_v, resolution_hz, realisations):
        played.append(level_rms_v)
        _ended_well(_ended("force_limit"), level_rms_v)

    monkeypatch.setattr(runs, "at", at)
    assert SEARCH.next_level(0.01, runs.search_at(0.01)) == pytest.approx(AFTER_TRIP * 0.01)
    assert "0.01 V RMS: it tripped" in runs.tripped
    with pytest.raises(TuningError, match=r"0\.0025 V RMS: it tripped"):
        runs.search_at(0.0025)
    assert played == [0.01, 0.0025]


def test_a_level_at_which_too_little_is_read_is_raised_once(monkeypatch):
    runs = _Runs(SimpleNamespace(bench=bench_with()), "magnet-beam", None)
    monkeypatch.setattr(runs, "at", lambda level_rms_v, *_: _ended_well(_ended("sensor_stuck"), level_rms_v))
    assert SEARCH.next_level(0.01, runs.search_at(0.01)) == pytest.approx(0.01 / AFTER_TRIP)
    with pytest.raises(TuningError, match=r"0\.04 V RMS: it tripped"):
        runs.search_at(0.04)


@pytest.mark.parametrize("known", [{"share_of_limits": 0.4}, {"tripped": "force above its limit"}])
def test_a_level_that_may_be_near_a_limit_is_not_raised(monkeypatch, known):
    runs = _Runs(SimpleNamespace(bench=bench_with()), "magnet-beam", None)
    vars(runs).update(known)
    monkeypatch.setattr(runs, "at", lambda level_rms_v, *_: _ended_well(_ended("sensor_stuck"), level_rms_v))
    with pytest.raises(TuningError, match=r"0\.01 V RMS: it tripped"):
        runs.search_at(0.01)


@pytest.mark.parametrize("reason", ["stop_requested", "daq_timeout"])
def test_what_else_ends_a_multisine_ends_the_tuning(monkeypatch, reason):
    runs = _Runs(SimpleNamespace(bench=bench_with()), "magnet-beam", None)
    monkeypatch.setattr(runs, "at", lambda level_rms_v, *_: _ended_well(_ended(reason), level_rms_v))
    with pytest.raises(TuningError, match="it tripped"):
        runs.search_at(0.01)
