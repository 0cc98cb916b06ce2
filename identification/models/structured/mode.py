"""The nonlinear mode of a structured model: frequency and damping over amplitude, with the errors of the fit."""

from collections.abc import Callable
from typing import Any

import numpy as np

from identification.channels import find_role
from identification.errors import IdentificationError
from identification.exciter_coupling.exciter import Exciter
from identification.harmonic_balance.paths import Resonances
from identification.harmonic_balance.setting_up import Held
from identification.harmonic_balance.states import motion_rows
from identification.models.dynamic_model import HARMONICS, SteadyRequest
from identification.models.structured.balance import StructuredBalance
from identification.models.structured.dynamics import StructuredDynamics
from identification.models.structured.fit import StructuredFit, std_of
from identification.models.structured.model import StructuredModel
from identification.models.structured.open_backbone import BackboneCurve, with_open_laws
from identification.nonlinear.nonlinear_modes import NonlinearMode
from identification.nonlinear.properties import States, properties
from vibrolock.arrays import Float

_POINTS = 25
"""Largest number of points; they are spread over the backbone."""
_MOST_POINTS = 300
"""Largest number of points of the backbone of which these are some. Chosen."""
_TRIES = 12
"""Doublings of the force until an element moves as far as in the training data."""
_REACHED = 0.8
"""Share of the training range below which a backbone that ends for another reason counts as cut off."""
_CORRECTIONS, _EXACT = 8, 1e-9  # most Newton corrections, and the relative change at which they end; chosen


def structured_mode(
    found: StructuredFit | StructuredModel,
    force_n: float | None = None,
    *,
    force: Held = "pure-sine",
    exciter: Exciter | None = None,
    support: bool = True,
    near_hz: float | None = None,
    harmonics: int = HARMONICS,
    samples: int | None = None,
) -> NonlinearMode:
    """Compute modal frequency and damping ratio of a structured model over the amplitude, as `nonlinear_mode` measures them.

    The points are those of `identification.backbone`. The damping ratio is that of the active power of the force's
    fundamental; the modal amplitude refers to the small vibrations (`StructuredModel.linearised`).

    Standard errors are those of frequency and damping at the same amplitude, from the covariance of the fit, to first order
    (`std_of`). They are NaN for a model without its fit. Where the force is above that of the training data they also hold laws
    that the data leave open there and the error that the fit left (`with_open_laws`); below they contain neither the misfit of
    the laws nor that of the modes.

    Raises `ExtrapolationError` for a force above twice that of the training data or laws that differ too much there, and
    `IdentificationError` if ``force_n`` is needed because the model does not know its training data, and as
    `identification.backbone` does.

    Parameters
    ----------
    found
        A fit, or a model alone.
    force_n
        Largest force, N; by default that at which an element moves as far as in the training data.
    force, exciter, near_hz, harmonics, samples
        As in `identification.backbone`.
    support
        Whether the model's static support acts, as it does in a measured backbone.
    """
    model = found.model if isinstance(found, StructuredFit) else found
    row = find_role(model.outputs, "drive")

    how: dict[str, Any] = {"force": force, "exciter": exciter, "support": support, "harmonics": harmonics}
    how |= {"samples": samples, "near_hz": near_hz}

    def backbone(force_n: float, largest_use: float) -> Resonances:
        return _backbone(model, force_n, largest_use, **how)

    path = _within_training(model, backbone, row, near_hz) if force_n is None else backbone(force_n, np.inf)
    if force_n is not None and path.reason:
        raise IdentificationError(
            f"the backbone ends at {path.level[-1] * force_n:.3g} N ({path.reason})", field="force_n"
        )
    path = path.some(np.unique(np.linspace(0, len(path.level) - 1, _POINTS).round().astype(int)))
    states = path.states(stability=False)
    at_rest, mode = _tested(model, near_hz)
    linear = at_rest.output_shapes[:, mode]
    shape = float(abs(linear[row]))
    of_motions = motion_rows(model.outputs)
    displacement = states.states @ model.output_shapes[of_motions].T
    values: dict[str, Any] = properties(
        States(
            frequency_hz=path.frequency_hz,
            force=states.force_n,
            drive_m=displacement[..., 0],
            drift=np.zeros(states.count, dtype=np.complex128),
            deflection_m=displacement[:, 1],
            inverse=None,
            drive_shape=shape,
            linear_shape=linear[of_motions],
            linear_columns=tuple(range(len(of_motions))),
        )
    )
    relative = np.full((2, states.count), np.nan)
    if isinstance(found, StructuredFit):
        relative = std_of(found, lambda other: _at_amplitudes(path, other, row, near_hz))
        if force_n is not None:
            curve = BackboneCurve.of(path)
            relative = with_open_laws(
                found, curve, relative, lambda m, largest_n: BackboneCurve.of(_backbone(m, largest_n, np.inf, **how))
            )
    return NonlinearMode(
        **values,
        modal_frequency_std_hz=relative[0] * values["modal_frequency_hz"],
        damping_ratio_std=relative[1] * values["damping_ratio"],
        damping_ratio_total_power_std=relative[1] * values["damping_ratio"],
        frequency_hz=path.frequency_hz,
        fit_residual=np.full(states.count, np.nan),
        force_harmonics=states.force_n,
        response_harmonics_m=displacement[..., 0],
        source="structured model",
        specimen=model.specimen,
        notes=(
            *_notes(isinstance(found, StructuredFit), force, support and model.support_n_m > 0.0),
            *([f"the backbone ends early ({path.reason})"] if float(path.use()[-1]) < _REACHED and path.reason else []),
        ),
        drive_mode_shape=shape,
        drive_mode_shape_source="small vibrations of the structured model",
    )


