"""Modal properties of a nonlinear mode from its backbone, measured near phase resonance.

One nonlinear mode under the fundamental force F at the drive point obeys

    (w^2 - W^2 + 2 i W w z) q = phi_d F exp(i psi),    psi = arg F_1 - arg Q_d (phase lag), q = |Q_d| / phi_d,

with W the frequency of the vibration, w and z the modal frequency and damping ratio (founding paper, steady slow flow). Its
real and imaginary parts are solved for w and z at every point, so that a residual phase error does not bias them:

    w^2 = W^2 + (phi_d F / q) cos psi,    2 W w z = (phi_d F / q) sin psi.

With the active power of the fundamental, ``P_1 = 1/2 Re(F_1 conj(i W Q_d))``, the second equation is
``z = P_1 / (W^2 w q^2)``. At W = w it is the founding paper's ``P_1 / (w^3 q^2)`` (Scheel et al. 2018). For a linear rig of
one mode the result is exactly its damping ratio. ``damping_ratio_uncorrected`` is ``P_1 / (W^3 q^2)``.

The harmonics of the force, which the exciter's reaction causes, do work too; ``damping_ratio_total_power`` is computed from
the power of all harmonics, ``P = sum_h 1/2 Re(F_h conj(i h W Q_d,h))``.

If the vibration has a mean, the exciter's suspension opposes the mean deflection with a static force that piezo sensors do
not measure. On the one-sided magnet beam this static force is 1.1 N at a force amplitude of 0.56 N and raises the modal
frequency by 0.37 %, compared with a purely sinusoidal force. The modal frequency here includes the effect of the static
force.
"""

from collections.abc import Mapping

import numpy as np

from identification.backbones import Backbone
from identification.channels import find_role
from identification.errors import IdentificationError
from identification.linear.mode_shapes import ModeShapes
from identification.linear.modes import LinearModes
from identification.measurements import PeriodicVibration, wrapped_deg
from identification.nonlinear.basis import shapes_for
from identification.nonlinear.nonlinear_modes import NonlinearMode
from identification.nonlinear.properties import States, properties
from identification.nonlinear.uncertainty import ErrorModel, propagated
from identification.validation import one_specimen
from vibrolock.arrays import Float

_NO_SHAPE = (
    "no mass-normalised mode shape: damping, modal amplitude and the correction for the phase error cannot be computed; "
    "give drive_mode_shape or mode_shapes"
)
_FAR_FROM_RESONANCE_DEG = 15.0  # deg; a lag farther from 90 deg is noted; chosen
_FEW_LEVELS = 4  # fewer distinct levels are noted; chosen
_FEW_PERIODS = 10  # fewer periods of a point are noted; chosen
_DROWNED = 3.0  # least ratio of force and motion to their standard errors


def nonlinear_mode(
    backbone: Backbone,
    *,
    modes: LinearModes | None = None,
    mode: int | None = None,
    mode_shapes: ModeShapes | None = None,
    linear_shape: Mapping[str, float] | None = None,
    calibration_std: float | Mapping[str, float] = 0.0,
    phase_skew_std_deg: float | Mapping[str, float] = 0.0,
    draws: int = 1000,
    seed: int = 0,
) -> NonlinearMode:
    """Identify a nonlinear mode from a measured backbone, every quantity with its standard error.

    The result is in the order of the backbone. Without any mass-normalised shape, damping and modal amplitude are NaN,
    the modal frequency is that of the vibration, and a note says so. Standard errors include the errors of the Fourier
    coefficients, of the drift, of the shapes (if known) and of the sensors (as given here). They do not include
    aliasing of the output's steps in inputs without an anti-aliasing filter. Nor do they include the run-to-run
    scatter of the specimen and of the reached level, which `identification.combined` estimates. At one voltage the
    amplitudes of the friction beam differ by up to 5e-5 from run to run, several times their standard error;
    frequency, damping and apparent mass at the reached amplitude do not.

    Raises `IdentificationError` if points are unsettled, a force or motion is zero or not above its noise, a modal
    frequency is not real, the damping is negative at most points (reversed polarity), or modes or channels do not
    match.

    Parameters
    ----------
    backbone
        Settled points; with ``drive_mode_shape``, from which the modal amplitude is ``|Q_d| / phi_d``.
    modes
        Linear modal analysis of the specimen; if given, modal amplitude and MAC come from its shapes, mapped by the
        names of the channels.
    mode
        Index in ``modes`` of the tested mode; if None, the mode nearest to the frequency of the lowest level.
    mode_shapes
        Mass-normalised shapes chosen by hand, in place of ``modes``.
    linear_shape
        Linear deflection shape for the MAC by channel name, in any scale; if None, the tested mode of the mode shapes.
    calibration_std, phase_skew_std_deg
        Relative standard error of the channels' sensitivities, and of their phase at the fundamental in degrees: one
        number for all, or by channel name. They are the same at all points.
    draws, seed
        Number of draws and seed of the Monte Carlo error propagation; the same seed gives the same numbers. With 0 draws no
        errors are propagated: all standard errors and intervals are NaN.
    """
    notes: tuple[str, ...] = ()
    if modes is not None:
        if mode_shapes is not None:
            raise IdentificationError("both given", field="modes, mode_shapes", allowed="one of them")
        one_specimen(modes=modes.specimen, backbone=backbone.specimen)
        mode_shapes, _, notes = shapes_for(modes, backbone, mode)
    elif mode is not None:
        raise IdentificationError("there are no modes to choose from", field="mode", value=mode, hint="give modes")
    for number, point in enumerate(backbone.points):
        _refuse(f"points[{number}] ({point.force_n:g} N, {point.frequency_hz:g} Hz)", point)
    if linear_shape is None and mode_shapes is not None:
        linear_shape = dict(zip(mode_shapes.channels, mode_shapes.tested.tolist(), strict=True))
    states, rows = _states(backbone, mode_shapes, linear_shape)
    found = properties(states)
    _refuse_unreal(backbone, found)
    alone = mode_shapes is None
    return NonlinearMode(
        **found,
        **propagated(states, backbone, rows, mode_shapes, ErrorModel(calibration_std, phase_skew_std_deg, draws, seed)),
        frequency_hz=backbone.frequency_hz,
        force_harmonics=states.force,
        response_harmonics_m=states.drive_m,
        source="backbone",
        specimen=backbone.specimen,
        notes=(*notes, *_notes(backbone, mode_shapes)),
        drive_mode_shape=backbone.drive_mode_shape if alone else None,
        drive_mode_shape_std=backbone.drive_mode_shape_std if alone else None,
        drive_mode_shape_source=backbone.drive_mode_shape_source if alone else "",
    )


