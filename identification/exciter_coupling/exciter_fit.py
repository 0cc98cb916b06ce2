"""Identify the parameters of an exciter from a multisine: voltage, force and drive-point acceleration, line by line.

Every line k of every realisation obeys, for parameters p and ``s = 2 pi i f_k``, times ``1 + s tau``

    e(p) = (1 + s tau + P r_s) F + P A / s^2 - g V = 0,    P = (1 + s tau) (s^2 m + s c + k) + s b,

for any structure, linear or nonlinear, because force and motion are both measured. Only the sensor noise in both causes a
residual. Where the force drops at a resonance, this noise is as large as the force itself. The maximum-likelihood cost for
noise in all channels is ``sum |e(p)|^2 / var e(p)`` (Pintelon and Schoukens, *System Identification*, 2nd ed., 9.10 and 9.11)
with the noise covariance taken from the scatter of the periods. The start is the linear regression

    F = g V - s tau F - c3 s A - c2 A - c1 A / s - c0 A / s^2.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from identification.channels import MOTION_ORDER, find_role
from identification.errors import IdentificationError
from identification.exciter_coupling.exciter import PARAMETERS, Exciter, ExciterLines, VoltagePath
from identification.multisine.spectra import PeriodicSpectra
from identification.validation import positive
from vibrolock.arrays import Complex, Float

_COMPLIANCE = PARAMETERS.index("stinger_compliance_m_n")
_STINGER_TIME = PARAMETERS.index("stinger_damping_time_s")
_MASS = PARAMETERS.index("moving_mass_kg")
_STIFFNESS = PARAMETERS.index("suspension_stiffness_n_m")
_DAMPING = PARAMETERS.index("suspension_damping_n_s_m")
_BACK_EMF = PARAMETERS.index("back_emf_damping_n_s_m")
_FEWEST_LINES = 20
"""Fewest lines of an identification. Chosen: more than twice the parameters."""
_POOLED_LINES = 21
"""Neighbouring lines over which the noise is pooled. Chosen."""
_UNSURE = 0.5
"""Standard error relative to a parameter above which it counts as not identified. Chosen."""
_MISFIT = 2.0
"""RMS of residual over expected error above which a note says so. Chosen."""


def identify_exciter(
    spectra: PeriodicSpectra,
    *,
    lowest_hz: float | None = None,
    highest_hz: float | None = None,
    voltage: str = "voltage",
    sample_rate_hz: float | None = None,
    stinger_stiffness_n_m: float | None = None,
    resistance_ohm: float | None = None,
    amplifier_gain: float = 1.0,
    source: str = "",
) -> Exciter:
    """Identify an exciter from the spectra of a multisine.

    Raises `IdentificationError` if there is a single period, too few lines, a channel is missing, or the voltage is zero.

    Parameters
    ----------
    spectra
        At least two periods, with the channel ``voltage``, one of role ``force`` and one of role ``drive`` (where the stinger
        is fixed). The band should reach well below and well above the suspension's resonance: a narrow band may give a mass
        with an error of 50 %.
    lowest_hz, highest_hz
        Part of the band to use, both ends included.
    voltage
        Name of the voltage channel.
    sample_rate_hz
        Sample rate of the converter that put out the voltage; None if the voltage was measured at the amplifier. Delay,
        dispersion and coupling of the `VoltagePath` are estimated too.
    stinger_stiffness_n_m
        Stinger stiffness k_s if it is known (E A / l). If None, it is estimated; the stinger is taken as rigid if the data do
        not determine k_s.
    resistance_ohm, amplifier_gain
        Measured resistance R of coil, cable and amplifier, and gain of a voltage amplifier (V/V). They give
        ``b = g^2 R / gain^2``. Without R, only the inductance of the coil separates suspension damping from back-EMF, which
        requires a band of several hundred hertz. Their sum is identified in either case and suffices for predictions.
    source
        Rig and exciter for which the result is valid.

    Returns
    -------
    Exciter
        The exciter with the covariance of its parameters from noise. If the mean square of residual over noise is above one,
        the covariance is multiplied by it, to include the steps of a converter, which repeat from period to period and differ
        from line to line. The covariance does not include model errors. On the shipped rigs these are 0.002 % (coil time
        constant 0.1 %, stinger damping 9 %) with stinger stiffness and resistance given; otherwise two to three times the
        standard error of the mass, c and b.
    """
    rate = np.inf if sample_rate_hz is None else positive("sample_rate_hz", sample_rate_hz, "Hz")
    data = _lines(spectra, voltage, rate, lowest_hz, highest_hz)
    start = _regression(data)
    if stinger_stiffness_n_m is not None:
        start[_COMPLIANCE] = 1.0 / positive("stinger_stiffness_n_m", stinger_stiffness_n_m, "N/m")
    known = set() if stinger_stiffness_n_m is None else {_COMPLIANCE}
    per_square = None
    if resistance_ohm is not None:
        known.add(_BACK_EMF)
        per_square = positive("resistance_ohm", resistance_ohm, "ohm") / positive("amplifier_gain", amplifier_gain) ** 2
    free = [index for index in range(start.size) if index not in known | {_STINGER_TIME}]
    values, covariance, residual = _fit(data, start, free, per_square)
    notes: tuple[str, ...] = ()
    if _COMPLIANCE in free and not _is_told(values, covariance, _COMPLIANCE):
        free.remove(_COMPLIANCE)
        values, covariance, residual = _fit(data, start, free, per_square)
        notes += ("the stinger's compliance cannot be identified from these data: taken as rigid; give its stiffness",)
    else:
        damped = _fit(data, values, [*free, _STINGER_TIME], per_square)
        if _is_told(*damped[:2], _STINGER_TIME):
            values, covariance, residual = damped
    if resistance_ohm is None:
        notes += (
            "suspension damping and back-EMF are distinguished by the coil's inductance alone: rely on their sum only",
        )
    _refuse_unphysical(values)
    notes += beside_resonance(values, float(data.frequency_hz[0]), float(data.frequency_hz[-1]))
    spread = np.sqrt(np.diag(covariance))
    for name, value, std in zip(PARAMETERS, values, spread, strict=False):
        if std > _UNSURE * abs(value):
            notes += (f"{name}: {value:.3g} with a standard error of {std:.2g}; a wider band determines it better",)
    if residual > _MISFIT:
        notes += (f"misfit is {residual:.1f} times the noise: amplifier or exciter are not linear, or not in step",)
    return Exciter(
        **dict(zip(PARAMETERS, values.tolist(), strict=False)),
        covariance=covariance[: len(PARAMETERS), : len(PARAMETERS)],
        lowest_hz=float(data.frequency_hz[0]),
        highest_hz=float(data.frequency_hz[-1]),
        fit_residual=residual,
        path=VoltagePath(rate, *_path(values)),
        source=source,
        notes=notes,
        lines=data.kept(values),
    )


def _refuse_unphysical(values: Float) -> None:
    """Raise an error if a mass, a stiffness or the sum of both dampings is not positive; c or b alone may be negative."""
    found = {
        "moving mass (kg)": values[_MASS],
        "suspension stiffness (N/m)": values[_STIFFNESS],
        "damping of suspension and back-EMF (N s/m)": values[_DAMPING] + values[_BACK_EMF],
    }
    for name, value in found.items():
        if value <= 0.0:
            raise IdentificationError(
                f"{value:.3g} fits best",
                field=name,
                allowed="above zero",
                hint="widen the band, from below to above the resonance of the suspension, and check the polarity of "
                "force and drive channel",
            )


def beside_resonance(values: Float, lowest_hz: float, highest_hz: float) -> tuple[str, ...]:
    """Return a note if the band does not enclose the resonance of mass and suspension."""
    resonance_hz = np.sqrt(values[_STIFFNESS] / values[_MASS]) / (2.0 * np.pi)
    if lowest_hz < resonance_hz < highest_hz:
        return ()
    return (
        f"the band does not enclose the resonance of the suspension, {resonance_hz:.3g} Hz: use the model inside the band "
        "alone, its errors do not cover what lies outside",
    )


def _is_told(values: Float, covariance: Float, index: int) -> bool:
    """Return whether a parameter that cannot be negative is at least twice its standard error."""
    return bool(values[index] >= np.sqrt(covariance[index, index]) / _UNSURE)


@dataclass(frozen=True, eq=False)
class _Lines:
    """Force, acceleration and voltage (complex[3, n_realisations, n_lines]), and noise covariance (complex[n_lines, 3, 3])."""

    frequency_hz: Float
    signals: Complex
    noise: Complex
    rate_hz: float

    @cached_property
    def s(self) -> Complex:
        """complex[n_lines]: ``2 pi i f``, rad/s."""
        return np.asarray(2j * np.pi * self.frequency_hz)

    def coefficients(self, p: Float) -> Complex:
        """complex[3, n_lines]: coefficients of force, acceleration and voltage in ``e``."""
        g, tau, m, c, k, b, compliance, time = p[: len(PARAMETERS)]
        s, path = self.s, VoltagePath(self.rate_hz, *_path(p))
        stiffness = (1.0 + s * tau) * ((s * m + c) * s + k) + s * b
        of_force = 1.0 + s * tau + stiffness * compliance / (1.0 + s * time)
        return np.array([of_force, stiffness / s**2, -g * path.factor(self.frequency_hz)])

    def residuals(self, p: Float) -> Float:
        """float[2 n_realisations n_lines]: ``e`` over the standard deviation of its real part."""
        x = self.coefficients(p)
        error = np.einsum("ik,irk->rk", x, self.signals)
        variance = np.einsum("ik,kij,jk->k", x, self.noise, np.conj(x)).real
        scaled = error / np.sqrt(0.5 * variance)
        return np.concatenate([scaled.real.ravel(), scaled.imag.ravel()])

    def kept(self, p: Float) -> ExciterLines:
        """Return force and acceleration per volt, means over realisations, and the noise of the force that ``p`` leaves."""
        x = self.coefficients(p)
        force, acceleration, voltage = self.signals
        power = np.sum(np.abs(voltage) ** 2, axis=0)
        variance = np.einsum("ik,kij,jk->k", x, self.noise, np.conj(x)).real
        return ExciterLines(
            frequency_hz=self.frequency_hz,
            force_per_volt=np.sum(force * np.conj(voltage), axis=0) / power,
            acceleration_per_volt=np.sum(acceleration * np.conj(voltage), axis=0) / power,
            noise=np.sqrt(variance / power) / np.abs(x[0]),
        )


def _path(p: Float) -> list[float]:
    return [float(value) for value in p[len(PARAMETERS) :]]


def _lines(
    spectra: PeriodicSpectra, voltage: str, rate_hz: float, lowest: float | None, highest: float | None
) -> _Lines:
    """Return the excited lines of the band, with the motion as acceleration."""
    low, high = 0.0 if lowest is None else lowest, np.inf if highest is None else highest
    used = spectra.excited & (spectra.frequency_hz >= low) & (spectra.frequency_hz <= high) & (spectra.frequency_hz > 0)
    if np.count_nonzero(used) < _FEWEST_LINES:
        raise IdentificationError(
            f"{np.count_nonzero(used)} excited lines in {low:g} to {high:g} Hz",
            field="lowest_hz, highest_hz",
            allowed=f"at least {_FEWEST_LINES}",
        )
    periods = spectra.spectra.shape[1]
    IdentificationError.raise_if(periods < 2, "has 1 period", field="spectra", allowed="at least 2 to tell the noise")
    drive = find_role(spectra.channels, "drive")
    rows = [find_role(spectra.channels, "force"), drive, spectra.index(voltage)]
    frequency = spectra.frequency_hz[used]
    signals = spectra.spectra[:, :, rows][..., used]
    signals[:, :, 1] *= (2j * np.pi * frequency) ** (2 - MOTION_ORDER[spectra.channels[drive].motion])
    mean = signals.mean(axis=1)
    if np.any(mean[:, 2] == 0.0):
        raise IdentificationError("is zero at an excited line", field=voltage, hint="is it the output that was played?")
    scatter = signals - mean[:, None]
    noise = np.einsum("rpik,rpjk->kij", scatter, np.conj(scatter)) / ((periods - 1) * signals.shape[0] * periods)
    return _Lines(frequency, np.moveaxis(mean, 1, 0), _pooled(noise, mean[:, 0]), rate_hz)


def _pooled(noise: Complex, force: Complex) -> Complex:
    """Mean noise covariance over neighbouring lines, with a small part of the force's power added in case there is no noise."""
    window = min(_POOLED_LINES, noise.shape[0])
    kernel = np.full(window, 1.0)
    counts = np.convolve(np.ones(noise.shape[0]), kernel, mode="same")
    flat = noise.reshape(noise.shape[0], -1)
    pooled = np.array([np.convolve(column, kernel, mode="same") / counts for column in flat.T]).T.reshape(noise.shape)
    pooled[:, 0, 0] += (1e-9**2) * np.mean(np.abs(force) ** 2)
    return np.asarray(pooled)


