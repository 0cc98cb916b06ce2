"""The response of a nonlinear mode to the force that a stepped-sine test really had.

No controller holds the force exactly: near resonance it drops or overshoots by ten percent and more. Predicting the
response to each point's own force keeps that out of what is said about the model.
"""

from functools import partial

import numpy as np
from numpy.typing import NDArray

from identification.frequency_responses import FrequencyResponse
from identification.linear.modes import LinearModes
from identification.nonlinear.nonlinear_modes import NonlinearMode
from identification.prediction.properties import HIGHER_LEVELS, REFUSED_BEYOND, ExtrapolationError, ModalProperties
from identification.prediction.steady_prediction import SteadyPrediction
from identification.prediction.steady_states import OneMode, fundamental_motion, range_notes

__all__ = ["recorded_force_response"]

Complex = NDArray[np.complex128]
Float = NDArray[np.float64]

_FARTHEST = 20.0
_SAME_LAG_DEG = 1.0
_MISSED = 0.02


def recorded_force_response(
    mode: NonlinearMode,
    reference: FrequencyResponse,
    *,
    modes: LinearModes | None = None,
    residuals: bool = True,
    allow_extrapolation: bool = False,
) -> SteadyPrediction:
    """Steady response at every frequency of a measurement to the fundamental of the force that was measured there.

    Points are in the order of the measurement. A force admits up to three states or more, and which of them the test held
    depends on what was controlled. Where it was the force, only stable states come into question: taken is the one nearest
    to the state of the point before, as for a test that is stepped slowly; at the first point the smallest. Anything else,
    as a constant voltage, also holds states that are unstable under constant force. Then all come into question: taken is
    the one whose phase lag is nearest to the measured lag, and where lags lie within 1 degree of that, the one nearest to
    the state before. At a fold the smallest error of model or force decides whether a state exists: there it is enough that
    the force is within 2 % of one that has it.

    Parameters
    ----------
    mode
        The nonlinear mode as identified.
    reference
        Frequencies and forces, what was controlled, and phase lags where that was not the force.
    modes, residuals, allow_extrapolation
        As for `frequency_response`.

    Returns
    -------
    SteadyPrediction
        With ``force`` as ``recorded``, ``force_n`` the median of the forces and no folds; ``stable`` is that under constant
        force all the same.

    Raises
    ------
    ExtrapolationError
        If a point needs more than twice the largest modal amplitude identified.
    """
    properties = ModalProperties.of(mode, allow_extrapolation=allow_extrapolation)
    by_force = reference.controlled == "force"
    states = _states(properties, reference, by_force)
    point = np.repeat(np.arange(len(states)), [each.size for each in states])
    q, forces = np.concatenate(states), reference.force_n[point]
    omegas = 2.0 * np.pi * reference.frequency_hz[point]
    channels, motion = fundamental_motion(mode, properties, q, omegas, forces, modes, residuals)
    if by_force:
        taken = _chosen(point, q, np.zeros(q.size))
    else:
        taken = _chosen(point, q, _apart_deg(motion[:, 0], reference.phase_lag_deg[point]))
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
    """Modal amplitudes of the states at each point, rising; `ExtrapolationError` where there are none."""
    limit = min(properties.highest_q, _FARTHEST * properties.q_range[1])
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
                f"{REFUSED_BEYOND:g}; {HIGHER_LEVELS}"
            )
        states.append(found)
    return states


def _stable(properties: ModalProperties, q: Float, omega: Float) -> NDArray[np.bool_]:
    """bool[n]: under constant force; the size of it does not enter once q and W are known."""
    return OneMode(properties, np.ones_like).stable(q, omega)


def _apart_deg(motion: Complex, lag_deg: Float) -> Float:
    """float[n]: how far the lags of predicted displacements are from measured ones, 0 to 180."""
    return np.abs(np.degrees(np.angle(motion * np.exp(1j * np.radians(lag_deg)))))


def _chosen(point: NDArray[np.int64], q: Float, apart_deg: Float) -> NDArray[np.int64]:
    """int[n_points]: of each point's states the one nearest to the state before, among those of nearly the best lag."""
    chosen: list[int] = []
    for here in range(int(point[-1]) + 1):
        states = np.flatnonzero(point == here)
        states = states[apart_deg[states] <= apart_deg[states].min() + _SAME_LAG_DEG]
        before = q[chosen[-1]] if chosen else 0.0
        chosen.append(int(states[np.argmin(np.abs(q[states] - before))]))
    return np.array(chosen, dtype=np.int64)
