"""Fit a modal model by weighted least squares: common poles by Levenberg-Marquardt, linear terms eliminated.

The accelerance of the channel o is

    H_o = sum_k (a_ok + b_ok s) s^2 / (s^2 + 2 z_k w_k s + w_k^2)
          + L_o + L'_o / s + L''_o / s^2 + U_o s^2 / (1 + c s^2) + U'_o s^3 / (1 + c s^2)^2,

with b = 0 for normal modes. With ``c = 1 / w_u^2`` the contribution of the higher modes grows towards the nearest of them, at
w_u (c = 0: a plain stiffness). L' and U' are the contributions of the damping of lower and higher modes, L'' that of the
stiffness of the lower modes. They are small, but in quadrature, like the damping to be identified: without them damping
ratios were 0.3 % off.

Given the poles and c, all these terms follow by linear least squares. The step of the poles is the Schur complement of the
full Gauss-Newton step (variable projection: Golub and Pereyra, SIAM J. Numer. Anal. 10, 1973; Ruhe and Wedin, SIAM Rev. 22,
1980). With weights P, Jacobian J and ``M = Re sum J^H P J`` the covariance of the parameters is
``M^-1 (1/2 Re sum J^H P C P J) M^-1``. This is correct for line errors with covariance C, whatever the weights are. If the
responses are a mean over records with known deviations e_r, the middle is ``n / (n - 1) sum_r g_r g_r^T`` with
``g_r = Re sum J^H P e_r`` instead, which also holds for errors that lines have in common.
"""

from dataclasses import dataclass

import numpy as np

from identification.linear.accelerance import WeightedResponses
from vibrolock.arrays import Complex, Float

RESIDUAL_TERMS = 5
"""Number of residual terms per channel, from modes outside the band."""
_ITERATIONS = 60
"""Iterations of a fit, at most. Chosen."""
_STEP_STD = 1e-4
"""The fit has converged if a step moves no parameter by more than this share of its standard error."""
_NEAREST = 0.9
"""Largest c, relative to the c of a mode at the highest line."""
_PRIOR = 0.25
"""Prior value of c, relative to the c of a mode at the highest line; c stays near it if the responses do not determine c."""
_PRIOR_STD = 5.0
"""Standard deviation of the prior on c, relative to its value, in units of the error of the responses; a weak prior."""
_AT_ONCE = 1024
"""Lines that are summed at once: what is computed of them stays in the cache of a processor. Chosen."""


