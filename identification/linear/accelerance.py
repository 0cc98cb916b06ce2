"""Convert frequency responses to accelerance and compute the covariance that weights each line.

A sample covariance of few periods or realisations is too scattered to be inverted. The weight of a line is therefore the
inverse of the mean covariance of its neighbours, without the line itself. Weight and error of a line are then independent,
and ``sum_k J_k^H W_k C_k W_k J_k``, with the line's own covariance C_k, is an unbiased estimate of the effect of the errors.
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from identification.channels import MOTION_ORDER
from identification.errors import IdentificationError
from identification.linear.response_matrix import FrequencyResponseMatrix
from vibrolock.arrays import Complex, Float

Weighting = Literal["auto", "total", "noise", "relative"]

_NEIGHBOURS = 4
"""Lines on either side that a weight averages: with five realisations, 32 degrees of freedom and a quarter more scatter."""
_MOST_ALIKE = 50
"""Neighbouring lines whose errors may be alike, at most. Chosen."""
_FLOOR = 1e-9
"""Least eigenvalue of a covariance relative to its largest, so that a nearly exact line cannot outweigh all others."""
_CANCELLED = 1e-13
"""Least variance relative to the largest of the same response: below it, differences of running sums are rounding errors."""
_TIMES_OVER = 4
"""Least number of samples per direction of a covariance that weights need."""
_ROUNDING = 1e-13
"""Standard deviation relative to the response, below which a covariance is only rounding error."""


@dataclass(frozen=True, eq=False)
class WeightedResponses:
    """Frequency responses ready for a fit."""

    frequency_hz: Float
    """float[n_lines]."""
    value: Complex
    """complex[n_lines, n_outputs, n_inputs]."""
    covariance: Complex | None
    """complex[n_lines, m, m], m = n_outputs n_inputs, as estimated at each line; None if unknown."""
    smooth: Complex
    """complex[n_lines, m, m], mean covariance of the neighbouring lines, whose inverse is the weight. If no
    covariance is known: the squared modulus (errors of equal relative size)."""
    kind: str
    """Kind of covariance: ``total``, ``noise``, ``line scatter`` (total, from neighbouring lines) or ``relative``."""
    deviations: Complex | None = None
    """complex[n_lines, n_records, m], contributions of single records to the errors; None if unknown."""
    decay_rate_1_s: float = 0.0
    """Rate of an exponential window."""

    @property
    def s(self) -> Complex:
        """complex[n_lines]: ``2 pi i f``, to the right of the imaginary axis by the rate of an exponential window, rad/s."""
        return np.asarray(self.decay_rate_1_s + 2j * np.pi * self.frequency_hz)

    @property
    def std(self) -> Float:
        """float[n_lines, n_outputs, n_inputs]: square roots of the diagonal of ``smooth``."""
        return np.asarray(np.sqrt(np.einsum("kii->ki", self.smooth).real).reshape(self.value.shape))

    @property
    def whitening(self) -> Complex:
        """complex[n_lines, m, m]: whitening matrix W, where ``W^H W`` is the inverse of ``smooth``."""
        return np.asarray(np.linalg.inv(np.linalg.cholesky(self.smooth)))


def weighted_responses(responses: FrequencyResponseMatrix, weighting: Weighting = "auto") -> WeightedResponses:
    """Return responses with their weights; ``auto`` takes the total covariance if known, else the noise covariance, else none.

    Raises `IdentificationError` if the requested covariance is unknown or a response is zero at all lines.
    """
    if weighting == "relative" and responses.deviations is not None:  # weights apart, the errors are known
        return relative_weights(weighted_responses(responses, "total"))
    covariance, kind = known_covariance(responses, weighting)
    count = responses.value[0].size
    modulus = np.abs(responses.value).reshape(-1, count)
    if not np.all(np.max(modulus, axis=0) > 0.0):
        raise IdentificationError("a response is zero at all lines", field="value")
    deviations = responses.deviations if kind == "total" else None
    smooth = _relative(modulus) if covariance is None else pooled(covariance, _lines_alike(deviations))
    return WeightedResponses(
        responses.frequency_hz, responses.value, covariance, smooth, kind, deviations, responses.decay_rate_1_s
    )


def relative_weights(data: WeightedResponses) -> WeightedResponses:
    """Return the same responses, with the same covariance, weighted as if their errors were of equal relative size."""
    return replace(data, smooth=_relative(np.abs(data.value).reshape(data.frequency_hz.size, -1)))


def _relative(modulus: Float) -> Complex:
    """complex[n_lines, m, m]: diagonal of the squared moduli, none far below the largest of its response."""
    variance = np.maximum(modulus, 1e-3 * np.max(modulus, axis=0)) ** 2
    return np.asarray(variance[:, :, None] * np.eye(modulus.shape[1], dtype=np.complex128))


def known_covariance(responses: FrequencyResponseMatrix, weighting: Weighting) -> tuple[Complex | None, str]:
    """Return the requested covariance and its kind; None and ``relative`` if it is unknown or no more than rounding error.

    Raises `IdentificationError` if the requested covariance is unknown.
    """
    known = {"total": responses.total_covariance, "noise": responses.noise_covariance}
    if weighting not in ("auto", "relative", *known):
        raise IdentificationError(field="weighting", value=weighting, allowed="auto, total, noise, relative")
    if known.get(weighting, 0) is None:
        raise IdentificationError(f"the responses have no {weighting}_covariance", field="weighting", value=weighting)
    size = np.abs(responses.value).reshape(responses.value.shape[0], -1)
    for kind in ("total", "noise") if weighting == "auto" else (weighting,):
        covariance = known.get(kind)
        if covariance is not None:
            deviation = np.sqrt(np.maximum(np.einsum("kii->ki", covariance).real, 0.0))
            if np.all(np.median(deviation, axis=0) > _ROUNDING * np.median(size, axis=0)):
                return covariance, kind
    return None, "relative"


def first_weighting(responses: FrequencyResponseMatrix, weighting: Weighting) -> Weighting:
    """Return the weighting with which a fit begins: ``auto`` in place of a total covariance that only the fit will provide."""
    return "auto" if weighting == "total" and responses.total_covariance is None else weighting


def motion_factors(responses: FrequencyResponseMatrix) -> Complex:
    """complex[n_lines, n_outputs]: factors that convert each motion to an acceleration; 1 for a force.

    Raises `IdentificationError` if the lines begin at 0 Hz.
    """
    if responses.frequency_hz[0] == 0.0:
        reason = "begins at 0 Hz, where no motion is an acceleration"
        raise IdentificationError(reason, field="frequency_hz", hint="leave this line out by `band_hz`")
    order = [0 if channel.role == "force" else 2 - MOTION_ORDER[channel.motion] for channel in responses.outputs]
    return np.asarray(responses.s[:, None] ** np.array(order))


def weighted_accelerance(responses: FrequencyResponseMatrix, weighting: Weighting = "auto") -> WeightedResponses:
    """Return responses with their weights, every output converted to an acceleration (m/s2).

    Raises `IdentificationError` if an output is not a motion, or at 0 Hz.
    """
    plain = weighted_responses(responses, weighting)
    factor = np.repeat(motion_factors(responses), len(responses.inputs), axis=1)

    def scaled(covariance: Complex) -> Complex:
        return np.asarray(factor[:, :, None] * covariance * np.conj(factor[:, None, :]))

    return replace(
        plain,
        value=plain.value * factor.reshape(plain.value.shape),
        covariance=None if plain.covariance is None else scaled(plain.covariance),
        smooth=scaled(plain.smooth),
        deviations=None if plain.deviations is None else plain.deviations * factor[:, None],
    )


def pooled(covariance: Complex, alike: int = 1) -> Complex:
    """Return the mean covariance over the neighbours of each line, without the line itself; floored so that it can be inverted.

    A sample covariance of few realisations has a low rank. The mean therefore takes as many lines as give several samples per
    direction. If ``alike`` neighbouring lines have their errors in common, it takes as many times more.
    """
    lines, count = covariance.shape[:2]
    reach = min(alike * max(_NEIGHBOURS, -(-_TIMES_OVER * count // (2 * _rank(covariance)))), lines - 1)
    number = np.arange(lines)
    first, last = np.maximum(number - reach, 0), np.minimum(number + reach, lines - 1)
    running = np.concatenate([np.zeros((1, count, count)), np.cumsum(covariance, axis=0)])
    total = running[last + 1] - running[first]
    others = np.maximum(last - first, 1)[:, None, None]
    smooth = (total - covariance if lines > 1 else total) / others
    largest = np.einsum("kii->ki", smooth).real
    floor = np.maximum(_FLOOR * largest, _CANCELLED * np.max(largest, axis=0) + 1e-300)
    return np.asarray(0.5 * (smooth + np.conj(np.swapaxes(smooth, 1, 2))) + floor[:, :, None] * np.eye(count))


def _lines_alike(deviations: Complex | None) -> int:
    """Number of neighbouring lines whose errors are nearly the same, from the correlation of the deviations over lines."""
    if deviations is None:
        return 1
    scaled = deviations / np.sqrt(np.maximum(np.mean(np.abs(deviations) ** 2, axis=1, keepdims=True), 1e-300))
    lines = deviations.shape[0]
    total, reached = 1.0, min(_MOST_ALIKE, lines - 1)
    for lag in range(1, reached + 1):
        correlation = np.abs(np.mean(scaled[lag:] * np.conj(scaled[:-lag]))) ** 2
        if correlation < 0.05:
            break
        total += 2.0 * correlation
    return round(total)


def _rank(covariance: Complex) -> int:
    some = covariance[:: max(1, covariance.shape[0] // 16)]
    unit = 1.0 / np.sqrt(np.maximum(np.einsum("kii->ki", some).real, 1e-300))
    values = np.linalg.eigvalsh(some * unit[:, :, None] * unit[:, None, :])
    return max(1, int(np.median(np.count_nonzero(values > 1e-9, axis=1))))
