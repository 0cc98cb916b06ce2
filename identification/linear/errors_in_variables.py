"""Force and motions from a voltage known without noise: what a fit needs where the force is hardly above its own noise.

The quotient of motion and force has no variance where noise of the force is not small against it: near a resonance, where
the structure lets the exciter give little force. Force F and motions Y, each over the voltage, are linear in the measured
noise instead, with a covariance C that is known as well as noise is. The model says ``Y = H F``, so that line by line

    r = Y - H F,    cov r = [-H, 1] C [-H, 1]^H = C_r,

and maximum likelihood, the true force of every line being unknown, is least ``sum_k r^H C_r^-1 r`` (Pintelon and
Schoukens, *System Identification*, 2nd ed., 9.10 and 9.11: errors in variables). Its gradient by the parameters of H is that of
a weighted fit to ``H_0 + r / F_0`` with the covariance ``C_r / |F_0|^2``, both at the present model H_0, where

    F_0 = F + (C_FF H_0^H - C_FY) C_r^-1 r

is the force that the model and the data together make most likely; taking F itself would bias the fit.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from identification.channels import find_role
from identification.linear.accelerance import WeightedResponses, Weighting, known_covariance, motion_factors, pooled
from identification.linear.response_matrix import FrequencyResponseMatrix

__all__ = ["DrivenResponses", "driven_responses", "is_driven", "over_force"]

Complex = NDArray[np.complex128]
Float = NDArray[np.float64]

_LOCAL = 4
"""Lines on either side for the first guess of the responses, of which only weights are made."""
_SMALLEST = 1e-9
"""Force below this part of its root mean square counts as this much: it has no weight either way."""


@dataclass(frozen=True, eq=False)
class DrivenResponses:
    """Force and accelerations over the voltage, with their covariance.

    Parameters
    ----------
    frequency_hz
        float[n_lines].
    value
        complex[n_lines, 1 + n_outputs], force and accelerations over voltage.
    covariance, smooth
        complex[n_lines, 1 + n_outputs, 1 + n_outputs], as estimated at the line, and that of its neighbours.
    kind
        ``total`` or ``noise``.
    """

    frequency_hz: Float
    value: Complex
    covariance: Complex
    smooth: Complex
    kind: str

    @property
    def s(self) -> Complex:
        """complex[n_lines]: ``2 pi i f``, rad/s."""
        return np.asarray(2j * np.pi * self.frequency_hz)

    def first_guess(self) -> WeightedResponses:
        """The quotients, weighted by what a mean of ``Y F* / |F|^2`` over neighbouring lines lets expect."""
        force, motion = self.value[:, :1], self.value[:, 1:]
        window = np.ones(2 * _LOCAL + 1)

        def around(values: Complex) -> Complex:
            return np.array([np.convolve(column, window, mode="same") for column in values.T]).T

        local = around(motion * np.conj(force)) / around(force * np.conj(force))
        return self._weighted(local, motion / self._not_zero(force), force)

    def around(self, model: Complex) -> WeightedResponses:
        """Responses to which a weighted fit returns ``model``, complex[n_lines, n_outputs], where that is most likely."""
        misfit = self.value[:, 1:] - model * self.value[:, :1]
        smooth = self._misfit(model, self.smooth)
        cross = self.smooth[:, 0, :1] * np.conj(model) - self.smooth[:, 0, 1:]
        correction = np.einsum("ko,ko->k", cross, np.linalg.solve(smooth, misfit[:, :, None])[:, :, 0])
        force = self._not_zero(self.value[:, :1] + correction[:, None])
        return self._weighted(model, model + misfit / force, force)

    def _weighted(self, model: Complex, value: Complex, force: Complex) -> WeightedResponses:
        """``value`` with the covariance of the misfit at ``model`` over the square of the force."""
        power = np.abs(self._not_zero(force))[:, :, None] ** 2
        return WeightedResponses(
            self.frequency_hz,
            value[:, :, None],
            self._misfit(model, self.covariance) / power,
            self._misfit(model, self.smooth) / power,
            self.kind,
        )

    def _misfit(self, model: Complex, covariance: Complex) -> Complex:
        """Covariance of ``Y - H F``."""
        outputs = model.shape[1]
        turn = np.concatenate(
            [-model[:, :, None], np.broadcast_to(np.eye(outputs), (model.shape[0], outputs, outputs))], axis=2
        )
        return np.asarray(turn @ covariance @ np.conj(turn.swapaxes(1, 2)))

    def _not_zero(self, force: Complex) -> Complex:
        least = _SMALLEST * np.sqrt(np.mean(np.abs(self.value[:, 0]) ** 2))
        return np.asarray(np.where(np.abs(force) < least, least, force))


def is_driven(responses: FrequencyResponseMatrix) -> bool:
    """Whether the force is among the outputs, over one input that drives it."""
    return len(responses.inputs) == 1 and any(channel.role == "force" for channel in responses.outputs)


def driven_responses(responses: FrequencyResponseMatrix, weighting: Weighting = "auto") -> DrivenResponses | None:
    """Force and motions over a voltage as accelerations; None where no covariance is known.

    Raises `IdentificationError` without a force among the outputs, where the covariance asked for is not known, or at 0 Hz.
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
    """Motions over force from both over a voltage, without covariance; the force's RMS as of a multisine with equal lines.

    Raises `IdentificationError` without a force among the outputs.
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
