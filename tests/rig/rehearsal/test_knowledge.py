"""What a rehearsal takes from a recording."""

import pytest

from rig.bench import load_bench
from rig.campaigns.plans import load_plan
from rig.recording.reader import Recording
from rig.rehearsal.knowledge import collect_knowledge
from tests.recorded import recorded

FEW_LINES = {"realisations": 2, "transient_periods": 1, "periods": 2, "levels_rms_v": [0.1], "resolution_hz": 0.5}


@pytest.mark.parametrize(("how", "taken"), [("measured", True), ("bench", True), ("open loop", False), (None, True)])
def test_the_delay_of_a_multisine_is_that_of_a_loop_unless_its_queue_was_chosen_without_one(how, taken):
    with Recording(recorded("magnet-beam/multisine-1", seed=1, **FEW_LINES)) as recording:
        about = recording.parts[-1].information["about"]
        if how is not None:
            about["queue"] = {"how": how}
        known = collect_knowledge(load_bench("magnet-beam"), load_plan("magnet-beam/backbone"), {"a": recording})
        assert known.loop_delay_samples == (about["lead_samples"] if taken else None)
