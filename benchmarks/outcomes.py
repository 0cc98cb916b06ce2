"""What a run of the magnet beam's shipped backbone came to: attempts, late outputs, errors against harmonic balance."""

from collections import Counter
from typing import Any

import numpy as np

import rig
from identification import nonlinear_mode
from rig.campaigns.evaluation.recorded import points_of
from tests.reference.harmonic_balance import backbone_at_voltages
from tests.reference.parameters import ONE_SIDED

PLAN = "magnet-beam/backbone"


def outcome(run: rig.Run) -> dict[str, Any]:
    """Return counts, reasons of refused attempts and points, and the largest relative errors of the accepted points."""
    parts, points = run.recording.parts, points_of(run.recording)
    counters = Counter[str]()
    for part in parts:
        counters.update({name: n for name, n in (part.end or {}).get("counters", {}).items() if isinstance(n, int)})
    good = [point for point in points if point.accepted]
    frequency, damping = np.full(1, np.nan), np.full(1, np.nan)
    if good:
        mode, truth = nonlinear_mode(run.backbone()), backbone_at_voltages(ONE_SIDED, [point.level for point in good])
        frequency = mode.frequency_hz / np.array([one.frequency_hz for one in truth]) - 1.0
        damping = mode.damping_ratio / np.array([one.damping_ratio for one in truth]) - 1.0
    return {
        "accepted": len(good),
        "points": len(points),
        "refused_attempts": [attempt.reason for point in points for attempt in point.refused_before],
        "refused": {point.number + 1: point.reason for point in points if not point.accepted},
        "continued": counters["output_continued"],
        "held": counters["output_held"],
        "lost": counters["lost_samples"],
        "samples": run.recording.n_rows,
        "frequency_error": float(np.abs(frequency).max()),
        "damping_error": float(np.abs(damping).max()),
        "ended": (parts[-1].end or {}).get("text", "cut short"),
    }
