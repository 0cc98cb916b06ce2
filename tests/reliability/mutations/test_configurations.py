"""Spoilt benches and plans are refused in one clear line, or work; the long run is a command (`__main__`)."""

import time

import pytest

from rig.errors import ConfigurationError
from tests.reliability.mutations.configurations import (
    Spoilt,
    compiled,
    judge,
    shipped_as_they_are,
    spoilt_configurations,
)
from tests.reliability.mutations.judging import judged


@pytest.fixture(scope="module", autouse=True)
def _compiled(tmp_path_factory):
    compiled(tmp_path_factory.mktemp("compiled"))


@pytest.mark.slow
def test_spoilt_configurations_are_refused_in_one_clear_line_or_work(tmp_path):
    verdicts = [(spoilt, judge(spoilt, tmp_path)) for spoilt in spoilt_configurations(150, seed=1)]
    wrong = [f"{s.name} {s.mutations}: {v.text}" for s, v in verdicts if v.outcome == "misbehaved"]
    assert wrong == []
    assert {verdict.outcome for _, verdict in verdicts} == {"refused", "accepted"}


def test_what_is_shipped_is_accepted_as_it_is_written_here(tmp_path):
    assert {judge(one, tmp_path).outcome for one in shipped_as_they_are()} == {"accepted"}


def test_a_seed_gives_the_same_files_and_a_longer_run_begins_with_those_of_a_shorter():
    few, many = list(spoilt_configurations(5, seed=3)), list(spoilt_configurations(10, seed=3))
    assert few == many[:5]
    assert few != list(spoilt_configurations(5, seed=4))


@pytest.mark.parametrize(
    ("text", "outcome", "said"),
    [("plain", "refused", "plain"), ("x" * 700, "refused", "xxx"), ("", "misbehaved", "no clear line")],
)
def test_only_a_clear_line_counts_as_a_refusal(text, outcome, said):
    def refusing():
        raise ConfigurationError(text)

    verdict = judged(refusing, (ConfigurationError,))
    assert verdict.outcome == outcome
    assert said in verdict.text


def test_any_other_exception_and_a_long_time_are_faults_of_ours(monkeypatch):
    assert judged(lambda: 1 / 0, (ConfigurationError,)).text.startswith("unexpected ZeroDivisionError")
    times = iter((0.0, 60.0))
    monkeypatch.setattr(time, "process_time", lambda: next(times))
    assert judged(lambda: None, (ConfigurationError,)).text.startswith("took 60.0 s, then accepted")


def test_a_file_of_little_is_refused_by_what_is_missing(tmp_path):
    verdict = judge(Spoilt("plan nothing", (), b'kind = "backbone"\n'), tmp_path)
    assert verdict.outcome == "refused"
    assert "`bench`: is missing" in verdict.text