@dataclass(frozen=True, eq=False)
class ModalFit:
    """Parameters of a modal model and their errors."""

    poles: Float
    """float[2 n_modes + 1], natural angular frequencies (rad/s), damping ratios, c (s^2)."""
    terms: Float
    """float[n_outputs, n_terms], a (1/kg) of every mode, then b (s/kg) of every mode if the fit has them, then the
    `RESIDUAL_TERMS`: L (1/kg), L' (1/(kg s)), L'' (1/(kg s^2)), U (s^2/kg), U' (s^3/kg)."""
    covariance: Float
    """float[m, m], covariance of ``(poles, terms row by row)``."""
    residual: float
    """RMS of the residual over its expected value from the covariance; NaN if no covariance is known."""
    converged: bool
    """Whether the iteration converged."""
    systematic: Float | None = None
    """float[m], variance of the same parameters that is due to an error of the model; None for none."""

    @property
    def omega(self) -> Float:
        """float[n_modes]: natural angular frequencies, rad/s."""
        return np.asarray(self.poles[: self.poles.size // 2])

    @property
    def zeta(self) -> Float:
        """float[n_modes]: damping ratios."""
        return np.asarray(self.poles[self.poles.size // 2 : -1])

    @property
    def misfit(self) -> float:
        """``residual`` where it is above 1, else 1: the factor by which errors grow (the Birge ratio)."""
        return max(1.0, self.residual) if np.isfinite(self.residual) else 1.0


def modal_basis(s: Complex, poles: Float, normal: bool) -> Complex:
    """complex[n_lines, n_terms]: basis functions that the terms multiply."""
    (omega, zeta), s = np.split(poles[:-1], 2), s[:, None]
    modal = s**2 / (s**2 + 2.0 * zeta * omega * s + omega**2)
    near = 1.0 + poles[-1] * s**2
    rest = [np.ones_like(s), 1.0 / s, 1.0 / s**2, s**2 / near, s**3 / near**2]
    return np.hstack([modal, *rest] if normal else [modal, modal * s, *rest])


def pole_derivatives(s: Complex, poles: Float, terms: Float, normal: bool) -> Complex:
    """complex[n_lines, n_outputs, 2 n_modes + 1]: derivatives of the accelerance with respect to the poles and c."""
    (omega, zeta), s = np.split(poles[:-1], 2), s[:, None, None]
    count, squared = omega.size, s * s
    numerator = terms[None, :, :count] + (0.0 if normal else terms[None, :, count : 2 * count] * s)
    resonance = 1.0 / (squared + 2.0 * zeta * omega * s + omega**2)
    slope = -numerator * (squared * resonance * resonance)
    near = 1.0 + poles[-1] * squared
    nearest = squared / near
    upper = -(terms[None, :, -2:-1] + 2.0 * terms[None, :, -1:] * (s / near)) * (nearest * nearest)
    return np.concatenate([slope * (2.0 * zeta * s + 2.0 * omega), slope * (2.0 * omega * s), upper], axis=2)


@dataclass(frozen=True, eq=False)
class _State:
    """Normal equations at one set of poles, with the terms that fit best there."""

    terms: Float
    cost: float
    matrix: Float
    gradient: Float  # of half the cost with respect to the poles


class _Problem:
    """The responses with the precision of every line, and the normal equations of the fit."""

    def __init__(self, data: WeightedResponses, normal: bool) -> None:
        self.data, self.normal, self.s = data, normal, data.s
        self.value = data.value[:, :, 0]
        self.precision = np.asarray(np.linalg.inv(data.smooth), dtype=np.complex128)
        self.weighted = (self.precision @ data.value)[:, :, 0]
        self.chunks = [slice(first, first + _AT_ONCE) for first in range(0, data.s.size, _AT_ONCE)]
        self.largest_c = _NEAREST / np.abs(data.s[-1]) ** 2
        self.prior_c = _PRIOR / np.abs(data.s[-1]) ** 2

    def state(self, poles: Float) -> _State:
        basis = modal_basis(self.s, poles, self.normal)
        linear = self._of_terms(basis, self.precision)
        unit = 1.0 / np.sqrt(np.diag(linear))
        known = unit * (self.weighted.T @ np.conj(basis)).real.ravel()
        terms = unit * np.linalg.lstsq(linear * np.outer(unit, unit), known, rcond=1e-15)[0]
        terms = terms.reshape(-1, basis.shape[1])
        matrix, gradient, cost = self._of_all(poles, terms, basis, linear, self.precision)
        width = _PRIOR_STD * self.prior_c
        off = (poles[-1] - self.prior_c) / width
        gradient[-1] += off / width
        matrix[poles.size - 1, poles.size - 1] += 1.0 / width**2
        return _State(terms, cost + off**2, matrix, gradient)

    def _of_terms(self, basis: Complex, weights: Complex) -> Float:
        """float[n, n]: ``Re sum J^H W J`` of the terms row by row, for Hermitian W, complex[n_lines, n_outputs, n_outputs]."""
        outputs, count = weights.shape[1], basis.shape[1]
        one, other = np.triu_indices(count)
        upper = np.zeros((outputs * outputs, one.size))
        for lines in self.chunks:
            part = basis[lines]
            upper += (weights[lines].reshape(len(part), -1).T @ (np.conj(part)[:, one] * part[:, other])).real
        found, upper = np.empty((outputs, outputs, count, count)), upper.reshape(outputs, outputs, -1)
        found[..., one, other], found[..., other, one] = upper, upper.swapaxes(0, 1)
        return found.transpose(0, 2, 1, 3).reshape(outputs * count, -1)

    def _of_all(
        self, poles: Float, terms: Float, basis: Complex, linear: Float, weights: Complex
    ) -> tuple[Float, Float, float]:
        """Return ``Re sum J^H W J`` of poles and terms, the gradient by the poles of half ``Re sum e^H W e``, and that sum.

        ``linear``: `_of_terms`. The misfit e is taken as one more column of the derivatives by the poles.
        """
        outputs, count = weights.shape[1], poles.size + 1
        own, cross = np.zeros((count, count)), np.zeros((basis.shape[1], outputs * count))
        for lines in self.chunks:
            misfit = self.value[lines] - basis[lines] @ terms.T
            columns = np.dstack([pole_derivatives(self.s[lines], poles, terms, self.normal), misfit])
            heavy = weights[lines] @ columns
            own += (np.conj(columns).reshape(-1, count).T @ heavy.reshape(-1, count)).real
            cross += (np.conj(basis[lines]).T @ heavy.reshape(len(heavy), -1)).real
        cross = cross.reshape(-1, outputs, count).transpose(1, 0, 2).reshape(-1, count)[:, :-1]
        return np.block([[own[:-1, :-1], cross.T], [cross, linear]]), -own[:-1, -1], float(own[-1, -1])

    def fitted(self, poles: Float, state: _State, converged: bool) -> ModalFit:
        """Return the fit with the covariance of its parameters."""
        basis = modal_basis(self.s, poles, self.normal)
        unit = 1.0 / np.sqrt(np.diag(state.matrix))
        inverse = np.linalg.pinv(state.matrix * np.outer(unit, unit), rcond=1e-14, hermitian=True)
        misfit = self.value - basis @ state.terms.T
        squares = float(np.sum(np.conj(misfit) * np.einsum("kop,kp->ko", self.precision, misfit)).real)
        freedom = max(1.0 - 0.5 * unit.size / misfit.size, 1e-3)
        if self.data.covariance is None:
            covariance, residual = 0.5 * squares / (misfit.size * freedom) * inverse, np.nan
        else:
            filling = self._filling(poles, state.terms, basis, self.data.covariance) * np.outer(unit, unit)
            covariance = inverse @ filling @ inverse
            expected = np.einsum("kop,kpo->", self.precision, self.data.covariance).real
            residual = float(np.sqrt(squares / (freedom * expected)))
        covariance = covariance * np.outer(unit, unit)
        return ModalFit(poles, state.terms, 0.5 * (covariance + covariance.T), residual, converged)

    def _filling(self, poles: Float, terms: Float, basis: Complex, covariance: Complex) -> Float:
        """float[m, m]: covariance of the gradient of the fit, from that of the lines or the deviations of the records.

        Deviations keep what the errors of lines have in common. Those of n records have n - 1 degrees of freedom, for which the
        standard errors are enlarged so that 1.96 of them hold as much as Student's interval.
        """
        deviations = self.data.deviations
        if deviations is None:
            weights = self.precision @ covariance @ self.precision
            return 0.5 * self._of_all(poles, terms, basis, self._of_terms(basis, weights), weights)[0]
        from scipy.stats import t  # only on use: it takes long to load

        records = deviations.shape[1]
        weighted = deviations @ np.conj(self.precision)
        slopes = pole_derivatives(self.s, poles, terms, self.normal)
        by_poles = np.tensordot(weighted, np.conj(slopes), ((0, 2), (0, 1))).real
        by_terms = np.tensordot(weighted, np.conj(basis), (0, 0)).real.reshape(records, -1)
        single = np.hstack([by_poles, by_terms])
        student = float(t.ppf(0.975, records - 1)) / 1.96
        return np.asarray(single.T @ single * (student**2 * records / (records - 1)))

    def allowed(self, poles: Float) -> Float | None:
        """Return the poles with c clipped to its range; None if a frequency or damping ratio is out of its range."""
        count = poles.size // 2
        if np.any(poles[:count] <= 0.0) or np.any(np.abs(poles[count:-1]) >= 1.0):
            return None
        return np.append(poles[:-1], np.clip(poles[-1], 0.0, self.largest_c))


def fit_modes(data: WeightedResponses, poles: Float, *, normal: bool = True, iterations: int = _ITERATIONS) -> ModalFit:
    """Fit a modal model by weighted least squares from starting ``poles``: rad/s, then damping ratios (then c)."""
    problem, damping = _Problem(data, normal), 1e-3
    poles = np.append(poles, problem.prior_c) if poles.size % 2 == 0 else poles
    state, count = problem.state(poles), poles.size | 1
    for _ in range(iterations):
        unit = 1.0 / np.sqrt(np.diag(state.matrix))
        scaled = state.matrix * np.outer(unit, unit)
        cross = scaled[count:, :count]
        reduced = scaled[:count, :count] - cross.T @ np.linalg.lstsq(scaled[count:, count:], cross, rcond=1e-15)[0]
        stretch = 1.0 / np.sqrt(np.maximum(np.diag(reduced), 1e-14))
        reduced = reduced * np.outer(stretch, stretch)
        unit = unit[:count] * stretch
        for _ in range(10):
            step = -unit * np.linalg.solve(reduced + damping * np.eye(count), unit * state.gradient)
            trial = problem.allowed(poles + step)
            if trial is not None and (new := problem.state(trial)).cost <= state.cost * (1.0 + 1e-10):
                break
            damping = 10.0 * damping + 1e-6
        else:
            return problem.fitted(poles, state, False)
        moved = np.max(np.abs(trial - poles) / unit)
        # Noise leaves a residual of one unit per value; ``unit`` is therefore of the size of the poles' standard errors.
        rest = moved <= _STEP_STD * np.sqrt(new.cost / problem.value.size + 1e-300)
        poles, state, damping = trial, new, 0.1 * damping
        if rest:
            return problem.fitted(poles, state, True)
    return problem.fitted(poles, state, iterations == 0)


def misfit_of(data: WeightedResponses, poles: Float) -> float:
    """Return the weighted sum of squares that is left by ``poles`` (rad/s, then damping ratios) with the best normal modes."""
    problem = _Problem(data, normal=True)
    return problem.state(np.append(poles, problem.prior_c)).cost
