"""The harmonics loop: drives harmonics of the output so that those of the measured force take their wanted values.

The output is ``u = U Re[exp(i (theta + turn))] + Re[sum_h V_h exp(i h theta)]`` with a complex V_h for each harmonic 2 to H.
An adaptive filter estimates the force's harmonics F_h in the oscillator's phase. Near a steady vibration
``F_h = D_h + P_h V_h``: D_h comes from structure and exciter, P_h is the plant from output to force at that harmonic. One
complex integral law for each harmonic acts through it, with the wanted G_h:

    ``dV_h/dt = -k (F_h - G_h)/P_h``

k and the filter's corner are fractions of the oscillator's frequency, so that they suit any structure. P_h is measured once the
vibration is locked and steady, by a small step of all harmonics at once, and again where an error does not decay. A harmonic
whose plant cannot be told from noise is left alone. Not modelled: a change of one harmonic changes the others through the
structure's nonlinearity; the integral laws take that for a disturbance.

The idea to make an exciter's force a sine by feedback through adaptive filters is that of arXiv 2410.17830.
"""

import cmath
import math
from collections.abc import Mapping
from enum import IntEnum
from typing import Literal, Self

import numpy as np
from pydantic import Field, model_validator

from controller.adaptive_filter import MOST_HARMONICS, adapt, turn_phasors
from controller.primitives import size
from controller.settings import Settings
from vibrolock.compiled import Record, inner_kernel, kernel

__all__ = ["HARMONICS", "HARMONICS_STATE", "HarmonicStage", "HarmonicsSettings"]


class HarmonicStage(IntEnum):
    """What the harmonics loop does."""

    WAITING = 0
    """It waits for a locked, steady vibration; the output has no harmonics."""
    LISTENING = 1
    """It averages the force's harmonics before the step that measures the plant."""
    PROBING = 2
    """It averages them under the step."""
    CONTROLLING = 3
    """It drives them to their wanted values."""


WAITING, LISTENING, PROBING, CONTROLLING = (int(stage) for stage in HarmonicStage)

WAIT_PERIODS = 6  # for filter and exciter after the step
MOST_UNSTEADY = 8  # periods in a row, at a lock, that do not end the measurement of the plant
MEAN_PERIODS = 4  # of the averages before and under the step
LARGER, LARGEST_PROBE = 3.0, 0.04  # factor of the next step, and the largest, relative to the fundamental
CLEAR = 4.0  # times its scatter from period to period: the least change under the step from which a plant is learned
NOISY = 1.0  # times its scatter: judged error that noise may cause; about four of its standard errors
QUIET = 10.0  # times the smallest mean square of late: more scatter is no noise
LEAK = 1.01  # by which that smallest grows in a period
SWING = 4.0  # times the bound of the mean error: bound of its root mean square
PATIENCE = 40  # periods at a held level after which an error must have decayed
DECAYED = 0.7  # to this part, while all else is steady
GROWN = 4.0  # factor by which no error may grow at a held level
MOST_PROBES = 4
LOUDER = 1.5  # times the output at which a harmonic was found too quiet: where it is tried again
JUDGED = 0.2  # weight of the last period in the slow means
LARGEST_WANTED = 10.0
FULL = 1.0 - 1e-9  # of the largest voltage: above it harmonics are held back
LEFT_ALONE = 0.5  # of the smallest amplitude: an error below it moves nothing

SMALLEST_MARGIN_DEG = 35.0
HIGHEST_TURN = 0.8 * math.pi  # of the highest harmonic from sample to sample
ORDERS = (MOST_HARMONICS + 1,)

HARMONICS = np.dtype(
    [
        ("highest", "i8"),
        ("of_drive", "i8"),
        ("corner", "f8"),
        ("integral", "f8"),
        ("largest", "f8"),
        ("probe", "f8"),
        ("tolerance", "f8"),
        ("smallest", "f8"),
        ("high_pass_rad_s", "f8"),
        ("largest_v", "f8"),
        ("step_v", "f8"),
        ("dt_s", "f8"),
        ("wanted", "c16", ORDERS),
        ("plant", "c16", ORDERS),
        ("left_alone", "i8", ORDERS),
    ]
)
"""Parameters of the harmonics loop (one record). ``highest``: H, or 0 without the loop. ``of_drive``: the controlled channel
is the drive. ``corner``, ``integral``: fractions of the oscillator's frequency. ``largest``: bound of |V_h| over the
fundamental. ``probe``: |V_h| of the step over it. ``tolerance``: of the channel's fundamental. ``smallest``: error (N) that
always counts as none. ``largest_v``: bound of the whole output. ``step_v``: bound of a harmonic's change from one sample to
the next. ``wanted``: ratios to the fundamental, where the plan names none. ``plant``: P_h where it is known, else 0.
``left_alone``: harmonics that are not controlled."""

