"""Room for hardening and softening: the frequency window, and how slowly levels change."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from controller.tuning import PlantModel
from identification import FrequencyResponseMatrix
from rig.bench import Bench
from rig.tick.tick import SMALLEST_BITS
from vibrolock.arrays import Float

SHIFTS = (0.8, 1.25)  # of the linear frequency: hardening and softening that a test allows for
MIN_PROMINENCE = 3.0  # of a mode's peak over the lowest response between it and the tested mode
RAMP_TIME_CONSTANTS = 1.5  # length of a ramp, in times 1/(D w_0) in which a free vibration decays by e
MIN_RAMP, MAX_RAMP = 20.0, 300.0  # ramps, periods
START_SHARES = (0.25, 0.5)
"""Of the force limit, on the way to the start voltage: the second where the first gives no force that can be read; chosen:
stiff springs double the linear force."""
START_REACH = 0.03  # distance from resonance at which a run may begin, relative: tunings were off by up to 1 %
READABLE = 5.0  # force at the start over the least whose phase is read (0.4 bits): rounding disturbs fewer bits; chosen
MIN_START, MAX_START = 40.0, 600.0  # periods
START_RAMPS = (10.0, 20.0, 40.0, 80.0, 160.0, 300.0)  # lengths of the ramp to the start voltage, periods
HELD_DECAYS = 4.0  # of the coupled pole, for which the start is computed
PLAUSIBLE_SHIFT = 0.005  # change of the frequency from level to level


@dataclass(frozen=True)
class Window:
    """Frequencies that the loop may take."""

    lowest_hz: float
    """Lower end, Hz."""
    highest_hz: float
    """Upper end, Hz."""
    why: str
    """What sets the ends."""


def frequency_window(bench: Bench, responses: FrequencyResponseMatrix, plant: PlantModel) -> Window:
    """Return the window: room for `SHIFTS`, but no further than half way to other modes, and within the bench's limits."""
    hertz = plant.lock_frequency_rad_s() / (2.0 * math.pi)
    below, above = other_modes(responses, plant)
    ends = [part * hertz for part in SHIFTS]
    why = [f"{100.0 * (part - 1.0):+.0f} %" for part in SHIFTS]
    for end, (other, inner) in enumerate(((below, max), (above, min))):
        if other is not None:
            half_way = math.sqrt(hertz * other)
            if inner(ends[end], half_way) == half_way:
                ends[end], why[end] = half_way, f"half way to another mode at {other:.4g} Hz"
        limit = bench.limits.frequency_hz[end]
        if inner(ends[end], limit) == limit:
            ends[end], why[end] = limit, "the bench's limit"
    return Window(float(f"{ends[0]:.6g}"), float(f"{ends[1]:.6g}"), f"from {why[0]} to {why[1]}")


def other_modes(responses: FrequencyResponseMatrix, plant: PlantModel) -> tuple[float | None, float | None]:
    """Return the frequencies (Hz) of the nearest other modes below and above the tested one, None where none is seen.

    A mode is a peak of the measured accelerance, the ratio of acceleration to force, that stands out of what lies between it
    and the tested mode.
    """
    hertz = plant.frequency_rad_s / (2.0 * math.pi)
    frequency = responses.frequency_hz
    size = np.abs(responses.value[:, 1, 0] / responses.value[:, 0, 0])
    apart = max(6.0 * plant.damping_ratio, 0.03) * hertz
    out: list[float | None] = []
    for side in (frequency < hertz - apart, frequency > hertz + apart):
        outwards = np.flatnonzero(side)
        outwards = outwards[np.argsort(np.abs(frequency[outwards] - hertz))]
        out.append(_first_peak(frequency[outwards], size[outwards]))
    return out[0], out[1]


def _first_peak(frequency: Float, size: Float) -> float | None:
    """Return the frequency of the first peak, seen outwards, that stands out of the lowest response before it and after it."""
    if size.size < 5:
        return None
    size = np.convolve(np.pad(size, 2, mode="edge"), np.full(5, 0.2), mode="valid")  # noise is no mode
    rising = np.flatnonzero(size > MIN_PROMINENCE * np.minimum.accumulate(size))
    if not rising.size:
        return None
    later = size[rising[0] :]
    fallen = np.flatnonzero(later < np.maximum.accumulate(later) / 1.5)
    end = int(fallen[0]) if fallen.size else later.size
    return float(frequency[rising[0] + int(np.argmax(later[:end]))])


