"""The controls of a replay, in a real browser."""

import pytest

from rig.monitor.replay import ReplayState
from tests.rig.monitor.browser.told import Told

ESCAPE = "\ue00c"


class Replayed(Told):
    """A recording that is replayed: it keeps what it is asked for."""

    def __init__(self):
        super().__init__()
        self.player = self
        self.state = {"time_s": 20.0, "duration_s": 62.0, "playing": True, "speed": 5.0}
        self.asked = []

    def replay_state(self):
        return ReplayState(**self.state)

    def control(self, action, value):
        self.asked.append((action, value))
        self.state |= {"pause": {"playing": False}, "play": {"playing": True}}.get(action, {})
        self.state |= {"seek": {"time_s": value}, "speed": {"speed": value}}.get(action, {})


@pytest.fixture
def shown():
    return [Replayed()]


@pytest.fixture
def replay(browser, serve, shown):
    browser.open(serve(lambda before: shown[0]))
    browser.shows("connection", "replay")
    return browser


def choose(browser, name, value):
    """Set a control as a person does."""
    browser.run(
        """const control = document.getElementById(arguments[0]);
        control.value = arguments[1];
        control.dispatchEvent(new Event("input"));
        control.dispatchEvent(new Event("change"));""",
        name,
        value,
    )


def test_a_replay_is_paused_goes_on_jumps_and_changes_its_speed(replay, shown):
    view = shown[0]
    replay.shows("replay-time", "0:20 min of 1:02 min")
    replay.click("replay-play")
    replay.shows("replay-play", "play")
    replay.until(lambda: replay.text("replay-play") == "play")
    replay.click("replay-play")
    replay.until(lambda: replay.text("replay-play") == "pause", "it goes on")
    choose(replay, "replay-seek", "41.5")
    replay.shows("replay-time", "0:42 min of 1:02 min")
    choose(replay, "replay-speed", "20")
    replay.until(lambda: view.state["speed"] == 20.0, "another speed")
    assert [action for action, _ in view.asked] == ["pause", "play", "seek", "speed"]
    assert view.asked[2] == ("seek", 41.5)


def test_a_replay_says_that_nothing_moves_and_has_no_stop(replay, shown):
    replay.shows("detail", "nothing moves")
    assert not replay.driver.find_element("id", "stop").is_displayed()
    replay.press(ESCAPE)
    replay.shows("replay-time", "0:20")
    assert shown[0].causes == []


def test_where_a_run_begins_after_a_replay_stop_comes_back(replay, shown):
    shown[0] = Told()
    replay.shows("connection", "live")
    replay.until(lambda: replay.driver.find_element("id", "stop").is_displayed(), "STOP")
    assert not replay.driver.find_element("id", "replay").is_displayed()
    replay.press(ESCAPE)
    replay.shows("stopping", "RAMPING DOWN")
