"""What is told at the start of a run to those who watch it, and of a recording to those who replay it."""

import os
from collections.abc import Mapping
from pathlib import Path

import vibrolock
from rig.bench import Bench
from rig.campaigns.kinds import KINDS
from rig.campaigns.planning.plan import Plan
from rig.live.facts import ChannelFacts, LimitFacts, RunFacts, text_in


def watched_facts(
    plan: Plan, bench: Bench, recording: Path, about: Mapping[str, object], started: str = ""
) -> RunFacts:
    """Return what does not change while a plan is carried out on a bench.

    ``about``: facts recorded for the part, such as the operator.
    """
    limits = bench.limits
    limit = {"force": limits.force_n, "drive": limits.acceleration_m_s2, "response": limits.acceleration_m_s2}
    armed = about.get("armed")
    return RunFacts(
        version=vibrolock.__version__,
        process=os.getpid(),
        recording=str(recording.absolute()),
        started=started,
        kind=plan.kind,
        purpose=text_in(about, "purpose"),
        description=plan.description,
        bench=bench.name,
        specimen=bench.specimen.name,
        specimen_serial=text_in(about, "specimen_serial"),
        operator=text_in(about, "operator"),
        armed=text_in(armed, "how") if isinstance(armed, dict) else "",
        sample_rate_hz=bench.sample_rate_hz,
        level_unit=plan.level_unit,
        points=len(plan.targets()),
        columns=KINDS[plan.kind].columns,
        channels=tuple(
            ChannelFacts(
                name=channel.name,
                role=channel.role,
                unit=channel.unit,
                range=channel.range_in_unit,
                limit=limit.get(channel.role),
            )
            for channel in bench.channels
        ),
        limits=LimitFacts(
            voltage_v=limits.voltage_v,
            displacement_m=limits.displacement_m,
            frequency_hz=limits.frequency_hz,
            ramp_down_s=limits.ramp_down_s,
        ),
    )
