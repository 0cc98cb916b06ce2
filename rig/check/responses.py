"""Evaluate the multisine of a check: coherence of every channel, responses per volt and per newton, the mode under test.

Near the mode under test the responses of all accelerations a_i to the force at the drive point share one pole,

    a_i / F = s^2 phi_d phi_i / (s^2 + 2 zeta omega_0 s + omega_0^2) + c_i + e_i s^2,    s = j omega,

with mass-normalised shapes phi (normal modes; Ewins, *Modal Testing*, 2nd ed., section 2.4) and other modes as residuals. The
pole is found by iterated linear least squares (Sanathanan and Koerner, 1963). Given the pole, residues and residuals follow
from a linear fit. They remain complex, because delays between channels rotate them.
"""

import math
from dataclasses import dataclass

import numpy as np

from identification import PeriodicSpectra
from rig.arming.checked_scale import CheckedScale
from rig.bench import Bench
from vibrolock.arrays import Complex, Float

BAND = (0.7, 1.4)  # band of the fit over the linear frequency; chosen
MAX_MISFIT = 0.15  # largest misfit of a fit that describes the responses; chosen, see `fit_mode`
ITERATIONS = 12  # iterations of the fit of the pole; chosen: it converges in fewer


@dataclass(frozen=True, eq=False)
class Responses:
    """Measured responses at the excited lines."""

    names: tuple[str, ...]
    """Names of the bench's channels, in the order of the bench."""
    frequency_hz: Float
    """float[n_lines], Hz."""
    per_volt: Complex
    """complex[n_channels, n_lines], unit of the channel per volt of output; the skew is removed."""
    coherence: Float
    """float[n_channels]: part of a channel's power in the band that is periodic with the excitation."""
    distortion: Float
    """float[n_channels]: RMS of lines that are not excited, without noise, relative to that of excited lines."""

    def per(self, reference: int) -> Complex:
        """Return the responses relative to another channel, complex[n_channels, n_lines]."""
        return np.asarray(self.per_volt / self.per_volt[reference])


@dataclass(frozen=True, eq=False)
class Mode:
    """The mode under test, identified from force and accelerations."""

    frequency_hz: float
    """Natural frequency, Hz."""
    damping_ratio: float
    """Damping ratio of the structure alone."""
    residue: Complex
    """complex[n_accelerations], phi_d phi_i, 1/kg; real and positive for a point that moves in phase with the drive point."""
    misfit: float
    """Largest relative RMS difference between fit and measurement."""


def responses_of(bench: Bench, measured: PeriodicSpectra) -> Responses:
    """Compute the responses per volt from the spectra of one level."""
    excited = measured.excited
    means, spread = measured.mean, measured.noise_variance
    rows = [measured.index(channel.name) for channel in bench.channels]
    voltage = means[:, measured.index("voltage")][:, excited]
    value = np.einsum("rck,rk->ck", means[:, rows][:, :, excited], voltage.conj()) / np.sum(
        np.abs(voltage) ** 2, axis=0
    )
    periods = measured.spectra.shape[1]
    power = np.abs(means[:, rows]) ** 2 - spread[:, rows] / periods
    signal = np.maximum(power[:, :, excited].sum(axis=(0, 2)), 0.0)
    noise = spread[:, rows][:, :, excited].sum(axis=(0, 2))
    coherence = signal / np.maximum(signal + noise, 1e-300)
    unexcited = np.maximum(power[:, :, ~excited].mean(axis=(0, 2)), 0.0) if (~excited).any() else np.zeros(len(rows))
    distortion = np.sqrt(unexcited / np.maximum(power[:, :, excited].mean(axis=(0, 2)), 1e-300))
    names = tuple(channel.name for channel in bench.channels)
    return Responses(names, measured.frequency_hz[excited], value, coherence, distortion)


def fit_mode(frequency_hz: Float, accelerance: Complex, near_hz: float) -> Mode | None:
    """Identify the mode nearest to a frequency from accelerations per force [n, n_lines]; None if the band contains none.

    There is no mode if the residuals of other modes alone describe the responses as well as a fit has to (``MAX_MISFIT``): then
    almost nothing remains in the equations for the pole, and their solution is noise or rounding error. With a mode inside the
    band, the residuals alone leave a misfit of 0.9 and more (0.2 at a damping ratio of 0.3); with a mode outside, up to 0.1.
    """
    around = (frequency_hz > BAND[0] * near_hz) & (frequency_hz < BAND[1] * near_hz)
    if np.count_nonzero(around) < 12:
        return None
    s: Complex = np.asarray(1j * frequency_hz[around] / near_hz, np.complex128)
    values = accelerance[:, around]
    sizes = np.sqrt(np.mean(np.abs(values) ** 2, axis=1))
    if not (np.isfinite(values).all() and np.all(sizes > 0.0)):
        return None
    residuals = np.column_stack([np.ones_like(s), s**2])
    if _fitted(residuals, values)[1] <= MAX_MISFIT:
        return None
    pole = _pole(s, values / sizes[:, None])
    if pole is None:
        return None
    omega = math.sqrt(pole[0])
    found, misfit = _fitted(np.column_stack([s**2 / (s**2 + pole[1] * s + pole[0]), residuals]), values)
    return Mode(omega * near_hz, pole[1] / (2.0 * omega), found[0], misfit)


