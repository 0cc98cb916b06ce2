"""The linearised loop: transfer from slow changes of the output's amplitude, phase and frequency to the demodulated signals.

Let ``u = Re U exp(a + i b + i theta)`` and ``theta' = W + Omega``. A slow complex change ``c = a + i(b + delta)`` of the
output, ``delta = Omega/s``, becomes ``h c`` behind a linear plant, with the envelope's transfer function
``h(s) = H(s + i W)/H(i W)``. The coefficients of h are complex. Real signals see

    ``P = [h(s) + h*(s)]/2``, ``R = [h(s) - h*(s)]/(2 i)``, ``h*(s) = H(s - i W)/H(-i W)``,

so that ``ln|Y| <- P a - R (b + delta)`` and ``arg Y <- R a + P (b + delta) - delta``. The transfer function from frequency to
lag is therefore ``T(s) = [P_F(s) - P_A(s)]/s``. The demodulators add their low-pass ``w_LP/(s + w_LP)``, the rig its delay.

A nonlinear structure answers a change of its amplitude with a change of its frequency, ``delta w_0 = kappa ln|A|``, kappa
positive where it hardens. That acts like a force on its mode, ``-2 w_0 delta w_0 q``, and closes one more loop in the plant,
around the transfer function from delta w_0 to ln|A| (`ControlLoop.response_after_shift`).
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from controller.amplitude import AmplitudeLaw
from controller.pll import PhaseLockedLoop
from controller.tuning.laws import (
    ComplexResponseLaw,
    LinearAmplitudeLaw,
    LinearFrequencyLaw,
    linear_amplitude_law,
    linear_frequency_law,
)
from controller.tuning.plant import PlantModel
from vibrolock.arrays import Complex


def envelope(response: Callable[[Complex], Complex], s: Complex, omega: float) -> tuple[Complex, Complex]:
    """Return P(s) and R(s) of a frequency response H at the frequency omega (rad/s)."""
    upper = response(s + 1j * omega) / response(np.array([1j * omega]))
    lower = response(s - 1j * omega) / response(np.array([-1j * omega]))
    return 0.5 * (upper + lower), -0.5j * (upper - lower)


class SlowChanges(NamedTuple):
    """What a plant makes of slow changes at complex frequencies s, before low-pass and delay: the same whatever the law."""

    s: Complex
    """complex[n], rad/s."""
    deviations: Complex
    """complex[n, 4, 3]: from (ln|U|, arg U, Omega) to (ln|F|, arg F, ln|A|, arg A)."""
    after_shift: Complex
    """complex[n, 4]: from a shift of the mode (rad/s) to the same."""


def slow_changes(plant: PlantModel, s: Complex, omega: float) -> SlowChanges:
    """Return what a plant that is locked at the frequency omega (rad/s) makes of slow changes at s [n]."""
    return SlowChanges(s, _deviations(plant, s, omega), _after_shift(plant, s, omega))


def _deviations(plant: PlantModel, s: Complex, omega: float) -> Complex:
    rows = []
    for response in (plant.force_per_v, plant.acceleration_per_v):
        p, r = envelope(response, s, omega)
        rows += [np.stack([p, -r, -r / s], axis=-1), np.stack([r, p, (p - 1.0) / s], axis=-1)]
    return np.stack(rows, axis=1)


def _after_shift(plant: PlantModel, s: Complex, omega: float) -> Complex:
    """Return what a shift of the mode leads to.

    It acts like the force ``G = 2 w_0 shift A/(phi_d^2 W^2)`` on the mode alone: ``F <- -H_F beta Y_m G`` and ``A <- H_F alpha
    Y_m G``, with the mode's part Y_m of the accelerance.
    """
    out = np.zeros((s.size, 4), np.complex128)
    for sign in (1.0, -1.0):
        carrier = 1j * sign * omega
        alpha, beta = plant.exciter(s + carrier)
        driven = plant.force_per_v(s + carrier) * plant.mode_accelerance(s + carrier)
        driven *= 2.0 * plant.frequency_rad_s / (plant.drive_shape * omega) ** 2
        for row, relative in ((0, -beta * driven * plant.accelerance(carrier)), (2, alpha * driven)):
            out[:, row] += 0.5 * relative
            out[:, row + 1] += -0.5j * sign * relative
    return out


@dataclass(frozen=True)
class ControlLoop:
    """Plant, demodulator and laws at one lag; all methods refer to the linearised loop."""

    plant: PlantModel
    low_pass_rad_s: float
    """w_LP of the demodulators: a first-order low-pass, or an adaptive filter, which is equivalent on average."""
    frequency_law: LinearFrequencyLaw
    amplitude_law: LinearAmplitudeLaw | None = None
    """None: the level is the output's amplitude in volts."""
    lag_deg: float = -90.0

    @cached_property
    def omega_rad_s(self) -> float:
        """W: frequency of the locked state."""
        return self.plant.lock_frequency_rad_s(self.lag_deg)

    def measured(self, s: Complex) -> Complex:
        """Return M(s) [n, 4, 3]: from (ln|U|, arg U, Omega) to the demodulated (ln|F|, arg F, ln|A|, arg A)."""
        return _deviations(self.plant, s, self.omega_rad_s) * self._smoothing(s)[:, None, None]

    def _smoothing(self, s: Complex) -> Complex:
        return np.asarray(self.low_pass_rad_s / (s + self.low_pass_rad_s) * np.exp(-s * self.plant.delay_s))

    def feedback(self, s: Complex) -> Complex:
        """Return K(s) [n, 3, 4]: from the measured deviations to (ln|U|, arg U, Omega)."""
        out = np.zeros((s.size, 3, 4), np.complex128)
        if self.amplitude_law is not None:
            out[:, :2] = self.amplitude_law.rows(s, self.plant, self.lag_deg)
        gain = self.frequency_law.phase_gain(s, self.plant, self.lag_deg)
        out[:, 2, 1], out[:, 2, 3] = gain, -gain  # the error is the wanted lag less arg F - arg A
        return out

    def return_difference(self, s: Complex) -> Complex:
        """Return I + K M [n, 3, 3]; its determinant vanishes at the poles of the closed loop."""
        return np.asarray(np.eye(3) + self.feedback(s) @ self.measured(s))

    def determinant(self, s: ArrayLike) -> Complex:
        """Return ``det(I + K M)``."""
        return np.asarray(np.linalg.det(self.return_difference(np.atleast_1d(np.asarray(s, np.complex128)))))

    def frequency_loop_gain(self, s: ArrayLike) -> Complex:
        """Return the loop gain L(s) of the frequency law with the amplitude law closed."""
        matrix = self.return_difference(np.atleast_1d(np.asarray(s, np.complex128)))
        opened = matrix.copy()
        opened[:, 2] = [0.0, 0.0, 1.0]
        return np.asarray(np.linalg.det(matrix) / np.linalg.det(opened) - 1.0)

    def amplitude_loop_gain(self, s: ArrayLike) -> Complex:
        """Return the loop gain L(s) of the amplitude law with the frequency held; 0 without an amplitude law.

        For complex response control L has complex coefficients, so that both signs of the frequency count.
        """
        s = np.atleast_1d(np.asarray(s, np.complex128))
        law = self.amplitude_law
        if law is None:
            return np.zeros_like(s)
        if isinstance(law, ComplexResponseLaw) and law.force_per_s == 0.0:
            h = self.plant.acceleration_per_v(s + 1j * self.omega_rad_s)
            h = h / self.plant.acceleration_per_v(1j * self.omega_rad_s)
            return np.asarray(law.gain(s) * h * self._smoothing(s))
        matrix = self.return_difference(s)[:, :2, :2]
        return np.asarray(np.linalg.det(matrix) - 1.0)

    def lag_after_target(self, s: Complex) -> Complex:
        """Return the transfer function from the wanted lag to the measured lag."""
        gain = self.frequency_law.phase_gain(s, self.plant, self.lag_deg)
        return self._lag(self._outputs(s, 2, gain))

    def lag_after_frequency(self, s: Complex) -> Complex:
        """Return the transfer function from a shift of the rig's frequencies (rad/s) to the measured lag (rad).

        A shift upwards acts like an oscillator frequency that is too low by the same amount.
        """
        return -self._lag(self._outputs(s, 2, np.ones_like(s)))

    def response_after_level(self, s: Complex) -> tuple[Complex, Complex]:
        """Return the transfer functions from the logarithm of the level to ln|A| as measured and to the lag (rad)."""
        inputs = np.zeros((s.size, 3), np.complex128)
        if self.amplitude_law is None:
            inputs[:, 0] = 1.0
        else:
            inputs[:, :2] = self.amplitude_law.level(s, self.plant, self.lag_deg)
        outputs = self._closed(s, inputs)
        return outputs[:, 2], self._lag(outputs)

    def response_after_shift(self, s: Complex, known: "SlowChanges | None" = None) -> Complex:
        """Return the transfer function from a shift of the mode's frequency (rad/s) to ln|A| of the vibration itself.

        The mode alone is shifted; the exciter stays as it is, unlike in `lag_after_frequency`. ``known`` are the slow changes
        of this plant at these ``s`` and this lag, where several laws are tried on it.
        """
        known = known or slow_changes(self.plant, s, self.omega_rad_s)
        smoothing, feedback = self._smoothing(s), self.feedback(s)
        demanded = feedback @ (known.after_shift * smoothing[:, None])[:, :, None]
        closed = np.eye(3) + feedback @ (known.deviations * smoothing[:, None, None])
        actuators = -np.linalg.solve(closed, demanded)[:, :, 0]
        return np.asarray(known.after_shift[:, 2] + np.sum(known.deviations[:, 2] * actuators, axis=1))

    def _outputs(self, s: Complex, actuator: int, drive: Complex) -> Complex:
        inputs = np.zeros((s.size, 3), np.complex128)
        inputs[:, actuator] = drive
        return self._closed(s, inputs)

    def _closed(self, s: Complex, inputs: Complex) -> Complex:
        actuators = np.linalg.solve(self.return_difference(s), inputs[:, :, None])
        return np.asarray((self.measured(s) @ actuators)[:, :, 0])

    @staticmethod
    def _lag(outputs: Complex) -> Complex:
        return np.asarray(outputs[:, 1] - outputs[:, 3])


def control_loop(
    plant: PlantModel, law: PhaseLockedLoop, amplitude_law: AmplitudeLaw, bench_shape: float | None
) -> ControlLoop:
    """Linearise the loop that a configured law makes with a plant, with its lag and its gains as they are.

    ``bench_shape`` is the mode shape (kg^-1/2) that the frequency-error law takes where ``law`` names none.
    """
    frequency = linear_frequency_law(law, plant, bench_shape)
    amplitude = linear_amplitude_law(law, amplitude_law)
    return ControlLoop(plant, law.low_pass_rad_s, frequency, amplitude, law.phase_lag_deg)