HARMONICS_STATE = np.dtype(
    [
        ("stage", "i8"),
        ("periods", "i8"),
        ("probes", "i8"),
        ("miss", "f8"),
        ("miss_before", "f8"),
        ("amplitude_v", "f8"),
        ("share", "f8"),
        ("probe_v", "f8"),
        ("probe", "f8", ORDERS),
        ("bounded", "i8"),
        ("unsteady", "i8"),
        ("samples", "i8"),
        ("off", "i8", ORDERS),
        ("prescribed", "i8"),
        ("wanted", "c16", ORDERS),
        ("phasors", "c16", ORDERS),
        ("filter", "c16", ORDERS),
        ("aim", "c16", ORDERS),
        ("volts", "c16", ORDERS),
        ("error", "c16", ORDERS),
        ("judged", "c16", ORDERS),
        ("sum", "c16", ORDERS),
        ("before", "c16", ORDERS),
        ("plant", "c16", ORDERS),
        ("total", "c16", ORDERS),
        ("mean", "c16", ORDERS),
        ("scatter_square", "f8", ORDERS),
        ("quiet_square", "f8", ORDERS),
        ("square", "f8", ORDERS),
    ]
)
"""State of the harmonics loop (one record). ``periods``: of the present stage. ``probes``: how often the plant was measured
again. ``miss``: largest judged error over its tolerance; infinite before the loop controls. ``unsteady``: unsteady periods
in a row. ``bounded``: the bound of the voltage holds harmonics back. ``amplitude_v``: the output's fundamental. ``share``:
what is left of the harmonics while a run comes down. ``probe``: sizes of the step, relative to ``probe_v``. ``off``:
harmonics that are left alone. ``wanted``: ratios to the fundamental where some are ``prescribed``. ``filter``: F_h.
``volts``: V_h, which follows ``aim`` no faster than the slew limit. ``error``: F_h - G_h. ``total``, ``samples``, ``mean``:
its sum over the present period, and its mean over the last one. ``judged``, ``square``: slow means of the mean and of its
square. ``sum``, ``before``: averages while the plant is measured. ``plant``: P_h. ``scatter_square``: mean square of the
mean's change from period to period; ``quiet_square``: its smallest of late."""


