"""Assessment of designed gains: margins, poles and step responses, as numbers and as arrays to plot."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from controller.tuning.exact import exact_phase_law, frequencies_for
from controller.tuning.hippold import hippold_gains
from controller.tuning.laws import ComplexResponseLaw, LinearFrequencyLaw
from controller.tuning.loop import ControlLoop
from controller.tuning.plant import PlantModel
from controller.tuning.stability import Margins, closed_loop_poles, margins, unstable_poles
from controller.tuning.steps import settling_s, step_response
from vibrolock.arrays import Complex, Float
from vibrolock.errors import InputError

LEVEL_STEP = 0.3  # relative step, about that of a backbone with ten levels over a decade
POOR_SENSITIVITY = 3.0  # largest max abs(S) of a loop that is accepted; chosen
POOR_FIT = 0.1  # largest accepted misfit of the plant's model, relative to its measurement; chosen


@dataclass(frozen=True, eq=False)
class Steps:
    """Step responses of the demodulated quantities, one entry per instant."""

    time_s: Float
    """Instants [n]."""
    lag_after_target: Float
    """Lag after a unit step of the wanted lag [n]."""
    lag_after_frequency_rad: Float
    """Lag after the rig's frequencies have shifted by D w_0, half the bandwidth [n]; 45 deg without a frequency law."""
    log_response_after_level: Float
    """ln|A| after a unit step of the logarithm of the level [n]."""
    lag_after_level_rad: Float
    """Lag after a unit step of the logarithm of the level [n]."""


@dataclass(frozen=True)
class Settling:
    """Number of periods until a step response has settled; infinite if it does not settle within the computed time."""

    frequency_shift: float
    """Until the lag is within 1 deg after the rig's frequencies have shifted by half the bandwidth."""
    level_amplitude: float
    """Until the response is within 1 % after the level has been raised by 30 %."""
    level_lag: float
    """Until the lag is within 1 deg after the level has been raised by 30 %."""

    @property
    def longest(self) -> float:
        """Largest of the three settling times: about the number of periods that a backbone point waits."""
        return max(self.frequency_shift, self.level_amplitude, self.level_lag)


@dataclass(frozen=True, eq=False)
class Design:
    """Control laws on a plant at a phase lag: margins, poles, step responses, and whether the gains are fit for use."""

    loop: ControlLoop
    """Plant, low-pass and laws."""
    unstable_poles: int
    """Closed-loop poles in the right half plane."""
    poles_rad_s: Complex
    """Poles of the closed loop within half the frequency [n] (1/s)."""
    frequency_margins: Margins
    """Margins of the frequency law with the amplitude law closed; meaningless if the loop is unstable."""
    amplitude_margins: Margins | None
    """Margins of the amplitude law with the frequency held; None if the level is a voltage."""
    settling: Settling
    """Settling times in periods; infinite if the loop is unstable."""
    failed: tuple[str, ...]
    """Assumptions of the gain design that do not hold."""
    notes: tuple[str, ...]
    """Which design was chosen, and why."""
    reasons: tuple[str, ...]
    """Reasons why the gains are not fit for use; empty if they are fit."""
    omega_rad_s: Float
    """Modulation frequencies [n] (rad/s)."""
    frequency_loop_gain: Complex
    """Loop gain L of the frequency law at i omega [n]."""
    amplitude_loop_gain: Complex
    """Loop gain L of the amplitude law at i omega and at -i omega [2, n]; 0 without an amplitude law."""
    steps: Steps | None
    """Step responses; None if the loop is unstable."""

    @property
    def suited(self) -> bool:
        """Whether the gains are fit for use."""
        return not self.reasons

    @property
    def stable(self) -> bool:
        """Whether every closed-loop pole decays."""
        return self.unstable_poles == 0


def assess(loop: ControlLoop, *, failed: Sequence[str] = (), notes: Sequence[str] = (), end_s: float = 0.0) -> Design:
    """Assess given laws on a known plant.

    ``end_s`` is the length of the step responses (s); 0 stands for 600 periods.
    """
    omega = frequencies_for(loop.plant)
    gain = loop.frequency_loop_gain(1j * omega)
    upper, lower = loop.amplitude_loop_gain(1j * omega), loop.amplitude_loop_gain(-1j * omega)
    both = np.concatenate([-omega[::-1], omega])
    count = unstable_poles(loop)
    poles = closed_loop_poles(loop)
    frequency = margins(omega, gain)
    amplitude = None if loop.amplitude_law is None else margins(both, np.concatenate([lower[::-1], upper]))
    period_s = 2.0 * math.pi / loop.omega_rad_s
    steps = _steps(loop, end_s or 600.0 * period_s) if count == 0 else None
    return Design(
        loop=loop,
        unstable_poles=count,
        poles_rad_s=poles,
        frequency_margins=frequency,
        amplitude_margins=amplitude,
        settling=_settling(steps, period_s),
        failed=tuple(failed),
        notes=tuple(notes),
        reasons=_reasons(loop, count, poles, frequency, amplitude),
        omega_rad_s=omega,
        frequency_loop_gain=gain,
        amplitude_loop_gain=np.stack([upper, lower]),
        steps=steps,
    )


