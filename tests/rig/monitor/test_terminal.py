"""The terminal view: what must be read from it at any size, in any state, without its colours."""

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

import rig
from rig.bench import load_bench
from rig.campaigns.plans import load_plan
from rig.campaigns.running.watched import watched_facts
from rig.live.layout import FRAME
from rig.live.reader import Frame
from rig.monitor.replay import ReplayState
from rig.monitor.shown import as_json, shown_frame
from rig.monitor.terminal import STALE_S, draw
from rig.monitor.words import event_text, figure, point_text, share_word, state_text
from rig.text.durations import duration
from rig.tick.layout import recorded_row
from rig.tick.safety.layout import EndReason, GuardMode

RATE = 5000.0
SIZES = [(80, 24), (100, 30), (140, 45), (200, 60)]


def facts():
    return watched_facts(load_plan("magnet-beam/backbone"), load_bench("magnet-beam"), Path("run.h5"), {})


def a_frame(age_s=0.02, force_n=0.5, **state):
    """Three periods of 25 Hz at 1 V with a force of an amplitude."""
    rows = np.zeros(1000, recorded_row(4))
    theta = 2.0 * np.pi * 25.0 * np.arange(rows.size) / RATE
    rows["theta_rad"] = np.mod(theta, 2.0 * np.pi)
    rows["inputs"][:, 0] = force_n * np.cos(theta)
    rows["inputs"][:, 1] = 40.0 * np.cos(theta)
    one = np.zeros((), FRAME)[()]
    for name, value in {
        "guard": GuardMode.ARMED,
        "lock": 2,
        "kind": 1,
        "channel": -1,
        "point": 3,
        "finished": 3,
        "total": 13,
        "frequency_hz": 25.0,
        "phase_error_rad": math.radians(-1.25),
        "voltage_v": 1.0,
        "level": 1.0,
        "target": 1.0743,
        "force_n": force_n,
        "displacement_m": 0.00162,
        "left_s": 215.0,
        "good_periods": 12,
        "settled_periods": 20,
        "sample": 60000,
        "part": 1,
        "late_us": (55.0, 150.0, 220.0, 900.0),
        **state,
    }.items():
        one[name] = value
    return Frame(one, rows, age_s)


def points(n):
    return [
        {
            "is": "point",
            "number": k,
            "level": 0.1 * (k + 1),
            "force_n": 0.026,
            "frequency_hz": 24.3726,
            "damping_ratio": 0.004,
            "amplitude_m": 1.144e-4,
            "quality": "good",
            "accepted": True,
        }
        for k in range(n)
    ]


def page(frame, lines, size, **how):
    width, height = size
    with open("/dev/null", "w") as nothing:  # noqa: PTH123
        console = Console(width=width, height=height, record=True, force_terminal=True, file=nothing)
        console.print(draw(shown_frame(frame, facts(), lines), facts(), lines, size=size, **how))
    return console.export_text(clear=False), console.export_html(inline_styles=True)


@pytest.mark.parametrize("size", SIZES)
def test_everything_that_matters_is_on_it_and_it_fits(size):
    lines = [{"is": "part"}, *points(3), {"is": "event", "sample": 9902, "what": "lock", "state": "locked"}]
    text, _ = page(a_frame(), lines, size)
    rows = text.splitlines()
    assert len(rows) <= size[1]
    assert all(len(row) <= size[0] for row in rows)
    assert "S E T T L I N G" in text
    assert "point 4 of 13" in text
    assert "3 min 35 s left" in text
    assert re.search(r"frequency +25\.0000 Hz", text)
    assert re.search(r"phase error +-1\.25 deg", text)
    assert re.search(r"force +0\.5000 N", text)
    assert re.search(r"displacement +1\.6200 mm", text)
    assert re.search(r"voltage +1\.0000 V", text)
    assert re.search(r"level +1 V, to 1\.074 V", text)
    assert re.search(r"settled +12 of 20 periods █+░+", text)
    assert re.search(r"output limit +█+░* +11 % ok +1 of 9\.5 V", text)
    assert re.search(r"3 +0\.3 +0\.0260 +24\.3726", text)
    assert "2.0 s lock: locked" in text


@pytest.mark.parametrize("size", [(40, 10), (20, 5), (120, 8)])
def test_in_a_terminal_that_is_too_small_the_state_comes_first(size):
    lines = [*points(9), {"is": "event", "sample": 9902, "what": "lock", "state": "locked"}]
    text, _ = page(a_frame(), lines, size)
    top = "".join(text.splitlines()[: size[1]])
    assert "S E T T L I N G" in top