class HarmonicsSettings(Settings):
    """Harmonics of the output that make those of the force zero, or what is prescribed."""

    highest: int = Field(7, ge=2, le=MOST_HARMONICS)
    """H: highest harmonic that is controlled; the lowest is the second."""
    channel: Literal["force", "drive"] = "force"
    """Channel whose harmonics are controlled: the force, or the drive point's acceleration, for a base that is to move in a
    sine."""
    wanted: dict[int, tuple[float, float]] = Field(default_factory=dict)
    """Prescribed harmonics of that channel by their number: amplitude relative to the fundamental, and phase in deg. At phase 0
    a peak of the harmonic coincides with a peak of the fundamental. All others are wanted to be zero."""
    left_alone: tuple[int, ...] = ()
    """Harmonics up to the highest that are not controlled."""
    force_per_v: dict[int, tuple[float, float]] = Field(default_factory=dict)
    """P_h by harmonic: real and imaginary part of the channel over the output at this harmonic, N/V, without the device's
    delay. If all controlled harmonics have it, they are controlled as soon as the loop is locked; otherwise those without it
    are measured by a step before."""
    corner: float = Field(0.2, gt=0, le=0.5)
    """Corner of the adaptive filter, as a fraction of the oscillator's frequency."""
    integral: float = Field(0.04, gt=0, le=0.2)
    """Integral gain, as a fraction of the oscillator's angular frequency: an error decays to 1/e within 1/(2 pi integral)
    periods."""
    probe: float = Field(0.004, gt=0, le=0.2)
    """Amplitude of each harmonic in the step that measures the plant, relative to the output's fundamental."""
    largest: float = Field(1.0, gt=0, le=10)
    """Largest amplitude of a harmonic of the output, relative to its fundamental."""
    tolerance: float = Field(0.002, gt=0, le=0.5)
    """Largest error of a harmonic with which a point counts as settled, relative to the fundamental. What noise can cause and a
    tenth of a bit of the converter are allowed in any case."""
    accepted: float = Field(0.005, gt=0, le=0.5)
    """Largest error of a recorded harmonic with which a point is accepted, relative to the fundamental; three of its standard
    errors and a tenth of a bit are allowed in any case."""

    @model_validator(mode="after")
    def _possible(self) -> Self:
        check_wanted("wanted", self.wanted, self.highest)
        for name, orders in (("left_alone", self.left_alone), ("force_per_v", self.force_per_v)):
            for order in orders:
                if not 2 <= order <= self.highest:
                    raise ValueError(
                        f"{name}: has harmonic {order}, allowed is 2 to {self.highest}, the loop's highest"
                    )
        for order, value in self.force_per_v.items():
            if not (math.isfinite(abs(complex(*value))) and value != (0.0, 0.0)):
                raise ValueError(
                    f"force_per_v: harmonic {order} = {list(value)}, allowed are finite numbers, not both 0"
                )
        for order in self.left_alone:
            if order in self.wanted:
                raise ValueError(f"left_alone: has harmonic {order}, which wanted prescribes; allowed is one of them")
        return self

    @property
    def controlled(self) -> dict[int, complex]:
        """Controlled harmonics with their wanted ratio to the fundamental, whose phase they follow."""
        ratios = harmonic_ratios(self.wanted)
        return {order: complex(ratios[order]) for order in range(2, self.highest + 1) if order not in self.left_alone}

    def build_harmonics(self, sample_rate_hz: float, largest_v: float) -> np.ndarray:
        """Return one record of `HARMONICS`; the bench gives ``smallest`` and ``step_v``, which the caller fills in."""
        out = np.zeros(1, HARMONICS)
        out["highest"], out["of_drive"] = self.highest, self.channel == "drive"
        out["corner"], out["integral"] = self.corner, self.integral
        out["largest"], out["probe"], out["tolerance"] = self.largest, self.probe, self.tolerance
        out["largest_v"], out["dt_s"], out["step_v"] = largest_v, 1.0 / sample_rate_hz, largest_v
        out["wanted"] = harmonic_ratios(self.wanted)
        for order, value in self.force_per_v.items():
            out["plant"][0, order] = complex(*value)
        out["left_alone"][0, list(self.left_alone)] = 1
        return out

    def check_frequency(self, sample_rate_hz: float, highest_hz: float, lead_samples: float) -> None:
        """Raise ValueError if ``highest_hz`` is too high for the filter, for a harmonic or for the delay of the output.

        ``lead_samples``: samples from an output to the input that shows it.
        """
        turn = 2.0 * math.pi * highest_hz / sample_rate_hz
        at = f"at {highest_hz:g} Hz and {sample_rate_hz:g} samples/s"
        if self.highest * turn > HIGHEST_TURN:
            raise ValueError(f"harmonics.highest = {self.highest}: allowed {at} is up to {int(HIGHEST_TURN / turn)}")
        if self.corner * turn * (2 * self.highest + 1) > 1.0:
            most = 1.0 / (turn * (2 * self.highest + 1))
            raise ValueError(
                f"harmonics.corner = {self.corner:g}: allowed {at} is up to {most:.2g} with H = {self.highest}"
            )
        margin = self.phase_margin_deg(turn * lead_samples)
        if margin < SMALLEST_MARGIN_DEG:
            raise ValueError(
                f"harmonics.integral = {self.integral:g}: its phase margin {at} is {margin:.0f} deg with {lead_samples:g} "
                f"samples from output to input, allowed is at least {SMALLEST_MARGIN_DEG:g}: smaller, or shorter blocks"
            )

    def phase_margin_deg(self, delay_rad: float) -> float:
        """Return the phase margin of every loop on a plant that is constant near its harmonic, deg.

        ``delay_rad``: turn of the oscillator during the delay of the output. With frequencies relative to the oscillator's the
        open loop is ``k w exp(-i x d)/(i x (i x + w))``, with the gain k, the filter's corner w and the delay d.
        """
        k, w = self.integral, self.corner
        crossover = w * math.sqrt(0.5 * (math.sqrt(1.0 + 4.0 * (k / w) ** 2) - 1.0))
        return math.degrees(0.5 * math.pi - math.atan(crossover / w) - crossover * delay_rad)


