"""The response of a nonlinear mode to the force that a stepped-sine test really had.

No controller holds the force exactly: near resonance it drops or overshoots by ten percent and more. Predicting the
response to each point's own force keeps that out of what is said about the model.
"""

from functools import partial

import numpy as np

from identification.frequency_responses import FrequencyResponse
from identification.linear.modes import LinearModes
from identification.nonlinear.nonlinear_modes import NonlinearMode
from identification.prediction.motion import fundamental_motion, range_notes
from identification.prediction.properties import REFUSED_BEYOND, ExtrapolationError, ModalProperties
from identification.prediction.steady_prediction import SteadyPrediction
from identification.prediction.steady_states import OneMode

__all__ = ["recorded_force_response"]

_FARTHEST = 20.0


def recorded_force_response(
    mode: NonlinearMode,
    reference: FrequencyResponse,
    *,
    modes: LinearModes | None = None,
    residuals: bool = True,
    allow_extrapolation: bool = False,
) -> SteadyPrediction:
    """Steady response at every frequency of a measurement to the fundamental of the force that was measured there.

    Points are in the order of the measurement. Where several states are stable, it is the one nearest to the state of the
    point before, as for a test that is stepped slowly; at the first point the smallest.

    Parameters
    ----------
    mode
        The nonlinear mode as identified.
    reference
        Frequencies and forces.
    modes, residuals, allow_extrapolation
        As for `frequency_response`.

    Returns
    -------
    SteadyPrediction
        With ``force_n`` the median of the forces and no folds.

    Raises
    ------
    ExtrapolationError
        If a point needs more than twice the largest modal amplitude identified.
    """
    properties = ModalProperties.of(mode, allow_extrapolation=allow_extrapolation)
    limit = min(properties.highest_q, _FARTHEST * properties.q_range[1])
    omegas = 2.0 * np.pi * reference.frequency_hz
    q = np.zeros(omegas.size)
    for point, (omega, force) in enumerate(zip(omegas, reference.force_n, strict=True)):
        one = OneMode(properties, partial(np.full_like, fill_value=float(force)))
        found = one.amplitudes(float(omega), limit)
        found = found[one.stable(found, np.full(found.size, omega))]
        if not found.size:
            raise ExtrapolationError(
                f"force[{point}]: {force:g} N at {reference.frequency_hz[point]:g} Hz has no stable response up to "
                f"{limit / properties.q_range[1]:g} times the largest modal amplitude identified, allowed is up to "
                f"{REFUSED_BEYOND:g}; measure higher levels, or allow_extrapolation"
            )
        q[point] = found[np.argmin(np.abs(found - q[point - 1]))] if point else found[0]
    forces = reference.force_n
    channels, motion = fundamental_motion(mode, properties, q, omegas, forces, modes, residuals)
    return SteadyPrediction(
        force_n=float(np.median(forces)),
        force="fundamental",
        channels=channels,
        frequency_hz=reference.frequency_hz,
        modal_amplitude=q,
        fundamental_n=forces,
        displacement_m=motion,
        stable=np.ones(q.size, dtype=bool),
        branch=np.zeros(q.size, dtype=np.int64),
        range_use=properties.range_use(q),
        fold_frequency_hz=np.zeros(0),
        fold_amplitude_m=np.zeros(0),
        fold_modal_amplitude=np.zeros(0),
        notes=("response to the force as it was recorded at each point", *range_notes(properties, q)),
    )
