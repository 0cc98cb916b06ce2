"""Design gains for a measured plant: of a few candidates, the quickest that keep a bound on the sensitivity."""

import cmath
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product
from typing import Literal

import numpy as np

from controller.tuning import (
    LARGEST_AT_HALF,
    ComplexResponseLaw,
    ControlLoop,
    Design,
    FrequencyErrorLaw,
    HippoldGains,
    PhaseLaw,
    PlantModel,
    assess,
    changes_of_hardening,
    complex_response_law,
    design_phase_law,
    frequencies_for,
    gains_at_half,
    hardening_margins,
    hippold_gains,
    margins,
    unstable_poles,
)
from identification import FrequencyResponseMatrix
from rig.tuning.plant import UnsuitedError, largest_outside

LawName = Literal["frequency-error", "phase"]
DAMPINGS = (1.0, 2.0, 4.0)  # damping at higher levels, as multiples of the damping in the linear test
LOW_PASSES = (5.0, 10.0, 20.0)  # candidates: resonance frequency divided by these
SHARES = (1.0 / 8.0, 1.0 / 16.0, 1.0 / 40.0)  # of the low-pass: integral gain of the frequency error
PROPORTIONALS = (0.0, 0.3, 0.7)  # proportional gain of the frequency error
RESPONSE_SHARES = (3.0 / 8.0, 1.0 / 4.0, 1.0 / 8.0, 1.0 / 16.0)  # of the low-pass: integral gain of the response loop
CANCELS = (1.0, 0.25, 1.6, 3.0, 1.5 * cmath.exp(-0.34j))  # times the proportional gain that cancels the coupled pole
WANTED_SOFTENING, WANTED_HARDENING = 0.06, 0.25
"""d ln(frequency)/d ln(amplitude) up to which the loops have to stay stable; chosen."""
SOFTENED, HARDENED = -0.05, 0.1
"""Of the frequency: shifts at which a softening or hardening structure stays stable as well."""
SHIFTS = (-0.05, -0.02, 0.0, 0.01, 0.02, 0.04, 0.06, 0.08, 0.1, 0.15, 0.2)
"""Of the frequency: shifts at which what the gains bear is looked at; chosen."""
ALIKE = 2.5  # largest over smallest slope that they bear at these shifts, for it to be believed; chosen
MAX_SLOPE_LOSS = 0.1  # of softening and of hardening that is given away for quicker gains; chosen
MAX_SENSITIVITY, OTHER_SENSITIVITY = 2.0, 3.0
"""Largest max |S| of chosen gains, at the measured damping and at other dampings; chosen."""
MAX_GAIN_OUTSIDE = 0.5  # largest gain of the response loop at other modes
FORCE_SHARES = (1.0 / 12.0, 1.0 / 16.0, 1.0 / 24.0, 1.0 / 36.0, 1.0 / 50.0, 1.0 / 100.0)  # of the low-pass
MAX_PHASE_SENSITIVITY = 1.6  # largest max |S| of the phase law; chosen


@dataclass(frozen=True, eq=False)
class Chosen:
    """Chosen gains, and the loops that they give."""

    law: LawName
    """Frequency law: ``frequency-error`` (with complex response control) or ``phase`` (levels in volts)."""
    low_pass_rad_s: float
    """Low-pass w_LP, rad/s."""
    cancels: complex
    """Proportional gain of the response loop over the one that would cancel the coupled pole; 0 for the phase law."""
    share: float
    """Integral gain of the frequency-error loop over w_LP; 0 for the phase law."""
    force_share: float
    """Gain over w_LP with which the loop may hold a force through the response; 0 for the phase law."""
    design: Design
    """Loops for the plant as measured."""
    others: tuple[Design, ...]
    """Loops for two and four times the plant's damping."""
    closed_form: HippoldGains
    """Gains by the closed form of Hippold et al. for the same low-pass, for comparison."""
    slopes: tuple[float, float]
    """Softening and hardening, both from 0, as d ln(frequency)/d ln(amplitude), up to which the loops stay stable."""
    outside: tuple[float, float]
    """Largest gain of the response loop at the measured lines beyond the model's band, and its frequency (Hz)."""
    why: str
    """How the low-pass and the gains were chosen."""

    @property
    def tracking_periods(self) -> float:
        """Periods in which the frequency comes nearer to the resonance by a factor e, on the plant as measured."""
        law, loop = self.design.loop.frequency_law, self.design.loop
        half_bandwidth = loop.plant.damping_ratio * loop.plant.frequency_rad_s
        rate = law.integral_per_s if isinstance(law, FrequencyErrorLaw) else law.integral_per_s2 / half_bandwidth
        return loop.omega_rad_s / (2.0 * math.pi * rate)

    @property
    def sensitivity_peak(self) -> float:
        """Largest max |S| of all loops at all dampings."""
        designs = (self.design, *self.others)
        if not all(design.stable for design in designs):
            return math.inf
        both = (found for design in designs for found in (design.frequency_margins, design.amplitude_margins))
        return max(1.0, *(found.sensitivity_peak for found in both if found is not None))