def check_wanted(name: str, wanted: Mapping[int, tuple[float, float]], highest: int) -> None:
    """Raise ValueError, naming ``name``, unless prescribed harmonics are from 2 to ``highest`` and their numbers possible."""
    for order, (ratio, phase_deg) in wanted.items():
        if not 2 <= order <= highest:
            raise ValueError(f"{name}: has harmonic {order}, allowed is 2 to {highest}, the loop's highest")
        if not (0.0 <= ratio <= LARGEST_WANTED and math.isfinite(phase_deg)):
            raise ValueError(
                f"{name}: harmonic {order} = [{ratio:g}, {phase_deg:g}], allowed is a ratio from 0 to {LARGEST_WANTED:g} "
                "and a phase"
            )


def harmonic_ratios(wanted: Mapping[int, tuple[float, float]]) -> np.ndarray:
    """Return complex ratios to the fundamental, complex128[13], from amplitude ratios and phases (deg) by harmonic."""
    out = np.zeros(ORDERS, np.complex128)
    for order, (ratio, phase_deg) in wanted.items():
        out[order] = cmath.rect(ratio, math.radians(phase_deg))
    return out


@kernel
def want_harmonics(state: Record, wanted: np.ndarray) -> None:
    """Prescribe the channel's harmonics, as complex ratios to the fundamental: complex128[13], entry h is harmonic h."""
    state.prescribed = 0
    for order in range(2, wanted.size):
        state.wanted[order] = wanted[order]
        if wanted[order] != 0.0:
            state.prescribed = 1


@kernel
def left_alone(parameters: Record, state: Record) -> int:
    """Return the harmonics whose plant could not be told from noise, as bits: bit h for harmonic h."""
    bits = 0
    for order in range(2, parameters.highest + 1):
        if state.off[order] == 1 and parameters.left_alone[order] == 0:
            bits |= 1 << order
    return bits


@inner_kernel
def measure_harmonics(parameters: Record, state: Record, value: float, phasor: complex, omega: float) -> None:
    """Update the controlled channel's harmonics and their errors with one sample (N or m/s^2).

    ``value`` is as measured, with its mean: a filter that removes the mean would turn the harmonics against each other.
    ``phasor`` is ``exp(i theta)`` at the input, ``omega`` the oscillator's frequency (rad/s).
    """
    highest = parameters.highest
    gain = parameters.corner * omega * parameters.dt_s
    turn_phasors(state.phasors, highest, phasor.real, phasor.imag)
    adapt(state.filter, state.phasors, highest, value, gain)
    late = parameters.high_pass_rad_s / omega
    fundamental = state.filter[1] * complex(1.0, -late)
    amplitude = size(fundamental)
    turn = fundamental / amplitude if amplitude > 0.0 else complex(1.0, 0.0)
    turned = turn * amplitude
    for order in range(2, highest + 1):
        error = state.filter[order]
        if state.prescribed == 1:
            turned *= turn
            error = error * complex(1.0, -late / order) - state.wanted[order] * turned
        state.error[order] = error
        state.total[order] += error
    state.samples += 1


@inner_kernel
def drive_harmonics(
    parameters: Record, state: Record, amplitude_v: float, omega: float, running: bool, acts: bool
) -> None:
    """Evaluate the integral laws for one sample: update the harmonics of an output whose fundamental is ``amplitude_v``.

    Without ``acts`` they are kept. Once the run is not ``running`` any more, they come down with the fundamental. The whole
    output stays within the largest voltage: harmonics give way to the fundamental.
    """
    if running:
        state.amplitude_v = amplitude_v
        state.share = 1.0
    else:
        state.share = amplitude_v / state.amplitude_v if state.amplitude_v > 0.0 else 0.0
        return
    highest, total = parameters.highest, 0.0
    gain = parameters.integral * omega * parameters.dt_s
    most = parameters.largest * amplitude_v
    for order in range(2, highest + 1):
        aim, volts = state.aim[order], state.volts[order]
        if acts and state.off[order] == 0 and state.stage == CONTROLLING:
            error = state.error[order]
            if size(error) > LEFT_ALONE * parameters.smallest:
                step = -gain * error / state.plant[order]
                aim += step * min(1.0, parameters.step_v / max(size(step), parameters.step_v))
        aim *= most / max(size(aim), most) if most > 0.0 else 0.0
        way = aim - volts
        volts += way * min(1.0, parameters.step_v / max(size(way), parameters.step_v))
        volts *= most / max(size(volts), most) if most > 0.0 else 0.0
        state.aim[order], state.volts[order] = aim, volts
        total += size(volts)
    state.bounded = 1 if amplitude_v + total > FULL * parameters.largest_v else 0
    if amplitude_v + total > parameters.largest_v and total > 0.0:
        left = max(parameters.largest_v - amplitude_v, 0.0) / total
        for order in range(2, highest + 1):
            state.volts[order] *= left
            state.aim[order] = state.volts[order]


