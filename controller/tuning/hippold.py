"""Gains from a linear modal test in closed form (Hippold et al. 2024)."""

import cmath
import math
from dataclasses import dataclass

from controller.tuning.laws import PhaseLaw
from controller.tuning.plant import PlantModel

DETUNED = 0.5  # fraction of the coupled pole's decay; a larger |w_p - w_0| counts as far
REACTIVE_DEG = 20.0  # largest phase between voltage and force of an exciter that counts as phase neutral


@dataclass(frozen=True)
class HippoldGains:
    """Phase PI law that places the poles of the idealised loop, and the assumptions that the plant violates."""

    law: PhaseLaw
    """The gains."""
    failed: tuple[str, ...]
    """Assumptions of the closed form that do not hold on this plant; empty if the closed form may be used."""


def hippold_gains(plant: PlantModel, low_pass_rad_s: float) -> HippoldGains:
    """Return the closed-form gains of the phase PI law at phase resonance.

    Let ds = D w_0 be the decay of the structure's mode, dp the decay of the coupled pole, and db = dp/w_LP. dp is D_p w_p as
    measured in the coupled plant; a further factor 1 + mu would count the exciter's mass twice. The idealised loop has a
    triple pole ``w_LP lR`` with ``lR = -(1 + db)/3``, which is conservative, for

        ``kp = w_LP (ds/dp)(3 lR^2 - db)``,  ``ki = w_LP^2 (ds/dp)(-lR^3)``.

    The plant of the idealised loop is ``T(s) = dp/(ds (s + dp))``: one coupled pole at the frequency of the structure, a
    phase-neutral exciter and no delay.
    """
    ds = plant.damping_ratio * plant.frequency_rad_s
    offset = plant.pole_offset_rad_s()
    dp = -offset.real
    if dp <= 0.0:
        raise ValueError(f"coupled pole = {offset:.4g} 1/s from the mode: allowed is one that decays")
    db = dp / low_pass_rad_s
    real = -(1.0 + db) / 3.0
    law = PhaseLaw(
        low_pass_rad_s * ds / dp * (3.0 * real**2 - db),
        low_pass_rad_s**2 * ds / dp * -real * real**2,
    )
    return HippoldGains(law, _failed(plant, offset, low_pass_rad_s))


def _failed(plant: PlantModel, offset: complex, low_pass_rad_s: float) -> tuple[str, ...]:
    out = []
    resonance = plant.lock_frequency_rad_s()
    if abs(offset.imag) > DETUNED * abs(offset.real):
        coupled_hz, mode_hz = (plant.coupled_pole_rad_s.imag / 2.0 / math.pi, resonance / 2.0 / math.pi)
        out.append(
            f"coupled pole at {coupled_hz:.2f} Hz, the structure's at {mode_hz:.2f} Hz: {abs(offset.imag):.1f} rad/s apart, "
            f"with a decay of {-offset.real:.1f} 1/s"
        )
    force = complex(plant.force_per_v(1j * resonance))
    phase_deg = math.degrees(cmath.phase(force))
    if abs(phase_deg) > REACTIVE_DEG:
        out.append(f"exciter not phase neutral: force {phase_deg:+.0f} deg from the voltage at resonance")
    if plant.delay_s * low_pass_rad_s > 0.2:
        out.append(f"delay of {plant.delay_s * 1e3:.2f} ms is not short beside the low-pass, 1/{low_pass_rad_s:.3g} s")
    return tuple(out)
