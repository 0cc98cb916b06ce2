"""STOP on the page: by the plain form, without any script, to 0 V; and what is said where that cannot be."""

import html
import re
import subprocess
import sys
import threading
from dataclasses import replace
from types import SimpleNamespace

import pytest

from rig.live.facts import LimitFacts
from rig.monitor import server, stopping
from rig.monitor.replay import ReplayState
from rig.monitor.sources import Latest, chosen
from rig.recording.reader import Recording
from rig.tick.safety.layout import EndReason, GuardMode
from tests.rig.monitor.scripted import Scripted, facts
from tests.rig.monitor.visitor import Visitor, served
from tests.waiting import wait_until

LIMITS = {"limits": LimitFacts(voltage_v=9.5, displacement_m=0.006, frequency_hz=(8.0, 600.0), ramp_down_s=0.5)}


@pytest.fixture
def run():
    return Scripted(**LIMITS)


@pytest.fixture
def inside(run):
    with served(run) as server:
        yield Visitor(server.url).enter()


def heading(answer):
    found = re.search(r"<h1[^>]*>(.*?)</h1>", answer.text)
    assert found is not None
    return html.unescape(found[1])


def onward(answer):
    found = re.search(r'http-equiv="refresh" content="1;url=(/stopping)"', answer.text)
    return found and found[1]


@pytest.mark.slow
def test_the_form_brings_a_run_to_0_v(tmp_path):
    """A virtual run by the clock, stopped by a form as a browser without scripts sends it, and followed to its end."""
    output = tmp_path / "run.h5"
    command = ["run", "magnet-beam/backbone", "--realtime", "-o", str(output)]
    code = "from rig.cli import main; main()"
    with (
        subprocess.Popen([sys.executable, "-c", code, *command], stdout=subprocess.PIPE, text=True) as campaign,
        served(chosen(output)) as server,
    ):
        inside = Visitor(server.url).enter()
        wait_until(lambda: (inside.state()["frame"] or {}).get("voltage_v", 0.0) > 0.05, "some output")
        answer = inside.stop()
        said = [heading(answer)]
        while onward(answer):
            answer = inside.get("/stopping")
            said.append(heading(answer))
        assert said[-1] == "OUTPUT AT 0 V"
        assert set(said) <= {"STOP REQUESTED", "RAMPING DOWN", "OUTPUT AT 0 V"}
        printed, _ = campaign.communicate()
        wait_until(lambda: not inside.state()["connected"], "the run's end")
        last = inside.get("/stopping")
        assert heading(last) == "OUTPUT AT 0 V"
        assert "stopped on the page" in last.text
    assert campaign.returncode == 1
    assert "stopped on the page" in printed
    with Recording(output) as recording:
        end = recording.parts[-1].end
        assert end is not None
        assert end["text"] == "stopped on the page"
        assert end["reason"] == "stop_requested"
        output_v = abs(recording.parts[-1].rows("output_v"))
        assert output_v[-1] == 0.0
        assert output_v.max() > 0.05


def test_from_asked_over_ramping_to_0_v(run, inside):
    assert heading(inside.get("/stopping")) == "NO STOP REQUESTED"
    assert heading(inside.stop()) == "STOP REQUESTED"
    assert run.stops == ["stopped on the page"]
    run.step(GuardMode.RAMPING, EndReason.STOP_REQUESTED, voltage_v=0.321)
    ramping = inside.get("/stopping")
    assert (heading(ramping), onward(ramping)) == ("RAMPING DOWN", "/stopping")
    assert "0.321 V" in ramping.text
    run.step(GuardMode.OFF, EndReason.STOP_REQUESTED)
    off = inside.get("/stopping")
    assert (heading(off), onward(off)) == ("OUTPUT AT 0 V", None)
    assert "This is no emergency stop" in off.text


def test_a_script_gets_the_same_as_data(run, inside):
    answer = inside.stop(Accept="application/json")
    assert answer.headers["content-type"] == "application/json"
    assert answer.text.startswith('{"state":"asked","text":"STOP REQUESTED.')
    run.step(GuardMode.OFF, EndReason.STOP_REQUESTED)
    assert '"state":"off"' in inside.get("/stopping", Accept="application/json").text
    assert '"state":"failed"' in inside.stop(Accept="application/json", Origin="null").text


def test_a_request_that_cannot_be_left_says_to_use_the_hardware_stop(run, inside):
    run.refuses = True
    answer = inside.stop()
    assert heading(answer) == "USE THE HARDWARE STOP"
    assert "No space left on device" in answer.text
    assert onward(answer)
    run.step(GuardMode.OFF, EndReason.FORCE_LIMIT)
    assert heading(inside.get("/stopping")) == "OUTPUT AT 0 V"


def test_a_run_that_cannot_be_read_is_asked_all_the_same(run, inside, monkeypatch):
    over = threading.Event()
    monkeypatch.setattr(server, "READ_S", 0.1)
    monkeypatch.setattr(run, "frame", over.wait)
    try:
        answer = inside.stop()
        assert heading(answer) == "USE THE HARDWARE STOP"
        assert run.stops == ["stopped on the page"]
    finally:
        over.set()


