"""Control laws whose gains are designed, linearised about a locked state.

Each law is one or two rows of the feedback ``v = K(s) (reference - m)`` from the demodulated
``m = (ln|F|, arg F, ln|A|, arg A)`` to ``v = (ln|U|, arg U, Omega)``. All entries are small deviations. Arguments are relative
to the oscillator's phase.
"""

import math
from dataclasses import dataclass
from typing import ClassVar, assert_never

import numpy as np

from controller.amplitude import AmplitudeLaw
from controller.pll import PhaseLockedLoop
from controller.tuning.plant import PlantModel
from vibrolock.arrays import Complex


@dataclass(frozen=True)
class PhaseLaw:
    """``Omega = omega_m + kp e + ki int e``, e = wanted minus measured lag in rad."""

    proportional_per_s: float
    """kp (1/s)."""
    integral_per_s2: float
    """ki (1/s^2)."""

    def phase_gain(self, s: Complex, plant: PlantModel, lag_deg: float) -> Complex:
        """Return the transfer function from phase error (rad) to frequency (rad/s)."""
        del plant, lag_deg
        return self.proportional_per_s + self.integral_per_s2 / s


@dataclass(frozen=True)
class FrequencyErrorLaw:
    """``Omega = omega_m + k_p eps + k int eps`` with ``eps = (phi_d^2 Omega/2)(|F|/|A|) sin(e)/|sin phi*|``.

    The error eps is the frequency distance to the wanted lag. It schedules the gains by the damping that is measured with every
    sample. With the gain ``proportional`` the law is a phase PI whose gains scale with the measured damping.
    """

    integral_per_s: float
    """k (1/s)."""
    proportional: float = 0.0
    """k_p (1)."""
    shape_factor: float = 1.0
    """phi_d^2 assumed by the law, divided by phi_d^2 of the plant."""

    def phase_gain(self, s: Complex, plant: PlantModel, lag_deg: float) -> Complex:
        """Return the transfer function from phase error (rad) to frequency (rad/s)."""
        slope = self.shape_factor * frequency_per_lag(plant, lag_deg)
        return (self.proportional + self.integral_per_s / s) * slope


LinearFrequencyLaw = PhaseLaw | FrequencyErrorLaw


def linear_frequency_law(law: PhaseLockedLoop, plant: PlantModel, bench_shape: float | None) -> LinearFrequencyLaw:
    """Linearise the frequency law of ``law`` with its gains as they are.

    The frequency-error law takes the mode shape (kg^-1/2) of ``law``, or else that of the bench, whatever the plant's own is.
    """
    kp, ki = law.proportional_and_integral()
    match law.frequency_law:
        case "phase":
            return PhaseLaw(kp, ki)
        case "frequency-error":
            shape = law.drive_mode_shape or bench_shape or plant.drive_shape
            return FrequencyErrorLaw(ki, kp, (shape / plant.drive_shape) ** 2)
        case other:
            assert_never(other)


def frequency_per_lag(plant: PlantModel, lag_deg: float) -> float:
    """Return ``(phi_d^2 W/2) |F|/|A| / |sin phi*|`` in rad/s per rad; it is about D w_0/sin^2 phi*."""
    omega = plant.lock_frequency_rad_s(lag_deg)
    size = 1.0 / abs(complex(plant.accelerance(1j * omega)))
    return 0.5 * plant.drive_shape**2 * omega * size / abs(math.sin(math.radians(lag_deg)))


@dataclass(frozen=True)
class ForceLaw:
    """The paper's force loop ``U = K3 e_F + K4 int e_F``."""

    k3_v_n: float
    """K3 (V/N)."""
    k4_v_n_s: float
    """K4 (V/(N s))."""

    def rows(self, s: Complex, plant: PlantModel, lag_deg: float) -> Complex:
        """Return the rows of K(s) for ln|U| and arg U [n, 2, 4]."""
        per_volt = abs(complex(plant.force_per_v(1j * plant.lock_frequency_rad_s(lag_deg))))
        return _amplitude_row(s, 0, (self.k3_v_n + self.k4_v_n_s / s) * per_volt)

    def level(self, s: Complex, plant: PlantModel, lag_deg: float) -> Complex:
        """Return the direct gain from a relative change of the level to ln|U| and arg U [n, 2]."""
        return self.rows(s, plant, lag_deg)[:, :, 0]


@dataclass(frozen=True)
class _LogLaw:
    """``ln U = kp e + ki int e``, where e is the logarithm of wanted over measured amplitude of one quantity."""

    proportional: float
    """kp (1)."""
    integral_per_s: float
    """ki (1/s)."""
    measured: ClassVar[int]
    """Index in m of the held quantity."""

    def rows(self, s: Complex, plant: PlantModel, lag_deg: float) -> Complex:
        """Return the rows of K(s) for ln|U| and arg U [n, 2, 4]."""
        del plant, lag_deg
        return _amplitude_row(s, self.measured, self.proportional + self.integral_per_s / s)

    def level(self, s: Complex, plant: PlantModel, lag_deg: float) -> Complex:
        """Return the direct gain from a relative change of the level to ln|U| and arg U [n, 2]."""
        return self.rows(s, plant, lag_deg)[:, :, self.measured]


