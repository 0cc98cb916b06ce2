"""Draws are rigs that can be, and one that cannot be computed is counted without ending the others."""

from pathlib import Path

import numpy as np
import pytest

from rig.bench import load_bench
from rig.campaigns.plans import load_plan
from rig.errors import ConfigurationError
from rig.rehearsal.forecasting import rehearsed_in
from rig.rehearsal.rehearsal import RehearsalRequest, rehearse
from rig.rehearsal.report import lines, summary, verdict_in_one_line
from rig.rehearsal.truth import NOT_BALANCED
from rig.rehearsal.verdict import Proportion, verdict_of
from rig.results.rehearsal.rehearse import Subject, request_for
from simulators.ensemble import VariantError
from tests.refused import refused
from tests.rig.rehearsal.known import knowledge_of_the_magnet_beam
from tests.rig.rehearsal.plans import SHORT, magnet_beam

OVERSHOT = 132
"""The draw of the README's rehearsal whose correction used to end at an armature of 0.16 g."""


def test_every_draw_of_the_readme_is_a_rig_with_an_armature_like_the_measured_one(command):
    command("check --bench magnet-beam -o check.h5").succeeded()
    subject = Subject(
        plan=load_plan("magnet-beam/backbone"), bench=load_bench("magnet-beam"), sources=[Path("check.h5")]
    )
    request = request_for(subject)
    likely = request.knowledge.linear.rig().values
    for number in (0, 100, OVERSHOT):
        drawn = request.twin(number).bench.driver.options
        assert 0.2 < drawn["exciter"]["armature_mass_kg"] / likely["moving_mass_kg"] < 5.0, number
        assert 1e3 < drawn["stinger"]["stiffness_n_m"] < 1e10, number


class _SomeFail(RehearsalRequest):
    """A rehearsal in which the third twin divides by zero, and every other from the fifth on."""

    def twin(self, number):
        if number == 2 or (number >= 4 and number % 2):
            raise ZeroDivisionError("float division by zero")
        return super().twin(number)


def request_of(draws):
    known = knowledge_of_the_magnet_beam()
    return _SomeFail(plan=SHORT, bench=magnet_beam(), knowledge=known, draws=draws, balanced=False)


def test_a_twin_that_cannot_be_computed_is_counted_and_the_others_go_on():
    found = rehearse(request_of(4))
    assert [draw.trial.computed for draw in found.draws] == [True, True, False, True]
    assert found.draws[2].trial.text == "ZeroDivisionError: float division by zero"
    assert found.draws[2].truth == NOT_BALANCED
    verdict = verdict_of(found)
    assert verdict.not_computed == Proportion(count=1, of=4)
    assert verdict.ends_well == Proportion(count=3, of=3)
    assert all(point.accepted == Proportion(count=3, of=3) for point in verdict.points)
    assert np.isfinite(verdict.duration_s.high)
    says = "1 of 4 twins could not be computed (1 x ZeroDivisionError: float division by zero); all shares are of the others"
    assert any(line.startswith(f"not computed    {says}") for line in lines(summary(found)))
    assert says in verdict_in_one_line(summary(found))


def test_a_twin_that_cannot_be_computed_counts_as_a_trip_when_a_bench_asks_for_a_largest_probability():
    found = rehearse(request_of(4))
    assert verdict_of(found).trips == Proportion(count=0, of=3)
    assert rehearsed_in(found, "r.h5").trips_at_most == pytest.approx(Proportion(count=1, of=4).interval[1])


@pytest.mark.parametrize("kind", [OSError, MemoryError])
def test_what_fails_because_of_the_machine_is_no_property_of_a_twin(kind):
    class NoRoom(_SomeFail):
        def twin(self, number):
            raise kind("no space left")

    request = NoRoom(plan=SHORT, bench=magnet_beam(), knowledge=knowledge_of_the_magnet_beam(), draws=2)
    with refused(VariantError, "no-space-left"):
        rehearse(request)


def test_too_many_of_them_are_said_and_none_at_all_is_refused():
    assert "too many" in verdict_in_one_line(summary(rehearse(request_of(3))))

    class AllFail(_SomeFail):
        def twin(self, number):
            raise OverflowError("too large")

    request = AllFail(plan=SHORT, bench=magnet_beam(), knowledge=knowledge_of_the_magnet_beam(), draws=2)
    with refused(ConfigurationError, "none-of-twins-could-be-computed"):
        rehearse(request)
