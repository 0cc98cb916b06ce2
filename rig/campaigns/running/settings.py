"""What the loop needs to know to measure some segments of a plan on a bench."""

from rig.arming.checked_scale import CheckedScale
from rig.bench import Bench
from rig.campaigns.planning.locked import LockedPlan
from rig.campaigns.planning.plan import Plan
from rig.tick.sequencer.segments import Segment
from rig.tick.tick import TickSettings


def tick_settings(
    plan: Plan, bench: Bench, segments: tuple[Segment, ...], checked: CheckedScale | None = None
) -> TickSettings:
    """Return what a tick is built from to measure some segments of a plan; ``checked`` is the scale of the last check."""
    locked = plan if isinstance(plan, LockedPlan) else None
    return TickSettings(
        bench,
        plan.law,
        plan.amplitude_law,
        plan.settle_rule,
        segments,
        plan.waveforms(bench.sample_rate_hz),
        plan.known_plant,
        plan.retries,
        start_judged=True,
        near_limits=1.0 if locked is None else locked.near_limits,
        output_bit_v=bench.output_bit_v if locked is not None and locked.noise_shaping else 0.0,
        per_volt=None if checked is None else (checked.newtons_per_volt, checked.acceleration_per_volt),
    )
