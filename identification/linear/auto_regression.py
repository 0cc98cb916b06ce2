"""Frequency responses from records that are not periodic, by a regression on past outputs and inputs (ARX model).

    y(k) = - sum_l A_l y(k-l) + sum_l B_l u(k-l) + e(k),   H(z) = A(z)^-1 B(z)

A regression of high order describes any linear system in noise, with whatever transients the records begin, and has no leakage
(Ljung, *System Identification*, 2nd ed., sections 4.2 and 10.1). All orders come from one triangular factor, and the order is
the one with the least Bayesian information criterion. From the covariance of the coefficients follows that of the responses:
``dH = A(z)^-1 (dB - dA H)``. Nonlinear distortion counts in it as noise.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from identification.channels import Channel
from identification.errors import IdentificationError
from identification.linear.response_matrix import FrequencyResponseMatrix
from vibrolock.arrays import Complex, Float

_LARGEST_ORDER = 80
"""Highest order of the model. Chosen."""
_COLUMNS = 160
"""Most coefficients of one output: the time of the factorisation grows with their square."""
_ROWS_PER_COLUMN = 4
"""Fewest rows of the regression for each of its columns. Chosen."""
_BLOCK = 8192
"""Rows that are decomposed at once. Chosen."""
_EXCITED = 0.1
"""A frequency counts as excited above this share of the strongest amplitude of the same input: 20 dB below it. Further down the
flank of a filter, noise of the outputs is as large as the response, and biases a regression beyond its standard errors."""
_SEGMENTS = 8
"""Fewest segments over which spectra of inputs are averaged: those of a single one scatter by their own size."""
_SMOOTHED = 5
"""Lines over which they are averaged as well."""
_LINES = 800
"""Lines of the responses that are computed from the model. Chosen."""


@dataclass(frozen=True, eq=False)
class Regression:
    """Coefficients of a regression."""

    past: Float
    """float[order + 1, n_outputs, n_outputs], matrices A_l, A_0 = 1."""
    forced: Float
    """float[order + 1, n_outputs, n_inputs], matrices B_l."""
    inverse_root: Float
    """float[n, n], R^-1 of the triangular factor of all regressors."""
    innovation: Float
    """float[n_outputs, n_outputs], covariance of e."""

    @property
    def order(self) -> int:
        """Number of past samples."""
        return len(self.past) - 1

    def responses(self, z: Complex) -> tuple[Complex, Complex]:
        """Return the responses complex[n, n_outputs, n_inputs] at points z of the unit circle, and their covariance."""
        back = z[:, None] ** -np.arange(self.order + 1)
        a = np.einsum("kl,loi->koi", back, self.past)
        value = np.linalg.solve(a, np.einsum("kl,loi->koi", back, self.forced))
        inputs, outputs = value.shape[2], value.shape[1]
        rows: list[Complex] = [np.broadcast_to(np.eye(inputs, dtype=np.complex128), (z.size, inputs, inputs))]
        for lag in range(1, self.order + 1):
            rows.append(back[:, lag, None, None] * value)
            rows.append(back[:, lag, None, None] * np.eye(inputs))
        told = np.einsum("nm,kni->kmi", self.inverse_root, np.concatenate(rows, axis=1))  # R^-T times the regressors
        of_inputs = np.einsum("kmi,kmj->kij", told, np.conj(told))
        left = np.linalg.inv(a)
        of_outputs = left @ self.innovation @ np.conj(np.swapaxes(left, 1, 2))
        both = np.einsum("kop,kij->koipj", of_outputs, of_inputs)
        return np.asarray(value), np.asarray(both.reshape(z.size, outputs * inputs, outputs * inputs))


def auto_regression(records: Sequence[tuple[Float, Float]], weights: Sequence[float] = ()) -> Regression:
    """Fit a regression to records, pairs of float[n_inputs, n] and float[n_outputs, n].

    ``weights``: weight of the squared errors of each record; 1 if empty. Raises `IdentificationError` if the records are too
    short or the inputs do not move.
    """
    inputs, outputs = records[0][0].shape[0], records[0][1].shape[0]
    scale_u, scale_y = (np.sqrt(np.mean(np.hstack([pair[part] for pair in records]) ** 2, axis=1)) for part in (0, 1))
    if not (np.all(scale_u > 0.0) and np.all(scale_y > 0.0)):
        what, scale = ("inputs", scale_u) if np.any(scale_u == 0.0) else ("outputs", scale_y)
        raise IdentificationError(f"channel {int(np.argmin(scale)) + 1} is zero throughout (dead channel)", field=what)
    samples = sum(u.shape[1] for u, _ in records)
    step = inputs + outputs
    most = min(_LARGEST_ORDER, (_COLUMNS - inputs) // step, (samples // _ROWS_PER_COLUMN - inputs) // step)
    most = min(most, min(u.shape[1] for u, _ in records) // 4)
    IdentificationError.raise_if(
        most < 1, f"have {samples} samples, too few for a linear model to begin with", field="experiments"
    )
    factor, rows = np.zeros((0, inputs + most * step + outputs)), 0
    for number, (u, y) in enumerate(records):
        root = np.sqrt(weights[number]) if weights else 1.0
        for block in _regressors(u / scale_u[:, None], y / scale_y[:, None], most):
            factor = np.asarray(np.linalg.qr(np.vstack([factor, root * block]), mode="r"))
            rows += len(block)
    order = _best_order(factor, rows, most, inputs, outputs)
    columns = inputs + order * step
    root = factor[:columns, :columns]
    small = 1e-11 * np.abs(np.diag(root)).max()
    root = np.vstack(
        [root, small * np.eye(columns)]
    )  # regressors of a noise-free system of lower order depend on each other
    target = np.vstack([factor[:columns, -outputs:], np.zeros((columns, outputs))])
    q, root = np.linalg.qr(root)
    inverse = np.asarray(scipy.linalg.solve_triangular(root, np.eye(columns)))
    found = inverse @ (q.T @ target)
    rest = factor[columns:, -outputs:]
    innovation = rest.T @ rest / max(rows - columns, 1)
    past, forced = [np.eye(outputs)], [found[:inputs].T]
    for lag in range(order):
        at = inputs + lag * step
        past.append(-found[at : at + outputs].T)
        forced.append(found[at + outputs : at + step].T)
    to_si_y, from_si_u = scale_y[:, None], 1.0 / scale_u
    scaled_columns = np.concatenate([1.0 / scale_u, *[np.concatenate([1.0 / scale_y, 1.0 / scale_u])] * order])
    return Regression(
        np.array(past) * to_si_y / scale_y,
        np.array(forced) * to_si_y * from_si_u,
        inverse * scaled_columns[:, None],
        innovation * to_si_y * scale_y,
    )


def _regressors(u: Float, y: Float, order: int) -> "Sequence[Float]":
    """Return blocks of rows: inputs now, then outputs and inputs of each past sample, then outputs now."""
    n = u.shape[1]
    found = []
    for begin in range(order, n, _BLOCK):
        end = min(begin + _BLOCK, n)
        parts = [u[:, begin:end]]
        for lag in range(1, order + 1):
            parts += [y[:, begin - lag : end - lag], u[:, begin - lag : end - lag]]
        found.append(np.vstack([*parts, y[:, begin:end]]).T)
    return found


def _best_order(factor: Float, rows: int, most: int, inputs: int, outputs: int) -> int:
    step = inputs + outputs
    size = np.linalg.norm(factor[:, -outputs:]) ** 2 / rows
    score = []
    for order in range(1, most + 1):
        columns = inputs + order * step
        rest = factor[columns:, -outputs:]
        covariance = rest.T @ rest / rows + 1e-20 * size * np.eye(outputs)
        score.append(rows * np.linalg.slogdet(covariance)[1] + np.log(rows) * columns * outputs)
    return 1 + int(np.argmin(score))


def regressed_responses(
    records: Sequence[tuple[Float, Float]],
    *,
    sample_rate_hz: float,
    inputs: Sequence[Channel],
    outputs: Sequence[Channel],
    band_hz: tuple[float, float] | None = None,
    weights: Sequence[float] = (),
    specimen: str = "",
) -> FrequencyResponseMatrix:
    """Return the frequency responses of records that need not be periodic, with their covariance.

    Raises `IdentificationError` if the records are too short, a channel is dead, or the band has no width.

    Parameters
    ----------
    records
        Pairs of inputs float[n_inputs, n] and outputs float[n_outputs, n], in the units of the channels.
    sample_rate_hz
        Samples per second.
    inputs, outputs
        Channels of the rows.
    band_hz
        Band of the 800 lines; None for the band in which every input has a tenth of its largest amplitude.
    weights
        Weight of each record; 1 if empty.
    specimen
        Name of what was tested.
    """
    found = auto_regression(records, weights)
    low, high = _excited_band(records, sample_rate_hz) if band_hz is None else band_hz
    high = min(high, 0.499 * sample_rate_hz)
    low = max(low, (high - low) / _LINES)
    if not low < high:
        reason = f"is {low:g} to {high:g} Hz"
        raise IdentificationError(reason, field="band_hz", allowed="two rising values below half the sample rate")
    frequency = np.linspace(low, high, _LINES)
    value, covariance = found.responses(np.exp(2j * np.pi * frequency / sample_rate_hz))
    rms = np.sqrt(np.mean(np.hstack([u for u, _ in records]) ** 2, axis=1))
    return FrequencyResponseMatrix(
        outputs=tuple(outputs),
        inputs=tuple(inputs),
        frequency_hz=frequency,
        value=value,
        noise_covariance=covariance,
        total_covariance=covariance,
        estimator="ARX",
        input_rms=tuple(float(one) for one in rms),
        specimen=specimen,
        notes=(f"no periods: responses of a regression of order {found.order} (ARX) over {len(records)} records",),
    )


def _excited_band(records: Sequence[tuple[Float, Float]], sample_rate_hz: float) -> tuple[float, float]:
    """Return the lowest and highest frequency that every input excites, from spectra averaged over segments of all records."""
    longest = max(u.shape[1] for u, _ in records)
    segment = max(min(2048, longest // _SEGMENTS), min(longest, 64))
    signal: Any = scipy.signal
    found = [
        (u.shape[1], signal.welch(u, sample_rate_hz, nperseg=segment, detrend="constant"))
        for u, _ in records
        if u.shape[1] >= segment
    ]
    frequency = found[0][1][0]
    power = np.average([one[1] for _, one in found], axis=0, weights=[size for size, _ in found])
    power = scipy.ndimage.uniform_filter1d(power, _SMOOTHED, axis=1, mode="nearest")
    inside = np.all(power >= _EXCITED**2 * power.max(axis=1, keepdims=True), axis=0) & (frequency > 0.0)
    if np.count_nonzero(inside) < 2:
        reason = "no band is excited at all of them"
        raise IdentificationError(reason, field="inputs", hint="excite them at the same frequencies")
    return float(frequency[inside][0]), float(frequency[inside][-1])