def worst(loop: ControlLoop, plants: Sequence[PlantModel]) -> Design:
    """Assess the laws on the worst of several plants: most unstable poles first, then highest peak of the sensitivity."""
    InputError.raise_if(not plants, "none given", field="plants", allowed="at least one")

    def badness(plant: PlantModel) -> tuple[int, float]:
        there = replace(loop, plant=plant)
        omega = frequencies_for(plant)
        return unstable_poles(there), margins(omega, there.frequency_loop_gain(1j * omega)).sensitivity_peak

    return assess(replace(loop, plant=max(plants, key=badness)))


def design_phase_law(plants: Sequence[PlantModel], low_pass_rad_s: float, *, sensitivity_peak: float = 1.6) -> Design:
    """Design a phase PI law for phase resonance.

    The closed form is used if its assumptions hold on the first plant and the loop is stable with ``max |S|`` up to
    ``sensitivity_peak`` on all plants. Otherwise the gains come from the exact map of all plants. The first plant is the
    measured one; the others represent it at the other levels of the test.
    """
    closed = hippold_gains(plants[0], low_pass_rad_s)
    if not closed.failed:
        loop = ControlLoop(plants[0], low_pass_rad_s, closed.law)
        design = worst(loop, plants)
        if design.stable and design.frequency_margins.sensitivity_peak <= sensitivity_peak:
            return replace(design, notes=("gains in closed form (Hippold et al.)",))
    law: LinearFrequencyLaw = exact_phase_law(plants, low_pass_rad_s, sensitivity_peak=sensitivity_peak)
    note = f"largest ki with max |S| <= {sensitivity_peak:g} on the exact map"
    return replace(worst(ControlLoop(plants[0], low_pass_rad_s, law), plants), failed=closed.failed, notes=(note,))


def _steps(loop: ControlLoop, end_s: float) -> Steps:
    half_bandwidth = loop.plant.damping_ratio * loop.plant.frequency_rad_s
    time, target = _step(loop, loop.lag_after_target, end_s)
    _, shifted = _step(loop, loop.lag_after_frequency, end_s)
    _, response = _step(loop, lambda s: loop.response_after_level(s)[0], end_s)
    _, lag = _step(loop, lambda s: loop.response_after_level(s)[1], end_s)
    return Steps(time, target, half_bandwidth * shifted, response, lag)


def _step(loop: ControlLoop, transfer: Callable[[Complex], Complex], end_s: float) -> tuple[Float, Float]:
    """Return a step response without content above half the frequency, where the fitted plant does not represent the rig."""
    return step_response(transfer, end_s, highest_rad_s=0.5 * loop.omega_rad_s)


def _settling(steps: Steps | None, period_s: float) -> Settling:
    if steps is None:
        return Settling(math.inf, math.inf, math.inf)
    degree = math.radians(1.0)
    rise = LEVEL_STEP * (steps.log_response_after_level - steps.log_response_after_level[-1])
    return Settling(
        settling_s(steps.time_s, steps.lag_after_frequency_rad, degree) / period_s,
        settling_s(steps.time_s, rise, 0.01) / period_s,
        settling_s(steps.time_s, LEVEL_STEP * steps.lag_after_level_rad, degree) / period_s,
    )


def _reasons(
    loop: ControlLoop, count: int, poles: Complex, frequency: Margins, amplitude: Margins | None
) -> tuple[str, ...]:
    out = []
    where = f"at {loop.omega_rad_s / 2.0 / math.pi:.2f} Hz, {100.0 * loop.plant.damping_ratio:.3g} % damping"
    if count > 0:
        growing = poles[poles.real > 0.0]
        growth = f", growing at {growing.real.max():.3g} 1/s" if growing.size else ""
        out.append(f"the loop is unstable {where}: {count} pole(s) in the right half plane{growth}")
    elif frequency.sensitivity_peak > POOR_SENSITIVITY:
        out.append(
            f"the frequency loop is barely stable {where}: max |S| = {frequency.sensitivity_peak:.2f}, "
            f"allowed is {POOR_SENSITIVITY:g}"
        )
    elif amplitude is not None and amplitude.sensitivity_peak > POOR_SENSITIVITY:
        kind = "complex response control" if isinstance(loop.amplitude_law, ComplexResponseLaw) else "amplitude loop"
        peak = amplitude.sensitivity_peak
        out.append(f"the {kind} is barely stable {where}: max |S| = {peak:.2f}, allowed is {POOR_SENSITIVITY:g}")
    if loop.plant.fit_error > POOR_FIT:
        out.append(
            f"the plant model differs from its measurement by {100.0 * loop.plant.fit_error:.3g} %, "
            f"allowed is {100.0 * POOR_FIT:.0f} %: another mode inside the band, or a nonlinear or noisy test"
        )
    if loop.plant.coupled_pole_rad_s.real >= 0.0:
        out.append(f"the plant itself is unstable: coupled pole {loop.plant.coupled_pole_rad_s:.4g} 1/s")
    return tuple(out)