def _refuse(name: str, point: PeriodicVibration) -> None:
    if not point.settled:
        raise IdentificationError("is not settled", where=name, hint="use backbone.settled() to leave such points out")
    if point.force_n == 0.0 or point.amplitude_m == 0.0:
        raise IdentificationError("force or drive-point motion is zero, nothing can be identified", where=name)
    if point.harmonics_std is None:
        return
    for role, what in (("force", "force"), ("drive", "drive-point motion")):
        row = find_role(point.channels, "force" if role == "force" else "drive")
        size, std = abs(point.harmonics[row, 1]), point.harmonics_std[row, 1]
        if size < _DROWNED * std:
            unit = point.channels[row].unit
            raise IdentificationError(
                f"{what} {size:.3g} {unit} is lost in its standard error of {std:.3g} {unit}; record more "
                "periods, raise the level, or leave the point out (backbone.select)",
                where=name,
            )


def _refuse_unreal(backbone: Backbone, found: Mapping[str, Float]) -> None:
    for number, point in enumerate(backbone.points):
        name = f"points[{number}] ({point.force_n:g} N, {point.frequency_hz:g} Hz)"
        if found["modal_amplitude"][number] == 0.0:
            raise IdentificationError(
                "modal amplitude is zero", where=name, hint="check the channels of the mode shapes"
            )
        if np.isnan(found["modal_frequency_hz"][number]):
            reason = f"phase lag {point.phase_lag_deg:.0f} deg gives no real modal frequency"
            hint = "check the polarity of force and drive channel"
            raise IdentificationError(reason, where=name, allowed="near 90 deg", hint=hint)
    damping = found["damping_ratio"]
    negative = int(np.count_nonzero(damping < 0.0))
    if 2 * negative > damping.size:
        raise IdentificationError(
            f"the damping ratio of {negative} of {damping.size} is negative, the force seems to draw power "
            "from the specimen; check the polarity of force and drive channel",
            field="points",
        )


def _states(
    backbone: Backbone, shapes: ModeShapes | None, linear: Mapping[str, float] | None
) -> tuple[States, tuple[int, ...]]:
    """Return the backbone as arrays, and the rows of the channels of its deflection shapes."""
    names = tuple(dict.fromkeys((*(shapes.channels if shapes is not None else ()), *(linear or ()))))
    rows = tuple(backbone.points[0].index(name) for name in names)
    deflection = [[point.displacement_m(name)[1] for name in names] for point in backbone.points]
    inverse: Float | None = None
    if shapes is not None:
        inverse = np.zeros((shapes.shapes.shape[1], len(names)))
        inverse[:, : len(shapes.channels)] = np.linalg.pinv(shapes.shapes)
    states = States(
        frequency_hz=backbone.frequency_hz,
        force=np.array([point.force for point in backbone.points]),
        drive_m=np.array([point.drive_m for point in backbone.points]),
        drift=np.array([_drift_rate(point) for point in backbone.points]),
        deflection_m=np.array(deflection, dtype=np.complex128).reshape(len(backbone.points), len(names)),
        inverse=inverse,
        drive_shape=backbone.drive_mode_shape,
        linear_shape=np.array(list((linear or {}).values()), dtype=np.float64),
        linear_columns=tuple(names.index(name) for name in linear or ()),
    )
    return states, rows


def _drift_rate(point: PeriodicVibration) -> complex:
    """Relative rate of change (1/s) of the fundamental of the drive-point motion; 0 if the drift is unknown."""
    if point.drift is None:
        return 0j
    return complex(point.drift[find_role(point.channels, "drive")]) * point.frequency_hz / point.periods


def _notes(backbone: Backbone, shapes: ModeShapes | None) -> tuple[str, ...]:
    notes = []
    if shapes is None and backbone.drive_mode_shape is None:
        notes.append(_NO_SHAPE)
    if shapes is not None and shapes.shapes_std is not None and np.isnan(shapes.shapes_std).any():
        notes.append("standard errors of some mode shapes are unknown and not counted")
    few = [number + 1 for number, point in enumerate(backbone.points) if point.periods < _FEW_PERIODS]
    if few:
        notes.append(
            f"point{'s' if len(few) > 1 else ''} {', '.join(map(str, few))}: fewer than {_FEW_PERIODS} periods, standard "
            "errors are rough; record more"
        )
    levels = np.unique(np.round(np.log(backbone.amplitude_m), 2)).size
    if levels < _FEW_LEVELS:
        notes.append(
            f"{levels} level{'s' if levels > 1 else ''} only: the intervals hold at the levels, not between them or "
            "beyond"
        )
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
