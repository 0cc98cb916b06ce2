"""Strange values among points, events and ends of a recording are one line, whatever command reads them."""

import copy
from types import SimpleNamespace

import pytest

from rig.errors import RecordingError
from rig.recording.hdf5_recording import write_recording
from rig.recording.layout import new_file
from rig.recording.reader import Recording
from rig.recording.stored_value_checks import check_stored_values
from tests.recorded import recorded
from tests.refused import refused

COMMANDS = (
    "show x.h5",
    "plot x.h5 -o x.png",
    "export x.h5 -o x.mat",
    "export x.h5 -o t.mat --data time",
    "identify x.h5 -o m.h5",
)


def with_point(path, **values):
    """Write the short backbone with other values in its second point to a file with a digest."""
    with Recording(recorded("magnet-beam/backbone-short")) as recording:
        part = recording.parts[0]
        point = copy.deepcopy(part.points[1])
        part.points[1] = {key: value for key, value in {**point, **values}.items() if value != "missing"}
        with new_file(path, kept="") as (file, check):
            write_recording(file, recording._header, recording.parts, check)


@pytest.mark.parametrize(
    "values",
    [
        {"harmonics": "text"},
        {"harmonics": [[["a", 1.0]]]},
        {"harmonics": []},
        {"harmonics_std": [[1.0], [1.0, 2.0]]},
        {"drift": []},
        {"amplitude_m": 1e200},
        {"force_n": "1.0"},
        {"number": "1e5"},
        {"number": "missing"},
        {"accepted": "missing"},
        {"level": []},
        {"warnings": [1]},
        {"direction": "sideways"},
        {"end_sample": 99_999_999_999},
    ],
    ids=lambda values: f"{values}",
)
def test_a_strange_value_in_a_point_is_one_line_of_every_command(tmp_path, command, values):
    with_point(tmp_path / "x.h5", **values)
    for typed in COMMANDS:
        done = command(typed)
        assert "unexpected" not in done.err, typed
        assert done.err.count("\n") <= 1, typed
        if "end_sample" not in values and "drift" not in values:
            assert done.status == 1, typed
            (key,) = values
            assert key in done.err, typed


def part_of(**told):
    return SimpleNamespace(**{"information": {}, "points": [], "events": [], "end": None, **told})


@pytest.mark.parametrize(
    ("told", "message"),
    [
        ({"events": [{"what": 3}]}, {"field": "events[0].what", "value": 3, "allowed": "a text"}),
        (
            {"events": [{"what": "telemetry", "row": 0}]},
            {"field": "events[0]", "allowed": "an event telemetry with row, sample and stride"},
        ),
        (
            {"events": [{"sample": "soon"}]},
            {"field": "events[0].sample", "value": "soon", "allowed": "a whole number from 0"},
        ),
        ({"events": [{"sample": 1.5}]}, {"field": "events[0].sample", "allowed": "a whole number from 0"}),
        ({"events": [{"sample": 10**400}]}, {"field": "events[0].sample", "allowed": "a whole number from 0"}),
        ({"events": [{"stride": 0}]}, {"field": "events[0].stride", "value": 0, "allowed": "a whole number from 1"}),
        (
            {"points": [{"amplitude_m": 1e200}]},
            {"field": "points[0].amplitude_m", "value": 1e200, "allowed": "a number up to 1e+100"},
        ),
        ({"points": [{"harmonics": [[1.0, -1e308]]}]}, {"field": "points[0].harmonics[0][1]", "value": -1e308}),
        (
            {"points": [{"accepted": "yes"}]},
            {"field": "points[0].accepted", "value": "yes", "allowed": "true or false"},
        ),
        ({"end": {"text": ["ended"]}}, {"field": "end.text", "value": ["ended"], "allowed": "a text"}),
        ({"information": {"first_sample": -1}}, {"field": "information.first_sample", "value": -1}),
    ],
)
def test_what_a_part_may_not_tell_is_named(told, message):
    with refused(RecordingError, **message, where="x.h5: part 1"):
        check_stored_values(part_of(**told), "x.h5: part 1")


def test_numbers_that_are_none_and_an_unknown_event_are_told():
    told = {
        "points": [{"force_purity": float("nan"), "misfit": float("inf")}],
        "events": [{"what": "of a later version"}],
    }
    check_stored_values(part_of(**told, end={"loop": None}), "x.h5: part 1")