def choose(
    plant: PlantModel, responses: FrequencyResponseMatrix, law: str, largest_low_pass_rad_s: float, noise: str
) -> Chosen:
    """Choose the gains for a plant; ``noise`` says in words what bounds the low-pass.

    Raises `UnsuitedError`, with the numbers, if no gains are suitable.
    """
    omega = plant.lock_frequency_rad_s()
    allowed = [w for w in (omega / part for part in LOW_PASSES) if w <= 1.001 * largest_low_pass_rad_s]
    if not any(math.isclose(w, largest_low_pass_rad_s, rel_tol=1e-3) for w in allowed):
        allowed.insert(0, largest_low_pass_rad_s)
    if law == "phase":
        return _phase(plant, allowed[0], noise)
    tried, best, design = _quickest(_candidates(plant, allowed), lambda loop: _suits(loop, plant, responses))
    if best is None or design is None:
        raise _unsuited(plant, responses, allowed[-1], tried)
    w, share = best.loop.low_pass_rad_s, best.share
    others = [assess(replace(best.loop, plant=other)) for other in _damped(plant)[1:]]
    return Chosen(
        law="frequency-error",
        low_pass_rad_s=w,
        cancels=best.cancels,
        share=share,
        force_share=_force_share(best.loop),
        design=design,
        others=tuple(others),
        closed_form=hippold_gains(plant, w),
        slopes=best.slopes,
        outside=_beyond(best.loop, responses),
        why=f"w_LP = w0/{omega / w:.3g} ({noise}), k = w_LP/{1 / share:.0f}, K = w_LP/{1 / best.response_share:.3g}: the "
        f"fastest stable gains that tolerate the frequency changes under *slopes* (max |S| at most {MAX_SENSITIVITY:g} with "
        f"the damping measured, {OTHER_SENSITIVITY:g} with up to {DAMPINGS[-1]:g} times that)",
    )


@dataclass(frozen=True, eq=False)
class _Candidate:
    """Gains that may be chosen."""

    loop: ControlLoop
    share: float
    proportional: float
    response_share: float
    cancels: complex
    slopes: tuple[float, float]

    @property
    def borne(self) -> tuple[float, float]:
        """Parts of the wanted softening and hardening that the loop bears, 0 to 1."""
        return min(self.slopes[0] / WANTED_SOFTENING, 1.0), min(self.slopes[1] / WANTED_HARDENING, 1.0)

    def bears_nearly(self, other: "_Candidate") -> bool:
        """Return whether it bears at most `MAX_SLOPE_LOSS` less softening and hardening than another one."""
        return all(own >= (1.0 - MAX_SLOPE_LOSS) * most for own, most in zip(self.borne, other.borne, strict=True))

    @property
    def quickness(self) -> float:
        """Rate of the slower of the two loops, 1/s."""
        return self.loop.low_pass_rad_s * min(self.share / (1.0 + self.proportional), 0.5 * self.response_share)


def steepest_hardening(loop: ControlLoop) -> float:
    """Return the hardening that the loop bears wherever a nonlinear structure may shift its frequency.

    It is the least of `controller.tuning.hardening_margins` over `SHIFTS`, and infinite where these differ by more than
    `ALIKE`: where the resonance crosses that of the exciter, linear theory foretells instability through which runs have gone.
    """
    plants = [loop.plant.at(frequency_rad_s=(1.0 + shift) * loop.plant.frequency_rad_s) for shift in SHIFTS]
    borne = [hardening_margins(replace(loop, plant=plant))[1] for plant in plants]
    return min(borne) if max(borne) <= ALIKE * min(borne) else math.inf


def _candidates(plant: PlantModel, low_passes_rad_s: list[float]) -> list[_Candidate]:
    out = []
    gains = product(low_passes_rad_s, SHARES, PROPORTIONALS, RESPONSE_SHARES, CANCELS)
    pole = plant.pole_offset_rad_s()
    shifted = [plant.at(frequency_rad_s=(1.0 + part) * plant.frequency_rad_s) for part in (0.0, SOFTENED, HARDENED)]
    plants = [(at, changes_of_hardening(at)) for at in shifted]
    for w, share, proportional, response, cancels in gains:
        if (pole / cancels).real >= 0.0:
            continue  # a plan allows stable poles alone
        law = complex_response_law(plant, w, share=response, smoothing_rad_s=w)
        law = replace(law, proportional=cancels * law.proportional)
        loop = ControlLoop(plant, w, FrequencyErrorLaw(share * w, proportional), law)
        (softening, hardening), (softer, _), (_, harder) = (
            hardening_margins(replace(loop, plant=at), changes) for at, changes in plants
        )
        slopes = min(softening, softer), min(hardening, harder)
        out.append(_Candidate(loop, share, proportional, response, cancels, slopes))
    return out


