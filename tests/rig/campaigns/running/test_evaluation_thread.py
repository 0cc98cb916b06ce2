"""Points are worked out beside the loop."""

import threading
from dataclasses import replace

import pytest

import rig
from rig.arming.run_options import Silent
from rig.campaigns.kinds import KINDS
from rig.campaigns.running.evaluation_thread import EvaluationThread
from tests.rig.campaigns.made_points import made_point
from tests.rig.campaigns.running.test_runs import plan_with


@pytest.mark.parametrize("beside", [True, False])
def test_what_an_evaluation_raises_is_raised_where_its_points_are_taken(beside):
    evaluations = EvaluationThread(beside=beside)
    evaluations.ask(lambda: [][0])
    with pytest.raises(IndexError):
        evaluations.take()
    evaluations.close()


def test_without_a_thread_points_are_there_once_they_were_asked_for():
    evaluations = EvaluationThread(beside=False)
    evaluations.ask(lambda: [made_point(number=threading.get_ident())])
    assert evaluations.ready()
    assert [point.number for point in evaluations.take()] == [threading.get_ident()]
    assert not evaluations


def test_points_come_in_the_order_in_which_they_were_asked_for_also_those_that_need_no_evaluation():
    free = threading.Event()
    evaluations = EvaluationThread()
    evaluations.ask(lambda: [made_point(number=0)] if free.wait(30) else [])
    evaluations.known(made_point(number=1))
    assert not evaluations.ready()
    free.set()
    assert [[point.number for point in evaluations.take()] for _ in range(2)] == [[0], [1]]
    assert not evaluations
    evaluations.close()


def test_rows_are_taken_while_a_point_is_evaluated_however_long_that_takes(monkeypatch):
    """An evaluation that ends only once later rows have come would wait for ever, were it not beside the loop."""
    seen, came = [], threading.Event()

    class Counting(Silent):
        def advance(self, rows, tick):
            seen.append(tick.sample)
            if evaluating and tick.sample > evaluating[0] + 5000:
                came.set()

    evaluating = []
    real = KINDS["backbone"]

    def slow(*arguments):
        evaluating.append(seen[-1] if seen else 0)
        assert came.wait(60), "no row was taken while a point was evaluated"
        return real.measure(*arguments)

    monkeypatch.setattr("rig.loop.loop.Loop.waits", False)  # as by the wall clock
    monkeypatch.setattr("rig.campaigns.backbone.points.BACKBONE", replace(real, measure=slow))
    with rig.run(plan_with(levels_v=(0.4, 0.8)), progress=Counting()) as run:
        assert run.complete
        assert [point["number"] for point in run.recording.points] == [0, 1]
