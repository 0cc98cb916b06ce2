"""A finished recording on the page, and the points of an earlier one under those of a run."""

import pytest

from rig.errors import RecordingError
from rig.live.publisher import Publisher
from rig.monitor.sources import chosen, earlier_run
from tests.recorded import recorded_at
from tests.refused import refused
from tests.rig.monitor.scripted import facts, point
from tests.rig.monitor.test_process import PLAN
from tests.rig.monitor.visitor import Visitor, heard, served


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    path = tmp_path_factory.mktemp("recorded") / "run.h5"
    path.with_name("plan.toml").write_text(PLAN.replace("[0.4]", "[0.4, 0.8]"))
    recorded_at(path, path.with_name("plan.toml"))
    return path


def test_of_a_finished_recording_its_end_is_shown(recording):
    with served(chosen(recording)) as server, Visitor(server.url).enter().feed() as socket:
        whole = heard(socket)
    assert whole["facts"]["bench"] == "magnet-beam"
    assert [line["number"] for line in whole["lines"] if line["is"] == "point"] == [0, 1]
    assert whole["lines"][-1]["text"] == "the plan was carried out"
    assert whole["frame"]["state"] == "finished"
    assert whole["replay"]["playing"] is False


def test_a_run_into_the_file_takes_the_place_of_what_was_recorded(recording):
    with served(chosen(recording)) as server, Visitor(server.url).enter().feed() as socket:
        assert heard(socket)["replay"] is not None
        with Publisher(facts(recording=str(recording)), 4) as run:
            run.line("point", point(7))
            while (message := heard(socket))["is"] != "whole":
                pass
            assert message["replay"] is None
            assert message["facts"]["process"] != 0


def test_points_of_an_earlier_recording_are_sent_along(recording):
    found = earlier_run(recording)
    assert [line["number"] for line in found.lines] == [0, 1]
    assert found.facts.recording == str(recording)
    assert "harmonics" not in found.lines[0]


def test_what_is_no_recording_is_refused(tmp_path):
    (tmp_path / "text.h5").write_text("hello")
    for read in (chosen, earlier_run):
        with refused(RecordingError, "text-not-file-of-vibrolock-but"):
            read(tmp_path / "text.h5")


def test_a_replay_is_steered_by_forms_of_its_own_page_alone(recording):
    with served(chosen(recording)) as server:
        inside = Visitor(server.url).enter()
        assert inside.post("/replay", {"token": "wrong", "action": "seek", "value": "0"}).status == 403
        assert (
            inside.post("/replay", {"token": inside.token, "action": "seek", "value": "0"}, Origin="null").status == 403
        )
        for action, value in (("dance", "1"), ("seek", "nan"), ("seek", "x"), ("speed", "-1"), ("", "")):
            answer = inside.post("/replay", {"token": inside.token, "action": action, "value": value})
            assert answer.status == 400
        with inside.feed() as socket:
            heard(socket)
            assert inside.post("/replay", {"token": inside.token, "action": "seek", "value": "0.5"}).status == 200
            while (message := heard(socket))["is"] != "whole":
                pass
            assert message["replay"]["time_s"] == 0.5
            assert [line for line in message["lines"] if line["is"] == "point"] == []
