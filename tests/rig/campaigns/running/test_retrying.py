"""Going on after a trip: a level that tripped is tried again on request only; plans that stay below it need none."""

import shutil
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import rig
from rig.campaigns.running.tripped_level import refuse_tripped
from rig.drivers.virtual.driver import VirtualDAQ
from rig.errors import ConfigurationError
from rig.loop.loop import Loop
from rig.recording.reader import Recording
from rig.show.summary import summarise
from tests.refused import refused
from tests.rig.campaigns.running.test_runs import LEVELS, plan_with
from tests.rig.rigs import bench_with

LIMIT = {"limits": {"displacement_m": 1.0e-3}}


@pytest.fixture(scope="module")
def tripped(tmp_path_factory):
    """A recording that tripped at a level above the first."""
    output = tmp_path_factory.mktemp("tripped") / "run.h5"
    rig.run(plan_with(), bench=bench_with(LIMIT), output=output, seed=1).close()
    return output


@pytest.fixture
def output(tripped, tmp_path):
    return Path(shutil.copy(tripped, tmp_path / "run.h5"))


def level_of(output):
    with Recording(output) as recording:
        return recording.parts[0].end["tripped_at"]["level"]


def test_the_end_says_at_which_level_it_tripped_what_the_cause_was_and_what_to_do(output):
    with Recording(output) as recording:
        end, points = recording.parts[0].end, recording.points
    level = points[-1]["level"]
    assert end["tripped"]
    assert end["tripped_at"] == {"level": level, "level_unit": "V", "start": False}
    assert LEVELS.index(level) > 0
    assert end["likely_cause"].startswith(f"the point before, {points[-2]['level']:g} V, had reached ")
    assert "% of limits.displacement_m on channel acc_magnet: the level" in end["likely_cause"]
    assert end["what_to_do"].startswith("lower levels_v below ")
    assert "polarity" not in end["text"] + end["likely_cause"] + end["what_to_do"] + points[-1]["reason"]


def test_the_level_that_tripped_is_not_tried_again_unasked(output):
    before = output.read_bytes()
    level = f"{level_of(output):g} V"
    with refused(ConfigurationError, "retry-tripped", reason=lambda text: f"`plan` with levels below {level}" in text):
        rig.resume(output)
    with refused(ConfigurationError, "retry-tripped"):
        rig.resume(output, plan=plan_with(levels_v=(0.4, 0.5, level_of(output) + 0.1)))
    assert output.read_bytes() == before


def test_on_request_it_is_tried_again_and_may_trip_again(output):
    with rig.resume(output, retry_tripped=True) as run:
        assert [part.end["tripped"] for part in run.recording.parts] == [True, True]
    with refused(ConfigurationError, "retry-tripped"):
        rig.resume(output)


def test_a_plan_that_stays_below_goes_on_and_the_trip_is_not_forgotten(output):
    lower = plan_with(levels_v=(0.4, 0.5))
    with rig.resume(output, plan=lower) as run:
        assert run.complete
    with refused(ConfigurationError, "retry-tripped"):
        rig.resume(output, plan=plan_with())


def test_once_the_level_was_measured_the_trip_is_forgotten(tmp_path, monkeypatch):
    exchange, seen = VirtualDAQ._exchange, 0

    def broken(self, voltages, inputs):
        nonlocal seen
        exchange(self, voltages, inputs)
        seen += len(inputs)
        if seen > 25_000:
            inputs[:, 0] = np.nan

    plan, output = plan_with(levels_v=(0.4, 0.8)), tmp_path / "run.h5"
    with monkeypatch.context() as patch:
        patch.setattr("rig.loop.session.Loop", partial(Loop, fused=False))
        patch.setattr(VirtualDAQ, "_exchange", broken)
        with rig.run(plan, bench=bench_with({"block": 10}), output=output) as run:
            assert run.recording.parts[0].end["reason"] == "non_finite_input"
            assert run.recording.parts[0].end["tripped_at"]["level"] == 0.8
    with refused(ConfigurationError, "tripped-at"):
        rig.resume(output)
    with rig.resume(output, retry_tripped=True) as run:
        assert run.complete
    with rig.resume(output, plan=plan_with(levels_v=(0.4, 0.8, 0.9))) as run:
        assert run.complete


def test_a_file_of_an_earlier_version_tripped_where_its_last_point_failed(output, monkeypatch):
    with Recording(output) as recording:
        end = {key: value for key, value in recording.parts[0].end.items() if key != "tripped_at"}
        monkeypatch.setattr(recording.parts[0], "end", end)
        plan = plan_with()
        with refused(ConfigurationError, reason=lambda text: f"tripped at {level_of(output):g} V" in text):
            refuse_tripped(recording, plan, plan.targets())
        refuse_tripped(recording, plan, plan.targets()[:1])


def test_the_closing_lines_name_the_cause_and_offer_no_bare_resume(command, output):
    code, out, _ = command("resume run.h5 --retry-tripped")
    assert code == 1
    assert "likely cause: the point before, " in out
    assert "what to do: lower levels_v below " in out
    assert "`rig resume run.h5 --plan PLAN.toml`" in out
    assert "`rig resume run.h5 --retry-tripped`" in out
    assert "`rig resume run.h5`" not in out
    code, out, err = command("resume run.h5")
    assert (code, out) == (1, "")
    assert len(err.strip().splitlines()) == 1
    assert [part["tripped"] for part in summarise(output)["parts"]] == [True, True]