@inner_kernel
def harmonics_at(parameters: Record, state: Record, theta: float) -> float:
    """Return ``Re sum_h V_h exp(i h theta)`` (V), the harmonics of the output."""
    turn = complex(math.cos(theta), math.sin(theta))
    phasor, out = turn, 0.0
    for order in range(2, parameters.highest + 1):
        phasor *= turn
        volts = state.volts[order]
        out += volts.real * phasor.real - volts.imag * phasor.imag
    return float(state.share * out)


@kernel
def probe_of(parameters: Record, state: Record, order: int) -> complex:
    """Return a harmonic of the step (V); the phases keep the sum of all low (Schroeder)."""
    angle = -math.pi * order * (order - 1) / parameters.highest
    volts = state.probe[order] * state.probe_v
    return complex(volts * math.cos(angle), volts * math.sin(angle))


@kernel
def listen(parameters: Record, state: Record, periods: int) -> None:
    """Begin to average the harmonics, after ``periods`` of the time that is waited have passed."""
    state.stage, state.periods = LISTENING, periods
    for order in range(2, parameters.highest + 1):
        state.sum[order] = 0.0


@kernel
def end_harmonics_period(
    parameters: Record, state: Record, amplitude_v: float, locked: bool, steady: bool, free: bool
) -> None:
    """Advance the loop's stage by one oscillator period, and judge the errors.

    ``locked``: the vibration is locked, or its frequency given. ``steady``: apart from harmonics it is also settled at its
    level. ``free``: the level is held and nothing is recorded, so that the plant may be measured.
    """
    end_means(parameters, state)
    if state.stage == CONTROLLING:
        judge_harmonics(parameters, state, amplitude_v, steady, free)
        return
    state.miss = math.inf
    state.periods += 1
    if state.probes == 0 and state.stage == WAITING and locked and knows_plant(parameters, state):
        begin_to_control(parameters, state)
        return
    state.unsteady = 0 if steady else state.unsteady + 1
    if not steady and (state.stage == WAITING or not (locked and free) or state.unsteady > MOST_UNSTEADY):
        if state.stage == PROBING:
            for order in range(2, parameters.highest + 1):
                state.aim[order] -= probe_of(parameters, state, order)
        state.stage = WAITING
        return
    if state.stage == WAITING:
        for order in range(2, parameters.highest + 1):
            state.probe[order] = 0.0 if parameters.left_alone[order] == 1 else parameters.probe
        first = state.probe_v == 0.0 and state.probes == 0  # else the loops have only now come to rest
        listen(parameters, state, WAIT_PERIODS if first else 0)
        return
    if state.periods <= WAIT_PERIODS:
        return
    for order in range(2, parameters.highest + 1):
        state.sum[order] += state.mean[order] / MEAN_PERIODS
    if state.periods < WAIT_PERIODS + MEAN_PERIODS:
        return
    if state.stage == LISTENING:
        state.stage, state.periods, state.probe_v = PROBING, 0, amplitude_v
        for order in range(2, parameters.highest + 1):
            state.before[order] = state.sum[order]
            state.aim[order] += probe_of(parameters, state, order)
            state.sum[order] = 0.0
    else:
        learn_plant(parameters, state)


@kernel
def knows_plant(parameters: Record, state: Record) -> bool:
    """Take the plants that are known beforehand; return whether those of all controlled harmonics are."""
    all_known = True
    for order in range(2, parameters.highest + 1):
        state.plant[order] = parameters.plant[order]
        state.off[order] = parameters.left_alone[order]
        if parameters.plant[order] == 0.0 and parameters.left_alone[order] == 0:
            all_known = False
    return all_known


@kernel
def begin_to_control(parameters: Record, state: Record) -> None:
    """Close the loops."""
    state.stage, state.periods, state.miss_before = CONTROLLING, 0, math.inf
    for order in range(2, parameters.highest + 1):
        state.judged[order] = state.mean[order]
        state.square[order] = size(state.mean[order]) ** 2


