"""Maximum-likelihood fit to force and motions over a noise-free voltage, where the force is hardly above its own noise.

The quotient of motion and force has no variance where the noise of the force is not small against the force. This happens
near a resonance, where the structure lets the exciter deliver little force. Force F and motions Y, each divided by the
voltage, are instead linear in the measured noise, and their covariance C is known as well as the noise. The model is
``Y = H F``, so that at each line

    r = Y - H F,    cov r = [-H, 1] C [-H, 1]^H = C_r.

With the true force of every line unknown, the maximum-likelihood estimate minimises ``sum_k r^H C_r^-1 r`` (Pintelon and
Schoukens, *System Identification*, 2nd ed., 9.10 and 9.11: errors in variables). The gradient of this sum with respect to the
parameters of H equals that of a weighted fit to ``H_0 + r / F_0`` with the covariance ``C_r / |F_0|^2``, both at the present
model H_0, where

    F_0 = F + (C_FF H_0^H - C_FY) C_r^-1 r

is the most likely force, given the model and the data. Using F instead of F_0 would bias the fit.
"""

from dataclasses import dataclass, replace

import numpy as np

from identification.channels import find_role
from identification.linear.accelerance import WeightedResponses, Weighting, known_covariance, motion_factors, pooled
from identification.linear.response_matrix import FrequencyResponseMatrix
from vibrolock.arrays import Complex, Float

_LOCAL = 4
"""Lines on either side that the first guess of the responses averages; the first guess determines only the weights."""
_SMALLEST = 1e-9
"""A force below this share of its RMS value is replaced by this share; its line has practically no weight in either case."""


@dataclass(frozen=True, eq=False)
class DrivenResponses:
    """Force and accelerations over the voltage, with their covariance."""

    frequency_hz: Float
    """float[n_lines]."""
    value: Complex
    """complex[n_lines, 1 + n_outputs], force and accelerations over voltage."""
    covariance: Complex
    """complex[n_lines, 1 + n_outputs, 1 + n_outputs], covariance as estimated at each line."""
    smooth: Complex
    """Mean covariance of the neighbouring lines, of the same shape."""
    kind: str
    """``total`` or ``noise``."""

    @property
    def s(self) -> Complex:
        """complex[n_lines]: ``2 pi i f``, rad/s."""
        return np.asarray(2j * np.pi * self.frequency_hz)

    def first_guess(self) -> WeightedResponses:
        """Return the quotients of motion and force, weighted by their expected covariance.

        The expected covariance is evaluated at the local estimate ``Y F* / |F|^2``, averaged over neighbouring lines.
        """
        force, motion = self.value[:, :1], self.value[:, 1:]
        window = np.ones(2 * _LOCAL + 1)

        def around(values: Complex) -> Complex:
            return np.array([np.convolve(column, window, mode="same") for column in values.T]).T

        local = around(motion * np.conj(force)) / around(force * np.conj(force))
        return self._weighted(local, motion / self._not_zero(force), force)

    def around(self, model: Complex) -> WeightedResponses:
        """Return responses linearised about ``model``, complex[n_lines, n_outputs].

        A weighted fit to these responses returns ``model`` itself if ``model`` is the most likely one.
        """
        misfit = self.value[:, 1:] - model * self.value[:, :1]
        smooth = self._misfit(model, self.smooth)
        cross = self.smooth[:, 0, :1] * np.conj(model) - self.smooth[:, 0, 1:]
        correction = np.einsum("ko,ko->k", cross, np.linalg.solve(smooth, misfit[:, :, None])[:, :, 0])
        force = self._not_zero(self.value[:, :1] + correction[:, None])
        return self._weighted(model, model + misfit / force, force)

    def _weighted(self, model: Complex, value: Complex, force: Complex) -> WeightedResponses:
        """Return ``value`` with the covariance of the residual at ``model``, divided by the squared force."""
        power = np.abs(self._not_zero(force))[:, :, None] ** 2
        return WeightedResponses(
            self.frequency_hz,
            value[:, :, None],
            self._misfit(model, self.covariance) / power,
            self._misfit(model, self.smooth) / power,
            self.kind,
        )

    def _misfit(self, model: Complex, covariance: Complex) -> Complex:
        """Covariance of the residual ``Y - H F``."""
        outputs = model.shape[1]
        turn = np.concatenate(
            [-model[:, :, None], np.broadcast_to(np.eye(outputs), (model.shape[0], outputs, outputs))], axis=2
        )
        return np.asarray(turn @ covariance @ np.conj(turn.swapaxes(1, 2)))

    def _not_zero(self, force: Complex) -> Complex:
        least = _SMALLEST * np.sqrt(np.mean(np.abs(self.value[:, 0]) ** 2))
        return np.asarray(np.where(np.abs(force) < least, least, force))


def is_driven(responses: FrequencyResponseMatrix) -> bool:
    """Return whether the force is among the outputs and there is a single input that drives it."""
    return len(responses.inputs) == 1 and any(channel.role == "force" for channel in responses.outputs)


def driven_responses(responses: FrequencyResponseMatrix, weighting: Weighting = "auto") -> DrivenResponses | None:
    """Return force and motions over a voltage as accelerations; None if no covariance is known.

    Raises `IdentificationError` without a force among the outputs, if the requested covariance is unknown, or at 0 Hz.
    """
    force = find_role(responses.outputs, "force")
    covariance, kind = known_covariance(responses, weighting)
    factor = motion_factors(responses)
    if covariance is None:
        return None
    order = [force, *(row for row, channel in enumerate(responses.outputs) if channel.role != "force")]
    factor = factor[:, order]
    covariance = factor[:, :, None] * covariance[:, order][:, :, order] * np.conj(factor[:, None, :])
    value = responses.value[:, order, 0] * factor
    return DrivenResponses(responses.frequency_hz, value, covariance, pooled(covariance), kind)


def over_force(responses: FrequencyResponseMatrix) -> FrequencyResponseMatrix:
    """Return motions over force from motions and force over a voltage, without covariance.

    The RMS value of the force is computed for a multisine with lines of equal amplitude. Raises `IdentificationError` without
    a force among the outputs.
    """
    force = find_role(responses.outputs, "force")
    motions = [row for row in range(len(responses.outputs)) if row != force]
    over_voltage = responses.value[:, [force]]
    rms = tuple(level * float(np.sqrt(np.mean(np.abs(over_voltage) ** 2))) for level in responses.input_rms)
    return replace(
        responses,
        outputs=tuple(responses.outputs[row] for row in motions),
        inputs=(responses.outputs[force],),
        value=responses.value[:, motions] / over_voltage,
        noise_covariance=None,
        total_covariance=None,
        input_rms=rms,
    )
