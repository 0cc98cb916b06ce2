"""Which rows are stored: with ``rows = "records"`` all of what is evaluated, and few of what lies between."""

from fractions import Fraction

import numpy as np
import pytest

import rig
from rig.campaigns.evaluation.recorded import point_rows
from rig.campaigns.evaluation.stored_samples import StoredSamples
from rig.campaigns.plans import load_plan
from rig.campaigns.running.row_buffer import RowBuffer
from rig.measurements.experiments.build import rows_from_rest
from rig.recording.reader import Recording
from tests.recorded import recorded
from tests.sharing import made_once, shared_folder

PLACE = ("first_sample", "end_sample")


def shortened(name):
    """A quick plan of each way in which rows are evaluated."""
    plan = load_plan(name)
    table = plan.model_dump(mode="json")
    if name.endswith("multisine-1"):
        table |= {"realisations": 1, "periods": 2, "levels_rms_v": table["levels_rms_v"][:1]}
    if name.endswith(("/backbone-short", "/continuous-backbone")):
        table |= {"levels_m": table["levels_m"][6:10]}
        table |= {"start_v": 0.3, "sweep_periods": 90} if "sweep_periods" in table else {}
    if name.endswith("/backbone"):
        table |= {"levels_v": table["levels_v"][:3], "record_periods": 20}
    return type(plan).model_validate(table)


@pytest.fixture(
    scope="module",
    params=[
        "magnet-beam/backbone",
        "magnet-beam/sweep-3",
        "magnet-beam/multisine-1",
        "friction-beam/backbone-short",
        "friction-beam/continuous-backbone",
    ],
)
def both(request):
    plan = shortened(request.param)
    thin = plan.model_copy(update={"rows": "records", "telemetry_s": 0.05})

    def run(folder):
        with pytest.MonkeyPatch.context() as patched:
            # records that wait for their evaluation in files give the same points
            patched.setitem(RowBuffer.__init__.__kwdefaults__, "in_memory_bytes", 20_000)
            rig.run(thin, output=folder / "run.h5", seed=2).close()

    folder = made_once(shared_folder() / f"stored-rows-{request.param.replace('/', '-')}", run)
    with Recording(recorded(plan, seed=2)) as full, Recording(folder / "run.h5") as records:
        yield full, records


def test_points_are_those_of_a_recording_with_all_rows(both):
    points = [
        [{key: value for key, value in point.items() if key not in PLACE} for point in recording.points]
        for recording in both
    ]
    assert points[0] == points[1]
    assert len(points[0]) > 0


def test_rows_of_every_point_are_there_and_few_others(both):
    full, records = both
    of_points = 0
    for point in full.points:
        rows = point_rows(records, point["number"])
        assert rows.tobytes() == point_rows(full, point["number"]).tobytes()
    for part in records.parts:
        ranges = {(point["first_sample"], point["end_sample"]) for point in part.points}
        of_points += sum(end - first for first, end in ranges)
    assert of_points <= records.n_rows < of_points + 0.02 * full.n_rows + 10


def test_events_say_which_sample_a_stored_row_is(both):
    full, records = both
    part = records.parts[0]
    at = StoredSamples(part).samples(np.arange(part.n_rows))
    assert at[-1] == round(at[-1]) > 0.9 * (full.n_rows - 1) - 250
    stored = full.parts[0].read(0, full.n_rows)[at.astype(int)]
    assert stored.tobytes() == part.read(0, part.n_rows).tobytes()


def test_rows_that_lead_to_a_point_are_given_only_where_all_are_stored(both):
    full, records = both
    number = full.points[0]["number"]
    assert rows_from_rest(records, number, Fraction(1)).size == 0
    if full.kind == "sweep":
        assert rows_from_rest(full, number, Fraction(1)).size > 0
