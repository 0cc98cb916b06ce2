"""A run that does what a test says, as it is watched: no loop, no files."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from controller import LockState
from rig.campaigns.plans import bench_of, load_plan
from rig.campaigns.running.watched import watched_facts
from rig.live.layout import FRAME, bin_dtype
from rig.live.reader import Frame
from rig.tick.layout import recorded_row
from rig.tick.safety.layout import EndReason, GuardMode
from rig.tick.sequencer.layout import Drive, SegmentKind

PLAN = "magnet-beam/backbone"
PERIODS, ROWS_PER_PERIOD = 4, 200
CHANNELS = 4
FORCE = 0


class Told:
    """A view of a run that settles at its third level, until a test says something else."""

    generation = 0
    player = None

    def __init__(self, process=1):
        plan = load_plan(PLAN)
        about = {"operator": "Ada", "specimen_serial": "no. 7", "armed": {"how": "virtual"}}
        facts = watched_facts(plan, bench_of(plan, PLAN), Path("/nowhere/told.h5"), about, "2026-01-01T00:00:00+00:00")
        self.facts = replace(facts, process=process)
        self.connected = True
        self.causes = []
        self.age_s = 0.0
        self._lines = [{"is": "part", "first_sample": 0}]
        self._bins = np.zeros(0, bin_dtype(CHANNELS))
        self._state = np.zeros(1, FRAME)
        self.say(
            part=1, lock=LockState.LOCKED, guard=GuardMode.ARMED, channel=-1, kind=SegmentKind.SETTLE, drive=Drive.LOOP,
            point=2, finished=2, total=len(plan.targets()), level=0.39, target=0.3923, frequency_hz=24.3841,
            phase_error_rad=0.01, voltage_v=0.3923, force_n=0.06, drive_m_s2=6.19, displacement_m=2.64e-4, good_periods=7,
            settled_periods=20, left_s=83.0, late_us=(70.0, 130.0, 250.0, 900.0),
        )  # fmt: skip
        self._window = _waves()

    def say(self, **values):
        """Change fields of the frame."""
        state = self._state.copy()
        for name, value in values.items():
            state[name] = value
        state["sample"] += 1
        state["window"] = PERIODS * ROWS_PER_PERIOD
        self._state = state

    def tell(self, **line):
        """Add a line."""
        self._lines = [*self._lines, line]

    def measure(self, number, **more):
        """Add a point."""
        more = {"quality": "good", "accepted": True, "reason": "", "warnings": [], **more}
        more |= {"level": 0.1 * (1 + number), "level_unit": "V", "end_sample": 5000 * (1 + number)}
        more |= {"amplitude_m": 1e-4 * (1 + number), "force_n": 0.02 * (1 + number)}
        more |= {"frequency_hz": 24.4 + 0.05 * number, "modal_frequency_std_hz": 0.01}
        more |= {"damping_ratio": 0.004 + 1e-5 * number, "damping_ratio_std": 4e-6}
        self.tell(**{"is": "point", "number": number, "phase_error_deg": 0.01, "force_purity": 0.98, **more})

    def trace(self, count):
        """Add bins of a tenth of a second."""
        bins = np.zeros(count, bin_dtype(CHANNELS))
        first = self._bins.size
        bins["end_s"] = 0.1 * (1 + first + np.arange(count))
        bins["part"], bins["lock"], bins["guard"] = 1, LockState.LOCKED, GuardMode.ARMED
        bins["frequency_hz"], bins["voltage_v"] = [24.3, 24.4], [0.0, 0.39]
        bins["inputs"] = [-0.06, 0.06]
        self._bins = np.concatenate([self._bins, bins])

    def trip(self):
        """Trip on the force."""
        self.say(guard=GuardMode.RAMPING, reason=EndReason.FORCE_LIMIT, channel=FORCE, value=35.2)

    def end(self, text="stopped by request", reason=EndReason.STOP_REQUESTED):
        """Bring the output to 0 V and say why."""
        self.say(guard=GuardMode.OFF, reason=reason, voltage_v=0.0)
        self.tell(**{"is": "end", "text": text, "tripped": reason.is_trip, "completed": False})

    def frame(self):
        state = self._state
        return Frame(state[0], self._window, self.age_s)

    def bins(self, first):
        return first, self._bins[first:]

    def lines(self, first):
        return self._lines[first:]

    def close(self):
        """Do nothing."""

    def request_stop(self, cause):
        """Ramp down; a test says when the output is at 0 V."""
        self.causes.append(cause)
        self.say(guard=GuardMode.RAMPING, reason=EndReason.STOP_REQUESTED)


def _waves():
    """Rows of whole periods of a sine, the force with a second harmonic."""
    rows = np.zeros(PERIODS * ROWS_PER_PERIOD, recorded_row(CHANNELS))
    theta = 2.0 * math.pi * np.arange(rows.size) / ROWS_PER_PERIOD
    rows["theta_rad"] = theta % (2.0 * math.pi)
    rows["output_v"] = 0.3923 * np.cos(theta)
    rows["inputs"] = 6.0 * np.sin(theta)[:, None]
    rows["inputs"][:, FORCE] = 0.06 * np.cos(theta) + 0.02 * np.cos(2.0 * theta)
    return rows
