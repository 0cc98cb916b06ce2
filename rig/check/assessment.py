"""Derive the findings of a check from its recording, with or without an earlier check as reference."""

from dataclasses import dataclass
from datetime import date
from itertools import zip_longest
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from identification import IdentificationError
from rig.arming.checked_scale import CheckedScale
from rig.bench import Bench
from rig.bench.cross_checks import objections
from rig.campaigns.evaluation.recorded import points_of
from rig.campaigns.multisine.plan import MultisinePlan
from rig.campaigns.multisine.points import spectra_of
from rig.campaigns.plans import plan_from
from rig.check.findings import Finding, Verdict, is_check, not_tested
from rig.check.judging import driven_findings, latency_findings
from rig.check.reference import reference_findings
from rig.check.resolution import resolution_findings
from rig.check.responses import Mode, Responses, responses_of, scale_of
from rig.check.silence import silent_findings
from rig.errors import RecordingError
from rig.measurements import bench_of_recording
from rig.recording.reader import Recording
from rig.tick.safety.layout import EndReason
from vibrolock.arrays import Float
from vibrolock.results import Result

SKIPPED = 0.1  # part of the silence that is left out at its beginning, because of the transient of the filters; chosen
CUT_SHORT = "the multisine was not played to its end"


@dataclass(frozen=True, eq=False)
class Assessment(Result):
    """Result of a check."""

    bench: Bench
    """The bench as it was recorded."""
    recording: Path
    """Path of the recording."""
    at: str
    """Begin of the check, ISO 8601."""
    level_rms_v: float | None
    """Level of the multisine that was evaluated, V RMS."""
    findings: tuple[Finding, ...]
    """Findings, good and bad."""
    responses: Responses | None
    """Measured responses; None if the run was cut short."""
    mode: Mode | None
    """The mode under test."""
    reference: Responses | None
    """Responses of the reference check; None if there is no reference."""

    @property
    def scale(self) -> CheckedScale | None:
        """Motion per newton and per volt at resonance, with which runs compare theirs; None if the check does not tell them."""
        return None if self.responses is None else scale_of(self.bench, self.responses, self.mode, self.at)

    @property
    def verdict(self) -> Literal["passed", "failed"]:
        """``failed`` if any finding has failed."""
        return "failed" if self.failed else "passed"

    @property
    def failed(self) -> tuple[str, ...]:
        """Labels of the findings that failed."""
        return tuple(finding.label for finding in self.findings if finding.verdict == "fail")


def assess(recording: Recording, reference: Recording | None = None) -> Assessment:
    """Return the findings of a recorded check; raise `RecordingError` if a recording is not that of a check."""
    bench = bench_of_recording(recording)
    plan = _plan(recording)
    findings = [
        *_how_it_ended(recording, bench),
        *(Finding("limits", "", "warn", one.value, one.unit, one.allowed, str(one)) for one in objections(bench)),
        *calibration_findings(bench, recording.started[:10]),
        *silent_findings(bench, _silence(recording, bench)),
    ]
    found = responses_in(recording)
    old = None if reference is None else responses_in(reference)
    mode = None
    if found is None:
        findings.append(not_tested("responses", CUT_SHORT))
    else:
        driven, mode = driven_findings(bench, found)
        lead_samples = float(recording.parts[-1].information.get("about", {}).get("lead_samples", 0.0))
        findings += [*driven, *latency_findings(bench, found, lead_samples % 1.0)]
        dead = {f.channel for f in driven if f.name == "life" and f.verdict == "fail"}
        if old is not None:
            findings += reference_findings(bench, found, old, dead)
    if reference is None:
        text = "no reference was given: drive polarity, volts to newtons and slow changes are not checked"
        findings.append(not_tested("reference", text))
    level = plan.levels_rms_v[-1] if found is not None else None
    if level is not None:
        findings += resolution_findings(bench, level, _driven_rows(recording))
    findings += _clipping(recording, bench, level)
    return Assessment(bench, recording.path, recording.started, level, tuple(findings), found, mode, old)


