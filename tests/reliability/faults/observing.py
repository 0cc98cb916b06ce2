"""What a fault does to a test: the test is carried out with it, and what is told is compared with what was true."""

import math
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np

from rig.arming.checked_scale import CheckedScale
from rig.arming.run_options import RunOptions
from rig.bench import Bench
from rig.campaigns.running.runner import run_plan
from rig.check.run import check
from rig.recording.conversion import finalise
from rig.recording.journal import journal_path
from rig.recording.parts import Part
from rig.recording.reader import Recording
from tests.reliability.faults.devices import EmulatedRig, HostKilledError, VirtualRigInProcess
from tests.reliability.faults.plans import BLOCK, LEVELS, bench_for, plan_for
from tests.reliability.faults.plant import BrokenRig
from tests.reliability.faults.table import Fault
from tests.rig.rigs import bench_with

DEVICES = {"virtual": VirtualRigInProcess, "emulated": EmulatedRig}
SPOILT = (0.05, 0.001, 0.03)  # of a channel's true fundamental, of the modal frequency, of the damping
SEED = 3
NO_WORD = ("quantisation is not in the error bounds", "force harmonics", "the lag scatters")
"""Warnings that a sound test may have: they tell of little signal or of the structure, not of a fault."""


class Errors(NamedTuple):
    """Largest relative errors of a point: of a fundamental, of the modal frequency and of the damping."""

    fundamental: float
    frequency: float
    damping: float

    @property
    def spoil(self) -> bool:
        """Whether the point is spoilt."""
        return any(error > bound for error, bound in zip(self, SPOILT, strict=True))


@dataclass(frozen=True)
class Healthy:
    """The same test without a fault."""

    output_v: float
    force_n: float
    displacement_m: float
    middle: int
    """Sample halfway through the record of the second point."""
    warnings: tuple[tuple[str, ...], ...]
    """Of each point."""
    finished: bool


@dataclass(frozen=True)
class Observation:
    """What one fault did to one test. Samples count from the fault, or from the first one where it was there before.

    ``samples_to_trip``: until the guard no longer lets the law's output through; ``samples_to_zero``: until the plant's last
    voltage. None: not at all. ``spoilt``: accepted points without a word that no other run has, with errors beyond `SPOILT`.
    """

    output_v: float
    healthy_output_v: float
    force_n: float
    healthy_force_n: float
    displacement_m: float
    healthy_displacement_m: float
    samples_to_trip: int | None
    samples_to_zero: int | None
    last_handed_v: float
    reason: str
    tripped: bool
    text: str
    said: tuple[str, ...]
    """What there is to read: the end's text, the points' reasons, and warnings that the run without a fault has not."""
    accepted: int
    """Points accepted whose record ends after the fault began."""
    spoilt: int
    worst: tuple[float, ...]
    """Largest relative errors of fundamental, frequency and damping in those accepted."""
    raised: str
    """Exception that the user sees, if there is one."""
    closed: bool
    """Whether the recording has an end."""
    samples: int


@contextmanager
def driver(make: Any, *given: Any) -> Iterator[list[Any]]:
    """A device in place of the bench's driver; the list holds it once it has been made."""
    made: list[Any] = []

    def make_daq(bench: Any, seed: int = 0) -> Any:
        made.append(make(bench, seed, *given))
        return made[-1]

    with patch("rig.loop.session.make_daq", make_daq):
        yield made


def carried_out(levels: str, device: str, *given: Any) -> tuple[Any, "Kept", str, bool]:
    """The device, the part of the recording, what was raised, and whether the recording has an end."""
    options = RunOptions(seed=SEED, check=checked(LEVELS[levels]["bench"]))
    with tempfile.TemporaryDirectory() as folder, driver(DEVICES[device], *given) as made:
        output, raised, kept = Path(folder) / "run.h5", "", None
        try:
            with run_plan(plan_for(levels), bench_for(levels), output, options) as recording:
                kept = Kept(recording.parts[-1])
        except (Exception, HostKilledError) as error:
            raised = f"{type(error).__name__}: {error}"
        if device == "emulated":
            made[0].left_alone()
        closed = output.exists()
        if not closed:
            finalise(journal_path(output), output)
        if kept is None:
            with Recording(output) as recording:
                kept = Kept(recording.parts[-1])
        return made[0], kept, raised, closed and kept.end is not None


@cache
def checked(bench: str) -> CheckedScale | None:
    """The scale that a check of this bench has measured before the fault."""
    with tempfile.TemporaryDirectory() as folder:
        return check(bench_with({"block": BLOCK}, bench), Path(folder) / "check.h5").scale


class Kept:
    """What is looked at of a part, once its file is gone."""

    def __init__(self, part: Part) -> None:
        self.points, self.events, self.end = list(part.points), list(part.events), part.end
        self.inputs, self.theta = part.rows("inputs"), part.rows("theta_rad").astype(float)


