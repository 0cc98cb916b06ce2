"""A check as one dictionary, and as a table for the terminal."""

from collections import Counter
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from rig.text.console import number, print_table
from vibrolock.printable import printable_strings

if TYPE_CHECKING:
    from rig.check.assessment import Assessment


def summary(found: "Assessment") -> dict[str, Any]:
    """Return verdict, findings and mode as a dictionary for JSON."""
    mode = found.mode
    return {
        "kind": "check",
        "bench": found.bench.name,
        "specimen": found.bench.specimen.name,
        "recording": str(found.recording),
        "verdict": found.verdict,
        "failed": list(found.failed),
        "level_rms_v": found.level_rms_v,
        "mode": None if mode is None else {"frequency_hz": mode.frequency_hz, "damping_ratio": mode.damping_ratio},
        "findings": [asdict(finding) for finding in found.findings],
    }


def say(facts: dict[str, Any]) -> None:
    """Print a `summary`: the table of findings, then what to do about them."""
    facts = printable_strings(facts)
    level = facts["level_rms_v"]
    print(f"check of {facts['specimen']} (bench {facts['bench']})" + (f", {level:.3g} V RMS" if level else ""))
    print_table(
        ("what", "channel", "verdict", "value", "unit", "allowed"),
        [
            (f["name"], f["channel"], f["verdict"], number(f["value"], ".4g"), f["unit"], f["allowed"])
            for f in facts["findings"]
        ],
    )
    for finding in facts["findings"]:
        if finding["text"] and finding["verdict"] != "ok":
            print(f"{finding['verdict']}: {' '.join((finding['name'], finding['channel'])).strip()}: {finding['text']}")
    counts = Counter(finding["verdict"] for finding in facts["findings"])
    told = ", ".join(f"{counts[v]} {v}" for v in ("ok", "warn", "fail", "not tested") if counts[v])
    print(f"{facts['verdict']}: {told}")
