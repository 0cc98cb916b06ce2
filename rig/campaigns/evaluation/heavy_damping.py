"""Whether a mode is damped so heavily that other modes count at its phase resonance.

At phase resonance the real part of the receptance of all modes together is 0. With ``r`` the share of the other modes in the
static compliance of the drive point, relative to that of the mode, and the damping ratio z,

    (1 - x^2) / ((1 - x^2)^2 + (2 z x)^2) + r = 0,  so that  x = W / w = 1 + 2 z^2 r

to the lowest order in z^2 r. A point knows nothing of r, and its standard errors are those of noise alone.
"""

from rig.campaigns.evaluation.point import Point

TRUSTED = 0.1
"""Damping ratio up to which the shift is below 2 % of the share of the other modes: 0.1 % where that is a twentieth."""


def with_heavy_damping(point: Point[object]) -> Point[object]:
    """Warn about a point at phase resonance whose damping ratio is so large that other modes shift frequency and damping."""
    modal = point.modal
    if modal is None or point.lock is None or modal.damping_ratio is None or not modal.damping_ratio > TRUSTED:
        return point
    shift = 2.0 * modal.damping_ratio**2
    return point.warned(
        f"damping ratio {100.0 * modal.damping_ratio:.3g} % (warning above {100.0 * TRUSTED:g} %): other modes shift the phase "
        f"resonance by {100.0 * shift:.2g} % of their share of the static compliance, which the standard errors do not include"
    )