@cache
def healthy(levels: str, device: str) -> Healthy:
    """The run without a fault."""
    daq, kept, raised, closed = carried_out(levels, device, None, 0, 0.0)
    assert not raised
    assert closed
    second = kept.points[1]
    motion = np.concatenate(daq.broken.motion)
    return Healthy(
        float(np.abs(np.concatenate(daq.handed)).max()),
        float(np.abs(motion[:, 0]).max()),
        float(np.abs(motion[:, 1]).max()),
        (second["first_sample"] + second["end_sample"]) // 20 * 10,
        tuple(tuple(point["warnings"]) for point in kept.points),
        all(point["accepted"] for point in kept.points),
    )


@cache
def observe(fault: Fault, levels: str, device: str) -> Observation:
    """Carry out the short plan of these levels with a fault."""
    whole = healthy(levels, device)
    onset = 0 if fault.onset == "start" else whole.middle
    daq, kept, raised, closed = carried_out(levels, device, fault, onset, whole.output_v)
    broken, end = daq.broken, kept.end or {}
    sent, motion, handed = (np.concatenate(part) for part in (broken.sent, broken.motion, daq.handed))
    left = [event["sample"] for event in kept.events if event["what"] == "guard" and event["state"] != "armed"]
    failed = raised or end.get("reason") in ("driver_failed", "emergency_stop")
    trip = left[0] - onset if left else (handed.size - onset if failed else None)
    driven = np.flatnonzero(sent[onset:])
    after = [point for point in kept.points if point["accepted"] and point["end_sample"] > onset]
    errors = [errors_of(point, kept, broken, bench_for(levels)) for point in after]
    news = [warnings_new(point, whole) for point in kept.points]
    silent = [error for point, error in zip(after, errors, strict=True) if not warnings_new(point, whole)]
    reasons = [point["reason"] for point in kept.points if not point["accepted"]]
    return Observation(
        output_v=float(np.abs(handed[onset:]).max(initial=0.0)),
        healthy_output_v=whole.output_v,
        force_n=float(np.abs(motion[onset:, 0]).max(initial=0.0)),
        healthy_force_n=whole.force_n,
        displacement_m=float(np.abs(motion[onset:, 1]).max(initial=0.0)),
        healthy_displacement_m=whole.displacement_m,
        samples_to_trip=None if end.get("reason") == "completed" else trip,
        samples_to_zero=int(driven[-1]) + 1 if driven.size else 0,
        last_handed_v=float(np.abs(daq.handed[-1]).max()),
        reason=end.get("reason", ""),
        tripped=bool(end.get("tripped")),
        text=end.get("text", ""),
        said=tuple(
            filter(
                None,
                [
                    raised,
                    end.get("text", ""),
                    end.get("likely_cause", ""),
                    *reasons,
                    *(line for lines in news for line in lines),
                ],
            )
        ),
        accepted=len(after),
        spoilt=sum(error.spoil for error in silent),
        worst=tuple(max(values) for values in zip(*errors, strict=True)) if errors else (0.0, 0.0, 0.0),
        raised=raised,
        closed=closed,
        samples=sent.size,
    )


def warnings_new(point: dict[str, Any], whole: Healthy) -> Sequence[str]:
    """Warnings that tell of a fault, of a kind that this point has not got without one; their first words are their kind."""
    usual = {tuple(line.split()[:4]) for line in whole.warnings[point["number"]]}
    lines = [line for line in point.get("warnings", ()) if not any(part in line for part in NO_WORD)]
    return [line for line in lines if tuple(line.split()[:4]) not in usual]


def errors_of(point: dict[str, Any], kept: Kept, broken: BrokenRig, bench: Bench) -> Errors:
    """Errors of a point's record by its readings; the fundamentals all turned alike are left out of account.

    One mode obeys ``omega_0^2 + 2 i zeta omega_0 omega = omega^2 + phi^2 F/x`` for the displacement x of the drive point, so
    that the errors of frequency and damping follow from those of ``phi^2 F/x``.
    """
    rows = slice(point["first_sample"], point["end_sample"])
    turn = np.exp(-1j * kept.theta[rows])
    told = kept.inputs[rows].astype(float)
    true = np.concatenate(broken.true)[rows] / [channel.sensitivity_v_per_unit for channel in bench.channels]
    seen = np.isfinite(told).all(axis=1)
    first, wanted = (turn[seen] @ (signal[seen] - signal[seen].mean(axis=0)) for signal in (told, true))
    together = np.vdot(first / np.abs(wanted), wanted / np.abs(wanted))
    fundamental = float((np.abs(first * together / abs(together) - wanted) / np.abs(wanted)).max())
    omega = float(np.polyfit(np.arange(seen.size), kept.theta[rows], 1)[0]) * bench.sample_rate_hz
    force, drive = bench.index_of("force"), bench.index_of("drive")
    shape = bench.specimen.drive_mode_shape or math.nan
    by_sensors, by_truth = (-(shape**2) * omega**2 * pair[force] / pair[drive] for pair in (first, wanted))
    return Errors(
        fundamental,
        abs(float((by_sensors - by_truth).real)) / (2.0 * omega**2),
        abs(float(by_sensors.imag / by_truth.imag - 1.0)),
    )
