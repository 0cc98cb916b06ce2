"""Predicted frequency responses at constant force, from a nonlinear mode."""

from collections.abc import Callable, Sequence
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from identification.errors import IdentificationError
from identification.linear.modes import LinearModes
from identification.nonlinear.nonlinear_modes import NonlinearMode
from identification.prediction.properties import (
    FLAGGED_BEYOND,
    REFUSED_BEYOND,
    ExtrapolationError,
    ModalProperties,
)
from identification.prediction.steady_prediction import SteadyPrediction
from identification.prediction.steady_states import OneMode, Path
from identification.validation import positive

__all__ = ["HeldForce", "frequency_response", "frequency_responses"]

Complex = NDArray[np.complex128]
Float = NDArray[np.float64]
HeldForce = Literal["fundamental", "rms", "pure-sine"]

_FARTHEST = 20.0


def frequency_response(
    mode: NonlinearMode,
    force_n: float,
    *,
    force: HeldForce = "fundamental",
    modes: LinearModes | None = None,
    residuals: bool = True,
    allow_extrapolation: bool = False,
    points: int = 401,
    lowest_share: float = 0.05,
) -> SteadyPrediction:
    """Steady response of a nonlinear mode to a constant force, all branches.

    Parameters
    ----------
    mode
        The nonlinear mode as identified.
    force_n
        Force held, N: the peak of its fundamental, or its RMS where ``force`` is ``rms``.
    force
        What "constant" means. ``fundamental``: |F_1| is held, and the force has the harmonics that the exciter gave it
        when the mode was identified, whose power is in the damping. ``rms``: the same with the RMS of the whole force held;
        the ratio of fundamental to RMS is interpolated over q as recorded at phase resonance. ``pure-sine``: a force
        without harmonics, with the damping from the total power.
    modes
        Linear modes, for the responses at their other channels (the tested mode's shape, scaled by the drive point's
        response), and for the contribution of the other modes.
    residuals
        Whether to add the linear response of the other modes of ``modes`` to the force.
    allow_extrapolation
        Whether to answer beyond twice the largest modal amplitude identified.
    points
        Points on each branch.
    lowest_share
        Modal amplitude at both ends of the main branch, over its largest.

    Raises
    ------
    IdentificationError
        On forces that are not above zero, properties that the mode lacks, fewer than 20 points.
    ExtrapolationError
        If the response needs more than twice the largest modal amplitude identified.
    """
    if force not in get_args(HeldForce):
        raise IdentificationError(f"force: is '{force}', allowed are {', '.join(get_args(HeldForce))}")
    if points < 20:
        raise IdentificationError(f"points: is {points}, needs at least 20")
    if not 0.0 < lowest_share < 1.0:
        raise IdentificationError(f"lowest_share: is {lowest_share:g}, allowed is between 0 and 1")
    level = positive("force_n", force_n, "N")
    properties = ModalProperties.of(
        mode,
        damping="total-power" if force == "pure-sine" else "fundamental",
        allow_extrapolation=allow_extrapolation,
    )
    one = OneMode(properties, _fundamental(mode, level, force))
    paths, notes = _branches(one, level)
    # An odd number of points has the largest modal amplitude among them.
    s = [_parameters(path, points | 1, lowest_share) for path in paths]
    q, sign = np.concatenate([path.at(each) for path, each in zip(paths, s, strict=True)], axis=1)
    omega = one.omega(q, sign)
    branch = np.repeat(np.arange(len(paths)), [each.size for each in s])
    found = np.isfinite(omega)
    q, omega, branch = q[found], omega[found], branch[found]
    trace, determinant = one.jacobian(q, omega)
    folds = np.concatenate([_folds(one, path, each) for path, each in zip(paths, s, strict=True)], axis=0)
    channels, motion = _motion(mode, one, q, omega, modes, residuals)
    return SteadyPrediction(
        force_n=level,
        force=force,
        channels=channels,
        frequency_hz=omega / (2.0 * np.pi),
        modal_amplitude=q,
        fundamental_n=one.fundamental_n(q),
        displacement_m=motion,
        stable=(trace < 0.0) & (determinant > 0.0),
        branch=branch,
        range_use=properties.range_use(q),
        fold_frequency_hz=folds[:, 1] / (2.0 * np.pi),
        fold_amplitude_m=properties.drive_shape(folds[:, 0]) * folds[:, 0],
        fold_modal_amplitude=folds[:, 0],
        notes=(*notes, *_range_notes(properties, q)),
    )


def frequency_responses(
    mode: NonlinearMode,
    forces_n: Sequence[float],
    *,
    force: HeldForce = "fundamental",
    modes: LinearModes | None = None,
    residuals: bool = True,
    allow_extrapolation: bool = False,
) -> tuple[SteadyPrediction, ...]:
    """`frequency_response` at several forces; the message of an error names the force."""
    return tuple(
        frequency_response(
            mode, force_n, force=force, modes=modes, residuals=residuals, allow_extrapolation=allow_extrapolation
        )
        for force_n in forces_n
    )


