"""Standard errors of the plant's mode from the covariance of the measured frequency responses.

To first order the fit's parameters follow the errors e of the responses through the pseudo-inverse of its Jacobian, so that
their covariance is ``J^+ C (J^+)^T`` with C that of the weighted errors. The cost that noise alone leaves is known,
``trace((I - J J^+) C)``. If the fit leaves more, the model misses something, and the covariance is multiplied by the ratio of
the two (R. Pintelon, J. Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., 2012, chapters 9 and 11:
analysis of the cost function, and uncertainty in the presence of model errors). That takes the misfit for random from line to
line; where it varies slowly over the band, the errors are larger. The fits to several bands then show it
(`rig.tuning.plant.plant_of`).
"""

import numpy as np

from vibrolock.arrays import Complex, Float


def parameter_covariance(jacobian: Float, residuals: Float, weights: Float, covariance: Complex | None) -> Float:
    """Return the covariance of the parameters' errors, float[p, p]; infinite if the lines do not determine them.

    ``residuals`` float[4 n + m] are the weighted errors of n lines, real parts of both responses, then imaginary parts, and
    those of m priors, which are no measurement. ``jacobian`` float[4 n + m, p] is their derivative, ``weights`` float[2, n] the
    weights of the lines. ``covariance`` complex[n, 2, 2] is ``E[e e^H]`` of both responses line by line, circular and
    independent between lines. If it is None, the noise is taken from the residuals, equal on all lines of a response.
    """
    lines = weights.shape[1]
    scale = np.linalg.norm(jacobian, axis=0)
    if not np.all(scale > 0.0):  # the fit has left what the lines can tell
        return np.full((jacobian.shape[1],) * 2, np.inf)
    left, size, right = np.linalg.svd(jacobian / scale, full_matrices=False)
    inverse = ((right.T / size) @ left.T / scale[:, None])[:, : 4 * lines]
    left, residuals = left[: 4 * lines], residuals[: 4 * lines]
    if covariance is None:
        parts = residuals.reshape(2, 2, lines)
        share = (4 * lines - size.size) / (4 * lines)  # of the noise that the fit leaves in the residuals
        power = np.mean(parts**2, axis=(0, 2)) / share
        noise = np.zeros((4, 4, lines))
        for row in range(4):
            noise[row, row] = power[row % 2]
    else:
        noise = _real_covariance(np.moveaxis(covariance, 0, -1) * weights[:, None] * weights[None])
    spread = _quadratic(inverse.reshape(-1, 4, lines), noise)
    expected = np.einsum("iin->", noise) - np.trace(_quadratic(left.T.reshape(-1, 4, lines), noise))
    misfit = float(residuals @ residuals) / expected if expected > 0.0 else 1.0
    return np.asarray(spread * max(1.0, misfit))


def _real_covariance(covariance: Complex) -> Float:
    """float[4, 4, n]: covariance of real and imaginary parts of circular errors with complex covariance [2, 2, n]."""
    real, imaginary = 0.5 * covariance.real, 0.5 * covariance.imag
    above = [np.concatenate([real[row], -imaginary[row]]) for row in range(2)]
    below = [np.concatenate([imaginary[row], real[row]]) for row in range(2)]
    return np.stack([*above, *below])


def _quadratic(rows: Float, noise: Float) -> Float:
    """float[p, p]: covariance of linear combinations ``rows`` float[p, 4, n] of errors with ``noise`` float[4, 4, n]."""
    return np.asarray(np.einsum("pin,ijn,qjn->pq", rows, noise, rows, optimize=True))