def _quickest(
    candidates: list[_Candidate], suits: Callable[[ControlLoop], Design | None]
) -> tuple[int, _Candidate | None, Design | None]:
    """Return the number of candidates tried, and of those that suit the quickest, with its assessment.

    It bears at most `MAX_SLOPE_LOSS` less softening and hardening than the one that bears most of what is wanted.
    """
    tried = 0
    steadiest: _Candidate | None = None
    best: _Candidate | None = None
    design: Design | None = None
    for candidate in sorted(candidates, key=lambda one: -sum(one.borne)):
        if steadiest is not None and not candidate.bears_nearly(steadiest):
            continue
        tried += 1
        if (best is None or candidate.quickness > best.quickness) and (suited := suits(candidate.loop)):
            steadiest, best, design = steadiest or candidate, candidate, suited
    return tried, best, design


def _damped(plant: PlantModel) -> list[PlantModel]:
    return [plant.at(damping_ratio=plant.damping_ratio * part) for part in DAMPINGS]


def _suits(loop: ControlLoop, plant: PlantModel, responses: FrequencyResponseMatrix) -> Design | None:
    """Return the assessment of gains at the damping measured if they suit all dampings, else None."""
    if _beyond(loop, responses)[0] > MAX_GAIN_OUTSIDE or max(gains_at_half(loop).values()) > LARGEST_AT_HALF:
        return None
    bounds = (MAX_SENSITIVITY, *(OTHER_SENSITIVITY for _ in DAMPINGS[1:]))
    peaks = (_quick_peak(replace(loop, plant=other)) for other in _damped(plant))
    if any(peak > bound for peak, bound in zip(peaks, bounds, strict=True)):
        return None
    design = assess(loop)
    return design if design.suited else None


def _unsuited(plant: PlantModel, responses: FrequencyResponseMatrix, w: float, tried: int) -> UnsuitedError:
    """Return the error for a plant that no gains suit, with the reasons for the slowest."""
    loop = ControlLoop(
        plant,
        w,
        FrequencyErrorLaw(SHARES[-1] * w),
        complex_response_law(plant, w, share=RESPONSE_SHARES[-1], smoothing_rad_s=w),
    )
    slowest, beyond = assess(loop), _beyond(loop, responses)
    reasons = "; ".join(slowest.reasons) or f"max |S| above {MAX_SENSITIVITY:g}"
    return UnsuitedError(
        f"this rig is unsuited to complex response control with a frequency-error loop: {reasons} ({tried} sets of gains "
        f"tried; the slowest, w_LP = w0/{loop.omega_rad_s / w:.3g}, has max |S| {_quick_peak(loop):.2f} and a gain of "
        f"{beyond[0]:.2f} at {beyond[1]:.4g} Hz)"
    )


def _phase(plant: PlantModel, w: float, noise: str) -> Chosen:
    plants = _damped(plant)
    design = design_phase_law(plants, w, sensitivity_peak=MAX_PHASE_SENSITIVITY)
    if not design.suited:
        raise UnsuitedError(f"this rig is unsuited to a phase-locked loop: {'; '.join(design.reasons)}")
    measured = replace(assess(replace(design.loop, plant=plant)), failed=design.failed, notes=design.notes)
    return Chosen(
        law="phase",
        low_pass_rad_s=w,
        cancels=0.0,
        share=0.0,
        force_share=0.0,
        design=measured,
        others=tuple(assess(replace(design.loop, plant=other)) for other in plants[1:]),
        closed_form=hippold_gains(plant, w),
        slopes=hardening_margins(measured.loop),
        outside=(0.0, 0.0),
        why=f"w_LP = w0/{plant.lock_frequency_rad_s() / w:.3g} ({noise}); {'; '.join(design.notes)}",
    )


def _force_share(loop: ControlLoop) -> float:
    """Return the largest trial gain of the outer force loop, around frequency and response law, with a gain margin of 1.5.

    If no trial gain has this margin, return the last one of `FORCE_SHARES`.
    """
    law, w = loop.amplitude_law, loop.low_pass_rad_s
    if not isinstance(law, ComplexResponseLaw):
        return FORCE_SHARES[-1]
    trials = ((part, replace(loop, amplitude_law=replace(law, force_per_s=1.5 * part * w))) for part in FORCE_SHARES)
    return next((part for part, trial in trials if unstable_poles(trial) == 0), FORCE_SHARES[-1])


def _quick_peak(loop: ControlLoop) -> float:
    """Largest max |S| of both loops; infinite if they are unstable."""
    if unstable_poles(loop):
        return math.inf
    omega = frequencies_for(loop.plant, 600)
    both = np.concatenate([-omega[::-1], omega])
    frequency = margins(omega, loop.frequency_loop_gain(1j * omega)).sensitivity_peak
    return max(frequency, margins(both, loop.amplitude_loop_gain(1j * both)).sensitivity_peak)


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
    pole = loop.plant.pole_offset_rad_s() / chosen.cancels
    proportional = {"frequency_proportional": law.proportional} if law.proportional else {}
    return {
        "frequency_integral_per_s": law.integral_per_s,
        **proportional,
        "response_integral_per_s": response.integral_per_s,
        "plant_pole_rad_s": (pole.real, pole.imag),
        "reference_integral_per_s": chosen.force_share * loop.low_pass_rad_s,
        "drive_mode_shape": loop.plant.drive_shape,
    }