class LogForceLaw(_LogLaw):
    """``ln U = kp e + ki int e`` with ``e = ln(F*/|F|)``."""

    measured = 0


class LogResponseLaw(_LogLaw):
    """``ln U = kp e + ki int e`` with ``e = ln(A_ref/|A|)``."""

    measured = 2


@dataclass(frozen=True)
class ComplexResponseLaw:
    """``ln U_c = kp E + K int E``, ``E = ln(A_ref/|A|) + i(phi_0 - arg A)``, with an optional outer force loop.

    The force loop is ``d ln A_ref/dt = k_F ln(F* sin psi*/(|F| sin psi))``: the active force sets the level of the response.
    """

    proportional: complex
    """kp (1)."""
    integral_per_s: float
    """K (1/s)."""
    force_per_s: float = 0.0
    """k_F (1/s); 0 if the level prescribes the response."""
    smoothing_rad_s: float = math.inf
    """Corner of a first-order low-pass that E passes before the gains (rad/s); infinite without a low-pass."""

    def gain(self, s: Complex) -> Complex:
        """Return the transfer function from E to ln U_c."""
        return np.asarray((self.proportional + self.integral_per_s / s) * self._smoothing(s))

    def _smoothing(self, s: Complex) -> Complex:
        return np.asarray(1.0 / (1.0 + s / self.smoothing_rad_s))

    def rows(self, s: Complex, plant: PlantModel, lag_deg: float) -> Complex:
        """Return the rows of K(s) for ln|U| and arg U [n, 2, 4]."""
        del plant
        real, imag = self._parts(s)
        out = np.zeros((s.size, 2, 4), np.complex128)
        out[:, 0, 2], out[:, 0, 3] = real, -imag
        out[:, 1, 2], out[:, 1, 3] = imag, real
        if self.force_per_s:
            force = self.force_per_s / s
            cot = 1.0 / math.tan(math.radians(lag_deg))
            for row, part in enumerate((real, imag)):
                out[:, row, 0] = part * force
                out[:, row, 1] = part * force * cot
                out[:, row, 3] -= part * force * cot
        return out

    def level(self, s: Complex, plant: PlantModel, lag_deg: float) -> Complex:
        """Return the direct gain from a relative change of the level to ln|U| and arg U [n, 2]."""
        del plant, lag_deg
        error = self.force_per_s / s if self.force_per_s else np.ones_like(s)
        return np.stack([part * error for part in self._parts(s)], axis=-1)

    def _parts(self, s: Complex) -> tuple[Complex, Complex]:
        """Return the transfer functions [n] from E to ln|U| and to arg U: (kp + K/s) after the smoothing, kp being complex."""
        smoothing = self._smoothing(s)
        kp = complex(self.proportional)
        return np.asarray((kp.real + self.integral_per_s / s) * smoothing), np.asarray(kp.imag * smoothing)


LinearAmplitudeLaw = ForceLaw | LogForceLaw | LogResponseLaw | ComplexResponseLaw


def linear_amplitude_law(law: PhaseLockedLoop, amplitude_law: AmplitudeLaw) -> LinearAmplitudeLaw | None:
    """Linearise the loop of ``law`` that holds levels of an `AmplitudeLaw`; None where the level is a voltage."""
    through = False
    match amplitude_law:
        case AmplitudeLaw.VOLTAGE:
            return None
        case AmplitudeLaw.FORCE | AmplitudeLaw.FORCE_RMS:
            match law.force_loop:
                case "linear":
                    return ForceLaw(law.k3, law.k4)
                case "logarithmic":
                    return LogForceLaw(law.force_proportional, law.force_integral_per_s)
                case "through-response":
                    through = True
                case other:
                    assert_never(other)
        case AmplitudeLaw.RESPONSE:
            pass
        case unknown:
            assert_never(unknown)
    gain = law.response_integral_per_s
    proportional = gain / -complex(*law.plant_pole_rad_s) if law.plant_pole_rad_s else 0.0 + 0.0j
    match law.response_loop:
        case "amplitude":
            return LogResponseLaw(proportional.real, gain)
        case "complex":
            force = law.reference_integral_per_s if through else 0.0
            return ComplexResponseLaw(proportional, gain, force, law.low_pass_rad_s)
        case loop:
            assert_never(loop)


def _amplitude_row(s: Complex, measured: int, gain: Complex) -> Complex:
    out = np.zeros((s.size, 2, 4), np.complex128)
    out[:, 0, measured] = gain
    return out
