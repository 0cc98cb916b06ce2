"""Static force of the unseen support in a periodic experiment: held over a period, by the mean displacement of the one before.

Force sensors without response at 0 Hz show all of a periodic force but its mean. The exciter's suspension makes that mean, by
the mean displacement of the drive point. A filter that tells the mean from the lowest line of a long period would take many
periods to settle. The mean over exactly one period contains no line, and is known at its end.
"""

from collections.abc import Iterator

import numpy as np

from identification.models.structured.steps import System
from vibrolock.arrays import Float


def held(system: System) -> System:
    """Return the system with a support whose force is held."""
    return system._replace(support=system.support * np.array([1.0, 0.0, 1.0]))


def periods_of(first: int, last: int, begin: int, period: int) -> Iterator[tuple[int, int]]:
    """Yield the stretches of samples ``first`` to ``last`` between the beginnings of periods, one of which is ``begin``."""
    while first < last:
        end = min(first + period - (first - begin) % period, last)
        yield first, end
        first = end


def renew(system: System, length_s: float, state: Float, sens: Float | None = None) -> None:
    """Hold the force at the mean displacement over the last ``length_s``, and begin with the next mean.

    The mean m was measured while the force was that of the displacement z. A linear structure at the mean z' would move by
    ``c k (z' - z)`` less, with the static compliance c at the input and the stiffness k of the support. So
    ``z' = (m + c k z)/(1 + c k)`` is the mean displacement with its own force; a nonlinear structure takes some periods.

    Parameters
    ----------
    system
        System with a support that is `held`.
    length_s
        Time since the last call.
    state, sens
        float[`System.size`], and its derivatives, float[`System.size`, P] (`run_with_sensitivities`); both are changed.
    """
    n, inputs, stiffness = len(system.omega), system.inputs, float(system.support[0])
    b, omega = system.b[:, 0], system.omega
    compliance = float(np.sum((b / omega) ** 2))
    coupling, before = compliance * stiffness, float(state[2 * n])
    state[2 * n] = (state[-1] / length_s + coupling * before) / (1.0 + coupling)
    state[-1] = 0.0
    if sens is None:
        return
    by = np.zeros(sens.shape[1])
    by[:n] = -2.0 * stiffness * b**2 / omega**3
    by[2 * n : 2 * n + n * inputs : inputs] = 2.0 * stiffness * b / omega**2
    by[-1] = compliance
    sens[2 * n] = (sens[-1] / length_s + coupling * sens[2 * n] + (before - state[2 * n]) * by) / (1.0 + coupling)
    sens[-1] = 0.0
