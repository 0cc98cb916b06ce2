"""Convert the parameters of a fit to modes: normalisation by a drive-point residue, standard errors, rejections, notes."""

from collections.abc import Sequence

import numpy as np

from identification.channels import Channel, find_role
from identification.linear.accelerance import WeightedResponses
from identification.linear.modes import LinearModes, mac_matrix
from identification.linear.rational_fractions import RESIDUAL_TERMS, ModalFit, fit_modes
from identification.linear.response_matrix import FrequencyResponseMatrix
from vibrolock.arrays import Complex, Float

_SIGNIFICANT = 3.0
"""Standard errors below which a residue counts as zero. The usual choice."""
_LARGEST_DAMPING = 0.25
"""Largest damping ratio of a mode. Chosen."""
_LARGEST_DAMPING_ERROR = 0.5
"""Largest standard error of a damping ratio, relative to it. Chosen."""
_CLOSE_BANDWIDTHS = 2.0
"""Distance of two modes in mean bandwidths below which a note says that they are close. Chosen."""
_LINES_PER_BANDWIDTH = 2.0
"""Lines within a mode's bandwidth below which a note says that the resolution is coarse. Chosen."""
_LARGEST_RESIDUAL = 1.3
"""RMS of residual over expected error above which a note says so. Chosen."""
_COLLINEAR = 0.95
"""Modal phase collinearity below which a note calls the mode complex. Chosen."""


def phase_collinearity(residues: Complex) -> Float:
    """float[n_modes]: modal phase collinearity of the residues of each column, 1 if they lie on one line through zero.

    It is ``((Sxx - Syy)^2 + 4 Sxy^2) / (Sxx + Syy)^2`` of the real and imaginary parts (Pappa, Elliott and Schenk, 1993).
    """
    xx, yy = np.sum(residues.real**2, axis=0), np.sum(residues.imag**2, axis=0)
    xy = np.sum(residues.real * residues.imag, axis=0)
    return np.asarray(((xx - yy) ** 2 + 4.0 * xy**2) / np.maximum((xx + yy) ** 2, 1e-300))


def _residues(poles: Float, terms: Float, normal: bool) -> Complex:
    """complex[n_outputs, n_modes]: residues ``rho = a + b p``, 1/kg."""
    omega, zeta = np.split(poles[:-1], 2)
    count = omega.size
    if normal:
        return terms[:, :count].astype(np.complex128)
    return np.asarray(terms[:, :count] + terms[:, count : 2 * count] * omega * (-zeta + 1j * np.sqrt(1.0 - zeta**2)))


def drive_of(channels: Sequence[Channel]) -> int | None:
    """Return the index of the drive channel; None if there is none. Raises `IdentificationError` if there are several."""
    return find_role(channels, "drive") if any(channel.role == "drive" for channel in channels) else None


def _prominence(fit: ModalFit, drive: int | None, *, normal: bool) -> tuple[Float, Float]:
    """Return a residue of each mode and its standard error: at the drive point, or else where it stands out most."""
    terms, count = fit.terms.shape[1], fit.omega.size
    std = np.sqrt(np.maximum(np.diag(fit.covariance), 0.0))
    residues = _residues(fit.poles, fit.terms, normal)
    errors = std[fit.poles.size :].reshape(-1, terms)[:, :count]
    if drive is not None:
        return residues[drive].real, errors[drive]
    row = np.argmax(np.abs(residues) / np.maximum(errors, 1e-300), axis=0)
    return np.abs(residues)[row, np.arange(count)], errors[row, np.arange(count)]


def accepted(fit: ModalFit, data: WeightedResponses, drive: int | None, *, normal: bool) -> tuple[list[str], Float]:
    """Return why each pole is not a mode (empty if it is one), and its prominence.

    The prominence is the residue over its standard error: that at the drive point, or the largest without one.
    """
    omega, zeta = fit.omega, fit.zeta
    count = omega.size
    std = np.sqrt(np.maximum(np.diag(fit.covariance), 0.0))
    residue, residue_std = _prominence(fit, drive, normal=normal)
    what = "residue" if drive is None else "drive-point residue"
    band = 2.0 * np.pi * data.frequency_hz[[0, -1]]
    reasons = []
    for k in range(count):
        if zeta[k] > _LARGEST_DAMPING:
            reasons.append(f"has a damping ratio of {100 * zeta[k]:.3g} %")
        elif not band[0] <= omega[k] <= band[1]:
            reasons.append("left the band")
        elif zeta[k] <= 0.0:
            reasons.append(f"has a damping ratio of {100 * zeta[k]:.3g} %")
        elif residue[k] <= _SIGNIFICANT * residue_std[k]:
            reasons.append(f"has a {what} of {residue[k]:.3g} +- {residue_std[k]:.3g} 1/kg")
        elif std[count + k] > _LARGEST_DAMPING_ERROR * zeta[k]:
            reasons.append(f"has a damping ratio of {100 * zeta[k]:.3g} +- {100 * std[count + k]:.3g} %")
        else:
            reasons.append("")
    return reasons, np.abs(residue) / np.maximum(residue_std, 1e-300)


