"""Convert the properties found in a slow flow to a settled vibration at phase resonance.

Stiffness k and damping c at an amplitude X determine how the mode would vibrate there at phase resonance: at ``w = sqrt(k)``,
under the force ``i c w X / phi_d^2``. In this form an estimate from a transient vibration is a point like any other for
`identification.nonlinear_mode`, which returns the same ``w`` and ``z = c / (2 w)``.
"""

from dataclasses import dataclass

import numpy as np

from identification.channels import MOTION_ORDER, find_role
from identification.errors import IdentificationError
from identification.measurements import PeriodicVibration
from identification.slow_flows.fits import LocalFit, as_settled, local_fits
from identification.slow_flows.signals import window_correlations
from identification.slow_flows.slow_flow import SlowFlow
from vibrolock.arrays import Complex, Float


@dataclass(frozen=True, eq=False)
class Amplitudes:
    """Harmonics complex[n_channels, H + 1] of all channels for a motion of phase zero, and their standard errors.

    The fundamentals of motions are displacements divided by the drive-point displacement.
    """

    values: Complex
    std: Float


def fit_at(flow: SlowFlow, place: Float, weight: Float, degree: int) -> LocalFit:
    """Fit stiffness and damping of a slow flow where ``place`` (float[n]) is zero."""
    stiffness, rate = flow.dynamic_stiffness[None], flow.rate_1_s[None]
    size, periods = flow.amplitude_m[None], flow.phase_periods[None]
    (fit,) = local_fits(stiffness, rate, size, periods, place[None], weight[None], degree)
    return as_settled(fit, flow.residual_m_n / flow.drive_mode_shape**2)


def amplitudes_at(flow: SlowFlow, place: Float, weight: Float, degree: int) -> Amplitudes:
    """Return harmonics where ``place`` is zero, by least squares over the instants, relative to the drive-point phase."""
    orders = np.arange(flow.harmonics.shape[2])
    series = flow.harmonics * np.exp(-1j * np.outer(np.angle(flow.drive_m), orders))
    for row, channel in enumerate(flow.channels):
        if channel.role in ("drive", "response"):
            series[row, :, 1] = flow.harmonics[row, :, 1] / (
                flow.drive_m * flow.rate_1_s ** MOTION_ORDER[channel.motion]
            )
    root = np.sqrt(weight)
    design = place[:, None] ** np.arange(degree + 1) * root[:, None]
    inverse = np.linalg.pinv(design)
    values = (series * root[:, None]).transpose(1, 0, 2).reshape(place.size, -1)
    solution = inverse @ values
    residual = np.sum(np.abs(values - design @ solution) ** 2, axis=0)
    noise = window_correlations(flow.phase_periods[:, None] - flow.phase_periods[None, :])[0].real * np.outer(
        root, root
    )
    left = noise - design @ (inverse @ noise)
    expected = 2.0 * (np.trace(left) - np.sum((left @ inverse.T) * design))
    spread = inverse[0] @ noise @ inverse[0]
    shape = (len(flow.channels), orders.size)
    return Amplitudes(solution[0].reshape(shape), np.sqrt(residual * spread / expected).reshape(shape))


def resonant_vibration(
    flow: SlowFlow,
    amplitude_m: float,
    stiffness: float,
    damping_1_s: float,
    errors: tuple[float, float],
    found: Amplitudes,
    periods: float,
    warnings: tuple[str, ...] = (),
    systematic: tuple[float, float] = (0.0, 0.0),
) -> PeriodicVibration:
    """Return the settled vibration at phase resonance of ``amplitude_m`` with this stiffness (1/s^2) and damping (1/s).

    ``errors`` are the random standard errors of stiffness and damping, ``systematic`` those that a further run would repeat;
    ``found`` gives harmonics and the other channels.
    """
    if not stiffness > 0.0:
        raise IdentificationError(
            f"stiffness {stiffness:g} 1/s^2 at an amplitude of {amplitude_m:g} m gives no real modal "
            "frequency; check the polarity of force and drive channel, and drive_mode_shape",
            field="samples",
        )
    omega = float(np.sqrt(stiffness))
    harmonics, std = found.values.copy(), found.std.copy()
    for row, channel in enumerate(flow.channels):
        if channel.role in ("drive", "response"):
            to_unit = (1j * omega) ** MOTION_ORDER[channel.motion] * amplitude_m
            harmonics[row, 1] *= to_unit
            std[row, 1] *= abs(to_unit)
    force, drive = find_role(flow.channels, "force"), find_role(flow.channels, "drive")
    per_stiffness = amplitude_m / flow.drive_mode_shape**2
    harmonics[force, 1] = 1j * damping_1_s * omega * per_stiffness
    repeated = np.zeros(harmonics.shape, np.complex128)
    repeated[force, 1] = per_stiffness * complex(
        omega * systematic[1], systematic[0]
    )  # in phase with the force, and ahead
    every = np.array([errors[0], omega * errors[1], systematic[0], omega * systematic[1]])
    std[force, 1] = per_stiffness * float(np.linalg.norm(every)) / np.sqrt(2.0)
    # The drive channel is the reference of all displacements and has no error here; its error is in k and c.
    harmonics[drive, 1] = (1j * omega) ** MOTION_ORDER[flow.channels[drive].motion] * amplitude_m
    return PeriodicVibration(
        channels=flow.channels,
        frequency_hz=omega / (2.0 * np.pi),
        harmonics=harmonics,
        periods=max(1, int(periods + 1e-6)),
        residual_rms=std[:, 1],
        harmonics_std=std,
        warnings=warnings,
        rounding_std=repeated if any(systematic) else None,
    )
