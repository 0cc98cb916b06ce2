"""Summary of a check: its content as JSON and as a table for the terminal."""

from collections import Counter
from typing import TYPE_CHECKING, Literal

from pydantic import BaseModel

from rig.check.findings import Finding
from rig.text.console import number, print_table
from vibrolock.printable import printable_strings

if TYPE_CHECKING:
    from rig.check.assessment import Assessment


class CheckedMode(BaseModel):
    """Mode under test, as a check has found it."""

    frequency_hz: float
    damping_ratio: float


class CheckSummary(BaseModel):
    """Verdict, findings and mode of a check."""

    kind: Literal["check"] = "check"
    bench: str
    specimen: str
    recording: str
    verdict: Literal["passed", "failed"]
    failed: list[str]
    level_rms_v: float | None
    mode: CheckedMode | None
    findings: list[Finding]


def summary(found: "Assessment") -> CheckSummary:
    """Return verdict, findings and mode."""
    mode = found.mode
    return CheckSummary(
        bench=found.bench.name,
        specimen=found.bench.specimen.name,
        recording=str(found.recording),
        verdict=found.verdict,
        failed=list(found.failed),
        level_rms_v=found.level_rms_v,
        mode=None if mode is None else CheckedMode(frequency_hz=mode.frequency_hz, damping_ratio=mode.damping_ratio),
        findings=list(found.findings),
    )


def print_summary(found: CheckSummary) -> None:
    """Print the table of findings, then what to do about them."""
    facts = CheckSummary.model_validate(printable_strings(found.model_dump()))
    level = facts.level_rms_v
    print(f"check of {facts.specimen} (bench {facts.bench})" + (f", {level:.3g} V RMS" if level else ""))
    print_table(
        ("what", "channel", "verdict", "value", "unit", "allowed"),
        [(f.name, f.channel, f.verdict, number(f.value, ".4g"), f.unit, f.allowed) for f in facts.findings],
    )
    for finding in facts.findings:
        if finding.text and finding.verdict != "ok":
            print(f"{finding.verdict}: {finding.label}: {finding.text}")
    counts = Counter(str(finding.verdict) for finding in facts.findings)
    parts = ", ".join(f"{counts[v]} {v}" for v in ("ok", "warn", "fail", "not tested") if counts[v])
    print(f"{facts.verdict}: {parts}")
