"""What is asked of a test with a fault: bounds as data, and what an observation says against them.

Asked always: the output stays below twice what the test needs, true force and motion below the bench's limits (and a
quarter, which a ramp may take), what ends goes to 0 V within its ramp and hands 0 V over, the recording is closed, and nothing
spoilt is accepted without a word. Where a fault would do harm, or leaves nothing to measure, the run ends as well, in time and
in words.
"""

from typing import NamedTuple

from rig.bench import Bench
from tests.reliability.faults.matrix import Case
from tests.reliability.faults.observing import Observation
from tests.reliability.faults.plans import plan_for
from tests.reliability.faults.table import Fault

OUTPUT_RATIO, OUTPUT_EXTRA_V = 2.0, 0.1
FADED = {"middle": 3.5, "start": 5.5}
"""Of what is held: a run ends at three times the output of a level; what fades from the start has faded by its first level."""
LIMIT_RATIO = 1.25  # beyond it the guard drops what it began to ramp
TO_ZERO_SAMPLES = 50  # beside the ramp: a block and the queue
FIRST_LEVEL = 1.01  # what is broken from the start ends at the first level in volts, before the first rise
ZERO_V = 1e-3
WATCHDOG_SAMPLES = 800  # of a device without a host: 0.1 s, its ramp of 0.05 s, and a block

HELD_PERIODS = 40.0
"""In which a fault is noticed that drives a loop which holds a force or a response."""
VOLTAGE_PERIODS = 120.0
"""The same with levels in volts, where nothing rises."""
AT_ONCE_S = 0.01
STUCK_S = 0.6
STUCK_FROM_START_S = 2.5  # a dead channel is looked for once a level is held
DRIVER_S = 0.5

AT_ONCE = ("over-range", "nan", "1e30", "nan-block", "times-out", "raises", "emergency-stop")
DRIVER = ("loses-all", "unplugged", "silent", "deaf", "reset", "drops-all")
BLIND = ("open", "reversed", "repeats", "dead", "held")
"""After which nothing can be controlled any more."""
RAISES_OUTPUT = ("x0.1", "clipped")
"""After which a loop has to ask for more, or for a part of the amplifier's range that is not there."""


class Bound(NamedTuple):
    """What is asked of one case. ``trip_s``: time in which the run is to end, None where it may go on."""

    output_v: float | None
    trip_s: float | None
    words: tuple[str, ...]
    may_spoil: bool


def held_role(levels: str) -> str:
    """Role of the channel whose amplitude a loop holds; empty for levels in volts."""
    return {"V": "", "N": "force", "m": "drive"}[levels.replace(",", "").split()[0]]


def bound_for(case: Case, bench: Bench, healthy_output_v: float) -> Bound:
    """The bounds of a case."""
    fault, held = case.fault, held_role(case.levels)
    ratio = FADED[fault.onset] if fault.kind == "fading" and held == fault.part else OUTPUT_RATIO
    output_v = ratio * healthy_output_v + OUTPUT_EXTRA_V
    within_s = trip_s(fault, held, 1.0 / bench.specimen.linear_frequency_hz)
    if fault.onset == "start" and within_s is not None and not held:
        output_v = FIRST_LEVEL * plan_for(case.levels).levels[0]
    return Bound(output_v, within_s, words_for(fault), False)


def trip_s(fault: Fault, held: str, period_s: float) -> float | None:
    """Time in which a fault is to end the run, s; None where it does no harm."""
    if fault.kind in AT_ONCE:
        return AT_ONCE_S
    if fault.kind in DRIVER:
        return DRIVER_S
    if fault.kind == "stuck":
        return STUCK_S if fault.onset == "middle" else STUCK_FROM_START_S
    if fault.kind == "reversed" and fault.onset == "middle":
        return None  # a lock may swing instead of being lost; then its points are refused
    in_the_loop = fault.part in ("force", "drive", "amplifier", "driver")
    if fault.part == "amplifier" and fault.kind in (*BLIND, *RAISES_OUTPUT):
        return period_s * VOLTAGE_PERIODS if held or fault.kind in BLIND else None
    if fault.kind in BLIND and in_the_loop:
        return period_s * (HELD_PERIODS if held and fault.onset == "middle" else VOLTAGE_PERIODS)
    if fault.kind in RAISES_OUTPUT and held and fault.part in (held, "amplifier"):
        return period_s * (HELD_PERIODS if fault.onset == "middle" else VOLTAGE_PERIODS)
    return None


