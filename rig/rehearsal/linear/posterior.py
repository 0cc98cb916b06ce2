"""Posterior of the linear rig: most likely parameters, their covariance, and samples from it.

With the Jacobian J of the residuals over their standard deviations, prior included, the covariance is ``s^2 (J^T J)^-1``
(Tarantola, Inverse Problem Theory, SIAM 2005, section 3.2), where s^2 is the misfit over its expectation if that is above 1.
"""

from dataclasses import dataclass

import numpy as np
import scipy

from rig.errors import ConfigurationError
from rig.rehearsal.linear.model import LinearRig, Responses
from rig.rehearsal.linear.slopes import weighted_slopes
from vibrolock.arrays import Bool, Float
from vibrolock.one_thread import one_thread

_MAX_CORRECTIONS = 20
"""Evaluations in which a sample must reach its responses; chosen: more are needed only by samples that belong to no rig."""


@dataclass(frozen=True, eq=False)
class Linearisation:
    """Linearised residuals of the responses near the most likely rig."""

    responses: Responses
    weight: Float
    """Standard deviations of the residuals, misfit included [n, outputs]."""
    jacobian: Float
    """Slope of the weighted residuals, real parts above imaginary ones [2 n outputs, p]."""
    prior_std: Float
    """Standard deviations of the priors [p]."""
    bounds: tuple[Float, Float]
    """Least and largest possible values of the parameters [p]."""

    def weighted(self, rig: LinearRig) -> Float:
        """Weighted model of a rig [2 n outputs]."""
        model = rig.responses(self.responses.frequency_hz, self.responses.sample_rate_hz) / self.weight
        return np.concatenate([model.ravel().real, model.ravel().imag])


@dataclass(frozen=True, eq=False)
class Posterior:
    """Posterior of the linear rig: the most likely parameters and their covariance."""

    names: tuple[str, ...]
    """Names of the parameters, in the order of ``mean``."""
    positive: Bool
    """Which of them are logarithms [p]."""
    mean: Float
    """Most likely values [p]."""
    covariance: Float
    """Covariance [p, p]."""
    channels: tuple[str, ...]
    """Response channels."""
    misfit: float = float("nan")
    """Relative misfit of the responses, root mean square; NaN without responses."""
    inflation: float = 1.0
    """Squared misfit over its expectation, by which the data's covariance is multiplied where it is above 1."""
    determined: float = 0.0
    """Share of the parameters' directions whose standard deviation the data have at least halved."""
    linearisation: Linearisation | None = None
    """Residuals near the most likely rig; None without responses."""

    def rig(self, x: Float | None = None) -> LinearRig:
        """Return the rig of a parameter vector [p]; by default the most likely one."""
        vector = self.mean if x is None else x
        values = np.where(self.positive, np.exp(np.where(self.positive, vector, 0.0)), vector)
        return LinearRig(dict(zip(self.names, values.tolist(), strict=True)), self.channels)

    def std(self, name: str) -> float:
        """Standard deviation of a parameter, relative where it is positive."""
        index = self.names.index(name)
        return float(np.sqrt(self.covariance[index, index]))

    def draw(self, generator: np.random.Generator) -> LinearRig:
        """Draw a rig from the joint distribution.

        Along directions that the data leave wide the responses are no longer linear in the parameters. So each sample is
        moved, as little as its prior allows, until its responses are those that the linearisation gives it: randomised maximum
        likelihood (Oliver, Reynolds and Liu, Inverse Theory for Petroleum Reservoir Characterization, 2008, section 10.7).

        Raises `ConfigurationError` for a sample that cannot be moved there: it belongs to no rig, and another must be drawn.
        """
        values, vectors = np.linalg.eigh(self.covariance)
        spread = vectors * np.sqrt(np.maximum(values, 0.0))
        drawn = self.mean + spread @ generator.standard_normal(self.mean.size)
        return self.rig(drawn if self.linearisation is None else self._corrected(drawn, self.linearisation))

    def _corrected(self, drawn: Float, near: Linearisation) -> Float:
        wanted = near.weighted(self.rig()) + near.jacobian @ (drawn - self.mean)

        def misses(x: Float) -> Float:
            return np.concatenate([near.weighted(self.rig(x)) - wanted, (x - drawn) / near.prior_std])

        def derivatives(x: Float) -> Float:
            of_responses = weighted_slopes(self.rig(x), self.names, near.responses, near.weight)
            return np.concatenate([of_responses, np.diag(1.0 / near.prior_std)])

        noise = float(self.mean.size)  # expected sum of squares by noise alone
        drawn = np.clip(drawn, *near.bounds)
        if float(np.sum(misses(drawn) ** 2)) < noise:
            return drawn
        least_squares = scipy.optimize.least_squares  # loads the libraries whose threads are limited
        with one_thread(), np.errstate(over="ignore", invalid="ignore"):
            found = least_squares(
                misses, drawn, derivatives, bounds=near.bounds, x_scale=near.prior_std, max_nfev=_MAX_CORRECTIONS
            )
        if not 2.0 * float(found.cost) < noise:
            raise ConfigurationError("no rig has the responses that were drawn")
        return np.asarray(found.x)
