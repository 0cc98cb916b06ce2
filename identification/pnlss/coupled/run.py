"""Simulate a force-driven model together with an identified exciter, from the recorded voltage.

``F = g_e V - Z X_a`` (`identification.prediction.exciter`): the contribution of the voltage is known beforehand. It is
computed at all lines of the run at once, with the delay, hold and coupling of its path, and is therefore exact at any sample
rate. The contribution of the motion is approximated during the simulation by a filter. The remainder is added in repeated
passes over the run, exactly above the lowest frequency, until the force no longer changes (waveform relaxation: Lelarasmee et
al., IEEE Trans. CAD 1, 1982).
"""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from identification.channels import MOTION_ORDER, find_role
from identification.errors import IdentificationError
from identification.pnlss.coupled.kernels import simulate_coupled
from identification.pnlss.coupled.reaction import Reaction, chosen_filter
from identification.pnlss.kernels import workspace
from identification.pnlss.model import PnlssModel
from identification.pnlss.simulation import Simulation, use_of
from identification.pnlss.steady.setting_up import linear_resonance_hz
from identification.prediction.exciter import Exciter
from identification.validation import finite_array, positive

__all__ = ["CoupledRun", "pnlss_coupled_run"]

Complex = NDArray[np.complex128]
Float = NDArray[np.float64]

_LOWEST, _GUESSED = 0.8, 0.5
"""Default lowest frequency: share of the lowest trained frequency, or of the linear resonance if that is unknown."""
_FADED = 0.5
"""Share of the lowest frequency below which only the filter contributes to the reaction."""
_AFTER_PERIODS = 40
"""Periods of the lowest frequency simulated at zero volts after the end, so that the run does not end with a jump."""
_TOLERANCE = 1e-6
_PASSES = 40


@dataclass(frozen=True, eq=False, kw_only=True)
class CoupledRun(Simulation):
    """A simulated run of a model with its exciter.

    Parameters
    ----------
    force_n
        float[n], force at the model's input; NaN from ``unbounded_at`` on.
    passes
        Number of passes over the run.
    change
        RMS change of the force in the last pass over the RMS force; NaN for an unbounded run.
    notes
        Remarks on this run, one line each.
    """

    force_n: Float
    passes: int
    change: float
    notes: tuple[str, ...] = ()


def pnlss_coupled_run(
    model: PnlssModel, exciter: Exciter, voltage_v: ArrayLike, *, lowest_hz: float | None = None
) -> CoupledRun:
    """Simulate a model with the exciter at its force input, both from rest, under a recorded voltage.

    Parameters
    ----------
    model
        Model with one force as its only input, and the drive-point motion among its outputs.
    exciter
        Exciter identified on the same rig. It applies no static force, as in harmonic balance (`pnlss_response`).
    voltage_v
        float[n], recorded voltage at the model's sample rate. Do not correct it for the voltage path, which the exciter's
        ``path`` models.
    lowest_hz
        Frequency above which the exciter's reaction is exact; below it the reaction fades. Default: 0.8 times the lowest
        frequency of the model's training, or half its linear resonance if that is unknown.

    Raises
    ------
    IdentificationError
        If values are NaN or infinite, the model lacks these channels, or no stable filter for the reaction is found.
    """
    v = finite_array("voltage_v", voltage_v, np.float64, 1)
    forces = [row for row, channel in enumerate(model.inputs) if channel.role == "force"]
    if len(forces) != 1:
        raise IdentificationError(
            f"model: has {len(forces)} forces among its inputs, needs one, which the exciter makes"
        )
    others = [channel.name for row, channel in enumerate(model.inputs) if row != forces[0]]
    if others:
        raise IdentificationError(
            f"model: has inputs beside its force ({', '.join(others)}), whose values a run with an exciter does not know; "
            "needs a model of the force alone"
        )
    output = find_role(model.outputs, "drive")
    low = _lowest(model) if lowest_hz is None else positive("lowest_hz", lowest_hz, "Hz")
    if low >= 0.45 * model.sample_rate_hz:
        raise IdentificationError(f"lowest_hz: is {low:g} Hz, must be well below half of {model.sample_rate_hz:g} Hz")
    reaction = Reaction(exciter, MOTION_ORDER[model.outputs[output].motion], low, model.sample_rate_hz)
    return _Run(model, reaction, forces[0], output, v).found()


