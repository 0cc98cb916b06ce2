"""Initial values of a structured model: modes from a modal test, and a linear regression for the nonlinear element."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from identification.channels import MOTION_ORDER, find_name
from identification.errors import IdentificationError
from identification.linear.modes import LinearModes
from identification.pnlss.experiment import Experiment
from identification.structured.elements import NonlinearElement
from identification.structured.model import StructuredModel

__all__ = ["linear_start", "with_element"]

Complex = NDArray[np.complex128]
Float = NDArray[np.float64]

_LOWEST, _HIGHEST = 0.2, 6.0
"""Lines of the regression, relative to the frequency of the mode."""
_POSITIONS = np.linspace(-1.0, 1.0, 21)
"""Mean positions that are tried, relative to the RMS of the motion: sensors of acceleration do not show it."""
_RESIDUAL_DAMPING = 0.02
_SMALLEST_ROOT = 1e-3
"""Least initial damping of the element relative to the mode's, so that its derivative is not zero."""


def linear_start(modes: LinearModes, experiment: Experiment, steps: int) -> StructuredModel:
    """Return the linear model with the channels of ``experiment``.

    The residual of the modes above the band becomes one more mode, at the frequency that `LinearModes` gives for it.
    Raises `IdentificationError` if an output is not among the channels of the modes.
    """
    rows = [find_name(modes.channels, channel.name) for channel in experiment.output_channels]
    drive = modes.drive_row
    shapes, upper = np.real(np.asarray(modes.shapes)), np.real(np.asarray(modes.upper))
    frequency, damping = np.asarray(modes.frequency_hz), np.asarray(modes.damping_ratio)
    inputs, outputs = shapes[drive], shapes[rows]
    if upper[drive] > 0.0:  # receptance upper = b c / w^2
        omega = 2.0 * np.pi * float(modes.upper_hz)
        at_drive = omega * np.sqrt(upper[drive])
        frequency, damping = np.append(frequency, modes.upper_hz), np.append(damping, _RESIDUAL_DAMPING)
        inputs = np.append(inputs, at_drive)
        outputs = np.column_stack([outputs, upper[rows] * omega**2 / at_drive])
    return StructuredModel(
        frequency_hz=frequency,
        damping_ratio=damping,
        input_shapes=inputs[:, None],
        output_shapes=outputs,
        direct=np.zeros((len(rows), 1)),
        elements=(),
        sample_rate_hz=experiment.sample_rate_hz,
        inputs=experiment.input_channels,
        outputs=experiment.output_channels,
        steps=steps,
        specimen=modes.specimen or experiment.specimen,
    )


def with_element(
    linear: StructuredModel,
    experiments: Sequence[Experiment],
    measured_modes: int,
    springs: int,
    dampers: int,
    reach: float,
) -> StructuredModel:
    """Add an element along the mode that moves most: what is left of its equation of motion, by linear least squares.

    The lines of the equation do not determine the mean position: a shift gives other coefficients with the same forces. It is
    the one in static balance. ``measured_modes``: number of modes that are not residuals. Only periodic experiments count.
    """
    periodic = [experiment for experiment in experiments if experiment.period_samples]
    if not periodic:
        raise IdentificationError("experiments: none is periodic, needs one at least for the initial values")
    coordinates = [_modal_spectra(linear, experiment, measured_modes) for experiment in periodic]
    sizes = [np.sqrt(np.mean(np.abs(q) ** 2, axis=1)) for q, _, _ in coordinates]
    mode = int(np.argmax(np.max(sizes, axis=0)))
    shape = float(linear.input_shapes[mode, 0])
    times = [
        np.fft.irfft(q[mode], e.period_samples) * e.period_samples
        for (q, _, _), e in zip(coordinates, periodic, strict=True)
    ]
    scale = float(np.max(np.abs(np.concatenate(times)))) * abs(shape)
    parts = [_Equation(linear, mode, spectra, q, shape / scale) for spectra, q in zip(coordinates, times, strict=True)]
    rms = float(np.sqrt(np.mean(np.concatenate(times) ** 2)))
    omega = linear.omega.copy()

    def unbalanced(position: float) -> float:
        law = _regression(parts, position, springs, dampers)
        return parts[0].mean_force(position, law, springs, omega[mode])

    law = _regression(parts, _root(unbalanced, _POSITIONS * rms), springs, dampers)
    omega[mode] = np.sqrt(max(omega[mode] ** 2 + law[-1], 0.25 * omega[mode] ** 2))
    least = (_SMALLEST_ROOT * 2.0 * linear.damping_ratio[mode] * omega[mode]) / shape**2
    direction = np.zeros(len(omega))
    direction[mode] = shape
    element = NonlinearElement(
        direction=direction,
        scale_m=scale,
        spring_n=law[:springs] / scale,
        damper_n_s_m=np.maximum(law[springs:-1] / scale**2, least),
        reach=reach,
    )
    return replace(linear, frequency_hz=omega / (2.0 * np.pi), elements=(element,))


