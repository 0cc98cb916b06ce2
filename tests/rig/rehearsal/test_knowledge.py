"""What a rehearsal takes from a recording."""

import numpy as np
import pytest

from identification import nonlinear_mode
from rig.bench import load_bench
from rig.campaigns.plans import load_plan
from rig.errors import ConfigurationError
from rig.measurements import backbone
from rig.recording.reader import Recording
from rig.rehearsal.knowledge import collect_knowledge
from tests.recorded import recorded
from tests.refused import refused

SHORT = {"levels_v": [0.4, 0.8, 1.6], "record_periods": 8}
FEW_LINES = {"realisations": 2, "transient_periods": 1, "periods": 2, "levels_rms_v": [0.1], "resolution_hz": 0.5}


@pytest.mark.parametrize(("how", "taken"), [("measured", True), ("bench", True), ("open loop", False), (None, True)])
def test_the_delay_of_a_multisine_is_that_of_a_loop_unless_its_queue_was_chosen_without_one(how, taken):
    with Recording(recorded("magnet-beam/multisine-1", seed=1, **FEW_LINES)) as recording:
        about = recording.parts[-1].information["about"]
        if how is not None:
            about["queue"] = {"how": how}
        known = collect_knowledge(load_bench("magnet-beam"), load_plan("magnet-beam/backbone"), {"a": recording})
        assert known.loop_delay_samples == (about["lead_samples"] if taken else None)


def test_a_backbone_tells_frequency_and_damping_over_the_amplitude():
    bench, plan = load_bench("magnet-beam"), load_plan("magnet-beam/backbone")
    with (
        Recording(recorded("magnet-beam/multisine-1", seed=1, **FEW_LINES)) as multisine,
        Recording(recorded("magnet-beam/backbone", **SHORT)) as trial,
    ):
        known = collect_knowledge(bench, plan, {"tuned.h5": multisine, "tuned-trial.h5": trial})
        measured = nonlinear_mode(backbone(trial))
    assert known.mode is not None
    np.testing.assert_array_equal(known.mode.modal_frequency_hz, measured.modal_frequency_hz)
    assert known.sources[-1] == "tuned-trial.h5: frequency and damping over the amplitude, 3 levels"


def test_a_backbone_of_another_bench_is_refused_by_its_file_and_frequency():
    bench, plan = load_bench("friction-beam"), load_plan("friction-beam/backbone")
    with (
        Recording(recorded("magnet-beam/backbone", **SHORT)) as other,
        refused(ConfigurationError, "its-lowest-level-vibrates", field="sources", value="other.h5"),
    ):
        collect_knowledge(bench, plan, {"other.h5": other})
