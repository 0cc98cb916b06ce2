"""Passes over a run of a model with its exciter, until the force does not change any more.

``F = g_e V - Z X_a`` (`identification.exciter_coupling.exciter`): the contribution of the voltage is known beforehand. It is
computed at all lines of the run at once, with the delay, hold and coupling of its path, and is therefore exact at any sample
rate. The contribution of the motion is approximated during the simulation by a filter (`reaction`). The remainder is added in
repeated passes over the run, exactly above the lowest frequency, until the force no longer changes (waveform relaxation:
Lelarasmee et al., IEEE Trans. CAD 1, 1982).
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import ArrayLike

from identification.channels import MOTION_ORDER, find_role
from identification.errors import IdentificationError
from identification.exciter_coupling.exciter import Exciter
from identification.exciter_coupling.reaction import Reaction, chosen_filter
from identification.experiments.simulators import Driven
from identification.linear.subspace import StateSpace
from identification.validation import finite_array, positive
from vibrolock.arrays import Complex, Float

_HIGHEST = 0.45
"""Upper limit of the lowest frequency, over the sample rate: the exciter's reaction needs lines above it. Chosen."""
_FADED = 0.5
"""Share of the lowest frequency below which only the filter contributes to the reaction. Chosen."""
_AFTER_PERIODS = 40
"""Periods of the lowest frequency simulated at zero volts after the end, so that the run does not end with a jump. Chosen."""
_TOLERANCE = 1e-6
"""Relative change of the force in a pass below which the passes end. Chosen."""
_PASSES = 40
"""Passes over a run, at most. Chosen."""


class DrivePoint(NamedTuple):
    """Where an exciter drives a model, and from which frequency on its reaction is exact."""

    row: int
    """Row of the force among the inputs of the model."""
    output: int
    """Row of the drive point among its outputs."""
    order: int
    """How often that output is differentiated: 0 for a displacement, 2 for an acceleration."""
    lowest_hz: float
    """Frequency above which the exciter's reaction is exact."""


def drive_point(model: Driven, rate_hz: float, lowest_hz: float | None, default_hz: Callable[[], float]) -> DrivePoint:
    """Return where the exciter drives a model of one force; raise `IdentificationError` if the model lacks the channels."""
    forces = [row for row, channel in enumerate(model.inputs) if channel.role == "force"]
    if len(forces) != 1:
        raise IdentificationError(
            f"has {len(forces)} forces among its inputs", field="model", allowed="one, which the exciter makes"
        )
    others = [channel.name for row, channel in enumerate(model.inputs) if row != forces[0]]
    if others:
        raise IdentificationError(
            f"has inputs beside its force ({', '.join(others)}), whose values a run with an exciter does not know",
            field="model",
            allowed="a model of the force alone",
        )
    output = find_role(model.outputs, "drive")
    low = default_hz() if lowest_hz is None else positive("lowest_hz", lowest_hz, "Hz")
    if low >= _HIGHEST * rate_hz:
        raise IdentificationError(field="lowest_hz", value=low, allowed=f"well below half of {rate_hz:g} Hz")
    return DrivePoint(forces[0], output, MOTION_ORDER[model.outputs[output].motion], low)


class Passes:
    """Passes over a run under a recorded voltage, float[n] at ``rate_hz``, with zero volts before and after it.

    ``linear``: linear part of the model. Raises `IdentificationError` for a voltage that is not finite, or if no stable filter
    for the reaction is found.
    """

    def __init__(
        self, exciter: Exciter, at: DrivePoint, linear: StateSpace, rate_hz: float, voltage_v: ArrayLike
    ) -> None:
        voltage = finite_array("voltage_v", voltage_v, np.float64, 1)
        reaction, self.n, low = Reaction(exciter, at.order, at.lowest_hz, rate_hz), voltage.size, at.lowest_hz
        self.loop = chosen_filter(reaction, linear, at.row, at.output)
        """Filter that approximates the reaction during a simulation."""
        rest = int(np.ceil(_AFTER_PERIODS * rate_hz / low))
        self.count = voltage.size + rest
        """Samples of a simulation, with those after the end."""
        self._size = int(scipy.fft.next_fast_len(self.count + rest, real=True))
        hz = np.arange(self._size // 2 + 1) * rate_hz / self._size
        made = np.zeros(hz.size, dtype=complex)
        made[1:] = exciter.force(1.0, 0.0, hz[1:])
        self._driving = self._filtered(made, voltage)
        share = np.clip((hz / low - _FADED) / (1.0 - _FADED), 0.0, 1.0)
        within = np.sin(0.5 * np.pi * share) ** 2
        self._left = np.zeros(hz.size, dtype=complex)
        used = np.flatnonzero(within)
        self._left[used] = within[used] * (reaction.exact(hz[used]) - reaction.response(self.loop, hz[used]))

    def _filtered(self, response: Complex, values: Float) -> Float:
        """Return the response of a filter, float[count], to values that are zero after their end."""
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
            return [f"diverged in pass {passes} over the run, and in none before"]
        if change > _TOLERANCE:
            return [
                f"after {passes} passes the force still changed by {100.0 * change:.2g} %: the run is that uncertain"
            ]
        return []
