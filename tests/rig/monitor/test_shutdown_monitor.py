"""How long a run that was asked to stop is waited for, by a clock of the test."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from rig.monitor import shutdown_monitor
from rig.monitor.shutdown_monitor import ShutdownMonitor
from rig.tick.safety.layout import GuardMode
from tests.rig.monitor.scripted import Scripted

NO_RAMP = float("nan")


class Held(Scripted):
    """A run whose output never comes down."""

    def close(self):
        """Nothing is open."""


@pytest.fixture
def followed(monkeypatch, tmp_path):
    """Begin to follow a run with this ramp; return its outcome so many seconds later."""

    def follow(ramp_s, timeout_s=None, begun=True):
        clock = SimpleNamespace(monotonic=lambda: clock.now_s, now_s=1000.0)
        run = Held()
        run.facts = replace(run.facts, limits=replace(run.facts.limits, ramp_down_s=ramp_s))
        run.step(GuardMode.RAMPING, voltage_v=0.25)
        monkeypatch.setattr(shutdown_monitor, "time", clock)
        monkeypatch.setattr(shutdown_monitor, "lives", lambda folder: True)
        monkeypatch.setattr(ShutdownMonitor, "_open", lambda self: setattr(self, "_run", run if begun else None))
        one = ShutdownMonitor(tmp_path, "stopped by a test", timeout_s)

        def after(seconds):
            clock.now_s = 1000.0 + seconds
            return one.outcome()

        return after

    return follow


@pytest.mark.parametrize(("ramp_s", "longest_s"), [(0.5, 10.5), (30.0, 40.0), (NO_RAMP, 10.0), (float("inf"), 10.0)])
def test_a_run_has_its_own_ramp_and_ten_seconds_to_be_at_0_v(followed, ramp_s, longest_s):
    after = followed(ramp_s)
    assert after(longest_s - 0.01) is None
    outcome = after(longest_s + 0.01)
    assert not outcome.at_0_v
    assert outcome.text.startswith(f"not at 0 V within {longest_s:.1f} s (guard ramping, 0.250 V, ")
    assert outcome.text.endswith(shutdown_monitor.HARDWARE)


def test_a_run_that_has_not_begun_has_ten_seconds(followed):
    after = followed(3.0, begun=False)
    assert after(9.99) is None
    assert "the request stays" in after(10.01).text


def test_a_time_of_ones_own_replaces_them(followed):
    after = followed(30.0, timeout_s=2.0)
    assert after(1.99) is None
    assert not after(2.01).at_0_v
