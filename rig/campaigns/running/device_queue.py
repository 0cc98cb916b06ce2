"""The queue of a run's device: settled before the run is armed, checked against the plan's gains, recorded."""

from collections.abc import Set

from rig.arming.arming import armed
from rig.arming.run_options import RunOptions
from rig.bench import Bench
from rig.campaigns.planning.plan import Plan
from rig.campaigns.running.settings import tick_settings
from rig.loop.on_device import record_sizes
from rig.loop.session import Session
from rig.loop.worker.queue_choice import QueueChoice, usual_delay_s
from rig.recording.stored import About, StoredTable


def armed_with_queue(
    plan: Plan, bench: Bench, session: Session, options: RunOptions, done: Set[int]
) -> tuple[StoredTable, QueueChoice | None]:
    """Arm the bench and settle the queue of its device; return both. ``done``: points of the plan that are not measured.

    The queue is settled before, so that a person arms what will run; where the device has something latched, which only an
    armed run clears, after. Raises `ConfigurationError` for gains that do not bear the delay.
    """
    first = not session.latched
    choice = settled_queue(plan, bench, session, options, done) if first else None
    arming = armed(bench, session, options.about.purpose or plan.kind, options.arm)
    return arming, choice if first else settled_queue(plan, bench, session, options, done)


def settled_queue(
    plan: Plan, bench: Bench, session: Session, options: RunOptions, done: Set[int]
) -> QueueChoice | None:
    """Settle the queue of a session's device, say which, and check the plan's gains against the delay.

    A multisine of a check or a tuning measures the delay that a closed loop will have, and gets the queue of one. Where it does
    not fit into a device that is to run the loop, the computer does, also where a plan would be refused.
    """
    feedback = plan.feedback or bool(options.about.purpose)
    usual_s = usual_delay_s(bench)
    delay_s = plan.longest_delay_s(bench, usual_s) if plan.feedback else usual_s
    sizes = None
    if session.identity.get("loop") == "device":
        segments = plan.segments(bench.sample_rate_hz, frozenset(done))
        sizes = record_sizes(tick_settings(plan, bench, segments).build(0.0).arrays)
    may_change = bool(options.about.purpose)
    choice = session.settle_queue(feedback=feedback, delay_s=delay_s, sizes=sizes, may_change=may_change)
    if choice is not None:
        if choice.note:
            options.progress.remark(choice.note)
        if choice.remark:
            options.progress.remark(choice.remark)
        delay_samples = bench.block + choice.latency_samples
        plan.check_delay(bench, delay_samples)
        if late := plan.remark_on_delay(bench, delay_samples / bench.sample_rate_hz):
            options.progress.remark(late)
    return choice


def with_queue(facts: About, choice: QueueChoice | None) -> About:
    """Return what is recorded of a part, with the queue and the line on it in place of those of an earlier part."""
    if choice is None:
        return facts
    before = [facts.get("queue", {}).get(name) for name in ("text", "note")]
    remarks = [remark for remark in facts["remarks"] if remark not in before]
    told = {name: value for name, value in choice._asdict().items() if name != "note" or value}
    return {**facts, "queue": told, "remarks": [*filter(None, [choice.note, choice.remark]), *remarks]}
