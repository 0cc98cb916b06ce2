"""Equations of the harmonic balance of the coupled rig, their Jacobian, and their solution by Newton's method.

The unknowns are the harmonics Z of the site coordinates, the angular frequency W and the voltage U of ``u = U cos(theta)``.
With the transfer T of the linear part and the site forces F(Z) (alternating frequency-time), each harmonic obeys
``Z = T_zf F(Z) + T_zu U``. Two closing equations (`Conditions`) prescribe the level, and the lag or the frequency. The phase
lag can serve as path parameter; along it, folds of the frequency are passed without arc-length continuation.

Where harmonics of the force are controlled, the voltage has those harmonics as well (`simulators.analysis.force_control`).
"""

from dataclasses import dataclass

import numpy as np

from simulators.analysis.condensed import CondensedRig, CondensedStructure
from simulators.analysis.conditions import Conditions
from simulators.analysis.force_control import ForceControl
from simulators.analysis.responses import NotConvergedError
from simulators.analysis.site_forces import Series, SiteForces, SiteWaves
from simulators.virtual_rig import VirtualRig
from vibrolock.arrays import Complex, Float

_TOLERANCE = 1e-9
"""Largest residual, relative to the magnitude of the terms of the equation."""
_ITERATIONS = 20  # most Newton iterations; chosen
_HALVINGS = 4  # most trials of a step, each half as long as the one before; chosen
_LARGEST_FREQUENCY_STEP = 0.05
"""Largest change of the frequency in one iteration, relative."""


@dataclass(frozen=True, eq=False)
class Solution:
    """A periodic vibration: its unknowns, the Jacobian at them, and the conditions that the vibration meets."""

    unknowns: Float
    jacobian: Float
    conditions: Conditions

    def tangent(self, level: float = 0.0, value: float = 0.0) -> Float:
        """Return the change of the unknowns for a relative change ``level`` and a change ``value`` of lag or frequency."""
        change = np.zeros(self.unknowns.size)
        change[-1] = level
        change[-2] = value if self.conditions.at == "lag" else value / self.conditions.value
        try:
            return np.asarray(np.linalg.solve(self.jacobian, change), dtype=np.float64)
        except np.linalg.LinAlgError:
            raise NotConvergedError(f"the path has no direction at {self.conditions}") from None

    def stable(self, *, under_voltage: bool = False) -> bool:
        """Return whether the fundamental is statically stable at constant frequency and level, without a control loop.

        The determinant of the equations at a given frequency is positive at rest and changes its sign at every fold.
        ``under_voltage``: the voltage is constant instead of the held quantity.
        """
        if under_voltage:
            left = self.jacobian[:-2, :-2]
        else:
            left = np.delete(np.delete(self.jacobian, -2, axis=0), -2, axis=1)
        return bool(np.linalg.slogdet(left)[0] > 0.0)

    def held_by_voltage(self) -> float:
        """Return ``d ln(level) / d ln(U)`` at the held lag or frequency: the static gain for a loop on the level alone."""
        change = self.tangent(level=1.0)[-1] / self.unknowns[-1]
        return float(1.0 / change) if change else float("inf")