def test_a_limit_that_is_near_or_passed_has_a_word():
    text, _ = page(a_frame(force_n=29.0), [], (80, 24))
    assert re.search(r"force limit +█+░+ +85 % close +29 of 34 N", text)
    text, _ = page(a_frame(force_n=35.0), [], (80, 24))
    assert re.search(r"force limit +█+ +103 % OVER +35 of 34 N", text)


def test_a_trip_says_channel_value_and_cause():
    tripped = a_frame(guard=GuardMode.RAMPING, reason=EndReason.FORCE_LIMIT, channel=0, value=34.6)
    text, _ = page(tripped, [], (80, 24))
    assert "T R I P P E D" in text
    assert "force above its limit on channel force: 34.6 N" in text
    assert "OUTPUT AT 0 V" not in text
    text, _ = page(a_frame(guard=GuardMode.OFF, reason=EndReason.FORCE_LIMIT), [{"is": "end", "text": "why"}], (80, 24))
    assert "T R I P P E D" in text
    assert "OUTPUT AT 0 V" in text
    assert "why" in text


def test_data_that_is_stale_is_grey_and_says_so():
    fresh, bright = page(a_frame(age_s=STALE_S - 0.05), [], (80, 24))
    assert "STALE" not in fresh
    text, html = page(a_frame(age_s=3.2), [], (80, 24))
    assert "STALE DATA, data of 3 s ago" in text
    assert "(last: settling)" in text
    body = html.split("STALE DATA")[1]
    assert "#808080" in body  # grey50
    assert html != bright


def test_a_run_that_has_died_wants_the_hardware_stop_and_one_that_is_over_does_not():
    text, _ = page(a_frame(), [], (80, 24), connected=False)
    assert "NOT CONNECTED: USE THE HARDWARE STOP" in text
    over = a_frame(guard=GuardMode.OFF, reason=EndReason.COMPLETED)
    text, _ = page(over, [{"is": "end", "text": "the plan was carried out"}], (80, 24), connected=False)
    assert "HARDWARE" not in text
    assert "the plan was carried out" in text


def test_before_the_first_frame_it_says_that_nothing_is_known():
    text, _ = page(None, [], (80, 24))
    assert "S T A R T I N G" in text


def test_a_replay_says_where_it_stands():
    replay = ReplayState(12.0, 60.0, playing=False, speed=5.0)
    text, _ = page(a_frame(age_s=0.0), [], (80, 24), replay=replay)
    assert re.search(r"REPLAY +12\.0 of 60\.0 s ━+─+ PAUSED", text)


def test_what_others_wrote_cannot_move_the_cursor():
    lines = [{"is": "event", "sample": 0, "text": "\x1b[2Jgone"}, {"is": "end", "text": "\x1b[31mred"}]
    text, _ = page(a_frame(), lines, (140, 45))
    assert "\x1b" not in text
    assert "\\x1b[2Jgone" in text
    assert "\x1b" not in point_text({**points(1)[0], "reason": "\x1b[2J"}, facts())
    assert "\x1b" not in state_text(shown_frame(a_frame(), facts(), lines), facts())
    assert event_text(lines[0], facts()) == "0.0 s \\x1b[2Jgone"


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.4, "0 s"), (99.0, "99 s"), (215.0, "3 min 35 s"), (7500.0, "2 h 5 min"), (math.nan, "? s"), (-1.0, "0 s")],
)
def test_times_are_said_as_people_say_them(seconds, text):
    assert duration(seconds) == text


def test_numbers_that_are_not_known_are_dashes_and_shares_are_words():
    assert figure(math.nan, ".3f") == "-"
    assert [share_word(share) for share in (0.1, 0.8, 1.0, math.nan)] == ["ok", "close", "OVER", "-"]


@pytest.mark.slow
@pytest.mark.parametrize("plan", ["magnet-beam/multisine-1", "magnet-beam/stepped-sine-up"])
def test_points_of_other_kinds_have_their_own_columns(plan, tmp_path):
    kind = watched_facts(load_plan(plan), load_bench("magnet-beam"), Path("run.h5"), {})
    with rig.run(load_plan(plan).model_copy(update={"bench": "magnet-beam"}), output=tmp_path / "run.h5") as run:
        point = json.loads(json.dumps(as_json(run.recording.points[0])))
    text = point_text(point, kind)
    assert text.startswith("point 1  ")
    assert text.endswith(str(point["quality"]))
    assert len(text.split()) > 8
