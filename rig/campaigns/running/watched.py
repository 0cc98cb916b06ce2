"""What is told at the start of a run to those who watch it, and of a recording to those who replay it."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import vibrolock
from rig.bench import Bench
from rig.campaigns.kinds import KINDS
from rig.campaigns.planning.plan import Plan


def watched_facts(plan: Plan, bench: Bench, recording: Path, about: Mapping[str, Any], **more: Any) -> dict[str, Any]:
    """Return what does not change while a plan is carried out on a bench, as plain data.

    ``about``: facts recorded for the part, such as the operator. Limits and ranges of the channels are in the channel's unit;
    ``limit`` is None where there is none.
    """
    limits = bench.limits
    limit = {"force": limits.force_n, "drive": limits.acceleration_m_s2, "response": limits.acceleration_m_s2}
    return {
        "version": vibrolock.__version__,
        "process": os.getpid(),
        "recording": str(recording.absolute()),
        "kind": plan.kind,
        "purpose": about.get("purpose", ""),
        "description": plan.description,
        "bench": bench.name,
        "specimen": bench.specimen.name,
        "specimen_serial": about.get("specimen_serial", ""),
        "operator": about.get("operator", ""),
        "armed": about.get("armed", {}).get("how", ""),
        "sample_rate_hz": bench.sample_rate_hz,
        "level_unit": plan.level_unit,
        "points": len(plan.targets()),
        "columns": [column._asdict() for column in KINDS[plan.kind].columns],
        "channels": [
            {
                "name": channel.name,
                "role": channel.role,
                "unit": channel.unit,
                "range": channel.range_in_unit,
                "limit": limit.get(channel.role),
            }
            for channel in bench.channels
        ],
        "limits": {
            "voltage_v": limits.voltage_v,
            "displacement_m": limits.displacement_m,
            "frequency_hz": list(limits.frequency_hz),
            "ramp_down_s": limits.ramp_down_s,
        },
        **more,
    }
