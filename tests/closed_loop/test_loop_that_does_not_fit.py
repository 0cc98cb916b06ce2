"""Where the loop of a bench cannot run on its device: refused with the sum, or run on the computer, with a note."""

import pytest

import rig
from rig.bench import load_bench
from rig.check.run import check
from rig.emulator.emulated import emulated
from rig.errors import DaqRefused
from rig.recording.reader import Recording
from tests.firmware.building import built_with_loop
from tests.recorded import changed
from tests.refused import refused

BENCH = load_bench("magnet-beam").model_copy(update={"block": 10})
AT_EVERY_SAMPLE = BENCH.model_copy(update={"block": 1})
PLAN = changed("magnet-beam/backbone", levels_v=[0.4], record_periods=4, settle={"average_periods": 2})
ROOM = 18_000
"""Bytes that do for no plan."""
SLOW = {"fd": True, "data_bitrate": 2_000_000}


def reaching(loop, wire="serial", room=None, bench=BENCH, **settings):
    firmware = built_with_loop("host", room)
    return emulated(bench, wire, firmware=firmware, options={"loop": loop}, **settings)


def require_on_the_computer(recording, because):
    about = recording.parts[0].information["about"]
    (note,) = [text for text in about["remarks"] if text.startswith("the loop runs on the computer: ")]
    assert because in note
    assert about["queue"]["note"] == note
    assert "loop" not in about["device"]


@pytest.mark.slow
def test_a_plan_that_does_not_fit_is_refused_with_the_sum_or_run_by_the_computer(tmp_path):
    output = tmp_path / "run.h5"
    with reaching("device", room=ROOM) as bench, refused(DaqRefused, "takes-more-than-there-is-room"):
        rig.run(PLAN, bench=bench, output=output)
    assert not output.exists()
    with reaching("auto", room=ROOM) as bench, rig.run(PLAN, bench=bench, output=output) as run:
        assert run.recording.points[0]["accepted"]
        require_on_the_computer(run.recording, f"it has room for {ROOM}")


@pytest.mark.parametrize(
    ("settings", "says"),
    [({"fd": False}, "5000 Hz x 48 bytes = 1.92 Mbit/s"), (SLOW, "would take 155 % of the wire")],
    ids=["classical", "slow"],
)
def test_a_bus_that_does_not_carry_the_rows_is_refused_with_the_sum_or_the_computer_runs_the_loop(
    settings, says, tmp_path
):
    with reaching("device", "can", bench=AT_EVERY_SAMPLE, **settings) as bench, pytest.raises(DaqRefused, match=says):
        rig.run(PLAN, bench=bench, output=tmp_path / "none.h5")
    with (
        reaching("auto", "can", **settings) as bench,
        rig.run(PLAN, bench=bench, output=tmp_path / "run.h5") as run,
    ):
        require_on_the_computer(run.recording, says)


@pytest.mark.slow
def test_a_check_that_does_not_fit_is_made_by_the_computer_where_a_plan_would_be_refused(tmp_path):
    output = tmp_path / "check.h5"
    with reaching("device", room=ROOM) as bench:
        check(bench, output, level_rms_v=0.1)
    with Recording(output) as recording:
        require_on_the_computer(recording, "waveforms")
