"""The table `[controller.harmonics]`, and what it may prescribe."""

import cmath
import math
from collections.abc import Mapping
from typing import Literal, Self

import numpy as np
from pydantic import Field, model_validator

from controller.adaptive_filter import MOST_HARMONICS
from controller.harmonics.records import HARMONICS, ORDERS
from controller.settings import Settings
from vibrolock.errors import InputError

LARGEST_WANTED = 10.0  # largest ratio of a prescribed harmonic to the fundamental; chosen
SMALLEST_MARGIN_DEG = 35.0  # deg; smallest phase margin of the harmonics loop; chosen
HIGHEST_TURN = 0.8 * math.pi  # of the highest harmonic from sample to sample


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
                    reason = f"has harmonic {order}"
                    raise InputError(reason, field=name, allowed=f"2 to {self.highest}, the loop's highest")
        for order, value in self.force_per_v.items():
            if not (math.isfinite(abs(complex(*value))) and value != (0.0, 0.0)):
                reason = f"harmonic {order} = {list(value)}"
                raise InputError(reason, field="force_per_v", allowed="finite numbers, not both 0")
        for order in self.left_alone:
            if order in self.wanted:
                reason = f"has harmonic {order}, which wanted prescribes"
                raise InputError(reason, field="left_alone", allowed="one of them")
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

    def check_frequency(self, sample_rate_hz: float, highest_hz: float, loop_delay_samples: float) -> None:
        """Raise ValueError if ``highest_hz`` is too high for the filter, for a harmonic or for the delay of the output.

        ``loop_delay_samples``: samples from an output to the input that shows it.
        """
        turn = 2.0 * math.pi * highest_hz / sample_rate_hz
        at = f"at {highest_hz:g} Hz and {sample_rate_hz:g} samples/s"
        if self.highest * turn > HIGHEST_TURN:
            reason = f"allowed {at} is up to {int(HIGHEST_TURN / turn)}"
            raise InputError(reason, field="harmonics.highest", value=self.highest)
        if self.corner * turn * (2 * self.highest + 1) > 1.0:
            most = 1.0 / (turn * (2 * self.highest + 1))
            reason = f"allowed {at} is up to {most:.2g} with H = {self.highest}"
            raise InputError(reason, field="harmonics.corner", value=self.corner)
        margin = self.phase_margin_deg(turn * loop_delay_samples)
        if margin < SMALLEST_MARGIN_DEG:
            reason = (
                f"its phase margin {at} is {margin:.0f} deg with {loop_delay_samples:g} samples from output to input"
            )
            allowed = f"at least {SMALLEST_MARGIN_DEG:g}: smaller, or shorter blocks, or a shorter queue"
            raise InputError(reason, field="harmonics.integral", value=self.integral, allowed=allowed)

    def longest_delay_s(self, highest_hz: float) -> float:
        """Return the delay with which the phase margin at ``highest_hz`` is the smallest allowed, s."""
        spare_deg = self.phase_margin_deg(0.0) - SMALLEST_MARGIN_DEG
        a_turn_deg = self.phase_margin_deg(0.0) - self.phase_margin_deg(
            2.0 * math.pi
        )  # the margin is linear in the delay
        return spare_deg / a_turn_deg / highest_hz

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
            raise InputError(f"has harmonic {order}", field=name, allowed=f"2 to {highest}, the loop's highest")
        if not (0.0 <= ratio <= LARGEST_WANTED and math.isfinite(phase_deg)):
            reason = f"harmonic {order} = [{ratio:g}, {phase_deg:g}]"
            raise InputError(reason, field=name, allowed=f"a ratio from 0 to {LARGEST_WANTED:g} and a phase")


def harmonic_ratios(wanted: Mapping[int, tuple[float, float]]) -> np.ndarray:
    """Return complex ratios to the fundamental, complex128[13], from amplitude ratios and phases (deg) by harmonic."""
    out = np.zeros(ORDERS, np.complex128)
    for order, (ratio, phase_deg) in wanted.items():
        out[order] = cmath.rect(ratio, math.radians(phase_deg))
    return out
