"""Compare the scale of force and motion with what the last check of the bench measured at resonance.

Two ratios are compared: motion per newton and motion per volt, both at the drive point. At phase resonance of one mode the
first is ``phi_d^2 / (2 zeta)``, the second ``1/(beta + alpha/Y)`` with the exciter ``u = alpha F + beta A``. If one part is at
fault, the two together tell which: a force sensor changes the first, the amplifier the second, a drive sensor both. Damping
that differs from that of the check looks like a force sensor that is off, so a factor of 1.5 is warned of in any case.

The force's power goes into damping and growth: ``phi_d^2 |F/A| sin(lag)/2 = zeta + sigma/omega`` at a rate of growth sigma.
This is the imaginary part of ``2 i omega a' + (omega_0^2 - omega^2 + 2 i zeta omega_0 omega) a = phi_d F`` for a slowly varying
amplitude a. The motion per volt of a vibration that builds up lies between what it is and what it becomes. Neither is judged
while the vibration changes quickly. A factor that the check had too cannot be seen.
"""

import cmath
import math
from typing import NamedTuple

from rig.arming.checked_scale import CheckedScale
from rig.bench import Bench
from rig.campaigns.evaluation.point import Point, spectrum_of, vibration_of

WARNED = 1.5  # factor; chosen: damping that differs this much is warned of as well
REFUSED = 3.0  # factor; chosen: no damping of a mode changes this much at the start
MORE_DAMPING = 2.0  # growth of the damping from a check to a first level that is not refused
STEADY = 0.5  # rate of growth over that of a decay by the damping of the check
OF_RESONANCE = 0.5  # sine of the lag below which the mode alone does not determine the motion per newton


class ScaleMisfit(NamedTuple):
    """The largest difference from the check."""

    factor: float
    """Factor, 1 or more."""
    allowed: float
    """Factor up to which the test goes on."""
    text: str
    """What was seen and where to look, in one sentence."""

    @property
    def refused(self) -> bool:
        """Whether the test does not go on with such a difference."""
        return self.factor >= self.allowed

    @property
    def warned(self) -> bool:
        """Whether points carry a warning."""
        return self.factor >= WARNED


def scale_misfit(
    bench: Bench, point: Point[object], checked: CheckedScale, growth_1_s: float = 0.0, *, at_start: bool = False
) -> ScaleMisfit | None:
    """Compare a vibration near resonance with a check; None if it is too far from resonance, not steady, or empty.

    ``growth_1_s``: relative rate at which the amplitude still grows. ``at_start``: whether the vibration is as small as that at
    the start voltage. At a first level the damping may be larger than in the check.
    """
    fundamentals, vibration = spectrum_of(point).harmonics[:, 1], vibration_of(point)
    force, motion = (complex(fundamentals[bench.index_of(role)]) for role in ("force", "drive"))
    if not (abs(force) > 0.0 and abs(motion) > 0.0 and vibration.voltage_v > 0.0):
        return None
    omega = 2.0 * math.pi * vibration.frequency_hz
    power = math.sin(cmath.phase(-force / motion))  # of the displacement's lag; 1 at phase resonance
    growth = growth_1_s / omega / checked.damping_ratio
    if power < OF_RESONANCE or abs(growth) > STEADY:
        return None
    damping = abs(force / motion) * power * checked.acceleration_per_newton - growth  # over that of the check
    if damping <= 0.0:
        return None
    per_newton = 1.0 / damping
    steady = abs(motion) / vibration.voltage_v / checked.acceleration_per_volt
    per_volt = min(max(1.0, steady), steady * (1.0 + max(0.0, growth)))  # the nearest to 1 of what it may become
    factor = max(_factor(per_newton), _factor(per_volt))
    damped = not at_start and per_newton < 1.0 and _factor(per_volt) < WARNED
    allowed = REFUSED * (MORE_DAMPING if damped else 1.0)
    bound = f"refused from a factor {allowed:g}" if factor >= allowed else f"warning above a factor {WARNED:g}"
    return ScaleMisfit(factor, allowed, _sentence(bench, per_newton, per_volt, bound, checked))


def _factor(ratio: float) -> float:
    return max(ratio, 1.0 / ratio)


def _sentence(bench: Bench, per_newton: float, per_volt: float, bound: str, checked: CheckedScale) -> str:
    """Say what differs from the check, and which one cause explains both ratios best."""
    names = {role: bench.channels[bench.index_of(role)].name for role in ("force", "drive")}
    x, y = math.log(per_newton), math.log(per_volt)
    left = {"force": abs(y), "amplifier": abs(x), "drive": abs(x - y)}  # of both ratios, once this cause is taken out
    cause = min(left, key=lambda one: left[one])
    at, look = {
        "force": (
            f"channel {names['force']}",
            "look at its sensor, cable and sensitivity_v_per_unit, or the damping has changed",
        ),
        "drive": (f"channel {names['drive']}", "look at its sensor, cable and sensitivity_v_per_unit"),
        "amplifier": ("amplifier", "look at its gain"),
    }[cause]
    when = f" of {checked.at[:16]}" if checked.at else ""
    return (
        f"{at}: the drive point moves {per_newton:.3g} times as far per newton and {per_volt:.3g} times as far per volt as in "
        f"the last check{when}, {bound}: {look}; `rig check` again if the rig was changed"
    )
