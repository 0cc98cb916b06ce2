"""Linear mass-normalised mode shapes from a modal analysis at low level, and the modal amplitudes computed with them."""

from dataclasses import dataclass

import numpy as np

from identification.errors import IdentificationError
from identification.measurements import PeriodicVibration
from identification.validation import finite_array, read_only
from vibrolock.arrays import Complex, Float


@dataclass(frozen=True, eq=False)
class ModeShapes:
    """Mass-normalised deflection shapes at the channels of a measurement.

    Parameters
    ----------
    channels
        Names of the drive and response channels, one per row of ``shapes``.
    shapes
        float[n_channels, n_modes], kg^-1/2; no more modes than channels, linearly independent.
    mode
        Column of the tested mode in ``shapes``.
    shapes_std
        Standard errors of ``shapes``, kg^-1/2, NaN where unknown; None if none is known.
    covariance
        float[n_channels n_modes, n_channels n_modes], covariance of ``shapes`` row by row, used instead of ``shapes_std``;
        None if only ``shapes_std`` is known. A modal analysis scales all channels of a mode by the residue at the drive
        point, so that their errors are correlated.
    """

    channels: tuple[str, ...]
    shapes: Float
    mode: int = 0
    shapes_std: Float | None = None
    covariance: Float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "channels", tuple(self.channels))
        shapes = finite_array("shapes", self.shapes, np.float64, 2)
        object.__setattr__(self, "shapes", shapes)
        if shapes.shape[0] != len(self.channels):
            raise IdentificationError(f"shape {shapes.shape} for {len(self.channels)} channels", field="shapes")
        if self.shapes_std is not None:
            object.__setattr__(self, "shapes_std", read_only(self.shapes_std, np.float64))
            if np.shape(self.shapes_std) != shapes.shape:
                reason = f"shape {np.shape(self.shapes_std)}, shapes have {shapes.shape}"
                raise IdentificationError(reason, field="shapes_std")
        if self.covariance is not None:
            covariance = finite_array("covariance", self.covariance, np.float64, 2)
            object.__setattr__(self, "covariance", covariance)
            if covariance.shape != (shapes.size, shapes.size):
                reason = f"shape {covariance.shape} for {shapes.size} shape values"
                raise IdentificationError(reason, field="covariance")
        if not shapes.shape[1] or np.linalg.matrix_rank(shapes) < shapes.shape[1]:
            reason = f"{shapes.shape[1]} modes cannot be distinguished by {shapes.shape[0]} channels; use fewer modes"
            raise IdentificationError(reason, field="shapes")
        IdentificationError.unless_between("mode", self.mode, 0, shapes.shape[1] - 1)

    @property
    def tested(self) -> Float:
        """float[n_channels]: shape of the tested mode."""
        return np.asarray(self.shapes[:, self.mode])

    def draw(self, draws: int, rng: np.random.Generator) -> Float | None:
        """float[draws, n_channels, n_modes]: random shapes, normal with the known errors; None if no error is known."""
        if self.covariance is not None:
            values, vectors = np.linalg.eigh(self.covariance)
            root = vectors * np.sqrt(np.maximum(values, 0.0))
            errors = rng.standard_normal((draws, values.size)) @ root.T
            return np.asarray(self.shapes + errors.reshape(draws, *self.shapes.shape)) if errors.any() else None
        if self.shapes_std is None or not np.nan_to_num(self.shapes_std).any():
            return None
        return np.asarray(
            self.shapes + np.nan_to_num(self.shapes_std) * rng.standard_normal((draws, *self.shapes.shape))
        )

    def fundamental_m(self, point: PeriodicVibration) -> Complex:
        """complex[n_channels]: fundamental of the displacement at the channels of the shapes, m."""
        return np.array([point.displacement_m(name)[1] for name in self.channels])

    def modal_amplitude(self, point: PeriodicVibration) -> tuple[float, float]:
        """Return the modal amplitude q (kg^1/2 m) and its standard error (NaN if the point has none).

        ``q^2 = psi^H (Phi^T)^+ Phi^+ psi`` with the fundamental psi of the deflection shape (Scheel et al. 2018; the founding
        paper's equation for the modal amplitude).
        """
        inverse = np.linalg.pinv(self.shapes)
        psi = self.fundamental_m(point)
        modal = inverse @ psi
        amplitude = float(np.linalg.norm(modal))
        if point.harmonics_std is None or amplitude == 0.0:
            return amplitude, np.nan
        rows = [point.index(name) for name in self.channels]
        std_m = point.harmonics_std[rows, 1] * np.abs(psi) / np.abs(point.harmonics[rows, 1])
        sensitivity = np.abs(inverse.T @ modal) / amplitude
        return amplitude, float(np.linalg.norm(sensitivity * std_m))


def mac(linear: Float, measured: Complex) -> float:
    """Return the modal assurance criterion ``|a^T b|^2 / ((a^T a) (b^H b))``, in [0, 1].

    Parameters
    ----------
    linear
        Linear shape a, float[n].
    measured
        Measured shape b, complex[n], at the same points.
    """
    product = abs(np.dot(linear, measured)) ** 2
    return float(product / (np.dot(linear, linear) * np.vdot(measured, measured).real))