def _fitted(terms: Complex, values: Complex) -> tuple[Complex, float]:
    """Fit factors of the terms for each response; also return the largest relative RMS difference that remains."""
    found, *_ = np.linalg.lstsq(terms, values.T, rcond=None)
    left = np.linalg.norm(values.T - terms @ found, axis=0) / np.linalg.norm(values, axis=1)
    return np.asarray(found), float(left.max())


def _pole(s: Complex, values: Complex) -> tuple[float, float] | None:
    """Return the stiffness and damping terms of the common denominator, with frequencies relative to the expected one."""
    powers: Complex = s[:, None] ** np.arange(5)[None, :]
    weight = np.ones(s.size)
    stiffness, damping = 1.0, 0.01
    for _ in range(ITERATIONS):
        rows = np.concatenate([_reduced(powers * weight[:, None], value * weight, s) for value in values])
        matrix, right = rows[:, :2], rows[:, 2]
        (stiffness, damping), *_ = np.linalg.lstsq(
            np.concatenate([matrix.real, matrix.imag]), np.concatenate([right.real, right.imag]), rcond=None
        )
        if not math.isfinite(stiffness) or not math.isfinite(damping):
            return None
        weight = 1.0 / np.maximum(np.abs(s**2 + damping * s + stiffness), 1e-9)
    inside = BAND[0] ** 2 < stiffness < BAND[1] ** 2 and 0.0 < damping < 0.6
    return (float(stiffness), float(damping)) if inside else None


def _reduced(numerator: Complex, value: Complex, s: Complex) -> Complex:
    """Set up ``value (s^2 + a s + b) = numerator coefficients`` and project out the unknowns of the numerator.

    The last column is the right side.
    """
    basis, _ = np.linalg.qr(numerator)
    columns = np.column_stack([value, value * s, -value * s**2])
    return np.asarray(columns - basis @ (basis.conj().T @ columns))


BANDWIDTHS = 8.0
"""Half width of the band around the mode in which volts per acceleration are fitted, in half bandwidths."""
FEWEST = 5  # lines of such a fit
LARGEST_ERROR = 0.3  # relative misfit from which the fit does not say how many volts the motion needs


def scale_of(bench: Bench, responses: Responses, mode: Mode | None, at: str = "") -> CheckedScale | None:
    """Return the scale at the resonance of the mode under test; None if the check does not tell it.

    The accelerance at resonance is ``|phi_d^2| / (2 zeta)`` by the mode's residue. Volts per acceleration are
    ``u / A = beta + alpha / Y`` with the exciter ``u = alpha F + beta A`` and the accelerance Y of the structure. One over Y is
    a polynomial near a mode, so that the sum is smooth across the resonance: a parabola is fitted to the lines around it.
    """
    drive = bench.index_of("drive")
    if mode is None or not mode.damping_ratio > 0.0:
        return None
    per_newton = abs(mode.residue[0]) / (2.0 * mode.damping_ratio)
    off = responses.frequency_hz / mode.frequency_hz - 1.0
    order = np.argsort(np.abs(off), kind="stable")
    near = np.abs(off) <= max(BANDWIDTHS * mode.damping_ratio, float(np.abs(off[order[min(FEWEST, off.size) - 1]])))
    if np.count_nonzero(near) < FEWEST or not np.all(np.abs(responses.per_volt[drive][near]) > 0.0):
        return None
    volts = 1.0 / responses.per_volt[drive][near]
    terms = np.vander(off[near], 3)
    found, *_ = np.linalg.lstsq(terms.astype(complex), volts, rcond=None)
    left = np.linalg.norm(volts - terms @ found) / np.linalg.norm(volts)
    if not (left <= LARGEST_ERROR and abs(found[-1]) > 0.0 and 0.0 < per_newton < math.inf):
        return None
    return CheckedScale(
        at=at,
        frequency_hz=mode.frequency_hz,
        damping_ratio=mode.damping_ratio,
        acceleration_per_newton=float(per_newton),
        acceleration_per_volt=float(1.0 / abs(found[-1])),
    )