class Balance:
    """Residual and Jacobian over ``y = [coefficients of every site coordinate, W, U]``.

    With ``pure_sine``, U is instead the amplitude of a sinusoidal force on the structure without exciter. ``control``
    prescribes harmonics of the force.
    """

    def __init__(
        self,
        rig: VirtualRig,
        harmonics: int,
        samples: int,
        *,
        pure_sine: bool = False,
        control: ForceControl | None = None,
    ) -> None:
        self.linear = CondensedStructure(rig) if pure_sine else CondensedRig(rig)
        self.control = ForceControl.of(None, harmonics) if control is None else control
        self.sites = SiteForces(rig)
        self.series = Series(harmonics, samples)
        self.n_site = self.linear.n_site

    def coefficients(self, unknowns: Float) -> Float:
        """Return the coefficients of the site coordinates [n_site, P]."""
        return unknowns[:-2].reshape(self.n_site, self.series.size)

    def responses(self, unknowns: Float) -> tuple[Complex, Complex, Float]:
        """Return site coordinates, force and drive displacement caused by site forces and voltage [n_site + 2, H + 1].

        Also return their Jacobian [n_site + 2, H + 1, len(y)], and the magnitude of the terms of each sum [n_site + 2].
        """
        series, n = self.series, self.n_site
        transfer, by_omega = self.control.driven(*self.linear.transfer(unknowns[-2], series.orders))
        waves = self.sites(series, self.coefficients(unknowns))
        inputs = self._uncontrolled(unknowns, waves)
        slopes = np.zeros((n + 1, series.orders.size, unknowns.size), np.complex128)
        slopes[:n, :, :-2] = series.to_complex(waves.jacobian.reshape(n, series.size, n * series.size))
        slopes[n, 1, -1] = 1.0
        fundamental, change = transfer[1, n] @ inputs[:, 1], transfer[1, n] @ slopes[:, 1]
        change[-2] += by_omega[1, n] @ inputs[:, 1]
        inputs[n, self.control.orders], slopes[n, self.control.orders] = self.control.forces(fundamental, change)
        jacobian = np.transpose(transfer @ np.transpose(slopes, (1, 0, 2)), (1, 0, 2))
        jacobian[:, :, -2] += np.einsum("hoi,ih->oh", by_omega, inputs)
        response = np.einsum("hoi,ih->oh", transfer, inputs)
        sizes = np.max(np.einsum("hoi,ih->oh", np.abs(transfer), np.abs(inputs)), axis=1, initial=0.0)
        return response, jacobian, sizes

    def inputs(self, unknowns: Float, waves: SiteWaves) -> Complex:
        """Return the harmonics of site forces and voltage (of the force, with ``pure_sine``) [n_site + 1, H + 1]."""
        inputs, at = self._uncontrolled(unknowns, waves), self.control.orders
        transfer = self.linear.transfer(unknowns[-2], self.series.orders)[0]
        fundamental = transfer[1, self.n_site] @ inputs[:, 1]
        inputs[-1, at] = self.control.forces(fundamental, np.zeros(0, np.complex128))[0]
        inputs[-1, at] = self.control.voltages(transfer, inputs)
        return inputs

    def _uncontrolled(self, unknowns: Float, waves: SiteWaves) -> Complex:
        """Return the inputs [n_site + 1, H + 1] with the fundamental of the voltage alone."""
        inputs = np.zeros((self.n_site + 1, self.series.orders.size), np.complex128)
        inputs[:-1] = self.series.to_complex(waves.forces @ self.series.projection.T)
        inputs[-1, 1] = unknowns[-1]
        return inputs

    def residual(self, unknowns: Float, conditions: Conditions) -> tuple[Float, Float, Float]:
        """Return the residual [len(y)], its Jacobian, and the magnitude of each equation's terms."""
        series, n = self.series, self.n_site
        response, slopes, sizes = self.responses(unknowns)
        value, jacobian = np.empty_like(unknowns), np.zeros((unknowns.size, unknowns.size))
        value[:-2] = unknowns[:-2] - series.to_real(response[:n]).ravel()
        jacobian[:-2] = -series.to_real(slopes[:n]).reshape(n * series.size, unknowns.size)
        jacobian[:-2, :-2] += np.eye(unknowns.size - 2)
        value[-2:], jacobian[-2:] = conditions.equations(unknowns, response[n:], slopes[n:])
        scale = np.append(np.repeat(np.where(sizes[:n] > 0.0, sizes[:n], 1.0), series.size), [1.0, 1.0])
        return value, jacobian, scale

    @np.errstate(all="ignore")  # a trial step may overflow; results that are not finite are refused
    def solve(self, start: Float, conditions: Conditions) -> Solution:
        """Solve by Newton's method, halving steps until the residual falls; raise `NotConvergedError` without convergence."""
        y = start
        value, jacobian, scale = self.residual(y, conditions)
        for _ in range(_ITERATIONS):
            size = np.max(np.abs(value / scale))
            if size < _TOLERANCE:
                if not np.all(y[-2:] > 0.0):  # a negative voltage: the same vibration shifted by half a period
                    raise NotConvergedError(f"no periodic vibration with a positive voltage found at {conditions}")
                return Solution(y, jacobian, conditions)
            columns = np.append(scale[:-2], y[-2:])
            try:
                step = columns * np.linalg.solve(jacobian * columns / scale[:, None], -value / scale)
            except np.linalg.LinAlgError:
                break
            share = min(1.0, _LARGEST_FREQUENCY_STEP * y[-2] / max(abs(step[-2]), 1e-300))
            for _ in range(_HALVINGS):
                trial = self.residual(y + share * step, conditions)
                if np.max(np.abs(trial[0] / scale)) < size:
                    break
                share *= 0.5
            y = y + share * step
            value, jacobian, scale = trial
            if not np.all(np.isfinite(value)):
                break
        raise NotConvergedError(f"no periodic vibration found at {conditions}")

    def linear_start(self, conditions: Conditions, omega_rad_s: float) -> Float:
        """Return the vibration of the linear part alone at W, at the level of the conditions."""
        transfer = self.linear.transfer(omega_rad_s, self.series.orders)[0][1, :, -1]
        voltage = conditions.voltage_v(*np.abs(transfer[self.n_site :]))
        harmonics = np.zeros((self.n_site, self.series.orders.size), np.complex128)
        harmonics[:, 1] = voltage * transfer[: self.n_site]
        return np.append(self.series.to_real(harmonics).ravel(), [omega_rad_s, voltage])
