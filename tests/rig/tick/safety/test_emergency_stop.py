"""The emergency stop as an input channel."""

import numpy as np
import pytest

import rig
from rig.bench import Bench
from rig.campaigns.backbone.plan import BackbonePlan
from rig.drivers.virtual.driver import VirtualDAQ
from rig.errors import DaqEmergencyStop
from rig.loop.loop import Loop
from rig.tick.safety.layout import EndReason, GuardMode
from tests.refused import refused
from tests.rig.campaigns.running.test_runs import plan_with
from tests.rig.check.rewired import ExtraChannelDAQ, add_channel
from tests.rig.rigs import bench_with, tick_for

SWITCH = {"name": "estop", "role": "monitor", "unit": "V", "sensitivity_v_per_unit": 1.0}


def bench(**stop) -> Bench:
    """The magnet beam with a switch on a further channel."""
    channels = [*bench_with().model_dump()["channels"], SWITCH]
    table = bench_with({"channels": channels, "block": 10}).model_dump()
    return Bench.model_validate(table | {"emergency_stop": {"channel": "estop", **stop}})


def reading(volts: float, pressed_v: float | None = None, at: int = 6003):
    """The switch's voltage, and from a sample on that of the pressed one."""

    def column(first, voltages):
        instants = first + np.arange(len(voltages))
        return np.where(instants >= at, volts if pressed_v is None else pressed_v, volts)

    return column


def run(chosen: Bench, column) -> tuple[Loop, np.ndarray]:
    with ExtraChannelDAQ(chosen, 3, column) as daq:
        daq.start(chosen.block)
        loop = Loop(daq, tick_for(chosen, chosen.block + daq.latency_samples, 0.4))
        return loop, np.concatenate(list(loop.run()))


@pytest.mark.parametrize(
    ("stop", "rest", "pressed"),
    [({"above_v": 2.5}, 0.0, 5.0), ({"below_v": 2.5}, 5.0, 0.0), ({"below_v": 2.5}, 5.0, np.nan)],
)
def test_pressed_it_is_0_v_at_once_and_stays_so(stop, rest, pressed):
    loop, rows = run(bench(**stop), reading(rest, pressed))
    guard = loop.tick.guard
    assert (guard["reason"][0], guard["mode"][0]) == (EndReason.EMERGENCY_STOP, GuardMode.OFF)
    assert guard["sample"][0] == 6003
    assert rows["guard"][6002] == GuardMode.ARMED
    assert rows["guard"][6003] == GuardMode.OFF
    assert len(rows) <= 6010  # no ramp: the run is over with the block


def test_released_it_may_stand_still_for_ever():
    loop, rows = run(bench(below_v=2.5), reading(5.0))
    assert loop.tick.guard["reason"][0] == EndReason.COMPLETED
    assert len(rows) / 5000.0 > 2 * bench(below_v=2.5).limits.stuck_s


def test_one_that_is_never_pressed_changes_no_bit():
    watched = run(bench(above_v=2.5), reading(0.0))[1]
    plain = bench_with({"block": 10})
    with VirtualDAQ(plain, 3) as daq:
        daq.start(10)
        loop = Loop(daq, tick_for(plain, 10 + daq.latency_samples, 0.4), fused=False)
        rows = np.concatenate(list(loop.run()))
    for name in rows.dtype.names:
        np.testing.assert_array_equal(watched[name][:, :4] if name == "inputs" else watched[name], rows[name])


def test_a_run_says_who_stopped_it(tmp_path, monkeypatch):
    add_channel(monkeypatch, reading(5.0, 0.0))
    plan: BackbonePlan = plan_with()
    with rig.run(plan, bench=bench(below_v=2.5), output=tmp_path / "stopped.h5") as stopped:
        end = stopped.recording.parts[-1].end
    assert (end["reason"], end["tripped"]) == ("emergency_stop", True)
    assert end["text"].startswith("emergency stop on channel estop (0 V) at sample 6003")


def test_a_device_that_stopped_by_itself_ends_the_run_for_the_same_reason(tmp_path, monkeypatch):
    def stop(first, voltages):
        if first >= 6000:
            raise DaqEmergencyStop("the device's emergency stop is pressed")
        return np.zeros(len(voltages))

    add_channel(monkeypatch, stop)
    with rig.run(plan_with(), bench=bench(above_v=2.5), output=tmp_path / "stopped.h5") as stopped:
        end = stopped.recording.parts[-1].end
    assert (end["reason"], end["tripped"]) == ("emergency_stop", True)
    assert end["text"] == "the device's emergency stop is pressed"


@pytest.mark.parametrize(
    ("stop", "message"),
    [
        ({"channel": "estop"}, {"field": "above_v, below_v", "allowed": "exactly one of the two"}),
        (
            {"channel": "estop", "above_v": 1.0, "below_v": 0.0},
            {"field": "above_v, below_v", "allowed": "exactly one of the two"},
        ),
        (
            {"channel": "drive", "above_v": 1.0},
            {
                "field": "emergency_stop.channel",
                "value": "drive",
                "allowed": "the name of a channel with role 'monitor'",
            },
        ),
    ],
)
def test_a_stop_that_is_none_is_refused(stop, message):
    with refused(ValueError, **message):
        bench(**stop)
