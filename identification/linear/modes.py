"""Linear modal model from a modal analysis: poles, mass-normalised shapes, residual terms, their errors; MAC of two models.

The accelerance is, with ``s = i W``,

    H_o(s) = sum_k phi_ok phi_dk s^2 / (s^2 + 2 z_k w_k s + w_k^2)
             + L_o + L'_o / s + L''_o / s^2 + U_o s^2 / (1 + s^2 / w_u^2) + U'_o s^3 / (1 + s^2 / w_u^2)^2,

phi are the mass-normalised shapes at the channel o and at the drive point d. L_o is the contribution of lower modes and
rigid-body motion in the band (inertia). U_o is that of higher modes: a stiffness that grows towards the nearest higher mode,
at w_u; a plain stiffness if w_u is infinite. L', L'' and U' are the small contributions of the damping of these modes and of
the stiffness of the lower modes. Complex residues ``rho_ok`` in place of ``phi_ok phi_dk`` turn a term into
``s^2 (a + b s) / (s^2 + 2 z w s + w^2)`` with ``rho = a + b p`` at the pole ``p = -z w + i w sqrt(1 - z^2)``.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from identification.channels import MOTION_ORDER, Channel, find_name, find_role
from identification.errors import IdentificationError
from identification.linear.mode_shapes import ModeShapes
from identification.linear.response_matrix import FrequencyResponseMatrix
from identification.storage import stored
from identification.validation import convert_fields, finite_array, table_rows
from vibrolock.arrays import Complex, Float
from vibrolock.results import Result

_POLES = ("frequency_hz", "frequency_std_hz", "damping_ratio", "damping_ratio_std", "phase_collinearity")
_SHAPES = ("shapes", "shapes_std")
_RESIDUALS = ("lower", "upper")
_OPTIONAL = ("covariance", "residues", "small_terms")


@stored(as_arrays=("lowest_hz", "highest_hz", "upper_hz", "force_rms_n", "fit_residual"))
@dataclass(frozen=True, eq=False, kw_only=True)
class LinearModes(Result):
    """Linear modes of a structure, lowest frequency first.

    Without a drive point the shapes are not mass-normalised: the largest of each mode is 1, and ``residues`` hold the rest.

    Raises `IdentificationError` if array shapes do not agree, there are several drive channels, or none and no residues, or
    frequencies are not positive and rising.

    Parameters
    ----------
    channels
        The motions, one per row of ``shapes``; the one of role ``drive``, if there is one, is where the force acts.
    frequency_hz, frequency_std_hz
        float[n_modes], undamped natural frequencies ``w / 2 pi`` and their standard errors (NaN if unknown).
    damping_ratio, damping_ratio_std
        float[n_modes].
    shapes, shapes_std
        float[n_channels, n_modes], mass-normalised deflection, kg^-1/2, positive at the drive point; without one, the
        deflection over the largest of its mode.
    phase_collinearity
        float[n_modes], modal phase collinearity in [0, 1]: 1 if the complex residues of a mode lie on one line; NaN if
        unknown.
    lower, upper
        complex[n_channels], residual terms L (1/kg) and U (s^2/kg) of the accelerance.
    small_terms
        float[n_channels, 3], L' (1/(kg s)), L'' (1/(kg s^2)) and U' (s^3/kg); None for none.
    lowest_hz, highest_hz
        Frequency band of the fit.
    upper_hz
        ``w_u / 2 pi``, the frequency of the residual higher mode, above the band.
    force_rms_n
        RMS of the force in the band, the level of the test; 0 if the modes were extrapolated to zero, NaN if unknown.
    covariance
        float[m, m], covariance of ``(frequency_hz, damping_ratio, shapes row by row)``; None if unknown.
    residues
        complex[n_channels, n_modes], residues rho (1/kg) if they were fitted as complex or there is no drive point; None for
        normal modes, whose residues are ``phi_o phi_d``.
    fit_residual
        RMS of residual over expected error; 1 if only noise is left; NaN if unknown.
    specimen
        Name of what was tested.
    notes
        Remarks on the quality of the result, one line each.
    force_unit
        Unit of the force: N, or V or 1 where there is no better one. ``force_rms_n``, shapes and residual terms are then in
        units with it in place of N.
    """

    channels: tuple[Channel, ...]
    frequency_hz: Float
    frequency_std_hz: Float
    damping_ratio: Float
    damping_ratio_std: Float
    shapes: Float
    shapes_std: Float
    phase_collinearity: Float
    lower: Complex
    upper: Complex
    lowest_hz: float
    highest_hz: float
    upper_hz: float = np.inf
    force_rms_n: float = np.nan
    fit_residual: float = np.nan
    covariance: Float | None = None
    residues: Complex | None = None
    small_terms: Float | None = None
    specimen: str = ""
    notes: tuple[str, ...] = ()
    force_unit: str = "N"

    def __post_init__(self) -> None:
        convert_fields(self, tuple, "channels", "notes")
        if self.normalised:
            find_role(self.channels, "drive")
        elif self.residues is None:
            raise IdentificationError(
                "none has the role 'drive'", field="channels", hint="without one residues are needed"
            )
        modes, rows = np.size(self.frequency_hz), len(self.channels)
        parameters = modes * (2 + rows)
        for names, shape, dtype in (
            (_POLES, (modes,), np.float64),
            (_SHAPES, (rows, modes), np.float64),
            (_RESIDUALS, (rows,), np.complex128),
            (("covariance",), (parameters, parameters), np.float64),
            (("residues",), (rows, modes), np.complex128),
            (("small_terms",), (rows, 3), np.float64),
        ):
            for name in names:
                if name in _OPTIONAL and getattr(self, name) is None:
                    continue
                array = np.array(getattr(self, name), dtype=dtype)
                if array.shape != shape:
                    raise IdentificationError(f"shape {array.shape}", field=name, allowed=f"{shape}")
                array.setflags(write=False)
                object.__setattr__(self, name, array)
        for name in ("frequency_hz", "damping_ratio", "shapes"):
            finite_array(name, getattr(self, name), np.float64, 2 if name == "shapes" else 1)
        if not modes or self.frequency_hz[0] <= 0.0 or np.any(np.diff(self.frequency_hz) <= 0.0):
            allowed = "at least one, above zero, each above the one before"
            raise IdentificationError(field="frequency_hz", allowed=allowed)

    @property
    def normalised(self) -> bool:
        """Whether the shapes are mass-normalised, which takes a drive point."""
        return any(channel.role == "drive" for channel in self.channels)

    @property
    def drive_row(self) -> int:
        """Row of the drive-point channel; raises `IdentificationError` without one."""
        if not self.normalised:
            raise IdentificationError(
                "have no drive point, so that their shapes are not mass-normalised",
                field="modes",
                hint="measure the motion where the force acts, as a channel of role drive",
            )
        return find_role(self.channels, "drive")

    @property
    def drive_shape(self) -> Float:
        """float[n_modes]: shapes at the drive point, kg^-1/2; raises `IdentificationError` without one."""
        return np.asarray(self.shapes[self.drive_row])

    def nearest(self, frequency_hz: float) -> int:
        """Return the index of the mode nearest to a frequency."""
        return int(np.argmin(np.abs(self.frequency_hz - frequency_hz)))

    def mode_shapes(self, mode: int = 0, *, modes: int | None = None) -> ModeShapes:
        """Return the shapes with which the modal amplitude of ``mode`` is computed.

        They are those of the ``modes`` modes nearest to it; if None, as many as there are channels. Raises
        `IdentificationError` without a drive point.
        """
        assert self.drive_row >= 0
        count = min(len(self.channels), self.frequency_hz.size) if modes is None else modes
        order = np.argsort(np.abs(self.frequency_hz - self.frequency_hz[mode]), kind="stable")[:count]
        return ModeShapes(tuple(c.name for c in self.channels), self.shapes[:, order], 0)

    def accelerance(
        self, frequency_hz: ArrayLike, *, without: int | None = None, decay_rate_1_s: float = 0.0
    ) -> Complex:
        """complex[n, n_channels]: acceleration over drive force, 1/kg, with residual terms; ``without`` omits one mode.

        ``decay_rate_1_s`` is the rate of an exponential window over force and motion.
        """
        s = decay_rate_1_s + 2j * np.pi * np.atleast_1d(np.asarray(frequency_hz, dtype=np.float64))[:, None]
        omega = 2.0 * np.pi * self.frequency_hz
        modal = s**2 / (s**2 + 2.0 * self.damping_ratio * omega * s + omega**2)
        if without is not None:
            modal[:, without] = 0.0
        modes: Complex
        if self.residues is None:
            modes = modal @ (self.shapes * self.drive_shape).T.astype(np.complex128)
        else:
            slope = self.residues.imag / (omega * np.sqrt(1.0 - self.damping_ratio**2))
            constant = self.residues.real + slope * self.damping_ratio * omega
            modes = modal @ constant.T + (s * modal) @ slope.T
        near = 1.0 + (s / (2.0 * np.pi * self.upper_hz)) ** 2
        rest = self.lower + self.upper * s**2 / near
        if self.small_terms is not None:
            rest = rest + np.hstack([1.0 / s, 1.0 / s**2, s**3 / near**2]) @ self.small_terms.T
        return np.asarray(modes + rest)

    def receptance(self, frequency_hz: ArrayLike, output: str | None = None, *, without: int | None = None) -> Complex:
        """complex[n]: displacement of a channel (the drive point if None) over drive force, m/N."""
        row = self.drive_row if output is None else find_name(self.channels, output)
        s = 2j * np.pi * np.atleast_1d(np.asarray(frequency_hz, dtype=np.float64))
        return np.asarray(self.accelerance(frequency_hz, without=without)[:, row] / s**2)

    def response_matrix(self, frequency_hz: ArrayLike, *, decay_rate_1_s: float = 0.0) -> FrequencyResponseMatrix:
        """Return the model's frequency responses to one force, in the units of the channels."""
        frequency = np.atleast_1d(np.asarray(frequency_hz, dtype=np.float64))
        s = decay_rate_1_s + 2j * np.pi * frequency
        order = np.array([2 - MOTION_ORDER[channel.motion] for channel in self.channels])
        value = self.accelerance(frequency, decay_rate_1_s=decay_rate_1_s) / s[:, None] ** order
        return FrequencyResponseMatrix(
            outputs=self.channels,
            inputs=(Channel("force", "force", self.force_unit),),
            frequency_hz=frequency,
            value=value[:, :, None],
            decay_rate_1_s=decay_rate_1_s,
            estimator="model",
            specimen=self.specimen,
        )

    def table(self) -> list[dict[str, float | None]]:
        """Return one JSON-able dictionary per mode, with None for unknown values."""
        drive_shape = self.drive_shape if self.normalised else np.full(self.frequency_hz.size, np.nan)
        known = {name: getattr(self, name) for name in _POLES}
        return table_rows({**dict(list(known.items())[:4]), "drive_shape": drive_shape, _POLES[4]: known[_POLES[4]]})


def mac_matrix(a: LinearModes, b: LinearModes) -> NDArray[np.float64]:
    """float[n_modes of a, n_modes of b]: MAC ``(x^T y)^2 / (x^T x y^T y)`` of the shapes at the common channels.

    Raises `IdentificationError` if the two have no channel in common.

    Parameters
    ----------
    a, b
        Linear modes with at least one channel in common.
    """
    names = [channel.name for channel in b.channels]
    common = [(row, names.index(channel.name)) for row, channel in enumerate(a.channels) if channel.name in names]
    if not common:
        reason = f"{', '.join(c.name for c in a.channels)} and {', '.join(names)} share none"
        raise IdentificationError(reason, field="channels")
    x, y = a.shapes[[i for i, _ in common]], b.shapes[[j for _, j in common]]
    product = np.outer(np.sum(x**2, axis=0), np.sum(y**2, axis=0))
    return np.asarray((x.T @ y) ** 2 / np.where(product > 0.0, product, 1.0))
