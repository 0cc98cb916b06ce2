"""Findings on the calibration of the sensors, by the dates in the bench."""

from datetime import date

from rig.bench import Bench
from rig.check.findings import Finding, Verdict


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
