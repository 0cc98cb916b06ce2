"""Passes over a run of a model with its exciter, until the force does not change any more."""

from collections.abc import Callable

import numpy as np
import scipy

from identification.exciter_coupling.reaction import Reaction, chosen_filter
from identification.linear.subspace import StateSpace
from vibrolock.arrays import Complex, Float

_FADED = 0.5
"""Share of the lowest frequency below which only the filter contributes to the reaction."""
_AFTER_PERIODS = 40
"""Periods of the lowest frequency simulated at zero volts after the end, so that the run does not end with a jump."""
_TOLERANCE = 1e-6
"""Relative change of the force in a pass below which the passes end. Chosen."""
_PASSES = 40
"""Passes over a run, at most. Chosen."""


class Passes:
    """Passes over a run, with zero volts before and after the recorded voltage.

    Parameters
    ----------
    reaction
        Reaction of the exciter to the output at the drive point.
    linear, row, output
        Linear part of the model, the input that the exciter drives, and the output at the drive point.
    voltage_v
        float[n].
    """

    def __init__(self, reaction: Reaction, linear: StateSpace, row: int, output: int, voltage_v: Float) -> None:
        self.n = voltage_v.size
        self.loop = chosen_filter(reaction, linear, row, output)
        """Filter that approximates the reaction during a simulation."""
        rate_hz, low = reaction.sample_rate_hz, reaction.lowest_hz
        rest = int(np.ceil(_AFTER_PERIODS * rate_hz / low))
        self.count = voltage_v.size + rest
        """Samples of a simulation, with those after the end."""
        self._size = int(scipy.fft.next_fast_len(self.count + rest, real=True))
        hz = np.arange(self._size // 2 + 1) * rate_hz / self._size
        made = np.zeros(hz.size, dtype=complex)
        made[1:] = reaction.exciter.force(1.0, 0.0, hz[1:])
        self._driving = self._filtered(made, voltage_v)
        share = np.clip((hz / low - _FADED) / (1.0 - _FADED), 0.0, 1.0)
        within = np.sin(0.5 * np.pi * share) ** 2
        self._left = np.zeros(hz.size, dtype=complex)
        used = np.flatnonzero(within)
        self._left[used] = within[used] * (reaction.exact(hz[used]) - reaction.response(self.loop, hz[used]))

    def _filtered(self, response: Complex, values: Float) -> Float:
        """float[count]: response of a filter to values that are zero after their end."""
        return np.asarray(scipy.fft.irfft(response * scipy.fft.rfft(values, self._size), self._size)[: self.count])

    def run(self, simulate: Callable[[Float], int], force: Float, motion: Float) -> tuple[int, int, float]:
        """Repeat a simulation; return the samples that it reached, the number of passes, and the last change of the force.

        ``simulate(given)`` simulates from rest with the force ``given`` (float[count]) plus the filter's, writes ``force`` and
        ``motion`` (the output at the drive point), float[count], and returns the first sample that is not valid, or ``count``.
        The change is relative to the RMS force; NaN for an unbounded run.
        """
        before = np.zeros(self.count)
        given, change, passes, reached = self._driving, np.inf, 0, self.count
        while change > _TOLERANCE and passes < _PASSES:
            passes += 1
            reached = simulate(given)
            if reached < self.n:
                return reached, passes, np.nan
            motion[reached:], force[reached:] = 0.0, 0.0
            change = float(np.linalg.norm(force - before) / max(float(np.linalg.norm(force)), 1e-300))
            before[:] = force
            given = self._driving + self._filtered(self._left, motion)
        return self.n, passes, change

    def notes(self, reached: int, passes: int, change: float) -> list[str]:
        """Return remarks on a run, one line each."""
        if reached < self.n and passes > 1:
            return [f"left all bounds in pass {passes} over the run, and in none before"]
        if change > _TOLERANCE:
            return [
                f"after {passes} passes the force still changed by {100.0 * change:.2g} %: the run is that uncertain"
            ]
        return []