def as_linear_modes(
    fit: ModalFit, band: FrequencyResponseMatrix, data: WeightedResponses, *, normal: bool
) -> LinearModes:
    """Return the modes in rising order of frequency; their covariance follows by first-order propagation.

    It grows with the square of a misfit above 1 (the Birge ratio): what the model misses moves its parameters as noise of that
    size would. The systematic part (`model_errors`) is added.
    """
    drive = drive_of(band.outputs)
    rows, count, terms = len(band.outputs), fit.omega.size, fit.terms.shape[1]
    nonlinear = fit.poles.size
    parameters = np.concatenate([fit.poles, fit.terms.ravel()])
    largest = np.argmax(np.abs(_residues(fit.poles, fit.terms, normal)), axis=0)

    def modes(values: Float) -> Float:
        """Frequencies (Hz), damping ratios and shapes row by row, in one vector."""
        poles = values[:nonlinear]
        residues = _residues(poles, values[nonlinear:].reshape(rows, terms), normal)
        by = residues[largest, np.arange(count)] if drive is None else np.sqrt(residues[drive])
        shapes = (residues / by).real
        return np.concatenate([poles[:count] / (2.0 * np.pi), poles[count:-1], shapes.ravel()])

    std = np.sqrt(np.maximum(np.diag(fit.covariance), 0.0))
    steps = np.maximum(1e-3 * std, 1e-9 * np.abs(parameters) + 1e-300)
    used = list(range(2 * count)) + [
        nonlinear + o * terms + t for o in range(rows) for t in range(terms - RESIDUAL_TERMS)
    ]
    jacobian = np.zeros((count * (2 + rows), parameters.size))
    for index in used:
        step = np.zeros(parameters.size)
        step[index] = steps[index]
        jacobian[:, index] = (modes(parameters + step) - modes(parameters - step)) / (2.0 * steps[index])
    rise = np.argsort(fit.omega, kind="stable")
    order = np.concatenate([block * count + rise for block in range(2 + rows)])
    values = modes(parameters)[order]
    parameter_covariance = fit.misfit**2 * fit.covariance
    if fit.systematic is not None:
        parameter_covariance = parameter_covariance + np.diag(fit.systematic)
    covariance = (jacobian @ parameter_covariance @ jacobian.T)[np.ix_(order, order)]
    errors = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    loose = fit if not normal else fit_modes(data, fit.poles, normal=False, iterations=0)
    return LinearModes(
        channels=band.outputs,
        frequency_hz=values[:count],
        frequency_std_hz=errors[:count],
        damping_ratio=values[count : 2 * count],
        damping_ratio_std=errors[count : 2 * count],
        shapes=values[2 * count :].reshape(rows, count),
        shapes_std=errors[2 * count :].reshape(rows, count),
        phase_collinearity=phase_collinearity(_residues(loose.poles, loose.terms, False))[rise],
        lower=fit.terms[:, -5].astype(np.complex128),
        upper=fit.terms[:, -2].astype(np.complex128),
        small_terms=fit.terms[:, [-4, -3, -1]],
        upper_hz=1.0 / (2.0 * np.pi * np.sqrt(fit.poles[-1])) if fit.poles[-1] > 0.0 else np.inf,
        lowest_hz=float(data.frequency_hz[0]),
        highest_hz=float(data.frequency_hz[-1]),
        force_rms_n=band.input_rms[0] if band.input_rms else np.nan,
        force_unit=band.inputs[0].unit,
        fit_residual=fit.residual,
        covariance=covariance,
        residues=None if normal and drive is not None else _residues(fit.poles, fit.terms, normal)[:, rise],
        specimen=band.specimen,
    )


def modal_notes(modes: LinearModes, data: WeightedResponses, converged: bool) -> list[str]:
    """Return notes, one line each, on modes that are close, poorly resolved or complex, and on a poor fit."""
    notes = (
        [] if modes.normalised else ["no drive point: shapes are not mass-normalised, the largest of each mode is 1"]
    )
    notes += [] if converged else ["the fit did not come to rest: the poles depend on where it began"]
    frequency, bandwidth = modes.frequency_hz, 2.0 * modes.damping_ratio * modes.frequency_hz
    alike = mac_matrix(modes, modes)
    for k in range(frequency.size - 1):
        apart = frequency[k + 1] - frequency[k]
        if apart < _CLOSE_BANDWIDTHS * 0.5 * (bandwidth[k] + bandwidth[k + 1]):
            notes.append(
                f"modes at {frequency[k]:.5g} and {frequency[k + 1]:.5g} Hz are close: {apart:.3g} Hz apart with half-power "
                f"bandwidths of {bandwidth[k]:.3g} and {bandwidth[k + 1]:.3g} Hz, MAC of their shapes {alike[k, k + 1]:.2f}"
            )
    for f, width in zip(frequency, bandwidth, strict=True):
        lines = np.count_nonzero(np.abs(data.frequency_hz - f) <= 0.5 * width)
        windowed = width + data.decay_rate_1_s / np.pi  # the peak as an exponential window broadens it
        above = int(np.clip(np.searchsorted(data.frequency_hz, f), 1, data.frequency_hz.size - 1))
        if windowed / float(data.frequency_hz[above] - data.frequency_hz[above - 1]) < _LINES_PER_BANDWIDTH:
            notes.append(
                f"mode at {f:.5g} Hz: half-power bandwidth {width:.3g} Hz holds {lines} lines; record longer periods for "
                "a reliable damping ratio"
            )
    for f, collinear in zip(frequency, modes.phase_collinearity, strict=True):
        if collinear < _COLLINEAR:
            notes.append(f"mode at {f:.5g} Hz: phase collinearity {collinear:.2f}, shape is complex or poorly measured")
    if data.kind == "relative":
        notes.append("no covariance of the responses is known: errors are taken from the misfit of the model")
    elif data.kind == "line scatter":
        notes.append(
            "total variance estimated from the scatter of neighbouring lines: the responses have none of realisations"
        )
    elif data.kind == "noise":
        notes.append("errors from noise and misfit; two realisations or more show nonlinear distortion line by line")
    if modes.fit_residual > _LARGEST_RESIDUAL:
        notes.append(
            f"misfit is {modes.fit_residual:.2f} times what its errors would explain: modes missing, or not linear "
            "at this level"
        )
    return notes
