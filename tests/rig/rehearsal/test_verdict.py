"""The verdict counts what happened, and calls an influence only what is not chance."""

import numpy as np
import pytest

from rig.rehearsal.rehearsal import Draw, Rehearsal, RehearsalFacts
from rig.rehearsal.report import lines, summary
from rig.rehearsal.trial import Trial, TrialPoint
from rig.rehearsal.truth import TrueBackbone
from rig.rehearsal.verdict import LevelCount, Proportion, Quantiles, verdict_of, without_numbers

FACTS = RehearsalFacts(
    bench={"name": "b", "specimen": {"name": "s"}},
    plan={"kind": "backbone", "description": "", "levels_v": [1.0, 2.0]},
    hypotheses={},
    seed=0,
    software_version="0",
    tests="t",
)


def draw_of(
    number, *, end="COMPLETED", level=np.nan, qualities=("good", "good"), unknowns=None, share=0.5, reason="at 3 Hz"
):
    points = tuple(
        TrialPoint(
            number=n,
            level=n + 1.0,
            quality=quality,
            reason="" if quality == "good" else reason,
            frequency_hz=20.0 + n,
            modal_frequency_hz=20.0 + n,
            damping_ratio=0.0101,
            amplitude_m=1e-3 * (n + 1),
        )
        for n, quality in enumerate(qualities)
    )
    tripped = end not in ("COMPLETED", "STOP_REQUESTED")
    trial = Trial(
        end=end,
        text=end.lower(),
        tripped=tripped,
        completed=not tripped and all(point.accepted for point in points),
        channel="force" if tripped else "",
        level=level,
        duration_s=10.0 + number,
        shares={"voltage": share},
        points=points,
    )
    truth = TrueBackbone(numbers=(0,), frequency_hz=(20.0 * (1 + 1e-6),), damping_ratio=(0.01,))
    return Draw(number=number, unknowns=unknowns or {}, trial=trial, truth=truth)


def rehearsal_of(draws):
    return Rehearsal(facts=FACTS, draws=tuple(draws), finished="2026-01-01T00:00:00+00:00")


def test_ends_are_counted_by_cause_and_level():
    draws = [draw_of(n) for n in range(6)]
    draws += [
        draw_of(6, end="FORCE_LIMIT", level=2.0, qualities=("good", "interrupted")),
        draw_of(7, qualities=("good", "lost-lock")),
    ]
    draws += [
        draw_of(8, end="FORCE_LIMIT", level=1.0, qualities=("interrupted",)),
        draw_of(9, end="LOST_LOCK", level=2.0),
    ]
    found = verdict_of(rehearsal_of(draws))
    assert (found.ends_well.count, found.trips.count, found.lost_lock.count) == (6, 3, 2)
    assert [(way.cause, way.levels) for way in found.ways_to_trip] == [
        ("FORCE_LIMIT", (LevelCount(level=1.0, count=1), LevelCount(level=2.0, count=1))),
        ("LOST_LOCK", (LevelCount(level=2.0, count=1),)),
    ]
    first, second = found.points
    assert (first.accepted.count, second.accepted.count) == (9, 7)
    assert second.qualities == {"good": 7, "interrupted": 1, "lost-lock": 1, "not begun": 1}
    assert second.reasons == {"at … Hz": 2}
    assert found.frequency_error.middle == pytest.approx(1e-6, rel=1e-3)
    assert found.damping_error.largest == pytest.approx(0.01)
    text = "\n".join(lines(summary(rehearsal_of(draws))))
    assert "force limit on channel force: 2 of 10 (1 at 1, 1 at 2 V)" in text
    assert "ends well       60 %" in text


def test_intervals_are_wilsons():
    z = 1.959963985
    for count, n in ((0, 200), (3, 40), (40, 40)):
        p = count / n
        middle = (p + z**2 / (2 * n)) / (1 + z**2 / n)
        half = z / (1 + z**2 / n) * np.sqrt(p * (1 - p) / n + z**2 / (4 * n**2))
        assert Proportion(count=count, of=n).interval == pytest.approx((middle - half, middle + half), abs=1e-9)


def test_bands_leave_out_what_is_not_a_number():
    band = Quantiles.of([1.0, 2.0, 3.0, float("nan")])
    assert (band.middle, band.largest, band.n) == (2.0, 3.0, 3)
    assert Quantiles.of([]).n == 0


def test_what_matters_is_found_and_chance_is_not():
    generator = np.random.default_rng(1)
    shift, other = generator.normal(size=(2, 120))
    draws = [
        draw_of(
            n,
            end="LOST_LOCK" if shift[n] > 0.8 else "COMPLETED",
            unknowns={"shift": shift[n], "moving_mass_kg": other[n]},
        )
        for n in range(120)
    ]
    found = verdict_of(rehearsal_of(draws)).influences
    assert found[0].unknown == "shift"
    assert {one.outcome for one in found} == {"ends well", "trip", "lost lock"}
    assert not any(one.unknown == "moving_mass_kg" for one in found)
    assert "backbone up to 80 %" in found[0].advice


def test_reasons_are_equal_without_their_numbers():
    assert without_numbers("phase error 3.1 deg, k1 = -2e-05") == without_numbers("phase error 0.2 deg, k1 = 7")
    assert without_numbers("k1 of F2") == "k1 of F2"