def _backbone(
    model: StructuredModel,
    force_n: float,
    largest_use: float,
    *,
    force: Held,
    exciter: Exciter | None,
    support: bool,
    near_hz: float | None,
    harmonics: int,
    samples: int | None,
) -> Resonances:
    request = SteadyRequest(
        level=force_n,
        held=force,
        exciter=exciter,
        support=support,
        harmonics=harmonics,
        samples=samples,
        points=_MOST_POINTS,
        largest_range_use=largest_use,
    )
    return StructuredDynamics(model).resonances(request, near_hz)


def _tested(model: StructuredModel, near_hz: float | None) -> tuple[StructuredModel, int]:
    """Return the small vibrations of a model, and the mode of them that is followed."""
    at_rest = model.linearised()
    resonance_hz = StructuredDynamics(model).resonance_hz(near_hz)
    return at_rest, int(np.argmin(np.abs(at_rest.frequency_hz - resonance_hz)))


def _within_training(
    model: StructuredModel, backbone: Callable[[float, float], Resonances], row: int, near_hz: float | None
) -> Resonances:
    """Return the part of the backbone on which no element moves further than in the training data."""
    if not model.elements or not all(element.largest for element in model.elements):
        raise IdentificationError(
            "is missing", field="force_n", hint="the model does not know the range of its training data"
        )
    at_rest, mode = _tested(model, near_hz)
    shape = abs(at_rest.output_shapes[row, mode])
    least = min(float(e.largest or 1.0) * e.scale_m / np.linalg.norm(e.direction) for e in model.elements)
    force_n = float(2.0 * at_rest.damping_ratio[mode] * at_rest.omega[mode] ** 2 * least / shape)
    for _ in range(_TRIES):
        path = backbone(force_n, 1.0)
        if path.reason:
            inside = np.flatnonzero(path.use() <= 1.0)
            if inside.size > 1:
                return path.some(inside)
            force_n /= 8.0
            continue
        force_n *= 2.0
    raise IdentificationError(
        f"is missing; up to {force_n:.3g} N no element moves as far as in the training data", field="force_n"
    )


def _at_amplitudes(path: Resonances, model: StructuredModel, row: int, near_hz: float | None) -> Float:
    """float[2, n]: logarithms of frequency and damping ratio of another model, near a path, at the same amplitudes."""
    own = path.balance
    assert isinstance(own, StructuredBalance)
    balance, amplitude_row = path.like(own.like(model)), np.append(own.like(model).amplitude_row, 0.0)
    own_row = np.append(own.amplitude_row, 0.0)
    at_rest, mode = _tested(model, near_hz)
    shape, out = abs(at_rest.output_shapes[row, mode]), np.empty((2, len(path.level)))
    resonance = balance.equations
    for k in range(len(path.level)):
        v = np.append(path.unknowns[k], path.level[k])
        target = float(own_row @ path.unknowns[k])
        scale = np.maximum(np.abs(v), 1e-3 * np.max(np.abs(v)))
        for _ in range(_CORRECTIONS):
            residual, by_z, by_level = resonance(v[:-1], float(v[-1]))
            matrix = np.zeros((v.size, v.size))
            matrix[:-1, :-1], matrix[:-1, -1] = by_z, by_level
            matrix[-1, :-1] = amplitude_row
            change = np.linalg.solve(matrix, -np.append(residual, amplitude_row @ v[:-1] - target))
            v = v + change
            if np.max(np.abs(change / scale)) < _EXACT:
                break
        else:
            raise IdentificationError(f"no vibration was found at the amplitude of point {k + 1}", field="covariance")
        at_hz = float(v[-2])
        inputs = balance.balance.inputs_of(v[:-2], float(v[-1]))
        out[0, k] = np.log(at_hz)
        out[1, k] = np.log(np.hypot(inputs[1, 0], inputs[2, 0]) * shape**2 / at_hz**2)
    return out


def _notes(fitted: bool, force: str, supported: bool) -> tuple[str, ...]:
    notes = [
        "computed from a structured model" + (", not measured" if fitted else "; without its fit errors are unknown")
    ]
    if fitted:
        notes.append("standard errors are those of the fit's numbers alone, as if its residual were white")
    if force == "pure-sine":
        notes.append(
            "held: a force without harmonics"
            + (", with the static force of the exciter's suspension" if supported else "")
        )
    return tuple(notes)
