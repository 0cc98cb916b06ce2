"""No shipped plan that holds a level comes near a trip on a sound rig."""

import pytest

from rig.tick.safety.keeping import CHANGED_PERIODS, FAR
from rig.tick.safety.layout import EndReason
from rig.tick.safety.response_plausibility import OUT_OF_BAND_PERIODS
from tests.reliability.false_trips import SoundRun, held_level_plans, sound_run, table_of

SHORTER = {"friction-beam/dwell": {"cycles": 20_000}}
"""Its cycles are all alike: a fifth of them is still by far the longest run here. The command runs them all."""


@pytest.mark.parametrize("plan", held_level_plans())
def test_a_sound_rig_with_ten_times_the_noise_never_comes_near_a_trip(plan):
    run = sound_run(plan, 7, 10.0, **SHORTER.get(plan, {}))
    assert run.reason is EndReason.COMPLETED
    assert run.out_of_band_periods <= OUT_OF_BAND_PERIODS // 2
    assert run.unlike_periods < 0.5
    assert run.highest < FAR  # the paper's gains hunt on the friction beam with such noise
    assert run.changed_periods <= CHANGED_PERIODS // 2


def test_a_run_that_ended_early_is_counted():
    sound = SoundRun("a/b", True, 1.0, EndReason.COMPLETED, 2, 0.0)
    tripped = sound._replace(reason=EndReason.LEVEL_NOT_FOLLOWED, out_of_band_periods=10)
    assert table_of([sound, tripped])[-1] == "| a level is held | 1 × | 2 | 1 | 10 | 0.00 | 0.00 | 0 |"
