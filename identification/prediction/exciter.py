"""An electrodynamic exciter with its amplifier and stinger, as a linear model from voltage and motion to force.

With ``s = i W``, the voltage V at the amplifier's input, the displacements X_d of the drive point and X_a of the armature,

    F = g_e V - Z X_a,    X_a = X_d + F / k_s,    g_e = g / (1 + s tau),    Z = s^2 m + s c + k + s b / (1 + s tau),

g the force per volt of the blocked exciter at low frequency (amplifier gain times G / R), tau = L / R the coil's time
constant, m moving mass, c and k suspension, b = G^2 / R what the back-EMF damps, 1 / k_s the stinger's compliance. A
current amplifier is the case b = 0.

The voltage that a recording holds is a number given to a converter. `Hold` says what becomes of it.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from identification.errors import IdentificationError
from identification.validation import finite_array, positive

__all__ = ["PARAMETERS", "Exciter", "Hold"]

Complex = NDArray[np.complex128]
Float = NDArray[np.float64]

PARAMETERS = (
    "force_per_volt_n_v",
    "coil_time_constant_s",
    "moving_mass_kg",
    "suspension_damping_n_s_m",
    "suspension_stiffness_n_m",
    "back_emf_damping_n_s_m",
    "stinger_compliance_m_n",
)
"""The parameters g, tau, m, c, k, b, 1/k_s, in the order of `Exciter.covariance`."""


@dataclass(frozen=True)
class Hold:
    """From the recorded voltage to the one at the amplifier: the converter's zero-order hold, and the delay on record.

    A held number lasts one sampling interval T: line f is weakened by ``sinc(f T)`` and comes half a sample late. Where a
    recording pairs inputs with the voltage that was on the converter, whole samples of latency are taken out already and
    ``delay_samples`` is the fraction of ``latency_samples`` that is left: 0.5 for a hold and nothing else.

    Parameters
    ----------
    sample_rate_hz
        Rate of the converter; infinite where the voltage was measured at the amplifier.
    delay_samples
        By how much the voltage at the amplifier is later than the recorded one, as the inputs show it.
    """

    sample_rate_hz: float = np.inf
    delay_samples: float = 0.5

    def __post_init__(self) -> None:
        if not self.sample_rate_hz > 0.0:
            raise IdentificationError(f"sample_rate_hz: is {self.sample_rate_hz:g} Hz, must be above zero")
        if not np.isfinite(self.delay_samples):
            raise IdentificationError(f"delay_samples: is {self.delay_samples:g}, must be finite")

    def factor(self, frequency_hz: ArrayLike) -> Complex:
        """complex, like ``frequency_hz``: amplitude at the amplifier over the recorded one."""
        ratio = np.asarray(frequency_hz, dtype=np.float64) / self.sample_rate_hz
        return np.asarray(np.sinc(ratio) * np.exp(-2j * np.pi * ratio * self.delay_samples))


@dataclass(frozen=True, eq=False, kw_only=True)
class Exciter:
    """Amplifier, exciter and stinger of one rig; see the module's head for the equations.

    Parameters
    ----------
    force_per_volt_n_v
        g, N per volt at the amplifier's input.
    coil_time_constant_s
        tau.
    moving_mass_kg, suspension_damping_n_s_m, suspension_stiffness_n_m
        m, c, k.
    back_emf_damping_n_s_m
        b.
    stinger_compliance_m_n
        1 / k_s; zero for a rigid one.
    covariance
        float[7, 7], of the parameters in the order of `PARAMETERS`; zero where a value was given, NaN if unknown.
    lowest_hz, highest_hz
        Band that the parameters were found in.
    fit_residual
        Root of the mean square of misfit over expected error; 1 where nothing but noise is left; NaN if unknown.
    hold
        What becomes of a recorded voltage.
    source
        Rig and exciter that the parameters belong to; they hold for no other.
    notes
        What a user should know about these numbers, one line each.

    Raises
    ------
    IdentificationError
        On a value that is not finite, a force per volt that is zero, a covariance of another shape.
    """

    force_per_volt_n_v: float
    coil_time_constant_s: float
    moving_mass_kg: float
    suspension_damping_n_s_m: float
    suspension_stiffness_n_m: float
    back_emf_damping_n_s_m: float
    stinger_compliance_m_n: float = 0.0
    covariance: Float | None = None
    lowest_hz: float = np.nan
    highest_hz: float = np.nan
    fit_residual: float = np.nan
    hold: Hold = Hold()
    source: str = ""
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "notes", tuple(self.notes))
        for name in PARAMETERS:
            if not np.isfinite(getattr(self, name)):
                raise IdentificationError(f"{name}: is {getattr(self, name):g}, must be finite")
        if self.force_per_volt_n_v == 0.0:
            raise IdentificationError("force_per_volt_n_v: is 0, must not be zero")
        size = len(PARAMETERS)
        covariance = np.full((size, size), np.nan) if self.covariance is None else np.array(self.covariance, float)
        if covariance.shape != (size, size):
            raise IdentificationError(f"covariance: shape {covariance.shape}, needs {(size, size)}")
        covariance.setflags(write=False)
        object.__setattr__(self, "covariance", covariance)

    @property
    def values(self) -> Float:
        """float[7]: the parameters in the order of `PARAMETERS`."""
        return np.array([getattr(self, name) for name in PARAMETERS])

    @property
    def std(self) -> dict[str, float]:
        """Standard error of each parameter by name; 0 where a value was given, NaN if unknown."""
        return dict(zip(PARAMETERS, np.sqrt(np.diag(np.asarray(self.covariance))).tolist(), strict=True))

    def force_per_volt(self, s: ArrayLike) -> Complex:
        """complex, like ``s`` (rad/s): ``g_e``, N/V, of the blocked exciter."""
        return np.asarray(self.force_per_volt_n_v / (1.0 + np.asarray(s) * self.coil_time_constant_s))

    def dynamic_stiffness(self, s: ArrayLike) -> Complex:
        """complex, like ``s`` (rad/s): ``Z``, N/m, force that the armature's displacement takes away."""
        s = np.asarray(s, dtype=np.complex128)
        back_emf = self.back_emf_damping_n_s_m / (1.0 + s * self.coil_time_constant_s)
        mechanical = (s * self.moving_mass_kg + self.suspension_damping_n_s_m) * s + self.suspension_stiffness_n_m
        return np.asarray(mechanical + s * back_emf)

    def force(self, voltage: ArrayLike, acceleration: ArrayLike, frequency_hz: ArrayLike) -> Complex:
        """complex: force (N) for amplitudes of recorded voltage (V) and drive-point acceleration (m/s^2); they broadcast.

        ``(1 + Z / k_s) F = g_e V - Z A / s^2``; the voltage is passed through ``hold``.
        """
        frequency = np.asarray(frequency_hz, dtype=np.float64)
        s = 2j * np.pi * frequency
        stiffness = self.dynamic_stiffness(s)
        driving = self.force_per_volt(s) * self.hold.factor(frequency) * np.asarray(voltage)
        reaction = stiffness * np.asarray(acceleration) / s**2
        return np.asarray((driving - reaction) / (1.0 + stiffness * self.stinger_compliance_m_n))

    def electrical(self, amplifier_gain: float) -> dict[str, float]:
        """Force factor, resistance and inductance for a known gain of a voltage amplifier (V/V).

        ``G = b gain / g``, ``R = b (gain / g)^2``, ``L = tau R``.
        """
        ratio = positive("amplifier_gain", amplifier_gain) / self.force_per_volt_n_v
        resistance = self.back_emf_damping_n_s_m * ratio**2
        return {
            "force_factor_n_a": self.back_emf_damping_n_s_m * ratio,
            "resistance_ohm": resistance,
            "inductance_h": self.coil_time_constant_s * resistance,
        }

    def to_arrays(self) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
        """Arrays by name, and the attributes (ready for JSON) that go with them."""
        numbers = (self.lowest_hz, self.highest_hz, self.fit_residual)
        hold = np.array([self.hold.sample_rate_hz, self.hold.delay_samples])
        arrays = {"values": self.values, "covariance": np.asarray(self.covariance), "fit": np.array(numbers)}
        return arrays | {"hold": hold}, {"source": self.source, "notes": list(self.notes)}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]], attributes: Mapping[str, Any]) -> "Exciter":
        """Inverse of `to_arrays`; raises `IdentificationError` if something is missing."""
        try:
            values = finite_array("values", arrays["values"], np.float64, 1)
            lowest, highest, residual = np.asarray(arrays["fit"], dtype=np.float64).tolist()
            rate, delay = np.asarray(arrays["hold"], dtype=np.float64).tolist()
            return cls(
                **dict(zip(PARAMETERS, values.tolist(), strict=True)),
                covariance=arrays["covariance"],
                lowest_hz=lowest,
                highest_hz=highest,
                fit_residual=residual,
                hold=Hold(rate, delay),
                source=attributes["source"],
                notes=tuple(attributes["notes"]),
            )
        except (KeyError, TypeError, ValueError) as error:
            raise IdentificationError(f"exciter: {error} is missing or unknown") from None