def test_a_server_that_fails_over_it_says_to_use_the_hardware_stop(run, inside, monkeypatch):
    monkeypatch.setattr(stopping.Stopping, "ask", lambda self, view: 1 / 0)
    answer = inside.stop()
    assert answer.status == 500
    assert heading(answer) == "NOT STOPPED: USE THE HARDWARE STOP"


def test_a_run_that_has_died_says_to_use_the_hardware_stop(run, inside):
    run.connected = False
    answer = inside.stop()
    assert heading(answer) == "USE THE HARDWARE STOP"
    assert "ended unexpectedly" in answer.text


def test_a_run_that_ended_with_its_output_on_says_to_use_the_hardware_stop(run, inside):
    """Its driver failed: it has told how it ended, and its last state was not 0 V."""
    run.tell({"is": "end", "text": "the driver failed"})
    run.connected = False
    answer = inside.get("/stopping")
    assert heading(answer) == "USE THE HARDWARE STOP"
    assert "the driver failed" in answer.text


def test_a_run_that_is_over_is_at_0_v(run, inside):
    run.step(GuardMode.OFF, EndReason.COMPLETED)
    run.tell({"is": "end", "text": "the plan was carried out"})
    run.connected = False
    assert heading(inside.stop()) == "OUTPUT AT 0 V"


def test_a_run_that_does_not_answer_says_to_use_the_hardware_stop(run, inside, monkeypatch):
    inside.stop()
    monkeypatch.setattr(stopping, "SILENT_S", 0.0)
    assert heading(inside.get("/stopping")) == "USE THE HARDWARE STOP"


def test_a_ramp_that_never_ends_says_to_use_the_hardware_stop(run, inside, monkeypatch):
    inside.stop()
    run.step(GuardMode.RAMPING, EndReason.STOP_REQUESTED, voltage_v=1.0)
    monkeypatch.setattr(stopping, "REST_S", -1.0)
    answer = inside.get("/stopping")
    assert heading(answer) == "USE THE HARDWARE STOP"
    assert "not at 0 V" in answer.text


def test_without_a_run_there_is_nothing_to_stop():
    with served(Latest(lambda facts: False)) as server:
        answer = Visitor(server.url).enter().stop()
        assert heading(answer) == "NO RUN IS UNDER WAY"
        assert onward(answer) is None


def test_a_recording_cannot_be_stopped_and_frightens_nobody(run, inside):
    run.refuses = True
    run.player = SimpleNamespace(replay_state=lambda: ReplayState(0.0, 1.0, playing=True, speed=1.0))
    assert heading(inside.stop()) == "THIS IS A RECORDING"


def test_the_stop_page_has_no_script_and_loads_only_style_and_icon(inside):
    answer = inside.stop()
    assert "<script" not in answer.text
    assert "onclick" not in answer.text
    assert re.findall(r'(?:src|href)="([^"]*)"', answer.text) == ["/page/icon.svg", "/page/plain.css", "/"]
    assert inside.get("/page/plain.css").headers["content-type"].startswith("text/css")


def test_what_a_run_says_of_itself_is_text_on_the_page(run, inside):
    run.step(GuardMode.OFF, EndReason.STOP_REQUESTED)
    run.tell({"is": "end", "text": '<script>alert("x")</script>'})
    assert "<script" not in inside.get("/stopping").text
    run.facts = replace(run.facts, bench="</title><script>x</script>")
    assert "</title><script>" not in inside.get("/").text


def test_a_request_for_a_run_that_has_not_begun_is_kept_for_it(run):
    begun: list[bool] = []
    kept = stopping.Stopping(expecting=lambda: True)

    def look(shown):
        if begun and shown is None:
            kept.begun(run)
        return run if begun else None

    with served(look, stopping=kept) as server:
        inside = Visitor(server.url).enter()
        assert heading(inside.get("/stopping")) == "THE RUN CANNOT BE SEEN"
        answer = inside.stop()
        assert heading(answer) == "STOP REQUESTED"
        assert onward(answer)
        assert "USE THE HARDWARE STOP" in answer.text
        begun.append(True)
        wait_until(lambda: run.stops, "the request reaches the run")
        run.step(GuardMode.OFF, EndReason.STOP_REQUESTED)
        run.tell({"is": "end", "text": "stopped on the page"})
        wait_until(lambda: heading(inside.get("/stopping")) == "OUTPUT AT 0 V", "0 V")


def test_a_file_is_the_same_by_another_spelling(tmp_path):
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "real")
    for given in ("link/run.h5", "real/../link/run.h5", "link", "real/../real"):
        wanted = chosen(tmp_path / given)._wanted
        assert wanted(facts(recording=str(tmp_path / "real" / "run.h5")))
        assert wanted(facts(recording=str(tmp_path / "link" / "run.h5")))
        assert not wanted(facts(recording=str(tmp_path / "run.h5")))
