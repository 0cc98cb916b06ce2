"""Modal properties as functions of the modal amplitude, inside the identified range and, with limits, outside it.

Inside the range, modal frequency w, damping ratio z and drive shape are monotone cubic (PCHIP) in the modal amplitude q, so
that the interpolation adds no extrema between levels. Below the lowest level they are constant. Above the highest level,
``w^2`` is linear in ``q^2`` (as for an amplitude-dependent stiffness ``k0 + k2 q^2``), and z is linear in q and never falls.
A continued cubic would cause spurious branches, and a falling z would let a response grow without bound. Both slopes are
those of a straight line through the levels above half the highest q, at least three. The difference of two levels would be
mostly noise, and a fixed number of levels would make the slope depend on the spacing of the test levels.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from identification.errors import ExtrapolationError, IdentificationError
from identification.nonlinear.nonlinear_modes import NonlinearMode
from identification.validation import finite_array
from vibrolock.arrays import Float

Damping = Literal["fundamental", "total-power"]

REFUSED_BEYOND = 2.0
"""Use of the identified range up to which predictions are made unless more is allowed (decision 24)."""
HIGHER_LEVELS = "measure higher levels, or allow extrapolation (`largest_range_use`)"
"""Advice of an `ExtrapolationError`, for Python and the command line."""
_TAIL_FROM = 0.5  # share of the largest modal amplitude from which levels are extrapolated by a line; chosen
_FEWEST_TAIL_LEVELS = 3  # levels that the line of the extrapolation takes at least, where there are so many; chosen
_SAME_LEVEL = 0.02  # relative distance of modal amplitudes that are averaged as one level; chosen
_LOWEST_OF_LAST = 0.01  # w^2 of a strongly softening mode ends at this share of its last value
_DAMPING_FIELD = {"fundamental": "damping_ratio", "total-power": "damping_ratio_total_power"}


@dataclass(frozen=True, eq=False, kw_only=True)
class ModalProperties:
    """Modal frequency, damping ratio and drive shape of one mode over its modal amplitude.

    A compiled kernel needs only these arrays. With k the last breakpoint not above q, ``t = q - modal_amplitude[k]`` and
    column k of the coefficients, a property is ``((c0 t + c1) t + c2) t + c3``. Below the first breakpoint it has the value
    at that breakpoint. Above the last, ``w^2 = max(tail[0], tail[1] + tail[2] (q^2 - q_max^2))``, ``z = tail[3] + tail[4] (q
    - q_max)`` and the drive shape is ``tail[5]``.

    Parameters
    ----------
    modal_amplitude
        float[n], breakpoints q, kg^1/2 m, above zero and rising.
    omega_rad_s, damping, drive_shape_at
        float[n], w, z and the drive shape (kg^-1/2: ``|X_d| = drive_shape q``) at the breakpoints.
    omega_coefficients, damping_coefficients, drive_shape_coefficients
        float[4, max(n - 1, 1)], coefficients of the cubic in each interval, highest power first.
    tail
        float[6], coefficients of the continuation above the last breakpoint.
    largest_range_use
        Largest q that is allowed, over the last breakpoint; ``inf`` allows any.
    """

    modal_amplitude: Float
    omega_rad_s: Float
    damping: Float
    drive_shape_at: Float
    omega_coefficients: Float
    damping_coefficients: Float
    drive_shape_coefficients: Float
    tail: Float
    largest_range_use: float = REFUSED_BEYOND

    @classmethod
    def of(
        cls, mode: NonlinearMode, *, damping: Damping = "fundamental", largest_range_use: float = REFUSED_BEYOND
    ) -> "ModalProperties":
        """Compute the properties of an identified mode, with damping from the power of the fundamental or of all harmonics.

        Levels may be in any order and repeated; those whose q differs by less than 2 % are averaged. If modal amplitudes are
        unknown but apparent masses m are known (stepped sine), ``q = |X| sqrt(m)`` and the drive shape is ``1 / sqrt(m)`` of
        the measured point, m being interpolated from level to level like w and z. Raises `IdentificationError` if no level has
        amplitude, frequency and damping, or if w or z is not positive at a level.
        """
        IdentificationError.unless_one_of("damping", damping, _DAMPING_FIELD)
        shape = 1.0 / np.sqrt(mode.apparent_mass_kg)
        q = np.where(np.isfinite(mode.modal_amplitude), mode.modal_amplitude, mode.amplitude_m / shape)
        z = getattr(mode, _DAMPING_FIELD[damping])
        table = np.array([q, 2.0 * np.pi * mode.modal_frequency_hz, z, shape])
        known = np.all(np.isfinite(table), axis=0)
        if not np.any(known):
            raise IdentificationError(
                "no level has modal amplitude (or apparent mass), modal frequency and "
                f"{_DAMPING_FIELD[damping]}; identify it with mass-normalised shapes, and harmonics for the "
                "total power",
                field="mode",
            )
        merged = _merged(table[:, known])
        return cls.from_levels(*merged, largest_range_use=largest_range_use)

    @classmethod
    def from_levels(
        cls,
        modal_amplitude: ArrayLike,
        omega_rad_s: ArrayLike,
        damping: ArrayLike,
        drive_shape: ArrayLike,
        *,
        largest_range_use: float = REFUSED_BEYOND,
    ) -> "ModalProperties":
        """Compute properties from values [n] at rising modal amplitudes; the drive shape may be a single number."""
        q = finite_array("modal_amplitude", modal_amplitude, np.float64, 1)
        omega = finite_array("omega_rad_s", omega_rad_s, np.float64, 1)
        z = finite_array("damping", damping, np.float64, 1)
        shape = finite_array("drive_shape", np.broadcast_to(drive_shape, q.shape), np.float64, 1)
        if not q.size or np.any(np.diff(q) <= 0.0):
            raise IdentificationError(field="modal_amplitude", allowed="at least one level, each above the one before")
        for name, values in (("modal_amplitude", q), ("omega_rad_s", omega), ("damping", z), ("drive_shape", shape)):
            if values.shape != q.shape:
                raise IdentificationError(f"shape {values.shape} for {q.size} levels", field=name)
            if np.any(values <= 0.0):
                where = int(np.argmax(values <= 0.0))
                raise IdentificationError(f"is {values[where]:g} at q = {q[where]:g}", field=name, allowed="above zero")
        last = slice(min(int(np.searchsorted(q, _TAIL_FROM * q[-1])), max(q.size - _FEWEST_TAIL_LEVELS, 0)), None)
        squared = _slope(q[last] ** 2, omega[last] ** 2)
        tail = (
            _LOWEST_OF_LAST * omega[-1] ** 2,
            omega[-1] ** 2,
            squared,
            z[-1],
            max(_slope(q[last], z[last]), 0.0),
            shape[-1],
        )
        values = np.column_stack([omega, z, shape])
        if q.size == 1:
            cubics = np.concatenate([np.zeros((3, 3, 1)), values.T[:, :, None]], axis=1)
        else:
            from scipy.interpolate import PchipInterpolator  # only on use: it takes long to load

            cubics = np.ascontiguousarray(np.moveaxis(PchipInterpolator(q, values).c, 2, 0))
        return cls(
            modal_amplitude=q,
            omega_rad_s=omega,
            damping=z,
            drive_shape_at=shape,
            omega_coefficients=cubics[0],
            damping_coefficients=cubics[1],
            drive_shape_coefficients=cubics[2],
            tail=np.array(tail),
            largest_range_use=largest_range_use,
        )

    @property
    def q_range(self) -> tuple[float, float]:
        """Smallest and largest modal amplitude identified, kg^1/2 m."""
        return float(self.modal_amplitude[0]), float(self.modal_amplitude[-1])

    @property
    def highest_q(self) -> float:
        """Largest allowed modal amplitude; infinite if extrapolation is allowed."""
        return self.largest_range_use * self.q_range[1]

    def range_use(self, q: ArrayLike) -> Float:
        """Modal amplitude over the largest identified; values above 1 are extrapolations, above 1.25 they are flagged."""
        return np.asarray(np.asarray(q, dtype=np.float64) / self.q_range[1])

    def frequency_rad_s(self, q: ArrayLike) -> Float:
        """Modal frequency w(q), rad/s, like q; raises `ExtrapolationError` beyond `highest_q`."""
        q, beyond, inside = self._inside(q, self.omega_coefficients)
        lowest, last, slope = self.tail[:3]
        outside = np.sqrt(np.maximum(lowest, last + slope * (q**2 - self.q_range[1] ** 2)))
        return np.where(beyond, outside, inside)

    def damping_ratio(self, q: ArrayLike) -> Float:
        """Modal damping ratio z(q), like q; raises `ExtrapolationError` beyond `highest_q`."""
        q, beyond, inside = self._inside(q, self.damping_coefficients)
        return np.where(beyond, self.tail[3] + self.tail[4] * (q - self.q_range[1]), inside)

    def drive_shape(self, q: ArrayLike) -> Float:
        """Drive-point displacement per modal amplitude, kg^-1/2, like q; also the modal force per drive-point force."""
        _, beyond, inside = self._inside(q, self.drive_shape_coefficients)
        return np.where(beyond, self.tail[5], inside)

    def slopes(self, q: ArrayLike) -> tuple[Float, Float, Float]:
        """Derivatives of w, z and the drive shape with respect to q, each like q."""
        q, beyond, omega = self._inside(q, _differentiated(self.omega_coefficients))
        z = self._inside(q, _differentiated(self.damping_coefficients))[2]
        shape = self._inside(q, _differentiated(self.drive_shape_coefficients))[2]
        lowest, last, slope = self.tail[:3]
        squared = last + slope * (q**2 - self.q_range[1] ** 2)
        falling = np.where(squared > lowest, slope * q / np.sqrt(np.maximum(squared, lowest)), 0.0)
        below = q < self.q_range[0]
        return (
            np.where(below, 0.0, np.where(beyond, falling, omega)),
            np.where(below, 0.0, np.where(beyond, self.tail[4], z)),
            np.where(below | beyond, 0.0, shape),
        )

    def _inside(self, q: ArrayLike, coefficients: Float) -> tuple[Float, NDArray[np.bool_], Float]:
        """Return the amplitudes as an array, whether each lies above the last breakpoint, and the values of the cubics."""
        amplitude = np.asarray(q, dtype=np.float64)
        if amplitude.size and not np.max(amplitude) <= self.highest_q:
            raise ExtrapolationError(
                f"modal amplitude: {np.max(amplitude):g} kg^1/2 m is {np.max(self.range_use(amplitude)):.2f} times the "
                f"largest identified, allowed is up to {self.largest_range_use:g}; {HIGHER_LEVELS}"
            )
        held = np.clip(amplitude, *self.q_range)
        interval = np.searchsorted(self.modal_amplitude, held, side="right") - 1
        interval = np.clip(interval, 0, coefficients.shape[1] - 1)
        c = coefficients[:, interval]
        t = held - self.modal_amplitude[interval]
        return amplitude, amplitude > self.q_range[1], np.asarray(((c[0] * t + c[1]) * t + c[2]) * t + c[3])


def _merged(table: Float) -> Float:
    """Sort columns by the first row and average those whose first entries differ by at most 2 %."""
    table = table[:, np.argsort(table[0], kind="stable")]
    groups: list[list[int]] = []
    for column, q in enumerate(table[0]):
        if groups and q <= table[0, groups[-1][0]] * (1.0 + _SAME_LEVEL):
            groups[-1].append(column)
        else:
            groups.append([column])
    return np.array([table[:, group].mean(axis=1) for group in groups]).T


def _slope(x: Float, y: Float) -> float:
    """Slope of the least-squares line; 0 for a single level."""
    if x.size < 2:
        return 0.0
    x = x - x.mean()
    return float(x @ y / (x @ x))


def _differentiated(coefficients: Float) -> Float:
    c0, c1, c2, _ = coefficients
    return np.array([np.zeros_like(c0), 3.0 * c0, 2.0 * c1, c2])
