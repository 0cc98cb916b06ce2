"""Modal properties of a nonlinear mode from its backbone, measured near phase resonance.

One nonlinear mode under the fundamental force F at the drive point obeys

    (w^2 - W^2 + 2 i W w z) q = phi_d F exp(i psi),    psi = arg F_1 - arg Q_d (phase lag), q = |Q_d| / phi_d,

W the frequency of the vibration, w and z modal frequency and damping ratio (founding paper, steady slow flow). Its
real and imaginary parts are solved for w and z at every point, so that a residual phase error costs nothing:

    w^2 = W^2 + (phi_d F / q) cos psi,    2 W w z = (phi_d F / q) sin psi.

The second is the active power of the fundamental, ``P_1 = 1/2 Re(F_1 conj(i W Q_d))``, as ``z = P_1 / (W^2 w q^2)``,
which at W = w is the founding paper's ``P_1 / (w^3 q^2)`` (Scheel et al. 2018). A linear rig of one mode returns its
own damping ratio exactly. ``damping_ratio_uncorrected`` is ``P_1 / (W^3 q^2)``.

The force's own harmonics, fed back by the exciter, do work too; ``damping_ratio_total_power`` takes the power of all
harmonics, ``P = sum_h 1/2 Re(F_h conj(i h W Q_d,h))``.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.backbones import Backbone
from identification.channels import Role, find_role
from identification.errors import IdentificationError
from identification.measurements import PeriodicVibration, wrapped_deg
from identification.nonlinear.mode_shapes import ModeShapes, mac
from identification.nonlinear.nonlinear_modes import NonlinearMode

__all__ = ["nonlinear_mode"]

Complex = NDArray[np.complex128]

_NO_SHAPE = (
    "no mass-normalised mode shape: damping, modal amplitude and the correction for the phase error cannot be had; "
    "give drive_mode_shape or mode_shapes"
)
_FAR_FROM_RESONANCE_DEG = 15.0


@dataclass(frozen=True)
class _PointMode:
    """Modal properties of one point; NaN where they cannot be had."""

    modal_amplitude: float = np.nan
    modal_frequency_hz: float = np.nan
    modal_frequency_std_hz: float = np.nan
    damping_ratio: float = np.nan
    damping_ratio_std: float = np.nan
    damping_ratio_total_power: float = np.nan
    damping_ratio_uncorrected: float = np.nan
    apparent_mass_kg: float = np.nan


def nonlinear_mode(
    backbone: Backbone,
    *,
    mode_shapes: ModeShapes | None = None,
    linear_shape: Mapping[str, float] | None = None,
) -> NonlinearMode:
    """Nonlinear mode from a measured backbone.

    Parameters
    ----------
    backbone
        Settled points; with ``drive_mode_shape``, from which the modal amplitude is ``|Q_d| / phi_d``.
    mode_shapes
        Mass-normalised shapes of a linear modal analysis; if given, the modal amplitude comes from these.
    linear_shape
        Linear deflection shape by channel name, in any scale, for the MAC; else the tested one of ``mode_shapes``.

    Returns
    -------
    NonlinearMode
        In the order of the backbone. Without any mass-normalised shape, damping and modal amplitude are NaN, the modal
        frequency is that of the vibration, and a note says so. Standard errors are the first-order propagation of
        those of the Fourier coefficients of force and motion, taken as independent: they hold neither errors of the
        mode shapes (1 % of phi_d is 2 % of the damping), calibration or phase skew of the sensors, nor run-to-run
        scatter of the specimen.

    Raises
    ------
    IdentificationError
        On unsettled points, a point without force or motion, a modal frequency that is not real, unknown channels.
    """
    shape = _shape_for_mac(mode_shapes, linear_shape)
    points = [_identify(number, point, backbone, mode_shapes) for number, point in enumerate(backbone.points)]
    force = np.array([point.force for point in backbone.points])
    motion = np.array([point.drive_m for point in backbone.points])
    return NonlinearMode(
        **{name: np.array([getattr(point, name) for point in points]) for name in _PointMode.__dataclass_fields__},
        force_n=backbone.force_n,
        frequency_hz=backbone.frequency_hz,
        phase_lag_deg=np.array([point.phase_lag_deg for point in backbone.points]),
        amplitude_m=backbone.amplitude_m,
        mac=np.array([np.nan if shape is None else _mac(shape, point) for point in backbone.points]),
        force_purity=_purity(force),
        response_purity=_purity(motion),
        fit_residual=np.full(len(points), np.nan),
        force_harmonics=force,
        response_harmonics_m=motion,
        source="backbone",
        specimen=backbone.specimen,
        notes=_notes(backbone, mode_shapes),
    )


def _identify(number: int, point: PeriodicVibration, backbone: Backbone, shapes: ModeShapes | None) -> _PointMode:
    """Modal properties of one point, from ``D = (phi_d F / q) exp(i psi) = w^2 + s^2 + 2 s w z`` with ``s = i W + sigma``.

    sigma is the rate at which the fundamental of the motion still drifted, relative to it: what a growing vibration
    stores, and a decaying one returns, is no damping. To first order ``D = w^2 - W^2 + 2 i W (w z + sigma)``.
    """
    name = f"points[{number}] ({point.force_n:g} N, {point.frequency_hz:g} Hz)"
    if not point.settled:
        raise IdentificationError(f"{name}: is not settled; use backbone.settled() to leave such points out")
    if point.force_n == 0.0 or point.amplitude_m == 0.0:
        raise IdentificationError(f"{name}: force or drive-point motion is zero, nothing can be identified")
    force_std, motion_std = _relative_std(point, "force"), _relative_std(point, "drive")
    if shapes is not None:
        q, q_std = shapes.modal_amplitude(point)
        if q == 0.0:
            raise IdentificationError(f"{name}: modal amplitude is zero; check the channels of the mode shapes")
        magnitude_std = float(np.sqrt(force_std**2 + motion_std**2 + (2.0 * q_std / q) ** 2))
    elif backbone.drive_mode_shape is not None:
        q = point.amplitude_m / abs(backbone.drive_mode_shape)
        magnitude_std = float(np.hypot(force_std, motion_std))
    else:
        return _PointMode(modal_frequency_hz=point.frequency_hz)
    omega = 2.0 * np.pi * point.frequency_hz
    lag = np.radians(point.phase_lag_deg)
    stiffness = point.amplitude_m * point.force_n / q**2
    sigma = _drift_rate(point)
    # The slope of a line over -1/2 ... 1/2 has the variance of its mean times twelve.
    sigma_std = 0.0 if point.drift is None else np.sqrt(12.0) * motion_std * point.frequency_hz / point.periods
    squared = omega**2 + stiffness * np.cos(lag) + 2.0 * omega * sigma.imag
    if squared <= 0.0:
        raise IdentificationError(
            f"{name}: phase lag {point.phase_lag_deg:.0f} deg gives no real modal frequency, must be near 90 deg; "
            "check the polarity of force and drive channel"
        )
    modal = float(np.sqrt(squared))
    powers = _active_powers(point)
    angle_std = float(np.hypot(force_std, motion_std))
    real_std = stiffness * np.hypot(np.cos(lag) * magnitude_std, np.sin(lag) * angle_std)
    imag_std = stiffness * np.hypot(np.sin(lag) * magnitude_std, np.cos(lag) * angle_std)
    modal_std = np.hypot(real_std / (2.0 * modal), sigma_std * omega / modal)
    scale = omega**2 * modal * q**2
    stored = sigma.real / modal
    damping = powers[0] / scale - stored
    return _PointMode(
        modal_amplitude=q,
        modal_frequency_hz=modal / (2.0 * np.pi),
        modal_frequency_std_hz=float(modal_std / (2.0 * np.pi)),
        damping_ratio=damping,
        damping_ratio_std=float(
            np.sqrt(
                (imag_std / (2.0 * omega * modal)) ** 2 + (damping * modal_std / modal) ** 2 + (sigma_std / modal) ** 2
            )
        ),
        damping_ratio_total_power=float(np.sum(powers)) / scale - stored,
        damping_ratio_uncorrected=powers[0] / (omega**3 * q**2),
        apparent_mass_kg=(q / point.amplitude_m) ** 2,
    )


def _drift_rate(point: PeriodicVibration) -> complex:
    """Relative rate of change (1/s) of the fundamental of the drive point's motion; 0 where the drift is not known."""
    if point.drift is None:
        return 0j
    return complex(point.drift[find_role(point.channels, "drive")]) * point.frequency_hz / point.periods