def _lowest(model: PnlssModel) -> float:
    if model.excited_hz and model.excited_hz[0] > 0.0:
        return _LOWEST * model.excited_hz[0]
    return _GUESSED * linear_resonance_hz(model)


class _Run:
    """Passes over a run, with zero volts before and after the recorded voltage."""

    def __init__(self, model: PnlssModel, reaction: Reaction, row: int, output: int, voltage_v: Float) -> None:
        self._model, self._row, self._output, self._n = model, row, output, voltage_v.size
        rate_hz, low = model.sample_rate_hz, reaction.lowest_hz
        self._loop = chosen_filter(reaction, model.linear_part, row, output)
        rest = int(np.ceil(_AFTER_PERIODS * rate_hz / low))
        self._count = voltage_v.size + rest
        self._size = int(scipy.fft.next_fast_len(self._count + rest, real=True))
        hz = np.arange(self._size // 2 + 1) * rate_hz / self._size
        made = np.zeros(hz.size, dtype=complex)
        made[1:] = reaction.exciter.force(1.0, 0.0, hz[1:])
        self._driving = self._filtered(made, voltage_v)
        share = np.clip((hz / low - _FADED) / (1.0 - _FADED), 0.0, 1.0)
        within = np.sin(0.5 * np.pi * share) ** 2
        self._left = np.zeros(hz.size, dtype=complex)
        used = np.flatnonzero(within)
        self._left[used] = within[used] * (reaction.exact(hz[used]) - reaction.response(self._loop, hz[used]))

    def _filtered(self, response: Complex, values: Float) -> Float:
        """float[count]: response of a filter to values that are zero after their end."""
        return np.asarray(scipy.fft.irfft(response * scipy.fft.rfft(values, self._size), self._size)[: self._count])

    def found(self) -> CoupledRun:
        m, model = self._model.matrices, self._model
        tables = (model.state_features.table, model.output_features.table)
        x, y = np.empty((self._count, model.states)), np.empty((self._count, len(model.outputs)))
        force, before = np.empty(self._count), np.zeros(self._count)
        xi, after, work = np.empty(self._loop.b.size), np.empty(self._loop.b.size), workspace(m)
        given, change, passes, reached = self._driving, np.inf, 0, self._count
        while change > _TOLERANCE and passes < _PASSES:
            passes += 1
            reached = simulate_coupled(
                m, *tables, self._loop, self._row, self._output, given, model.bound, work, xi, after, force, x, y
            )
            if reached < self._n:
                change = np.nan
                break
            y[reached:], force[reached:] = 0.0, 0.0
            change = float(np.linalg.norm(force - before) / max(float(np.linalg.norm(force)), 1e-300))
            before[:] = force
            given = self._driving + self._filtered(self._left, y[:, self._output])
        return self._result(min(reached, self._n), x[: self._n], y[: self._n], force[: self._n], passes, change)

    def _result(self, reached: int, x: Float, y: Float, force: Float, passes: int, change: float) -> CoupledRun:
        model, n = self._model, self._n
        x[reached:], y[reached:], force[reached:] = np.nan, np.nan, np.nan
        inputs = np.zeros(len(model.inputs))
        inputs[self._row] = np.max(np.abs(force[:reached]), initial=0.0)
        notes = []
        if reached < n and passes > 1:
            notes.append(f"left all bounds in pass {passes} over the run, and in none before")
        elif change > _TOLERANCE:
            notes.append(
                f"after {passes} passes the force still changed by {100.0 * change:.2g} %: the run is that uncertain"
            )
        if np.max(np.abs(np.linalg.eigvals(model.a))) > 1.0:
            notes.append("the model's linear part is unstable")
        return CoupledRun(
            outputs=y.T,
            states=x.T,
            state_use=use_of(np.max(np.abs(x[:reached]), axis=0, initial=0.0), model.state_range),
            input_use=use_of(inputs, model.input_range),
            unbounded_at=None if reached == n else reached,
            force_n=force,
            passes=passes,
            change=change,
            notes=tuple(notes),
        )
