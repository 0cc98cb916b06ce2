"""What a structured fit tells of itself: its stage, its iteration, and once how long such a fit usually takes."""

import pytest

from identification import FitProgress
from identification.models.structured.progress import FitWatch


def told(took_s):
    """Return what is told after linearisations of two or three fits that took so long, s."""
    seen: list[FitProgress] = []
    watch = FitWatch(seen.append, fits=(2, 3), iterations=100)
    watch.begin("stage 1 of 4")
    for seconds in took_s:
        watch.linearised(0.5, seconds)
    return seen


def test_the_usual_time_follows_from_the_second_linearisation_alone():
    assert [at.usual_s for at in told([9.0, 0.1, 7.0])] == [None, pytest.approx((6.0, 36.0)), None]
    assert [at.usual_s for at in told([9.0, 1.0])] == [None, pytest.approx((60.0, 360.0))]


def test_iterations_are_counted_by_stage():
    seen: list[FitProgress] = []
    watch = FitWatch(seen.append, fits=(1, 1), iterations=100)
    for stage in ("stage 1 of 2", "stage 2 of 2"):
        watch.begin(stage)
        watch.linearised(0.5, 1.0)
        watch.linearised(0.4, 1.0)
    assert [(at.stage[:7], at.iteration) for at in seen] == [
        ("stage 1", 0),
        ("stage 1", 1),
        ("stage 2", 0),
        ("stage 2", 1),
    ]


def test_of_several_fits_the_stage_says_which():
    seen: list[FitProgress] = []
    watch = FitWatch(seen.append, fits=(3, 4), iterations=100)
    for _ in range(2):
        watch.begin_fit()
        watch.begin("stage 1 of 4")
        watch.linearised(0.5, 1.0)
    assert [at.stage for at in seen] == ["fit 1 of 3 to 4, stage 1 of 4", "fit 2 of 3 to 4, stage 1 of 4"]


def test_of_laws_that_are_tried_the_stage_says_which():
    seen: list[FitProgress] = []
    watch = FitWatch(seen.append, fits=(1, 3), iterations=100)
    watch.begin("short fit of stop below", short=True)
    for _ in range(3):
        watch.linearised(0.5, 0.01)
    watch.begin_fit("stop below")
    watch.begin("stage 1 of 4")
    watch.linearised(0.5, 1.0)
    watch.linearised(0.5, 1.0)
    assert [at.stage for at in seen] == [
        *["short fit of stop below"] * 3,
        *["fit 1 of 1 to 3, stop below, stage 1 of 4"] * 2,
    ]
    assert [at.usual_s for at in seen] == [*[None] * 4, (30.0, 360.0)]  # that of the whole fit alone