def _fundamental(mode: NonlinearMode, level: float, force: HeldForce) -> Callable[[Float], Float]:
    """Peak of the fundamental of the force over q."""
    if force != "rms":
        return lambda q: np.full(np.shape(q), level)
    share = np.abs(mode.force_harmonics[:, 1]) / np.linalg.norm(mode.force_harmonics[:, 1:], axis=1)
    q = np.where(np.isfinite(mode.modal_amplitude), mode.modal_amplitude, mode.amplitude_m * mode.apparent_mass_kg**0.5)
    known = np.isfinite(share) & np.isfinite(q)
    if not np.any(known) or mode.force_harmonics.shape[1] < 3:
        raise IdentificationError("force: 'rms' needs a mode with recorded force harmonics; 'fundamental' does not")
    order = np.argsort(q[known], kind="stable")
    q, share = q[known][order], share[known][order]
    return lambda at: np.asarray(np.sqrt(2.0) * level * np.interp(at, q, share))


def _branches(one: OneMode, level: float) -> tuple[list[Path], list[str]]:
    """Branches of solutions; `ExtrapolationError` where one that begins in the identified range leaves the allowed."""
    largest = one.properties.q_range[1]
    limit = min(one.properties.highest_q, _FARTHEST * largest)
    paths, opened = one.paths(limit)
    if opened is not None and (opened <= largest or not paths):
        advice = (
            "measure higher levels"
            if one.properties.allow_extrapolation
            else ("measure higher levels, or allow_extrapolation")
        )
        raise ExtrapolationError(
            f"force_n: {level:g} N drives the mode beyond {limit / largest:g} times the largest modal amplitude "
            f"identified ({largest:g} kg^1/2 m); {advice}"
        )
    notes = []
    if opened is not None:
        notes.append(f"a detached branch that the extrapolation has from q = {opened:g} on was left out")
    if detached := sum(path.closed for path in paths):
        notes.append(f"{detached} detached branch{'es' if detached > 1 else ''}: reached by a large disturbance only")
    return paths, notes


def _parameters(path: Path, points: int, lowest_share: float) -> Float:
    if path.closed:
        return np.linspace(0.0, 2.0 * np.pi, points)
    first = np.arcsin(lowest_share)
    return np.linspace(first, np.pi - first, points)


def _folds(one: OneMode, path: Path, s: Float) -> Float:
    """float[n_folds, 2]: q and W where the determinant of the slow flow vanishes along a branch."""
    from scipy.optimize import brentq

    def determinant(at: float) -> float:
        q, sign = path.at(np.array([at]))
        return float(one.jacobian(q, one.omega(q, sign))[1][0])

    q, sign = path.at(s)
    values = one.jacobian(q, one.omega(q, sign))[1]
    with np.errstate(invalid="ignore"):
        changes = np.flatnonzero(values[1:] * values[:-1] < 0.0)
    roots = np.array([brentq(determinant, s[k], s[k + 1], xtol=1e-12) for k in changes])
    q, sign = path.at(roots)
    return np.column_stack([q, one.omega(q, sign)]) if roots.size else np.zeros((0, 2))


def _motion(
    mode: NonlinearMode, one: OneMode, q: Float, omega: Float, modes: LinearModes | None, residuals: bool
) -> tuple[tuple[str, ...], Complex]:
    """Names of the channels, drive point first, and complex[n, n_channels] displacement against the force."""
    lag = one.lag_rad(q, omega) + _turn_rad(mode, q)
    drive = one.properties.drive_shape(q) * q * np.exp(-1j * lag)
    if modes is None:
        return ("drive",), drive[:, None]
    frequency = omega / (2.0 * np.pi)
    tested = modes.nearest(float(mode.modal_frequency_hz[int(np.argmin(mode.amplitude_m))]))
    order = [modes.drive_row, *(row for row in range(len(modes.channels)) if row != modes.drive_row)]
    ratio = modes.shapes[order, tested] / modes.drive_shape[tested]
    motion = drive[:, None] * ratio
    names = tuple(modes.channels[row].name for row in order)
    if residuals:
        others = np.column_stack([modes.receptance(frequency, name, without=tested) for name in names])
        motion = motion + others * one.fundamental_n(q)[:, None]
    return names, motion


def _turn_rad(mode: NonlinearMode, q: Float) -> Float:
    """float[n]: turn of the modal constant over q, which a fit of stepped sines has found; else zero."""
    if mode.source != "stepped sine":
        return np.zeros_like(q)
    at = mode.amplitude_m * np.sqrt(mode.apparent_mass_kg)
    order = np.argsort(at, kind="stable")
    return np.asarray(np.interp(q, at[order], np.radians(mode.phase_lag_deg[order] - 90.0)))


def _range_notes(properties: ModalProperties, q: Float) -> list[str]:
    use = float(properties.range_use(np.max(q)))
    notes = []
    if use > REFUSED_BEYOND:
        notes.append(f"reaches {use:.2f} times the largest modal amplitude identified: not to be trusted")
    elif use > FLAGGED_BEYOND:
        notes.append(f"reaches {use:.2f} times the largest modal amplitude identified: extrapolated")
    if np.max(q) < properties.q_range[0]:
        notes.append("stays below the lowest level identified: modal properties are those of the lowest level")
    return notes
