"""Estimators of the best linear approximation from spectra, with its noise and total covariance.

Pintelon and Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., chapters 2 (H1, H2, instrumental
variables), 3 and 4 (robust method, several inputs). Every estimate is, line by line and over realisations r,

    H = S_YZ S_UZ^-1,    S_YZ = sum_r Y_r Z_r^H,    S_UZ = sum_r U_r Z_r^H,

Y_r and U_r are means over the periods; the estimators differ in Z. ``instrument`` takes noise-free signals that drive the
inputs, such as the voltage. Noise and nonlinear distortion in the force, which the structure itself causes, then leave no
bias. ``H1`` takes Z = U (noise of the inputs biases it low where they are small, near resonance), ``H2`` takes Z = Y, each
output separately (noise of the outputs biases it high, near antiresonance). ``Hv`` takes the sum of U and Y, each divided by
its RMS, with Y turned into the phase of U. It is the total least squares estimate with noise of equal relative size in both
(Rocklin, Crowley and Vold, Proc. 3rd IMAC, 1985), the geometric mean of H1 and H2. With a noiseless input, ``instrument`` with
the input as its own instrument and ``H1`` are the same.

To first order the error is ``sum_r (Y_r - H U_r) Z_r^H S_UZ^-1``. The part of ``Y - H U`` that differs from period to period
is noise; the part that differs between realisations is noise and nonlinear distortion. Noise common to input and output
counts once.
"""

from collections.abc import Sequence
from typing import Literal, get_args

import numpy as np

from identification.channels import Channel, Role, find_name
from identification.errors import IdentificationError
from identification.linear.response_matrix import FrequencyResponseMatrix
from vibrolock.arrays import Complex, Float

Estimator = Literal["instrument", "H1", "H2", "Hv"]
"""How a frequency response is estimated: with the generator's signal as instrument, or as H1, H2 or Hv."""

_DEPENDENT = 1e-9  # smallest singular value of S_UZ, scaled to a unit diagonal, below which only rounding is left
_SILENT = 1e-12  # amplitude against the strongest line


def estimated_responses(
    channels: tuple[Channel, ...],
    frequency_hz: Float,
    values: Complex,
    *,
    outputs: Sequence[str] | None,
    inputs: Sequence[str] | None,
    estimator: Estimator,
    instruments: Sequence[str],
    keep_deviations: bool = False,
) -> FrequencyResponseMatrix:
    """Estimate responses and covariances from spectra complex[n_realisations, n_periods, n_channels, n_lines].

    ``keep_deviations`` keeps the error of every realisation. All lines must be excited; the other parameters are those of
    `best_linear_approximation`, which also raises the errors listed there.
    """
    IdentificationError.unless_one_of("estimator", estimator, get_args(Estimator))
    rows = chosen("outputs", channels, outputs, ("drive", "response"))
    columns = chosen("inputs", channels, inputs, ("force",))
    y, u = values[:, :, rows], values[:, :, columns]
    names = [channels[column].name for column in columns]
    if y.shape[0] % len(names):
        reason = f"are {y.shape[0]}, need a multiple of the {len(names)} inputs {', '.join(names)}"
        raise IdentificationError(reason, field="realisations")
    z, label = _instruments(channels, values.mean(axis=1), rows, columns, estimator, instruments)
    weights = _weights(u.mean(axis=1), z, frequency_hz, label)
    value = np.einsum(
        "rok,roik->koi", y.mean(axis=1), np.broadcast_to(weights, (y.shape[0], len(rows), *weights.shape[2:]))
    )
    error = (y - np.einsum("koi,rpik->rpok", value, u))[:, :, :, None] * weights[:, None]
    error = error.reshape(*y.shape[:2], len(rows) * len(columns), -1)
    periods, means = error.shape[1], error.mean(axis=1)
    # The total covariance is that of blocks of as many realisations as inputs.
    blocks = means.reshape(-1, len(columns), *means.shape[1:]).sum(axis=1)[:, None]
    count = blocks.shape[0]
    noise = _products(error - means[:, None]) / (periods * (periods - 1)) if periods > 1 else None
    total = _products(blocks) * (count / (count - 1)) if count > 1 else None
    return FrequencyResponseMatrix(
        outputs=tuple(channels[row] for row in rows),
        inputs=tuple(channels[column] for column in columns),
        frequency_hz=frequency_hz,
        value=value,
        noise_covariance=noise,
        total_covariance=total,
        deviations=np.moveaxis(means, -1, 0) if keep_deviations else None,
        estimator=estimator,
        notes=(*_mixed([channels[row] for row in rows]), *_notes(error, len(columns))),
    )


def chosen(what: str, channels: Sequence[Channel], names: Sequence[str] | None, roles: tuple[Role, ...]) -> list[int]:
    """Return the rows of the channels called ``names``, or of all with one of ``roles``; at least one row, none twice."""
    if isinstance(names, str):
        names = (names,)
    if names is None:
        rows = [row for row, channel in enumerate(channels) if channel.role in roles]
    else:
        rows = [find_name(channels, name) for name in names]
    if not rows or len(set(rows)) < len(rows):
        asked = f"no channel of role {' or '.join(roles)}" if names is None else ", ".join(names) or "none given"
        allowed = f"one or more, each once, of {', '.join(channel.name for channel in channels)}"
        raise IdentificationError(asked, field=what, allowed=allowed)
    return rows


