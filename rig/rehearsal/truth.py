"""True modal properties of a trial's points: phase resonance of its own rig by harmonic balance."""

from dataclasses import dataclass

import numpy as np

from controller.harmonics import HarmonicsSettings
from rig.bench import Bench
from rig.drivers.virtual import VirtualDAQ
from rig.rehearsal.trial import Trial
from simulators.analysis import NotConvergedError, phase_resonance_backbone

MAX_POINTS = 4  # points that are balanced; chosen
HARMONICS = 9  # harmonics of the balance, at least; chosen


@dataclass(frozen=True, kw_only=True)
class TrueBackbone:
    """Modal properties of the rig at the amplitudes of some accepted points."""

    numbers: tuple[int, ...]
    """Numbers of the points."""
    frequency_hz: tuple[float, ...]
    """Frequencies at phase resonance, Hz."""
    damping_ratio: tuple[float, ...]
    """Damping ratios."""


NOT_BALANCED = TrueBackbone(numbers=(), frequency_hz=(), damping_ratio=())
"""Of a trial without points that could be balanced."""


def true_backbone(bench: Bench, trial: Trial, seed: int = 0, loop: HarmonicsSettings | None = None) -> TrueBackbone:
    """Balance the rig at the amplitudes of up to four accepted points, the lowest and the highest included.

    ``loop``: the harmonics loop of the plan, by which the force's harmonics are what it wants. Empty if no point has modal
    properties, or none can be balanced.
    """
    measured = [p for p in trial.points if p.accepted and np.isfinite(p.modal_frequency_hz)]
    measured.sort(key=lambda point: point.amplitude_m)
    picked = sorted({round(i) for i in np.linspace(0, len(measured) - 1, min(MAX_POINTS, len(measured)))})
    points = [measured[i] for i in picked]
    if not points:
        return NOT_BALANCED
    rig = VirtualDAQ(bench, seed).rig.realised(seed)
    amplitudes = np.maximum.accumulate([p.amplitude_m for p in points]) * (1.0 + 1e-12 * np.arange(len(points)))
    try:
        found = phase_resonance_backbone(
            rig,
            amplitudes_m=amplitudes,
            near_hz=points[0].modal_frequency_hz,
            harmonics=HARMONICS if loop is None else max(HARMONICS, loop.highest),
            force_harmonics=None if loop is None else loop.controlled,
        )
    except NotConvergedError as error:
        if error.found is None:
            return NOT_BALANCED
        found = error.found
    except (ValueError, ArithmeticError):  # it could be simulated, and no more
        return NOT_BALANCED
    n = found.frequency_hz.size
    return TrueBackbone(
        numbers=tuple(p.number for p in points[:n]),
        frequency_hz=tuple(found.modal_frequency_hz.tolist()),
        damping_ratio=tuple(found.damping_ratio.tolist()),
    )
