"""Whether the harmonics that the harmonics loop controls are in the record what they were wanted to be."""

import numpy as np

from controller.harmonics import harmonic_ratios
from rig.bench import Bench
from rig.campaigns.evaluation.point import Point, Spectrum
from rig.campaigns.planning.plan import Plan, Target

SIGMAS = 3.0  # standard errors beyond which a harmonic counts as off; the usual choice


def with_force_harmonics(
    bench: Bench, plan: Plan, target: Target, point: Point[object], left_alone: int
) -> Point[object]:
    """Refuse or warn about a point whose controlled harmonics are off; without the harmonics loop return it as it is.

    ``left_alone``: bit h for each harmonic h that the loop left alone; those only warn, and so do points that did not settle.
    """
    loop = plan.law.harmonics
    if loop is None or point.spectrum is None or not point.accepted:
        return point
    channel = bench.index_of(loop.channel)
    facts = bench.channels[channel]
    negligible = facts.negligible_amplitude
    wanted = harmonic_ratios(loop.wanted if target.harmonics is None else target.harmonics)
    off = _errors(point.spectrum, channel, wanted[: loop.highest + 1], loop.accepted, negligible)
    alone = [order for order in off if left_alone & 1 << order]
    others = {order: error for order, error in off.items() if order not in alone}
    if alone:
        point = point.warned(
            f"harmonics {', '.join(map(str, alone))} of channel {facts.name} were not controlled: their response is "
            f"lost in noise; they are off by up to {100.0 * max(off[order] for order in alone):.2g} % of the fundamental"
        )
    if not others:
        return point
    worst = max(others, key=lambda order: others[order])
    text = (
        f"harmonic {worst} of channel {facts.name} is {100.0 * others[worst]:.2g} % of the fundamental off what was wanted, "
        f"accepted up to {100.0 * loop.accepted:g} %"
    )
    return point.refused(text) if point.settled and not plan.evaluates_approach else point.warned(text)


def _errors(
    spectrum: Spectrum, channel: int, wanted: np.ndarray, accepted: float, negligible: float
) -> dict[int, float]:
    """Return the harmonics that are off by more than is allowed, and by how much relative to the fundamental."""
    recorded = spectrum.harmonics[channel, : wanted.size]
    stds = np.zeros(recorded.size) if spectrum.harmonics_std is None else spectrum.harmonics_std[channel]
    size = abs(recorded[1])
    out: dict[int, float] = {}
    for order in range(2, recorded.size):
        error = abs(recorded[order] - wanted[order] * size * (recorded[1] / size) ** order)
        if error > max(accepted * size, negligible, SIGMAS * float(stds[order])):
            out[order] = error / size
    return out
