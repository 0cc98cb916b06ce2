"""From the recorded rows of a sweep to its result, and to fundamentals over time."""

from dataclasses import asdict, replace
from typing import Any

import numpy as np

from identification import IdentificationError, Transient, demodulate, force_drop_out
from rig.bench import Bench
from rig.campaigns.evaluate import VOLTAGE, channels_of, head, skew_turn
from rig.campaigns.plan import Column, Target
from rig.campaigns.sweep import SweepPlan

__all__ = ["SWEEP_COLUMNS", "measure_sweep", "transient_of"]

SWEEP_COLUMNS = (
    Column("off_resonance_n", "force off resonance", "N", ".4f"),
    Column("minimum_ratio", "smallest", "%", ".2f", 100.0),
    Column("minimum_frequency_hz", "at", "Hz", ".3f"),
    Column("overshoot_ratio", "then up to", "%", ".1f", 100.0),
    Column("peak_m", "peak", "mm", ".4f", 1e3),
    Column("peak_frequency_hz", "at", "Hz", ".3f"),
)


def measure_sweep(bench: Bench, plan: SweepPlan, target: Target, rows: np.ndarray, settling: np.void) -> dict[str, Any]:
    """The result of a recorded sweep: a transient vibration, that nothing was asked to settle in."""
    point = head(plan, target)
    try:
        drop_out = force_drop_out(transient_of(bench, rows), off_resonance_hz=plan.off_resonance_hz)
    except (IdentificationError, ArithmeticError) as error:
        return {**point, "settled": False, "accepted": False, "reason": f"cannot be evaluated: {error}"}
    return {
        **point,
        "settled": None,
        "accepted": True,
        "reason": "",
        **asdict(drop_out),
        "minimum_ratio": drop_out.minimum_ratio,
        "overshoot_ratio": drop_out.overshoot_ratio,
        "duration_s": rows.size / bench.sample_rate_hz,
        "warnings": [],
    }


def transient_of(bench: Bench, rows: np.ndarray) -> Transient:
    """Fundamentals over time of recorded rows: every input, its skew taken out, and the output as channel ``voltage``."""
    signals = np.vstack([rows["inputs"].T, rows["output_v"]])
    transient = demodulate(
        rows["theta_rad"],
        signals,
        (*channels_of(bench), VOLTAGE),
        sample_rate_hz=bench.sample_rate_hz,
    )
    without_skew = transient.fundamentals.copy()
    without_skew[:-1] *= skew_turn(bench, transient.frequency_hz)
    return replace(transient, fundamentals=without_skew)
