"""Simulations that the measured motion leads, so that a fit from a poor start does not end at a far minimum.

A lightly damped model with wrong numbers soon moves in another phase, or on another branch, than the measurement, and the sum
of squares has many minima. With a force ``rate (measured velocity - velocity)`` on every mode it cannot: its memory is as short
as ``1 / rate``. A fit begins with a fast rate and ends without any.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from identification.models.structured.held_support import held, periods_of
from identification.models.structured.model import ends_of_steps
from identification.models.structured.steps import System, led
from vibrolock.arrays import Float


@dataclass(frozen=True, eq=False)
class Lead:
    """Forces that lead the modes.

    Parameters
    ----------
    before, rate
        float[n_modes], rates up to sample ``until`` and from there on, rad/s; 0 for a mode that is not led.
    signals
        float[n_inputs + n_modes, n], inputs and measured modal velocities.
    steps
        Steps in a sample.
    until
        Number of samples that are led at the rate ``before``.
    period
        Samples of a period. Periods begin at ``until``.
    """

    before: Float
    rate: Float
    signals: Float
    steps: int
    until: int
    period: int

    @cached_property
    def ends(self) -> Float:
        """float[n steps + 1, n_inputs + n_modes], the signals at the ends of all steps."""
        return ends_of_steps(self.signals, self.steps)

    def stretches(self, system: System, samples: int) -> list[tuple[System, int, int]]:
        """Return the system that is led, and first and last sample, of every period or part of one."""
        systems = [held(led(system, self.before)), held(led(system, self.rate))]
        ends = zip(systems, (0, self.until), (self.until, samples), strict=True)
        return [(one, *at) for one, a, b in ends for at in periods_of(a, b, self.until, self.period)]


def not_led(derivatives: Float, system: System, rate: Float) -> Float:
    """Return derivatives ``[..., P]`` by omega at the damping ratios of the system that is not led.

    At a given damping ratio of its own, the damping ratio of the led mode falls with its frequency.
    """
    n, own = len(rate), derivatives.copy()
    own[..., :n] -= derivatives[..., n : 2 * n] * (0.5 * rate / system.omega**2)
    return np.asarray(own)
