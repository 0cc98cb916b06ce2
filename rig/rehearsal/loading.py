"""What a worker loads before its first twin. This module imports nothing of it by itself."""

from vibrolock.collecting import collect_rarely

PLAN = "magnet-beam/backbone"
"""Shipped plan whose lowest level is run."""


def load() -> None:
    """Load the modules and the compiled code that twins need, by one level of a shipped plan on its own rig."""
    collect_rarely()
    from rig.bench import load_bench
    from rig.campaigns.backbone.plan import BackbonePlan
    from rig.campaigns.plans import load_plan
    from rig.rehearsal.rehearsal import RehearsalRequest

    plan = load_plan(PLAN)
    assert isinstance(plan, BackbonePlan)
    assert plan.levels_v is not None
    lowest = plan.model_copy(update={"levels_v": plan.levels_v[:1]})
    RehearsalRequest(plan=lowest, bench=load_bench(plan.bench))(0)
