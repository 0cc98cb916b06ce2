"""Identify a nonlinear mode from single points of stepped-sine tests, under any kind of control.

Every settled point near resonance obeys the one-mode equation at its own amplitude,

    w^2 - W^2 + 2 i W w z = phi_d^2 F / Q',    Q' = Q - R F,

with Q the displacement at the drive point and R the drive-point receptance of all other modes. The response passes the same
amplitudes on both sides of the resonance, so that each level contributes up to two points per amplitude. Far from resonance F
/ Q is nearly real, and a small error of the phase or of R becomes a large relative error of the damping. Such points are left
out.

Compared with backbones measured on the shipped rigs, both magnet beams agree at 60 degrees from resonance within 0.3 % in
damping and 0.006 % in frequency. On the friction beam, whose slipping joint also changes the other modes, the damping error
is 1 % per 10 degrees, with opposite signs below and above resonance, so that points on both sides cancel it.
"""

from collections.abc import Sequence

import numpy as np

from identification.errors import IdentificationError
from identification.frequency_responses import FrequencyResponse
from identification.linear.modes import LinearModes
from identification.nonlinear.nonlinear_modes import NonlinearMode
from vibrolock.arrays import Complex, Float

_FAR_DEG = 30.0  # deg; a lag farther from 90 deg is noted; chosen


def single_point_mode(
    responses: Sequence[FrequencyResponse],
    drive_mode_shape: float,
    *,
    phase_window_deg: float = 30.0,
    modes: LinearModes | None = None,
    mode: int | None = None,
) -> NonlinearMode:
    """Identify a nonlinear mode from points near resonance, each point independently.

    Returns one entry per point, smallest amplitude first; ``frequency_hz`` and ``phase_lag_deg`` show its distance
    from resonance. Standard errors are NaN, because fundamentals alone do not provide them. Harmonics, total power,
    purity and MAC are NaN.

    Raises `IdentificationError` if no point is in the window, the mode shape is zero, or the window is out of its
    range.

    Parameters
    ----------
    responses
        Stepped-sine responses at the drive point, with force, response, voltage or nothing controlled.
    drive_mode_shape
        Mass-normalised shape of the tested mode at the drive point, kg^-1/2.
    phase_window_deg
        Largest distance of the phase lag from 90 degrees; points beyond it are left out.
    modes, mode
        Linear modal analysis, and the index of the tested mode in it (if None, the mode nearest to the points). The other
        modes and the residual terms are subtracted from the response (``R F`` above). Without ``modes``, R is zero.
    """
    if not 0.0 < phase_window_deg <= 80.0:
        raise IdentificationError(field="phase_window_deg", value=phase_window_deg, allowed="above 0 to 80")
    if not (np.isfinite(drive_mode_shape) and drive_mode_shape):
        raise IdentificationError(field="drive_mode_shape", value=drive_mode_shape, allowed="finite and not zero")
    IdentificationError.raise_if(not responses, "none given", field="responses", allowed="one at least")
    frequency = np.concatenate([response.frequency_hz for response in responses])
    force = np.concatenate([response.force for response in responses])
    motion = np.concatenate([response.displacement_m for response in responses])
    lag = np.degrees(np.angle(force * np.conj(motion)))
    near = np.abs(lag - 90.0) <= phase_window_deg
    if not near.any():
        raise IdentificationError(
            f"none of {near.size} points lies within {phase_window_deg:g} deg of phase resonance (lags "
            f"{lag.min():.0f} to {lag.max():.0f} deg); measure nearer to resonance, or check the "
            "polarity",
            field="responses",
        )
    order = np.flatnonzero(near)[np.argsort(np.abs(motion[near]), kind="stable")]
    return _identified(
        responses, drive_mode_shape, frequency[order], force[order], motion[order], near.size, modes, mode
    )


def _identified(
    responses: Sequence[FrequencyResponse],
    shape: float,
    frequency: Float,
    force: Complex,
    motion: Complex,
    given: int,
    modes: LinearModes | None,
    mode: int | None,
) -> NonlinearMode:
    omega = 2.0 * np.pi * frequency
    own = motion
    if modes is not None:
        tested = modes.nearest(float(np.median(frequency))) if mode is None else mode
        own = motion - modes.receptance(frequency, without=tested) * force
    stiffness = shape**2 * force / own
    squared = omega**2 + stiffness.real
    if np.any(squared <= 0.0):
        worst = int(np.argmin(squared))
        reason = f"{shape:g} gives no real modal frequency at {frequency[worst]:g} Hz; check it and the units"
        raise IdentificationError(reason, field="drive_mode_shape")
    modal = np.sqrt(squared)
    lag = np.degrees(np.angle(force * np.conj(motion)))
    q = np.abs(own) / abs(shape)
    nothing = np.full(frequency.size, np.nan, np.complex128)
    far = int(np.count_nonzero(np.abs(lag - 90.0) > _FAR_DEG))
    notes = ["from single points of stepped sines: no standard errors, harmonics, total power, purity or MAC"]
    if given > frequency.size:
        notes.append(f"{given - frequency.size} of {given} points left out: too far from phase resonance")
    if far:
        notes.append(f"{far} points are more than {_FAR_DEG:g} deg from phase resonance: their damping is less certain")
    return NonlinearMode(
        force_n=np.abs(force),
        frequency_hz=frequency,
        phase_lag_deg=lag,
        amplitude_m=np.abs(motion),
        modal_frequency_hz=modal / (2.0 * np.pi),
        damping_ratio=stiffness.imag / (2.0 * omega * modal),
        damping_ratio_uncorrected=0.5 * np.imag(force / motion) * np.abs(motion) ** 2 / (omega**2 * q**2),
        modal_amplitude=q,
        apparent_mass_kg=np.full(frequency.size, shape**-2),
        force_harmonics=np.column_stack([nothing, force]),
        response_harmonics_m=np.column_stack([nothing, motion]),
        source="stepped sine",
        specimen=responses[0].specimen,
        notes=tuple(notes),
    )
