"""Design gains for a measured plant: of a few candidates, the quickest that keep a bound on the sensitivity."""

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from controller.tuning import (
    ComplexResponseLaw,
    ControlLoop,
    Design,
    HippoldGains,
    PhaseLaw,
    PlantModel,
    assess,
    complex_response_law,
    design_phase_law,
    frequency_error_law,
    hippold_gains,
    margins,
    unstable_poles,
)
from controller.tuning.exact import frequencies_for
from identification import FrequencyResponseMatrix
from rig.tuning.plant import TuningError, largest_outside

__all__ = ["Chosen", "LawName", "choose", "gains_of"]

LawName = Literal["frequency-error", "phase"]
DAMPINGS = (1.0, 2.0, 4.0)  # damping at higher levels, as multiples of the damping in the linear test
LOW_PASSES = (5.0, 7.0, 10.0, 14.0, 20.0)  # candidates: resonance frequency divided by these
SHARES = (1.0 / 8.0, 1.0 / 12.0, 1.0 / 16.0, 1.0 / 24.0)  # of the low-pass: gain of the frequency-error loop
PEAK, OTHER_PEAK = 2.0, 3.0  # largest max |S| allowed for chosen gains, at the measured damping and at other dampings
OUTSIDE = 0.5  # largest gain of the response loop at other modes
FORCE_SHARES = (1.0 / 12.0, 1.0 / 16.0, 1.0 / 24.0, 1.0 / 36.0, 1.0 / 50.0, 1.0 / 100.0)  # of the low-pass
PHASE_PEAK = 1.6


@dataclass(frozen=True, eq=False)
class Chosen:
    """Chosen gains, and the loops that they give."""

    law: LawName
    """Frequency law: ``frequency-error`` (with complex response control) or ``phase`` (levels in volts)."""
    low_pass_rad_s: float
    """Low-pass w_LP, rad/s."""
    share: float
    """Gain of the frequency-error loop over w_LP; 0 for the phase law."""
    force_share: float
    """Gain over w_LP with which the loop may hold a force through the response; 0 for the phase law."""
    design: Design
    """Loops for the plant as measured."""
    others: tuple[Design, ...]
    """Loops for two and four times the plant's damping."""
    closed_form: HippoldGains
    """Gains by the closed form of Hippold et al. for the same low-pass, for comparison."""
    outside: tuple[float, float]
    """Largest gain of the response loop at the measured lines beyond the model's band, and its frequency (Hz)."""
    why: str
    """How the low-pass and the gains were chosen."""

    @property
    def sensitivity_peak(self) -> float:
        """Largest max |S| of all loops at all dampings."""
        return max(_peak(design) for design in (self.design, *self.others))


def choose(
    plant: PlantModel, responses: FrequencyResponseMatrix, law: str, largest_low_pass_rad_s: float, noise: str
) -> Chosen:
    """Choose the gains for a plant; ``noise`` says in words what bounds the low-pass.

    Raises `TuningError`, with the numbers, if no gains are suitable.
    """
    omega = plant.lock_frequency_rad_s()
    allowed = [w for w in (omega / part for part in LOW_PASSES) if w <= 1.001 * largest_low_pass_rad_s]
    if not any(math.isclose(w, largest_low_pass_rad_s, rel_tol=1e-3) for w in allowed):
        allowed.insert(0, largest_low_pass_rad_s)
    if law == "phase":
        return _phase(plant, allowed[0], noise)
    tried: list[str] = []
    for w in allowed:
        for share in SHARES:
            loops = [_loop(plant.at(damping_ratio=plant.damping_ratio * part), plant, w, share) for part in DAMPINGS]
            peak, *others = (_quick_peak(loop) for loop in loops)
            beyond = _beyond(loops[0], responses)
            tried.append(f"w_LP = w0/{omega / w:.3g}, k = w_LP/{1 / share:.0f}: max |S| {peak:.2f}")
            if peak > PEAK or max(others) > OTHER_PEAK or beyond[0] > OUTSIDE:
                continue
            designs = [assess(loop) for loop in loops]
            if not designs[0].suited:
                continue
            return Chosen(
                law="frequency-error",
                low_pass_rad_s=w,
                share=share,
                force_share=_force_share(plant, w, share),
                design=designs[0],
                others=tuple(designs[1:]),
                closed_form=hippold_gains(plant, w),
                outside=beyond,
                why=f"w_LP = w0/{omega / w:.3g} ({noise}), k = w_LP/{1 / share:.0f}: the quickest of those tried whose "
                f"max |S| is at most {PEAK:g} with the damping measured, {OTHER_PEAK:g} with up to {DAMPINGS[-1]:g} times that",
            )
    best = assess(_loop(plant, plant, allowed[-1], SHARES[-1]))
    reasons = "; ".join(best.reasons) or f"max |S| above {PEAK:g}"
    raise TuningError(
        f"this rig is unsuited to complex response control with a frequency-error loop: {reasons} (tried: "
        f"{tried[0]}; ... {tried[-1]}; gain of {beyond[0]:.2f} at {beyond[1]:.4g} Hz)"
    )


