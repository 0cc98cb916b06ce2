"""All steady states of one nonlinear mode under a constant force, their stability, and the motion of the channels.

The founding paper's steady slow flow, ``(w^2 - W^2 + 2 i W w z) q = L exp(i psi)`` with the modal force ``L = phi_d F`` and
w, z functions of q (L too, if the harmonics of the force or the shape depend on the level), can be solved for the frequency W
of the vibration:

    W^2 = w^2 (1 - 2 z^2) +- sqrt(P),    P = (L / q)^2 - 4 w^4 z^2 (1 - z^2).

Solutions exist at amplitudes with P >= 0. The solutions from rest up to the first zero of P are the response that a test
measures; further intervals of q with P >= 0 are detached branches (isolas). Each branch is parameterised by s, with
``q = q_end sin s`` (main branch) or ``q = middle - half cos s`` (detached), lower sign first, so that the curve is smooth at
the ends of the interval.

Stability is that of the complex slow flow ``2 (i W + z w) Q' = L exp(i psi) - D(|Q|) Q``, ``D = w^2 - W^2 + 2 i W w z`` under
constant force and frequency. With a disturbance ``u + i v`` of ``Q = q``,

    2 (i W + z w) (u + i v)' = -(D + q dD/dq - (q D / L) dL/dq) u - i D v,

a real 2 x 2 Jacobian. Its determinant changes sign exactly at the folds, where dW/ds = 0.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.linear.modes import LinearModes
from identification.models.modal.properties import REFUSED_BEYOND, ModalProperties
from identification.nonlinear.nonlinear_modes import NonlinearMode
from identification.prediction.steady_prediction import FLAGGED_BEYOND
from identification.validation import one_specimen
from vibrolock.arrays import Complex, Float

_LOWEST_SHARE = 1e-4  # lowest amplitude that is searched, over the highest; chosen
_GRID = 4000  # number of amplitudes between which changes of sign are looked for; chosen


def modal_stiffness(properties: ModalProperties, q: Float, omega: Float) -> Complex:
    """complex[n]: ``D = w^2 - W^2 + 2 i W w z``; its angle is the phase lag of the modal coordinate behind the force."""
    w, z = properties.frequency_rad_s(q), properties.damping_ratio(q)
    return np.asarray(w**2 - omega**2 + 2j * omega * w * z)


@dataclass(frozen=True)
class Path:
    """One connected branch of solutions with amplitudes from ``lowest`` to ``highest``; closed if detached from rest."""

    lowest: float
    highest: float
    closed: bool

    def at(self, s: Float) -> tuple[Float, Float]:
        """Return modal amplitude and sign of the square root at path parameters in [0, pi] (main) or [0, 2 pi] (closed)."""
        if not self.closed:
            return self.highest * np.sin(s), np.where(s <= 0.5 * np.pi, -1.0, 1.0)
        middle, half = 0.5 * (self.highest + self.lowest), 0.5 * (self.highest - self.lowest)
        return middle - half * np.cos(s), np.where(s <= np.pi, -1.0, 1.0)


@dataclass(frozen=True, eq=False)
class OneMode:
    """One nonlinear mode under a constant force."""

    properties: ModalProperties
    """w(q), z(q) and drive shape."""
    fundamental_n: Callable[[Float], Float]
    """Peak of the fundamental of the force over q, N."""

    def modal_force(self, q: Float) -> Float:
        """float[n]: modal force L, kg^1/2 m/s^2."""
        return np.asarray(self.properties.drive_shape(q) * self.fundamental_n(q))

    def discriminant(self, q: Float) -> Float:
        """float[n]: discriminant P, (rad/s)^4."""
        w, z = self.properties.frequency_rad_s(q), self.properties.damping_ratio(q)
        return np.asarray((self.modal_force(q) / q) ** 2 - 4.0 * w**4 * z**2 * (1.0 - z**2))

    def paths(self, highest_q: float) -> tuple[list[Path], float | None]:
        """Return all branches up to ``highest_q``, and the amplitude at which a branch begins that is still open there."""
        from scipy.optimize import brentq

        grid = highest_q * np.geomspace(_LOWEST_SHARE, 1.0, _GRID)
        inside = self.discriminant(grid) >= 0.0
        changes = np.flatnonzero(inside[1:] != inside[:-1])
        ends = [
            float(brentq(lambda q: float(self.discriminant(np.array(q))), grid[k], grid[k + 1], rtol=1e-14))
            for k in changes
        ]
        if inside[0]:
            ends.insert(0, 0.0)
        opened = ends.pop() if inside[-1] else None
        return [Path(low, high, low > 0.0) for low, high in zip(ends[::2], ends[1::2], strict=True)], opened

    def amplitudes(self, omega: float, highest_q: float, *, missed: float = 0.0) -> Float:
        """float[n]: modal amplitudes of all steady states up to ``highest_q`` at the frequency ``omega``, rising.

        With ``missed``, a pair of solutions just beyond its fold is included too, as one amplitude, if a change of the force
        by less than this share would create the pair.
        """
        from scipy.optimize import brentq

        def surplus(q: Float) -> Float:
            return np.asarray(np.abs(modal_stiffness(self.properties, q, np.array(omega))) * q - self.modal_force(q))

        grid = highest_q * np.geomspace(_LOWEST_SHARE, 1.0, _GRID)
        values = surplus(grid)
        changes = np.flatnonzero((values[1:] > 0.0) != (values[:-1] > 0.0))
        found = [brentq(lambda q: float(surplus(np.array(q))), grid[k], grid[k + 1], rtol=1e-12) for k in changes]
        before, here, after = values[:-2], values[1:-1], values[2:]
        bend = before - 2.0 * here + after
        turns = (here - before) * (after - here) < 0.0
        close = np.abs(here) < missed * self.modal_force(grid[1:-1])
        near = np.flatnonzero(turns & close & (here * bend > 0.0))  # a maximum below zero, a minimum above
        shift = 0.5 * (before - after)[near] / bend[near]
        return np.sort([*found, *(grid[near + 1] * (grid[1] / grid[0]) ** shift)])

    def omega(self, q: Float, sign: Float) -> Float:
        """float[n]: frequency W of the vibration, rad/s; NaN where the branch has none (below its static deflection)."""
        w, z = self.properties.frequency_rad_s(q), self.properties.damping_ratio(q)
        squared = w**2 * (1.0 - 2.0 * z**2) + sign * np.sqrt(np.maximum(self.discriminant(q), 0.0))
        return np.asarray(np.sqrt(np.where(squared > 0.0, squared, np.nan)))

    def jacobian(self, q: Float, omega: Float) -> tuple[Float, Float]:
        """Return trace and determinant, float[n] each, of the slow flow linearised at the solutions."""
        w, z = self.properties.frequency_rad_s(q), self.properties.damping_ratio(q)
        dw, dz, _ = self.properties.slopes(q)
        stiffness = modal_stiffness(self.properties, q, omega)
        slope = 2.0 * w * dw + 2j * omega * (dw * z + w * dz)
        step = 1e-6 * q
        upper = np.minimum(q + step, self.properties.highest_q)
        load_slope = np.log(self.modal_force(upper) / self.modal_force(q - step)) / (upper - q + step)
        inertia = 2.0 * (1j * omega + z * w)
        by_u = -(stiffness + q * slope - q * stiffness * load_slope) / inertia
        by_v = -1j * stiffness / inertia
        trace = by_u.real + by_v.imag
        return np.asarray(trace), np.asarray(by_u.real * by_v.imag - by_v.real * by_u.imag)

    def stable(self, q: Float, omega: Float) -> NDArray[np.bool_]:
        """bool[n]: whether both eigenvalues of the linearised slow flow have negative real parts."""
        trace, determinant = self.jacobian(q, omega)
        return np.asarray((trace < 0.0) & (determinant > 0.0))


def fundamental_motion(
    mode: NonlinearMode,
    properties: ModalProperties,
    q: Float,
    omega: Float,
    fundamental_n: Float,
    modes: LinearModes | None,
    residuals: bool,
) -> tuple[tuple[str, ...], Complex]:
    """Return the names of the channels, drive point first, and their displacement complex[n, n_channels] relative to the force.

    ``q``, ``omega``, ``fundamental_n``: float[n], modal amplitude, frequency W (rad/s) and peak of the fundamental of the force
    (N) of each state. ``modes`` give the other channels, to which the shape of the tested mode is scaled by the drive-point
    displacement, and with ``residuals`` the linear response of all modes but the tested one.
    """
    lag = np.angle(modal_stiffness(properties, q, omega)) + _turn_rad(mode, q)
    drive = properties.drive_shape(q) * q * np.exp(-1j * lag)
    if modes is None:
        return ("drive",), drive[:, None]
    one_specimen(mode=mode.specimen, modes=modes.specimen)
    frequency = omega / (2.0 * np.pi)
    tested = modes.nearest(float(mode.modal_frequency_hz[int(np.argmin(mode.amplitude_m))]))
    order = [modes.drive_row, *(row for row in range(len(modes.channels)) if row != modes.drive_row)]
    ratio = modes.shapes[order, tested] / modes.drive_shape[tested]
    motion = drive[:, None] * ratio
    names = tuple(modes.channels[row].name for row in order)
    if residuals:
        others = np.column_stack([modes.receptance(frequency, name, without=tested) for name in names])
        motion = motion + others * fundamental_n[:, None]
    return names, motion


def _turn_rad(mode: NonlinearMode, q: Float) -> Float:
    """float[n]: phase of the modal constant over q from a fit of stepped sines; zero for other sources."""
    if mode.source != "stepped sine":
        return np.zeros_like(q)
    at = mode.amplitude_m * np.sqrt(mode.apparent_mass_kg)
    order = np.argsort(at, kind="stable")
    return np.asarray(np.interp(q, at[order], np.radians(mode.phase_lag_deg[order] - 90.0)))


def range_notes(properties: ModalProperties, q: Float) -> list[str]:
    """Return notes on a response outside the identified range, one line each."""
    use = float(properties.range_use(np.max(q)))
    notes = []
    if use > REFUSED_BEYOND:
        notes.append(f"reaches {use:.2f} times the largest modal amplitude identified: not to be trusted")
    elif use > FLAGGED_BEYOND:
        notes.append(f"reaches {use:.2f} times the largest modal amplitude identified: extrapolated")
    if np.max(q) < properties.q_range[0]:
        notes.append("stays below the lowest level identified: modal properties are those of the lowest level")
    return notes
