"""Rehearsals are reproducible, resumable, and kept in files."""

from dataclasses import asdict

import numpy as np
import pytest

from rig.errors import ConfigurationError, RecordingError
from rig.rehearsal.rehearsal import RehearsalRequest, rehearse
from rig.results.files import load, save
from tests.refused import refused
from tests.rig.rehearsal.known import knowledge_of_the_magnet_beam
from tests.rig.rehearsal.plans import SHORT, magnet_beam


def request_of(draws=3, seed=0, **changes):
    known = knowledge_of_the_magnet_beam()
    return RehearsalRequest(
        **{"plan": SHORT, "bench": magnet_beam(), "knowledge": known, "draws": draws, "seed": seed} | changes
    )


def same(draws, others):
    """Whether all numbers are equal; NaN equals NaN."""
    np.testing.assert_equal([asdict(draw) for draw in draws], [asdict(draw) for draw in others])


@pytest.fixture(scope="module")
def rehearsed():
    return rehearse(request_of())


def test_draws_do_not_depend_on_how_many_processes_made_them(rehearsed):
    same(rehearse(request_of(), jobs=2).draws, rehearsed.draws)


def test_an_interrupted_rehearsal_goes_on_where_it_ended(tmp_path, rehearsed):
    journal, seen = tmp_path / "r.h5.draws", []

    class EnoughError(Exception):
        pass

    def stop_after_two(draw, done):
        if done == 2:
            raise EnoughError

    with pytest.raises(EnoughError):
        rehearse(request_of(), journal, progress=stop_after_two)
    with journal.open("a") as stream:
        stream.write('{"number": 2, "unkn')  # a power cut in mid-line
    found = rehearse(request_of(), journal, progress=lambda draw, done: seen.append((draw.number, done)))
    assert seen == [(0, 1), (1, 2), (2, 3)]
    same(found.draws, rehearsed.draws)
    assert len(journal.read_text().splitlines()) == 4


def test_more_draws_go_on_from_fewer(tmp_path, rehearsed):
    journal = tmp_path / "r.h5.draws"
    rehearse(request_of(2), journal)
    same(rehearse(request_of(3), journal).draws, rehearsed.draws)


def test_a_journal_of_another_rehearsal_is_refused(tmp_path):
    journal = tmp_path / "r.h5.draws"
    rehearse(request_of(1), journal)
    with refused(RecordingError, "another-rehearsal"):
        rehearse(request_of(1, seed=5), journal)


def test_a_full_disk_is_said_and_the_draws_stay(tmp_path):
    journal = tmp_path / "gone" / "r.h5.draws"
    with refused(RecordingError, "cannot-be-written"):
        rehearse(request_of(1), journal)


def test_a_file_gives_back_every_draw(tmp_path, rehearsed):
    save(rehearsed, tmp_path / "r.h5")
    read = load(tmp_path / "r.h5")
    assert read.facts == rehearsed.facts
    assert read.digest == rehearsed.digest
    for one, other in zip(read.draws, rehearsed.draws, strict=True):
        assert one.unknowns == other.unknowns
        assert one.truth == other.truth
        assert dict(one.trial.shares) == dict(other.trial.shares)
        for p, q in zip(one.trial.points, other.trial.points, strict=True):
            np.testing.assert_equal(vars(p), vars(q))


def test_a_virtual_bench_is_its_own_twin():
    found = rehearse(request_of(2, knowledge=None))
    assert found.facts.hypotheses is None
    assert not found.draws[0].unknowns
    first, second = (draw.trial.points[0].modal_frequency_hz for draw in found.draws)
    assert first != second  # other noise
    assert first == pytest.approx(second, rel=1e-4)


def test_what_cannot_be_rehearsed_is_refused_at_once():
    with refused(ConfigurationError, field="draws", value=0):
        request_of(0)
    with refused(ConfigurationError, "levels", field="levels_v[0]", value=20.0):
        request_of(plan=SHORT.model_copy(update={"levels_v": (20.0,)}))


def test_a_changed_plan_meets_the_rigs_of_the_plan_before():
    lower = SHORT.model_copy(update={"levels_v": (0.1, 0.2)})
    kept, drawn_anew = request_of(plan=lower, drawn_for=SHORT), request_of(plan=lower)
    for number in range(3):
        assert kept.twin(number).bench == request_of().twin(number).bench
        assert drawn_anew.twin(number).bench != request_of().twin(number).bench