def _phase(plant: PlantModel, w: float, noise: str) -> Chosen:
    plants = [plant.at(damping_ratio=plant.damping_ratio * part) for part in DAMPINGS]
    design = design_phase_law(plants, w, sensitivity_peak=PHASE_PEAK)
    if not design.suited:
        raise TuningError(f"this rig is unsuited to a phase-locked loop: {'; '.join(design.reasons)}")
    measured = replace(assess(replace(design.loop, plant=plant)), failed=design.failed, notes=design.notes)
    return Chosen(
        law="phase",
        low_pass_rad_s=w,
        share=0.0,
        force_share=0.0,
        design=measured,
        others=tuple(assess(replace(design.loop, plant=other)) for other in plants[1:]),
        closed_form=hippold_gains(plant, w),
        outside=(0.0, 0.0),
        why=f"w_LP = w0/{plant.lock_frequency_rad_s() / w:.3g} ({noise}); {'; '.join(design.notes)}",
    )


def _force_share(plant: PlantModel, w: float, share: float) -> float:
    """Return the largest trial gain of the outer force loop, around frequency and response law, with a gain margin of 1.5.

    If no trial gain has this margin, return the last one of `FORCE_SHARES`.
    """
    loops = ((part, _loop(plant, plant, w, share, 1.5 * part)) for part in FORCE_SHARES)
    return next((part for part, loop in loops if unstable_poles(loop) == 0), FORCE_SHARES[-1])


def _loop(plant: PlantModel, measured: PlantModel, w: float, share: float, force_share: float = 0.0) -> ControlLoop:
    """Return the loop of both laws around ``plant``, with gains designed for the ``measured`` plant."""
    response = complex_response_law(measured, w, smoothing_rad_s=w, force_share=force_share)
    return ControlLoop(plant, w, frequency_error_law(w, share=share), response)


def _quick_peak(loop: ControlLoop) -> float:
    """Largest max |S| of both loops; infinite if they are unstable."""
    if unstable_poles(loop):
        return math.inf
    omega = frequencies_for(loop.plant, 600)
    both = np.concatenate([-omega[::-1], omega])
    frequency = margins(omega, loop.frequency_loop_gain(1j * omega)).sensitivity_peak
    return max(frequency, margins(both, loop.amplitude_loop_gain(1j * both)).sensitivity_peak)


def _peak(design: Design) -> float:
    if not design.stable:
        return math.inf
    amplitude = design.amplitude_margins.sensitivity_peak if design.amplitude_margins is not None else 1.0
    return max(design.frequency_margins.sensitivity_peak, amplitude)


def _beyond(loop: ControlLoop, responses: FrequencyResponseMatrix) -> tuple[float, float]:
    """Largest gain of the response loop, computed from the measured responses beyond the band of the plant model.

    Motion at another frequency f appears in the demodulated response at ``f - f_lock``.
    """
    law, plant = loop.amplitude_law, loop.plant
    if not isinstance(law, ComplexResponseLaw):
        return 0.0, 0.0
    s = np.asarray(1j * (2.0 * np.pi * responses.frequency_hz - loop.omega_rad_s), np.complex128)
    envelope = responses.value[:, 1, 0] / plant.acceleration_per_v(1j * loop.omega_rad_s)
    gain = law.gain(s) * envelope * loop.low_pass_rad_s / (s + loop.low_pass_rad_s)
    return largest_outside(responses, plant, gain)


def gains_of(chosen: Chosen) -> dict[str, float | tuple[float, float]]:
    """Return the designed keys of ``[controller]`` with their values."""
    loop = chosen.design.loop
    law = loop.frequency_law
    if isinstance(law, PhaseLaw):
        return {"k1": law.proportional_per_s, "k2": law.integral_per_s2}
    response = loop.amplitude_law
    if not isinstance(response, ComplexResponseLaw):
        raise TypeError("amplitude_law: allowed is complex response control")
    pole = loop.plant.pole_offset_rad_s()
    return {
        "frequency_integral_per_s": law.integral_per_s,
        "response_integral_per_s": response.integral_per_s,
        "plant_pole_rad_s": (pole.real, pole.imag),
        "reference_integral_per_s": chosen.force_share * loop.low_pass_rad_s,
        "drive_mode_shape": loop.plant.drive_shape,
    }