def _instruments(
    channels: Sequence[Channel],
    means: Complex,
    rows: list[int],
    columns: list[int],
    estimator: Estimator,
    instruments: Sequence[str],
) -> tuple[Complex, str]:
    """Return Z, complex[n_realisations, n_outputs or 1, n_inputs, n_lines], and its name for messages."""
    if estimator in ("H2", "Hv"):
        if len(columns) > 1:
            reason = f"is '{estimator}' with {len(columns)} inputs"
            raise IdentificationError(reason, field="estimator", allowed="one", hint="H1 takes several")
        y, u = means[:, rows], means[:, columns]
        if estimator == "H2":
            return y[:, :, None], "outputs"
        cross = np.sum(y * np.conj(u), axis=0)
        turned = y * np.conj(cross) / np.maximum(np.abs(cross), 1e-300)
        both = [signal / np.maximum(np.sqrt(np.sum(np.abs(signal) ** 2, axis=0)), 1e-300) for signal in (u, turned)]
        return (both[0] + both[1])[:, :, None], "inputs and outputs"
    if estimator == "H1":
        return means[:, None, columns], "inputs"
    known = chosen("instruments", channels, instruments, ())
    if len(known) != len(columns):
        reason = f"are {len(known)} ({', '.join(channels[row].name for row in known)})"
        raise IdentificationError(reason, field="instruments", allowed=f"one per input, {len(columns)}")
    label = "instrument " if len(known) == 1 else "instruments "
    return means[:, None, known], label + ", ".join(f"'{channels[row].name}'" for row in known)


def _weights(u: Complex, z: Complex, frequency_hz: Float, label: str) -> Complex:
    """Weights ``Z_r^H S_UZ^-1``, complex[n_realisations, n_outputs or 1, n_inputs, n_lines]; ``H = sum_r Y_r weight_r``."""
    size_u, size_z = np.sqrt(np.sum(np.abs(u) ** 2, axis=0)), np.sqrt(np.sum(np.abs(z) ** 2, axis=0))
    silent = np.any(size_u <= _SILENT * size_u.max(axis=-1, keepdims=True), axis=0)
    silent |= np.any(size_z <= _SILENT * size_z.max(axis=-1, keepdims=True), axis=(0, 1))
    if np.any(silent):
        where = frequency_hz[int(np.argmax(silent))]
        raise IdentificationError(
            f"gives no input at {where:g} Hz, an excited line; is the design what was played?", field=label
        )
    scaled_u, scaled_z = u / size_u, np.conj(z / size_z)
    cross = np.einsum("rik,rojk->okij", scaled_u, scaled_z)
    dependent = np.linalg.svd(cross, compute_uv=False).min(axis=-1) < _DEPENDENT
    if np.any(dependent):
        where = frequency_hz[int(np.argmax(dependent.any(axis=0)))]
        reason = f"does not move the {u.shape[1]} inputs independently of each other at {where:g} Hz"
        allowed = "as many realisations with other phases at each input, best orthogonal ones"
        raise IdentificationError(reason, field=label, allowed=allowed)
    scaled = np.einsum("rojk,okji->roik", scaled_z, np.linalg.inv(cross))
    return np.asarray(scaled / size_u)


def _products(samples: Complex) -> Complex:
    """Sum of ``x x^H`` over the first two axes, complex[n_lines, m, m]."""
    columns = np.moveaxis(samples.reshape(-1, *samples.shape[2:]), 0, -1).swapaxes(0, 1)
    return np.asarray(columns @ np.conj(columns.swapaxes(1, 2)))


def _mixed(outputs: list[Channel]) -> list[str]:
    motions = {channel.name: channel.motion for channel in outputs if channel.role in ("drive", "response")}
    if len(set(motions.values())) < 2:
        return []
    named = ", ".join(f"{name} {motion}" for name, motion in motions.items())
    return [f"outputs are different motions ({named}): their responses do not compare"]


def _notes(error: Complex, inputs: int) -> list[str]:
    realisations, periods, paths = error.shape[:3]
    blocks = realisations // inputs
    plural = "s" if blocks > 1 else ""
    scatter = f"{blocks} realisation{plural}" if inputs == 1 else f"{blocks} block{plural} of {inputs} realisations"
    found = []
    for name, rank, reason in (
        ("noise", realisations * (periods - 1), f"{realisations} x {periods} period{'s' if periods > 1 else ''}"),
        ("total", blocks - 1, scatter),
    ):
        if rank == 0:
            found.append(f"{name} covariance unknown: {reason} only")
        elif rank < paths:
            found.append(f"{name} covariance of {paths} paths has rank {rank} ({reason}): single paths only")
    return found