def _root(function: Callable[[float], float], places: Float) -> float:
    """Return the root nearest to zero between two of the places; without a change of sign the place of the least value."""
    from scipy.optimize import brentq  # only on use: it takes long to load

    values = np.array([function(float(place)) for place in places])
    crossings = np.flatnonzero(np.sign(values[1:]) != np.sign(values[:-1]))
    if not crossings.size:
        return float(places[np.argmin(np.abs(values))])
    middles = 0.5 * (places[crossings] + places[crossings + 1])
    at = crossings[np.argmin(np.abs(middles))]
    return float(brentq(function, places[at], places[at + 1], rtol=1e-6))


def _modal_spectra(linear: StructuredModel, experiment: Experiment, modes: int) -> tuple[Complex, Complex, Float]:
    """Amplitudes (of the FFT over its length) of modal coordinates and input of the mean period, and frequencies in rad/s."""
    n = experiment.period_samples
    inputs, outputs = (
        np.fft.rfft(values.reshape(len(values), -1, n).mean(axis=1), axis=1) / n
        for values in (experiment.counted_inputs, experiment.counted_outputs)
    )
    omega = 2.0 * np.pi * np.fft.rfftfreq(n, 1.0 / experiment.sample_rate_hz)
    moving = np.zeros_like(outputs)
    moving[:, 1:] = [
        row[1:] / (1j * omega[1:]) ** MOTION_ORDER[channel.motion]
        for row, channel in zip(outputs, experiment.output_channels, strict=True)
    ]
    above = slice(modes, None)
    residual = linear.output_shapes[:, above] @ (linear.input_shapes[above] / linear.omega[above, None] ** 2)
    moving = moving - residual @ inputs
    q = np.linalg.pinv(linear.output_shapes[:, :modes]) @ moving
    q[:, omega < _LOWEST * linear.omega[0]] = 0.0
    return q, inputs, np.asarray(omega, dtype=np.float64)


class _Equation:
    """The equation of motion of one mode in one experiment, line by line."""

    def __init__(
        self,
        linear: StructuredModel,
        mode: int,
        spectra: tuple[Complex, Complex, Float],
        q: Float,
        phi: float,
    ) -> None:
        coordinates, inputs, omega = spectra
        own = linear.omega[mode]
        self.lines = (omega > _LOWEST * own) & (omega < _HIGHEST * own)
        dynamic = own**2 - omega**2 + 2j * linear.damping_ratio[mode] * own * omega
        left = linear.input_shapes[mode] @ inputs - dynamic * coordinates[mode]
        self.left, self.phi, self.q = left[self.lines], phi, q
        self.rate = np.fft.irfft(1j * omega * coordinates[mode], q.size) * q.size

    def mean_force(self, position: float, law: Float, springs: int, omega: float) -> float:
        """Return the mean restoring force of mode and element at a mean position; zero is static balance."""
        x = self.phi * (self.q + position)
        element = sum(self.phi * float(np.mean(x ** (k + 2))) * law[k] for k in range(springs))
        return float(element + (omega**2 + law[-1]) * position)

    def columns(self, position: float, springs: int, dampers: int) -> Complex:
        """complex[n_lines, springs + dampers + 1]: forces of the element per coefficient, and of a linear spring."""
        x, rate = self.phi * (self.q + position), self.phi * self.rate
        forces = [self.phi * x ** (k + 2) for k in range(springs)]
        forces += [self.phi * np.abs(x) ** (j + 1) * rate for j in range(dampers)]
        spectra = np.fft.rfft([*forces, self.q], axis=1) / self.q.size
        return np.asarray(spectra[:, self.lines].T)


def _regression(parts: Sequence[_Equation], position: float, springs: int, dampers: int) -> Float:
    """Return coefficients of spring and damper, and the change of the squared frequency."""
    columns = np.concatenate([part.columns(position, springs, dampers) for part in parts])
    left = np.concatenate([part.left for part in parts])
    a, y = np.concatenate([columns.real, columns.imag]), np.concatenate([left.real, left.imag])
    scale = np.linalg.norm(a, axis=0)
    return np.asarray(np.linalg.lstsq(a / scale, y, rcond=1e-10)[0] / scale)