def words_for(fault: Fault) -> tuple[str, ...]:
    """Words of which one at least is to be read where the run ends."""
    own = {
        "force": ("channel force", "load cell"),
        "drive": ("channel drive", "drive-point sensor"),
        "response": ("channel acc_",),
        "amplifier": ("amplifier", "does not follow", "does not change while the rig is driven"),
        "structure": ("structure", "settle"),
    }
    driver = {
        "times-out": ("no block within",),
        "raises": ("library of the device has failed",),
        "nan-block": ("not a number",),
        "loses-all": ("samples were lost",),
        "drops-all": ("lost", "no samples", "watchdog"),
        "emergency-stop": ("emergency stop",),
        "unplugged": ("unplugged",),
        "reset": ("restarted",),
        "deaf": ("watchdog", "no answer"),
        "silent": ("silent", "no samples", "nothing"),
        "repeats": ("on channel ",),
    }
    return (*own.get(fault.part, driver.get(fault.kind, ())), "phase lock lost", "no lock")


def objections(case: Case, seen: Observation, bench: Bench) -> list[str]:
    """What is wrong with an observation, a line each; none where all is well."""
    bound = bound_for(case, bench, seen.healthy_output_v)
    out = _too_much(seen, bound, bench)
    if case.fault.kind == "host-killed":
        if seen.samples_to_zero is None or seen.samples_to_zero > WATCHDOG_SAMPLES:
            out.append(f"0 V after {seen.samples_to_zero} samples, allowed {WATCHDOG_SAMPLES}")
        return out
    if bound.trip_s is not None:
        out += _too_late(seen, bound.trip_s * bench.sample_rate_hz, bound.words)
    if seen.samples_to_trip is not None:
        out += _not_at_rest(case, seen, bench)
    if not seen.closed:
        out.append("the recording has no end")
    if seen.spoilt and not bound.may_spoil:
        worst = ", ".join(
            f"{name} {100.0 * error:.3g} %"
            for name, error in zip(("fundamental", "frequency", "damping"), seen.worst, strict=True)
        )
        out.append(f"{seen.spoilt} spoilt points accepted, off by: {worst}")
    return out


def _too_much(seen: Observation, bound: Bound, bench: Bench) -> list[str]:
    largest = {
        "output": (seen.output_v, bound.output_v, "V"),
        "force": (seen.force_n, LIMIT_RATIO * bench.limits.force_n, "N"),
        "displacement": (seen.displacement_m, LIMIT_RATIO * bench.limits.displacement_m, "m"),
    }
    return [
        f"{name} of {value:.3g} {unit}, allowed {allowed:.3g}"
        for name, (value, allowed, unit) in largest.items()
        if allowed is not None and value > allowed
    ]


def _too_late(seen: Observation, samples: float, words: tuple[str, ...]) -> list[str]:
    if seen.samples_to_trip is None:
        return ["the run went on"]
    out = []
    if seen.samples_to_trip > samples:
        out.append(f"ended after {seen.samples_to_trip} samples, allowed {samples:.0f}")
    if not any(word in line for word in words for line in seen.said):
        out.append(f"nothing said of it: {seen.said}")
    return out


def _not_at_rest(case: Case, seen: Observation, bench: Bench) -> list[str]:
    assert seen.samples_to_trip is not None
    allowed = seen.samples_to_trip + bench.limits.ramp_down_s * bench.sample_rate_hz + TO_ZERO_SAMPLES
    out = []
    if seen.samples_to_zero is not None and seen.samples_to_zero > allowed:
        out.append(f"0 V after {seen.samples_to_zero} samples, allowed {allowed:.0f}")
    failed = seen.reason in ("driver_failed", "emergency_stop") or seen.raised
    if not failed and seen.last_handed_v > ZERO_V:
        out.append(f"{seen.last_handed_v:.3g} V handed over last, never 0 V")
    return out
