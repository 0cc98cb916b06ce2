"""Simulate a force-driven model together with an identified exciter, from the recorded voltage.

``F = g_e V - Z X_a`` (`identification.exciter_coupling.exciter`): the contribution of the voltage is known beforehand. It is
computed at all lines of the run at once, with the delay, hold and coupling of its path, and is therefore exact at any sample
rate. The contribution of the motion is approximated during the simulation by a filter. The remainder is added in repeated
passes over the run, exactly above the lowest frequency, until the force no longer changes (waveform relaxation: Lelarasmee et
al., IEEE Trans. CAD 1, 1982).
"""

import numpy as np
from numpy.typing import ArrayLike

from identification.exciter_coupling.channels import drive_point
from identification.exciter_coupling.exciter import Exciter
from identification.exciter_coupling.passes import Passes
from identification.exciter_coupling.reaction import Reaction
from identification.experiments.simulation import Simulation, use_of
from identification.models.pnlss.coupled.kernels import simulate_coupled
from identification.models.pnlss.kernels import workspace
from identification.models.pnlss.model import PnlssModel
from identification.models.pnlss.steady.setting_up import linear_resonance_hz
from vibrolock.arrays import Float

_LOWEST, _GUESSED = 0.8, 0.5
"""Default lowest frequency: share of the lowest trained frequency, or of the linear resonance if that is unknown."""


class CoupledRun(Simulation):
    """A simulated run of a model with its exciter: the fields of `Simulation`."""


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
    at = drive_point(model, model.sample_rate_hz, voltage_v, lowest_hz, lambda: _lowest(model))
    reaction = Reaction(exciter, at.order, at.lowest_hz, model.sample_rate_hz)
    return _run(model, Passes(reaction, model.linear_part, at.row, at.output, at.voltage_v), at.row, at.output)


def _lowest(model: PnlssModel) -> float:
    if model.excited_hz and model.excited_hz[0] > 0.0:
        return _LOWEST * model.excited_hz[0]
    return _GUESSED * linear_resonance_hz(model)


def _run(model: PnlssModel, passes: Passes, row: int, output: int) -> CoupledRun:
    m, loop, n = model.matrices, passes.loop, passes.n
    tables = (model.state_features.table, model.output_features.table)
    x, y = np.empty((passes.count, model.states)), np.empty((passes.count, len(model.outputs)))
    force, xi, after, work = np.empty(passes.count), np.empty(loop.b.size), np.empty(loop.b.size), workspace(m)

    def simulate(given: Float) -> int:
        return int(simulate_coupled(m, *tables, loop, row, output, given, model.bound, work, xi, after, force, x, y))

    reached, count, change = passes.run(simulate, force, y[:, output])
    x, y, force = x[:n], y[:n], force[:n]
    x[reached:], y[reached:], force[reached:] = np.nan, np.nan, np.nan
    inputs = np.zeros(len(model.inputs))
    inputs[row] = np.max(np.abs(force[:reached]), initial=0.0)
    notes = passes.notes(reached, count, change)
    if np.max(np.abs(np.linalg.eigvals(model.a))) > 1.0:
        notes.append("the model's linear part is unstable")
    return CoupledRun(
        outputs=y.T,
        states=x.T,
        state_use=use_of(np.max(np.abs(x[:reached]), axis=0, initial=0.0), model.state_range),
        input_use=use_of(inputs, model.input_range),
        unbounded_at=None if reached == n else reached,
        force_n=force,
        passes=count,
        change=change,
        notes=tuple(notes),
    )
