"""Decays under a force, as that of an exciter that hangs on the structure: its part is taken out through the measured force.

The exciter may damp and detune the vibration many times more than the structure itself. The slow flow of force and motion
gives stiffness and damping of the structure alone at every instant (`identification.slow_flows.slow_flow`); they are fitted
around levels of the amplitude as for a continuous backbone, the window's bias taken out.

What is left of the accuracy: noise, the bend of the curves within a fit, and errors that force and motion do not share. The
damping is the difference of two rates, that of the decay and that of the exciter's force. A relative error e of
``drive_mode_shape^2`` or of the gain of the force against that of the motion shows in it multiplied by their ratio.
"""

import numpy as np
from numpy.typing import NDArray

from identification.channels import find_role
from identification.decays.result import DecayMode
from identification.errors import IdentificationError
from identification.slow_flows.continuous import fit_around
from identification.slow_flows.fits import neighbours, noise_variances
from identification.slow_flows.slow_flow import SlowFlow
from vibrolock.arrays import Complex, Float

_HALF_WIDTHS = (0.35, 0.5, 0.8, 1.2)  # in ln(amplitude)
_DEGREE, _HIGHER_DEGREE = 1, 2
"""Degree of a local polynomial, and of the one whose difference bounds the curvature within the fit. Chosen."""
_FEWEST_INSTANTS = 5
"""Fewest instants of a decay. Chosen."""
_CURVATURE = 2.0  # bound of the error over the difference between fits of two degrees
_WORST = 0.25
"""Relative standard error of the damping above which a level is left out."""
_WINDOW_PERIODS = 1.5
"""Periods after the beginning that the window of the demodulation still mixes with what was before. Chosen."""
_UNKNOWN, _RISEN = 0.2, 1.2
"""Standard error of the damping at an instant over the rate of decay, and a rise of the amplitude, at which a decay ends."""
_MEDIAN = 0.839  # median over mean of a chi-square variable with four degrees of freedom