def calibration_findings(bench: Bench, day: str) -> list[Finding]:
    """Return a finding for each channel that states when its calibration is due; ``day`` of the check is YYYY-MM-DD.

    An overdue calibration is a warning; with ``[arming] require_calibration`` it fails.
    """
    overdue: Verdict = "fail" if bench.arming.require_calibration else "warn"
    out = []
    for channel in bench.channels:
        if not channel.calibration_due:
            continue
        left = (date.fromisoformat(channel.calibration_due) - date.fromisoformat(day)).days
        sensor = f", of sensor {channel.serial_number}" if channel.serial_number else ""
        text = f"was due on {channel.calibration_due}{sensor}: have it calibrated" if left < 0 else ""
        verdict: Verdict = overdue if left < 0 else "ok"
        out.append(Finding("calibration", channel.name, verdict, float(left), "days left", "from 0", text))
    return out


def checked_scale(path: Path, bench: Bench) -> CheckedScale:
    """Return the scale of force and motion from the recording of a check of this bench.

    Raises `RecordingError` if it is not the recording of a check, is of other channels, or does not tell the scale.
    """
    with Recording(path) as recording:
        found = assess(recording)
    for one, other in zip_longest(found.bench.channels, bench.channels):
        if one != other:
            name = (one or other).name if one or other else ""
            raise RecordingError(f"{path}: is a check of other channels than those of the bench {bench.name} ({name})")
    if found.scale is None:
        raise RecordingError(f"{path}: the check does not tell the scale of force and motion: no mode was found in it")
    return found.scale


def _clipping(recording: Recording, bench: Bench, level_rms_v: float | None) -> list[Finding]:
    """Note that amplifier and shaker were not tested above the voltage that was played."""
    if level_rms_v is None:
        return []
    part = recording.parts[-1]
    peak_v = float(np.abs(part.rows("output_v")).max(initial=0.0))
    text = (
        f"played were up to {peak_v:.2g} V of the {bench.limits.voltage_v:g} V allowed; an amplifier or shaker "
        "that clips above that lowers the force purity of a run's points"
    )
    return [Finding("clipping", "", "not tested", peak_v, "V", f"up to {bench.limits.voltage_v:g}", text)]


def responses_in(recording: Recording) -> Responses | None:
    """Return the responses to the multisine of a check; None if it was not played to its end."""
    if not is_check(recording):
        raise RecordingError(f"{recording.path}: is not the recording of a check")
    bench, plan = bench_of_recording(recording), _plan(recording)
    points = [point for point in points_of(recording) if point.rows is not None]
    if not points or points[-1].rows is None:
        return None
    try:
        return responses_of(bench, spectra_of(bench, plan, {points[-1].realisation or 0: _driven_rows(recording)}))
    except IdentificationError:
        return None


def _driven_rows(recording: Recording) -> NDArray[np.void]:
    """Return the rows of the last multisine, which was played to its end."""
    rows = next(point.rows for point in reversed(points_of(recording)) if point.rows is not None)
    return recording.parts[-1].read(rows.first_sample, rows.end_sample)


def _plan(recording: Recording) -> MultisinePlan:
    plan = plan_from(recording.configuration["plan"], f"{recording.path}: plan")
    if not isinstance(plan, MultisinePlan):
        raise RecordingError(f"{recording.path}: is not the recording of a check")
    return plan


def _silence(recording: Recording, bench: Bench) -> Float:
    """Return the readings before the first realisation, [n, n_channels]."""
    first = recording.plans[0].plan
    samples = round(float(first.get("silent_s", 0.0)) * bench.sample_rate_hz)
    part = recording.parts[0]
    stop = min(samples, part.n_rows)
    return np.asarray(part.read(min(round(SKIPPED * samples), stop), stop)["inputs"])


def _how_it_ended(recording: Recording, bench: Bench) -> list[Finding]:
    """Return a finding with the channel that tripped if the run ended early."""
    end = recording.parts[-1].end
    if end is None:
        return [Finding("run", "", "fail", text="the recording was cut short")]
    if end["reason"] == EndReason.COMPLETED.name.lower():
        return []
    name = next((c.name for c in bench.channels if f"channel {c.name} " in f"{end['text']} "), "")
    label = "life" if end["reason"] == EndReason.SENSOR_STUCK.name.lower() else "run"
    return [Finding(label, name, "fail", text=end["text"])]
