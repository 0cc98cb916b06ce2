"""The paths from an output through cables to inputs: what their responses say of gain, delay and high-pass of each.

The response of input i to the output is modelled as

    H_i(f) = g_i exp(-2 pi j f d_i / f_s) P(f, f_o) P(f, f_i),    P(f, f_c) = j f / (f_c + j f),

with a gain g_i, a delay d_i of samples beyond the latency, the corner f_o of the output's high-pass and f_i of the input's. The
gains follow linearly from the rest (variable projection; Golub and Pereyra, 1973), which `scipy.optimize.least_squares` fits.
Where all inputs are alike, their corner and the output's may change places: no cable tells which is whose (`Paths.exchanged`).
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy

from vibrolock.arrays import Complex, Float

CONNECTED = 0.1
"""Gain, over the largest one, from which on an input counts as connected; chosen: crosstalk of audio devices is below 0.003."""
ALIKE = 0.02
"""Relative difference of corners up to which inputs are alike; chosen: what noise leaves uncertain."""
LARGEST_CORNER_HZ = 100.0
"""Largest corner, Hz, as of a channel of a bench."""
LARGEST_DELAY = 100.0
"""Largest delay beyond the latency, samples, as of a channel of a bench."""


@dataclass(frozen=True)
class InputPath:
    """What was found of an input."""

    name: str
    connected: bool
    """Whether the output reaches it by cable."""
    gain: float
    """Reading over output, V/V; negative where the polarity is reversed. Of an input without cable: its crosstalk."""
    delay_samples: float
    """Delay beyond the latency, samples; 0 of an input without cable."""
    high_pass_hz: float
    """Corner of its high-pass, Hz; 0 of an input without cable."""
    misfit_deg: float
    """Largest difference of the phase from the model's, degrees; 0 of an input without cable."""


@dataclass(frozen=True)
class Paths:
    """What was found of output and inputs."""

    output_high_pass_hz: float
    """Corner of the output's high-pass, Hz."""
    inputs: tuple[InputPath, ...]

    @property
    def are_alike(self) -> bool:
        """Whether the inputs' corners are one."""
        corners_hz = [one.high_pass_hz for one in self.connected]
        return max(corners_hz) - min(corners_hz) <= ALIKE * max(corners_hz)

    def exchanged(self, output_hz: float) -> "Paths":
        """Return the paths with the corners of output and inputs exchanged, if these are alike and nearer to the output's."""
        if not self.connected or not self.are_alike:
            return self
        of_inputs = sum(one.high_pass_hz for one in self.connected) / len(self.connected)
        if abs(self.output_high_pass_hz - output_hz) <= abs(of_inputs - output_hz):
            return self
        ours = self.output_high_pass_hz
        inputs = [replace(one, high_pass_hz=ours) if one.connected else one for one in self.inputs]
        return Paths(of_inputs, tuple(inputs))

    @property
    def connected(self) -> tuple[InputPath, ...]:
        """The inputs that the output reaches by cable."""
        return tuple(one for one in self.inputs if one.connected)


def high_pass(frequency_hz: Float, corner_hz: float) -> Complex:
    """Return the response [n] of a first-order high-pass at frequencies [n] above 0."""
    return np.asarray(1j * frequency_hz / (corner_hz + 1j * frequency_hz))


def fitted_paths(names: tuple[str, ...], frequency_hz: Float, responses: Complex, sample_rate_hz: float) -> Paths:
    """Fit the paths to measured responses [n_channels, n_lines] of the inputs per volt of output, V/V."""
    sizes = np.sqrt(np.mean(np.abs(responses) ** 2, axis=1))
    connected = np.flatnonzero(sizes >= CONNECTED * sizes.max()) if sizes.max() > 0.0 else np.zeros(0, int)
    n = connected.size

    def model(parameters: Float) -> Complex:
        corner_out, delays, corners = parameters[0], parameters[1 : 1 + n], parameters[1 + n :]
        turned = np.exp(-2j * np.pi * np.outer(delays / sample_rate_hz, frequency_hz))
        passed = np.array([high_pass(frequency_hz, corner) for corner in corners])
        return np.asarray(turned * passed * high_pass(frequency_hz, corner_out))

    def gains(shapes: Complex) -> Float:
        measured = responses[connected]
        return np.asarray(np.sum((measured * shapes.conj()).real, axis=1) / np.sum(np.abs(shapes) ** 2, axis=1))

    def residual(parameters: Float) -> Float:
        shapes = model(parameters)
        left = (responses[connected] - gains(shapes)[:, None] * shapes) / sizes[connected, None]
        return np.concatenate([left.real.ravel(), left.imag.ravel()])

    if n == 0:
        return Paths(0.0, tuple(InputPath(name, False, 0.0, 0.0, 0.0, 0.0) for name in names))
    start = np.concatenate([[1.0], np.zeros(n), np.linspace(0.5, 1.5, n)])
    lowest = np.concatenate([[0.0], np.full(n, -LARGEST_DELAY), np.zeros(n)])
    highest = np.concatenate([[LARGEST_CORNER_HZ], np.full(n, LARGEST_DELAY), np.full(n, LARGEST_CORNER_HZ)])
    found = scipy.optimize.least_squares(
        residual, start, bounds=(lowest, highest), x_scale="jac", ftol=1e-14, xtol=1e-14, gtol=1e-14, max_nfev=2000
    ).x
    shapes = model(found)
    gain = gains(shapes)
    misfit = np.degrees(np.abs(np.angle(responses[connected] / (gain[:, None] * shapes)))).max(axis=1)
    inputs = []
    for index, name in enumerate(names):
        if index not in connected:
            inputs.append(InputPath(name, False, float(sizes[index]), 0.0, 0.0, 0.0))
            continue
        at = int(np.flatnonzero(connected == index)[0])
        inputs.append(
            InputPath(
                name,
                True,
                float(gain[at]),
                float(found[1 + at]),
                float(found[1 + n + at]),
                float(misfit[at]),
            )
        )
    return Paths(float(found[0]), tuple(inputs))
