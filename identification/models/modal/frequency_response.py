"""Predicted frequency responses at constant force, from a nonlinear mode."""

from collections.abc import Callable
from functools import partial
from typing import Literal, get_args

import numpy as np

from identification.errors import ExtrapolationError, IdentificationError
from identification.models.dynamic_model import SteadyRequest
from identification.models.modal.properties import HIGHER_LEVELS, ModalProperties
from identification.models.modal.steady_states import OneMode, Path, fundamental_motion, range_notes
from identification.nonlinear.nonlinear_modes import NonlinearMode
from identification.prediction.steady_prediction import SteadyPrediction
from identification.validation import positive
from vibrolock.arrays import Float

HeldForce = Literal["fundamental", "rms", "pure-sine"]

FARTHEST = 20.0
"""Use of the identified range up to which branches are sought where any extrapolation is allowed. Chosen."""


def mode_response(mode: NonlinearMode, request: SteadyRequest) -> SteadyPrediction:
    """Predict the steady response of a nonlinear mode to a constant force, on all branches.

    ``fundamental``: ``|F_1|`` is held, and the force has the harmonics that the exciter caused when the mode was identified;
    their power is included in the damping. ``rms``: the RMS of such a force is held; the ratio of fundamental to RMS recorded
    at phase resonance is interpolated over q, and a note states this. ``pure-sine``: the damping is from the total power.
    """
    force, lowest_share = request.held, request.lowest_share
    IdentificationError.unless_one_of("force", force, get_args(HeldForce))
    IdentificationError.unless_at_least("points", request.points, 20)
    if not 0.0 < lowest_share < 1.0:
        raise IdentificationError(field="lowest_share", value=lowest_share, allowed="between 0 and 1")
    level = positive("force_n", request.level, "N")
    properties = ModalProperties.of(
        mode,
        damping="total-power" if force == "pure-sine" else "fundamental",
        largest_range_use=request.largest_range_use,
    )
    one = OneMode(properties, fundamental_of(mode, level, force))
    paths, notes = _branches(one, level)
    if not paths:
        raise IdentificationError(
            "too small: the response cannot be distinguished from rest", field="force_n", value=level
        )
    if force == "rms":
        notes.append(
            "the force's harmonics per fundamental are those recorded at phase resonance, off resonance as well"
        )
    s = [_parameters(one, path, request.points | 1, lowest_share) for path in paths]  # odd: the largest q is among them
    q, sign = np.concatenate([path.at(each) for path, each in zip(paths, s, strict=True)], axis=1)
    omega = one.omega(q, sign)
    folds = np.concatenate([_folds(one, path, each) for path, each in zip(paths, s, strict=True)], axis=0)
    channels, motion = fundamental_motion(
        mode, properties, q, omega, one.fundamental_n(q), request.linear_modes, request.residuals
    )
    return SteadyPrediction(
        force_n=level,
        force=force,
        channels=channels,
        frequency_hz=omega / (2.0 * np.pi),
        modal_amplitude=q,
        fundamental_n=one.fundamental_n(q),
        displacement_m=motion,
        stable=one.stable(q, omega),
        branch=np.repeat(np.arange(len(paths)), [each.size for each in s]),
        range_use=properties.range_use(q),
        fold_frequency_hz=folds[:, 1] / (2.0 * np.pi),
        fold_amplitude_m=properties.drive_shape(folds[:, 0]) * folds[:, 0],
        fold_modal_amplitude=folds[:, 0],
        notes=(*notes, *range_notes(properties, q)),
    )


def fundamental_of(mode: NonlinearMode, level: float, force: str) -> Callable[[Float], Float]:
    """Return the function that gives the amplitude (peak) of the fundamental force at a modal amplitude q."""
    if force != "rms":
        return partial(np.full_like, fill_value=level)
    share = np.abs(mode.force_harmonics[:, 1]) / np.linalg.norm(mode.force_harmonics[:, 1:], axis=1)
    q = np.where(np.isfinite(mode.modal_amplitude), mode.modal_amplitude, mode.amplitude_m * mode.apparent_mass_kg**0.5)
    known = np.isfinite(share) & np.isfinite(q)
    if not np.any(known) or mode.force_harmonics.shape[1] < 3:
        raise IdentificationError(
            "'rms' needs a mode with recorded force harmonics", field="force", hint="'fundamental' does not"
        )
    order = np.argsort(q[known], kind="stable")
    q, share = q[known][order], share[known][order]
    return lambda at: np.asarray(np.sqrt(2.0) * level * np.interp(at, q, share))


def _branches(one: OneMode, level: float) -> tuple[list[Path], list[str]]:
    """Return the branches of solutions; raise `ExtrapolationError` if a branch from the identified range exceeds the limit."""
    largest = one.properties.q_range[1]
    limit = min(one.properties.highest_q, FARTHEST * largest)
    paths, opened = one.paths(limit)
    if opened is not None and (opened <= largest or not paths):
        advice = "measure higher levels" if np.isinf(one.properties.highest_q) else HIGHER_LEVELS
        raise ExtrapolationError(
            f"{level:g} N drives the mode beyond {limit / largest:g} times the largest modal amplitude "
            f"identified ({largest:g} kg^1/2 m); {advice}",
            field="force_n",
        )
    notes = []
    invented = [path.lowest for path in paths if path.lowest > largest] + ([] if opened is None else [opened])
    if invented:
        notes.append(
            f"detached branches that the extrapolation alone has, from q = {min(invented):g} on, were left out"
        )
        paths = [path for path in paths if path.lowest <= largest]
    if detached := sum(path.closed for path in paths):
        notes.append(f"{detached} detached branch{'es' if detached > 1 else ''}: reached by a large disturbance only")
    return paths, notes


def _parameters(one: OneMode, path: Path, points: int, lowest_share: float) -> Float:
    """Return the path parameters of the points of a branch, without those at which there is no frequency."""
    first = 0.0 if path.closed else float(np.arcsin(lowest_share))
    s = np.linspace(first, 2.0 * np.pi if path.closed else np.pi - first, points)
    return np.asarray(s[np.isfinite(one.omega(*path.at(s)))])


def _folds(one: OneMode, path: Path, s: Float) -> Float:
    """float[n_folds, 2]: q and W where the determinant of the slow flow changes sign along a branch."""
    from scipy.optimize import brentq

    def determinant(at: float) -> float:
        q, sign = path.at(np.array([at]))
        return float(one.jacobian(q, one.omega(q, sign))[1][0])

    q, sign = path.at(s)
    values = one.jacobian(q, one.omega(q, sign))[1]
    changes = np.flatnonzero(values[1:] * values[:-1] < 0.0)
    roots = np.array([brentq(determinant, s[k], s[k + 1], xtol=1e-12) for k in changes])
    q, sign = path.at(roots)
    return np.column_stack([q, one.omega(q, sign)]) if roots.size else np.zeros((0, 2))
