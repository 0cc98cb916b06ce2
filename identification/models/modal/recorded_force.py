"""Predict the response of a nonlinear mode to the recorded force of a stepped-sine test.

No controller holds the force exactly: near resonance it drops or overshoots by ten percent and more. Predicting the response
to the recorded force of each point removes this effect from the assessment of the model.
"""

from functools import partial

import numpy as np
from numpy.typing import NDArray

from identification.errors import ExtrapolationError
from identification.frequency_responses import FrequencyResponse
from identification.linear.modes import LinearModes
from identification.models.modal.frequency_response import FARTHEST
from identification.models.modal.properties import HIGHER_LEVELS, REFUSED_BEYOND, ModalProperties
from identification.models.modal.steady_states import OneMode, fundamental_motion, range_notes
from identification.nonlinear.nonlinear_modes import NonlinearMode
from identification.prediction.steady_prediction import SteadyPrediction
from identification.renamed import formerly
from vibrolock.arrays import Float

_SAME_LAG_DEG = 1.0
"""Difference of phase lags below which the states of a point count as equally near to the measured one. Chosen."""
_MISSED = 0.02
"""Share of the force by which a state beyond its fold may be missed. Chosen."""


@formerly
def recorded_force_response(
    mode: NonlinearMode,
    reference: FrequencyResponse,
    *,
    linear_modes: LinearModes | None = None,
    residuals: bool = True,
    largest_range_use: float = REFUSED_BEYOND,
) -> SteadyPrediction:
    """Predict the steady response at every frequency of a measurement to the fundamental of the force measured there.

    Points are in the order of the measurement. At one force and frequency there may be three states or more; the quantity
    controlled in the test decides which of them occurs. Under force control only stable states are considered. The state
    nearest to that of the previous point is chosen, as in a slowly stepped test; at the first point the smallest. Under other
    control, such as constant voltage, states that are unstable under constant force also occur. All states are then
    considered, and the one with the phase lag nearest to the measured lag is chosen; among lags within 1 degree of the best,
    the state nearest to the previous one. Near a fold, small errors of model or force decide whether a state exists. A state
    is therefore accepted there if it exists at a force within 2 % of the recorded one.

    Raises `ExtrapolationError` if a point needs more than ``largest_range_use`` times the largest modal amplitude identified.

    Parameters
    ----------
    mode
        The identified nonlinear mode.
    reference
        Measured frequencies and forces, the controlled quantity, and phase lags unless the force was controlled.
    linear_modes, largest_range_use
        As for `frequency_response`.
    residuals
        Whether to add the linear response of the other modes of ``linear_modes`` to the force.

    Returns
    -------
    SteadyPrediction
        Its ``force`` is ``recorded``, ``force_n`` is the median of the forces, and there are no folds. ``stable`` refers to
        constant force nevertheless.
    """
    properties = ModalProperties.of(mode, largest_range_use=largest_range_use)
    by_force = reference.controlled == "force"
    states = _states(properties, reference, by_force)
    point = np.repeat(np.arange(len(states)), [each.size for each in states])
    q, forces = np.concatenate(states), reference.force_n[point]
    omegas = 2.0 * np.pi * reference.frequency_hz[point]
    channels, motion = fundamental_motion(mode, properties, q, omegas, forces, linear_modes, residuals)
    apart_deg = np.zeros(q.size)
    if not by_force:
        turned = motion[:, 0] * np.exp(1j * np.radians(reference.phase_lag_deg[point]))
        apart_deg = np.abs(np.degrees(np.angle(turned)))
    taken = _chosen(point, q, apart_deg)
    q, omegas, forces = q[taken], omegas[taken], forces[taken]
    stable = _stable(properties, q, omegas)
    notes = ["response to the force as it was recorded at each point", *range_notes(properties, q)]
    if unstable := int(np.count_nonzero(~stable)):
        notes.insert(
            1,
            f"{unstable} of {q.size} states are unstable under constant force, not so in this test; of several states the "
            "measured phase lag tells which",
        )
    return SteadyPrediction(
        force_n=float(np.median(forces)),
        force="recorded",
        channels=channels,
        frequency_hz=reference.frequency_hz,
        modal_amplitude=q,
        fundamental_n=forces,
        displacement_m=motion[taken],
        stable=stable,
        branch=np.zeros(q.size, dtype=np.int64),
        range_use=properties.range_use(q),
        fold_frequency_hz=np.zeros(0),
        fold_amplitude_m=np.zeros(0),
        fold_modal_amplitude=np.zeros(0),
        notes=tuple(notes),
    )


def _states(properties: ModalProperties, reference: FrequencyResponse, stable_only: bool) -> list[Float]:
    """Return the modal amplitudes of the states at each point, rising; raise `ExtrapolationError` if there are none."""
    limit = min(properties.highest_q, FARTHEST * properties.q_range[1])
    states = []
    for point, (frequency_hz, force) in enumerate(zip(reference.frequency_hz, reference.force_n, strict=True)):
        omega = 2.0 * np.pi * float(frequency_hz)
        found = OneMode(properties, partial(np.full_like, fill_value=float(force))).amplitudes(
            omega, limit, missed=0.0 if stable_only else _MISSED
        )
        if stable_only:
            found = found[_stable(properties, found, np.full(found.size, omega))]
        if not found.size:
            raise ExtrapolationError(
                f"force[{point}]: {force:g} N at {frequency_hz:g} Hz has no {'stable ' if stable_only else ''}response up "
                f"to {limit / properties.q_range[1]:g} times the largest modal amplitude identified, allowed is up to "
                f"{properties.largest_range_use:g}; {HIGHER_LEVELS}"
            )
        states.append(found)
    return states


def _stable(properties: ModalProperties, q: Float, omega: Float) -> NDArray[np.bool_]:
    """bool[n]: stability under constant force, which follows from q and W alone."""
    return OneMode(properties, np.ones_like).stable(q, omega)


def _chosen(point: NDArray[np.int64], q: Float, apart_deg: Float) -> NDArray[np.int64]:
    """int[n_points]: chosen state of each point, the nearest to the previous state among those with nearly the best lag."""
    chosen: list[int] = []
    for here in range(int(point[-1]) + 1):
        states = np.flatnonzero(point == here)
        states = states[apart_deg[states] <= apart_deg[states].min() + _SAME_LAG_DEG]
        before = q[chosen[-1]] if chosen else 0.0
        chosen.append(int(states[np.argmin(np.abs(q[states] - before))]))
    return np.array(chosen, dtype=np.int64)