def _regression(data: _Lines) -> Float:
    """Return the start of the fit by linear least squares, which noise biases."""
    delay = 0.5 / data.rate_hz
    f, a, v = data.signals
    s, v = data.s, v * VoltagePath(data.rate_hz, delay).factor(data.frequency_hz)
    columns = np.array([v, -s * f, -s * a, -a, -a / s, -a / s**2]).reshape(6, -1).T
    scale = np.linalg.norm(columns, axis=0)
    stacked = np.concatenate([columns.real, columns.imag]) / scale
    g, tau, _, mass, damping, stiffness = (
        np.linalg.lstsq(stacked, np.concatenate([f.real.ravel(), f.imag.ravel()]), rcond=None)[0] / scale
    )
    shortest = 1e-3 / (2.0 * np.pi * data.frequency_hz[-1])
    return np.array([g, max(tau, shortest), mass, 0.5 * damping, stiffness, 0.5 * damping, 0.0, 0.0, delay, 0.0, 0.0])


def _fit(data: _Lines, start: Float, free: list[int], back_emf_per_square: float | None) -> tuple[Float, Float, float]:
    """Return maximum-likelihood values, their covariance (zero if not free), and the RMS of the weighted residual.

    ``back_emf_per_square`` is ``R / gain^2``, from which b follows as ``g^2 R / gain^2``; None if b is free.
    """
    from scipy.optimize import least_squares

    scale = np.abs(start)
    top = 2.0 * np.pi * data.frequency_hz[-1]
    # Each scale has an effect of 1 %: of the mass's inertia, or of a radian, at the highest line, or of the lowest frequency.
    scale[_COMPLIANCE:] = 0.01 / (scale[2] * top**2), 0.01 / top, 0.01 / top, 0.01 / top**3, 0.01 * data.frequency_hz[0]
    scale = np.maximum(scale, 1e-300)

    def full(free_values: Float) -> Float:
        p = start.copy()
        p[free] = free_values * scale[free]
        if back_emf_per_square is not None:
            p[_BACK_EMF] = back_emf_per_square * p[0] ** 2
        return p

    def residuals(free_values: Float) -> Float:
        return data.residuals(full(free_values))

    begin = start[free] / scale[free]
    result: Any = least_squares(residuals, begin, method="lm", x_scale="jac", xtol=1e-12, ftol=1e-12)
    values = full(result.x)
    freedom = max(result.fun.size - len(free), 1)
    mean_square = float(np.sum(result.fun**2)) / freedom
    column = np.zeros((start.size, len(free)))
    column[free, range(len(free))] = scale[free]
    if back_emf_per_square is not None:
        column[_BACK_EMF] = 2.0 * back_emf_per_square * values[0] * column[0]
    inverse = np.linalg.pinv(result.jac.T @ result.jac, hermitian=True) * max(mean_square, 1.0)
    return values, column @ inverse @ column.T, float(np.sqrt(mean_square))