def ramp_periods(plant: PlantModel, tracking_periods: float) -> float:
    """Return the length of the ramps between levels, periods.

    The force that lets a vibration grow comes on top of the one that holds it: it falls with the length of a ramp over
    ``1/(D w_0)``. A frequency that changes with the level is followed late, by its change within ``tracking_periods``: a change
    of `PLAUSIBLE_SHIFT` per level shall leave less than half of the half bandwidth ``D w_0``.
    """
    grows = RAMP_TIME_CONSTANTS / (2.0 * math.pi * plant.damping_ratio)
    follows = 0.5 * math.pi * PLAUSIBLE_SHIFT * tracking_periods / (0.5 * plant.damping_ratio)
    return float(min(max(5.0 * math.ceil(max(grows, follows) / 5.0), MIN_RAMP), MAX_RAMP))


class Start(NamedTuple):
    """How a run sets the rig in motion."""

    voltage_v: float
    """Voltage at which the lock is sought, V peak."""
    ramp_periods: float
    """Length of the ramp to it, periods."""


def start_of(bench: Bench, plant: PlantModel, needed_v: float) -> Start:
    """Return the voltage that sets the rig in motion, ``needed_v`` (V peak) of the lowest level or less, and the ramp to it.

    The force on the way there may reach a quarter of the bench's limit (`largest_start_force`), or half. The ramp is the
    shortest of some whose voltage then gives a force at resonance that can be read, or that of the lowest level.
    """
    force = bench.channels[bench.index_of("force")]
    readable_v = min(needed_v, READABLE * SMALLEST_BITS * force.resolution_in_unit * plant.volts_per_newton())
    most_v = {ramp: bench.limits.force_n / largest_start_force(plant, ramp) for ramp in START_RAMPS}
    starts = [Start(min(needed_v, share * most_v[ramp]), ramp) for share in START_SHARES for ramp in START_RAMPS]
    return next((start for start in starts if start.voltage_v >= readable_v), starts[-1])


def largest_start_force(plant: PlantModel, ramp_periods: float) -> float:
    """Return the largest force per volt (N/V) in a ramp of the voltage to 1 V, and while it is held, near resonance.

    At resonance a lightly damped structure takes a small part of the force that the same voltage gives while it is at rest, or
    a few per cent beside it. The envelope of the force is the inverse Fourier transform of that of the voltage, a raised
    cosine, times the response around the output's frequency, which is within `START_REACH` of the resonance.
    """
    resonance = plant.lock_frequency_rad_s()
    decay = resonance / (-2.0 * math.pi * plant.coupled_pole_rad_s.real)
    rise = 0.5 * (1.0 - np.cos(np.pi * np.arange(ramp_periods) / ramp_periods))
    held = np.ones(math.ceil(min(HELD_DECAYS * decay, MAX_START)))
    envelope = np.concatenate([rise, held, rise[::-1]])  # one entry a period
    size = 2 ** math.ceil(math.log2(2 * envelope.size))
    sent = np.fft.fft(envelope, size)
    frequency = resonance * np.linspace(1.0 - START_REACH, 1.0 + START_REACH, 13)[:, None]
    around = frequency * (1.0 + np.fft.fftfreq(size))
    return float(np.max(np.abs(np.fft.ifft(sent * plant.force_per_v(1j * around)))))


def start_periods(plant: PlantModel, tracking_periods: float) -> float:
    """Return the time at the first voltage, periods.

    It is three decays of the coupled pole, but at least four times what the frequency takes to follow.
    """
    decays = 3.0 * plant.frequency_rad_s / (-2.0 * math.pi * plant.coupled_pole_rad_s.real)
    periods = 5.0 * math.ceil(max(decays, 4.0 * tracking_periods) / 5.0)
    return float(min(max(periods, MIN_START), MAX_START))