def _active_powers(point: PeriodicVibration) -> NDArray[np.float64]:
    """float[H]: mean power of the force at harmonics 1 to H, W."""
    motion = point.drive_m[1:]
    velocity = 2j * np.pi * point.frequency_hz * np.arange(1, motion.size + 1) * motion
    return np.asarray(0.5 * np.real(point.force[1:] * np.conj(velocity)))


def _relative_std(point: PeriodicVibration, role: Role) -> float:
    """Relative standard error of the fundamental of the channel with ``role``; NaN if unknown."""
    index = find_role(point.channels, role)
    if point.harmonics_std is None:
        return np.nan
    return float(point.harmonics_std[index, 1] / abs(point.harmonics[index, 1]))


def _purity(harmonics: Complex) -> NDArray[np.float64]:
    """float[n]: share of the fundamental in all harmonics from the first."""
    return np.asarray(np.abs(harmonics[:, 1]) / np.linalg.norm(harmonics[:, 1:], axis=1))


def _shape_for_mac(shapes: ModeShapes | None, linear_shape: Mapping[str, float] | None) -> dict[str, float] | None:
    if linear_shape is not None:
        return dict(linear_shape)
    return None if shapes is None else dict(zip(shapes.channels, shapes.tested.tolist(), strict=True))


def _mac(shape: Mapping[str, float], point: PeriodicVibration) -> float:
    measured = np.array([point.displacement_m(name)[1] for name in shape])
    return mac(np.array(list(shape.values())), measured)


def _notes(backbone: Backbone, shapes: ModeShapes | None) -> tuple[str, ...]:
    notes = []
    if shapes is None and backbone.drive_mode_shape is None:
        notes.append(_NO_SHAPE)
    if any(point.phase_lag_deg < 0.0 for point in backbone.points):
        notes.append(
            "the force draws power from the specimen (negative lag): check the polarity of force and drive channel"
        )
    away = [wrapped_deg(90.0 - point.phase_lag_deg) for point in backbone.points]
    worst = int(np.argmax(np.abs(away)))
    if abs(away[worst]) > _FAR_FROM_RESONANCE_DEG:
        notes.append(
            f"up to {away[worst]:.1f} deg away from phase resonance (point {worst + 1}): corrected for by the one-mode "
            "equation, which holds near resonance"
        )
    return tuple(notes)