def decay_with_force(
    flow: SlowFlow,
    *,
    start_s: float,
    stop_s: float | None = None,
    number: int = 10,
    drive_mode_shape_std: float = 0.0,
    residual_std_m_n: float = 0.0,
) -> DecayMode:
    """Return the properties of the mode without the exciter, from the slow flow of its decay.

    Raises `IdentificationError` if too few instants are above the noise, or the noise leaves the damping unknown at
    every level.

    Parameters
    ----------
    flow
        Slow flow of the record; what lies before ``start_s`` only keeps its ends away.
    start_s
        Where the free decay begins. The first window and a half after it are left out.
    stop_s
        Where it ends; at the noise, or with the record, if None.
    number
        Number of levels in equal ratios of the amplitude.
    drive_mode_shape_std
        Standard error of the slow flow's mode shape, kg^-1/2; it counts among the systematic errors.
    residual_std_m_n
        Standard error of the slow flow's receptance of the other modes, m/N; likewise.
    """
    # variance of the noise of ``g X`` from the force alone, (m/s^2)^2, where the vibration is gone
    quiet = float(np.median(flow.force_noise[-max(4, flow.time_s.size // 4) :])) / _MEDIAN
    decay = _decay(flow, start_s, stop_s, quiet)
    size = decay.amplitude_m
    levels = np.geomspace(size[0], size[-1], number + 2)[1:-1]
    tables = np.array([_at_width(decay, levels, width, quiet) for width in _HALF_WIDTHS])  # widths by levels by columns
    bounds = np.array([_pooled(table[:, 4:]) for table in tables])
    cost = np.hypot(tables[..., 3], bounds[..., 1]) / np.abs(tables[..., 1])
    cost[~np.isfinite(cost)] = np.inf
    keep = np.flatnonzero(cost.min(axis=0) < _WORST)
    if not keep.size:
        raise IdentificationError(
            "the noise and the exciter leave the damping unknown at every level; record from a higher level, "
            "or take the exciter off",
            field="samples",
        )
    best = cost.argmin(axis=0)[keep]
    chosen = tables[best, keep, :4], bounds[best, keep]
    return _mode(decay, levels[keep], *chosen, drive_mode_shape_std, residual_std_m_n)


def _decay(flow: SlowFlow, start_s: float, stop_s: float | None, quiet: float) -> SlowFlow:
    """Return the instants of the decay, from a window after its beginning to the noise."""
    rest = flow.select(flow.time_s > start_s + _WINDOW_PERIODS / float(np.median(flow.frequency_hz)))
    if stop_s is not None:
        rest = rest.select(rest.time_s <= stop_s)
    if rest.time_s.size < _FEWEST_INSTANTS:
        raise IdentificationError(f"{rest.time_s.size} instants of the slow flow after {start_s:g} s", field="start_s")
    size = rest.amplitude_m
    early = slice(0, _FEWEST_INSTANTS)
    decay_1_s, omega = (float(np.median(np.abs(part[early]))) for part in (rest.growth_1_s, rest.rate_1_s))
    unknown = np.sqrt(quiet) > _UNKNOWN * decay_1_s * omega * size
    below = np.flatnonzero(unknown | (size > _RISEN * np.minimum.accumulate(size)))
    count = int(below[0]) if below.size else size.size
    if count < _FEWEST_INSTANTS:
        reason = f"the decay is above the noise for {count} instants of the slow flow"
        raise IdentificationError(reason, field="samples", allowed=_FEWEST_INSTANTS)
    return rest.select(np.arange(size.size) < count)


def _at_width(decay: SlowFlow, levels: Float, width: float, quiet: float) -> Float:
    """float[n, 6]: stiffness, damping, their standard errors, and what they differ by to the fit of the other degree.

    These differences are squared, beyond noise, and may be below zero. NaN where there are too few instants.
    """
    fits = [
        [fit_around(decay, float(np.log(level)), width, degree) for degree in (_DEGREE, _HIGHER_DEGREE)]
        if np.count_nonzero(np.abs(np.log(decay.amplitude_m / level)) < width) >= _FEWEST_INSTANTS
        else None
        for level in levels
    ]
    out = np.full((levels.size, 6), np.nan)
    for row, both, near in zip(out, fits, neighbours(levels.size), strict=True):
        if both is None:
            continue
        noise = np.maximum(noise_variances([some[1] for some in fits[near] if some is not None]), [quiet, 0.0])
        (k_std, c_std), (k_further, c_further) = (fit.standard_errors(noise) for fit in both)
        row[:4] = both[0].stiffness, both[0].damping, k_std, c_std
        row[4] = (both[1].stiffness - both[0].stiffness) ** 2 - max(k_further**2 - k_std**2, 0.0)
        row[5] = (both[1].damping - both[0].damping) ** 2 - max(c_further**2 - c_std**2, 0.0)
    return out


def _pooled(square: Float) -> Float:
    """float[n, 2]: bounds of the systematic errors of stiffness and damping, averaged over neighbouring levels."""
    out = np.full(square.shape, np.nan)
    for row, near in zip(out, neighbours(len(square)), strict=True):
        known = square[near][np.isfinite(square[near, 0])]
        if known.size:
            row[:] = _CURVATURE * np.sqrt(np.maximum(known.mean(axis=0), 0.0))
    return out


def _mode(
    decay: SlowFlow, amplitude: Float, fits: Float, bounds: Float, shape_std: float, residual_std: float
) -> DecayMode:
    stiffness, damping, std = fits[:, 0], fits[:, 1], fits[:, 2:]
    omega = np.sqrt(stiffness)
    falling, growth = np.log(decay.amplitude_m), decay.growth_1_s

    def at(values: NDArray[np.generic]) -> Complex:
        order = np.argsort(falling)
        place = np.log(amplitude)
        real = np.interp(place, falling[order], np.real(values)[order])
        return np.asarray(real + 1j * np.interp(place, falling[order], np.imag(values)[order]))

    pull = at(decay.drive_mode_shape**2 * decay.force[:, 1] / decay.drive_m)
    turning = at(decay.rate_1_s).imag
    for error in (
        2.0 * shape_std / abs(decay.drive_mode_shape) * pull,
        residual_std / decay.drive_mode_shape**2 * pull**2,
    ):
        bounds = bounds + 1.96 * np.abs(np.stack([error.real, error.imag / turning], axis=-1))
    if amplitude.size > 1:  # what changes with the amplitude lags behind it, to first order in the rate of decay
        lag = np.abs(np.gradient(stiffness, np.log(amplitude)) * at(growth).real) / stiffness
        bounds[:, 1] += lag
    drive = find_role(decay.channels, "drive")
    deflection = np.full((amplitude.size, len(decay.channels)), complex(np.nan, np.nan))
    for row, channel in enumerate(decay.channels):
        if channel.role in ("drive", "response"):
            deflection[:, row] = at(decay.deflection_ratio(channel.name))
    harmonics = np.full((amplitude.size, decay.harmonics.shape[2]), complex(np.nan, np.nan))
    harmonics[:, 1] = amplitude
    return DecayMode(
        amplitude_m=amplitude,
        amplitude_std_m=np.zeros(amplitude.size),
        time_s=at(decay.time_s).real,
        frequency_hz=at(decay.frequency_hz).real,
        modal_frequency_hz=omega / (2.0 * np.pi),
        modal_frequency_std_hz=std[:, 0] / (4.0 * np.pi * omega),
        modal_frequency_systematic_hz=bounds[:, 0] / (4.0 * np.pi * omega),
        damping_ratio=0.5 * damping / omega,
        damping_ratio_std=0.5 * std[:, 1] / omega,
        damping_ratio_systematic=0.5 * bounds[:, 1] / omega,
        decay_ratio=-at(growth).real / omega,
        deflection=deflection,
        harmonics_m=harmonics,
        force_n=pull * amplitude / decay.drive_mode_shape**2,
        reference=decay.channels[drive].name,
        start_s=float(decay.time_s[0]),
        stop_s=float(decay.time_s[-1]),
        floor_m=float(np.sqrt(np.median(decay.noise[:, 0])) / float(np.median(stiffness))),
        drive_mode_shape=decay.drive_mode_shape,
    )