@kernel
def learn_plant(parameters: Record, state: Record) -> None:
    """Take every harmonic's plant from its change under the step, and begin to control.

    Where a change is not clear, repeat with a larger step of that harmonic; leave it alone if the largest one shows nothing.
    """
    if state.bounded == 1:  # the step was held back: nothing is learned from it
        for order in range(2, parameters.highest + 1):
            state.aim[order] = 0.0
        state.stage = WAITING
        return
    again = False
    for order in range(2, parameters.highest + 1):
        change, step = state.sum[order] - state.before[order], probe_of(parameters, state, order)
        state.aim[order] -= step
        clear = size(change) > CLEAR * math.sqrt(state.scatter_square[order])
        state.off[order] = 0 if clear else 1
        if parameters.left_alone[order] == 1:
            state.off[order] = 1
        elif parameters.plant[order] != 0.0 and state.probes == 0:
            state.off[order] = 0  # known beforehand, and not found wrong
        elif clear:
            state.plant[order] = change / step
        elif state.probe[order] * LARGER <= LARGEST_PROBE:
            state.probe[order] *= LARGER
            again = True
    if again:
        listen(parameters, state, 0)
        return
    for order in range(2, parameters.highest + 1):
        if state.off[order] == 1:
            state.aim[order] = 0.0
    begin_to_control(parameters, state)


@kernel
def end_means(parameters: Record, state: Record) -> None:
    """Take the means of the errors over the period that has ended; harmonics above the highest leave no ripple in them.

    Update their slow mean and mean square, and, except under the step and shortly after one, the mean square of their change
    from period to period, by which noise is told. Before a step only the periods count whose mean is taken.
    """
    n = max(state.samples, 1)
    weight = JUDGED
    if state.stage == PROBING:
        weight = 0.0
    elif state.stage == LISTENING:
        averaged = state.periods + 1 - WAIT_PERIODS
        weight = 1.0 / averaged if averaged > 0 else 0.0
    for order in range(2, parameters.highest + 1):
        mean = state.total[order] / n
        change = size(mean - state.mean[order])
        state.mean[order] = mean
        state.total[order] = 0.0
        state.judged[order] += JUDGED * (mean - state.judged[order])
        state.square[order] += JUDGED * (size(mean) ** 2 - state.square[order])
        if weight > 0.0:
            state.scatter_square[order] += weight * (change * change - state.scatter_square[order])
        if state.stage in (WAITING, CONTROLLING):
            scatter, quiet = state.scatter_square[order], state.quiet_square[order]
            state.quiet_square[order] = min(LEAK * quiet, scatter) if quiet > 0.0 else scatter
    state.samples = 0


@kernel
def judge_harmonics(parameters: Record, state: Record, amplitude_v: float, steady: bool, free: bool) -> None:
    """Compare the errors with their tolerances.

    Measure the plant again if at a held level they grow or do not decay, or if a harmonic was left alone at a lower level.
    """
    allowed = max(parameters.tolerance * size(state.filter[1]), parameters.smallest)
    state.miss = 0.0
    for order in range(2, parameters.highest + 1):
        if state.off[order] == 0:
            # A loop that swings scatters too: noise is not more than a few times what it was when all was quiet.
            noise = math.sqrt(min(state.scatter_square[order], QUIET * state.quiet_square[order]))
            bound = max(allowed, NOISY * noise)
            state.miss = max(
                state.miss, size(state.judged[order]) / bound, math.sqrt(state.square[order]) / (SWING * bound)
            )
    if steady and free and amplitude_v > LOUDER * state.probe_v and left_alone(parameters, state) != 0:
        state.stage = WAITING
        return
    if not free or state.miss <= 1.0:
        state.periods, state.miss_before = 0, math.inf
        return
    if state.periods == 0:
        state.miss_before = state.miss
    state.periods += 1
    grows = state.miss > GROWN * state.miss_before
    if state.periods > PATIENCE or grows:
        stays = grows or (steady and state.miss > DECAYED * state.miss_before)
        state.periods = 0
        if stays and state.probes < MOST_PROBES:
            state.stage = WAITING
            state.probes += 1
            for order in range(2, parameters.highest + 1):
                if state.bounded == 1:  # there is no room for a step
                    state.aim[order] = 0.0
