"""An electrodynamic exciter with its amplifier and stinger, as a linear model from voltage and motion to force.

With ``s = i W``, the voltage V at the amplifier's input, the displacements X_d of the drive point and X_a of the armature,

    F = g_e V - Z X_a,    X_a = X_d + r_s F,    r_s = (1 / k_s) / (1 + s T),
    g_e = g / (1 + s tau),    Z = s^2 m + s c + k + s b / (1 + s tau),

with g the force per volt of the blocked exciter at low frequency (amplifier gain times G / R), tau = L / R the time constant
of the coil, m the moving mass, c and k damping and stiffness of the suspension, b = G^2 / R the damping by back-EMF, 1 / k_s
the compliance of the stinger, and T its damping over its stiffness. For a current amplifier b = 0.

The recorded voltage is the number sent to a converter, and the inputs that measure force and motion have filters.
`VoltagePath` models the path from this number to the amplifier.
"""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from identification.errors import IdentificationError
from identification.storage import stored
from identification.validation import positive, shaped_array
from vibrolock.arrays import Complex, Float
from vibrolock.results import Result

PARAMETERS = (
    "force_per_volt_n_v",
    "coil_time_constant_s",
    "moving_mass_kg",
    "suspension_damping_n_s_m",
    "suspension_stiffness_n_m",
    "back_emf_damping_n_s_m",
    "stinger_compliance_m_n",
    "stinger_damping_time_s",
)
"""The parameters g, tau, m, c, k, b, 1/k_s, T, in the order of `Exciter.covariance`."""


@dataclass(frozen=True)
class VoltagePath:
    """Transfer factor from the recorded voltage to the voltage at the amplifier, relative to the filtered inputs.

    The zero-order hold of a sampling interval T attenuates line f by ``sinc(f T)`` and delays it by half a sample. A
    recording compensates the latency between voltage and inputs only by whole samples. The remaining latency, the delay of
    anti-aliasing filters, and the aliases of the images of the held output act at low frequency as one delay D with a first
    correction. Force and motion pass the same AC coupling of their conditioners, the voltage does not:

        factor = sinc(f T) exp(-s D + s^3 D_3) s / (s + 2 pi f_c).

    Parameters
    ----------
    sample_rate_hz
        Sample rate of the converter; infinite if the voltage was measured at the amplifier.
    delay_s, dispersion_s3
        D and D_3.
    coupling_hz
        f_c, corner of the first-order high-pass of both force and motion; 0 for none.
    """

    sample_rate_hz: float = np.inf
    delay_s: float = 0.0
    dispersion_s3: float = 0.0
    coupling_hz: float = 0.0

    def __post_init__(self) -> None:
        IdentificationError.unless_above("sample_rate_hz", self.sample_rate_hz, 0.0)
        for name in ("delay_s", "dispersion_s3", "coupling_hz"):
            if not np.isfinite(getattr(self, name)):
                raise IdentificationError(field=name, value=getattr(self, name), allowed="finite")

    def factor(self, frequency_hz: ArrayLike) -> Complex:
        """complex, like ``frequency_hz`` (Hz, above zero): amplitude at the amplifier over the recorded one."""
        frequency = np.asarray(frequency_hz, dtype=np.float64)
        s = 2j * np.pi * frequency
        late = np.sinc(frequency / self.sample_rate_hz) * np.exp(s * (s**2 * self.dispersion_s3 - self.delay_s))
        return np.asarray(late * s / (s + 2.0 * np.pi * self.coupling_hz))


@dataclass(frozen=True, eq=False, kw_only=True)
class ExciterLines:
    """Measured lines with which an exciter was identified, as means over the realisations."""

    frequency_hz: Float
    """float[n]."""
    force_per_volt: Complex
    acceleration_per_volt: Complex
    """complex[n], force (N) and drive-point acceleration (m/s^2) per recorded volt."""
    noise: Float
    """float[n], standard error of the force that the model leaves over, N/V."""

    def __post_init__(self) -> None:
        for name in ("frequency_hz", "force_per_volt", "acceleration_per_volt", "noise"):
            kind = np.complex128 if "per_volt" in name else np.float64
            object.__setattr__(self, name, shaped_array(name, getattr(self, name), kind, (len(self.frequency_hz),)))


def _upgrade(arrays: dict[str, NDArray[Any]], attributes: dict[str, Any]) -> None:
    """Name the numbers of earlier files, which hold them in three arrays."""
    if "values" not in arrays:
        return
    values = arrays.pop("values")
    if values.size != len(PARAMETERS):
        raise IdentificationError(
            f"has {values.size} parameters",
            field="exciter",
            allowed=f"{len(PARAMETERS)} ({', '.join(PARAMETERS)})",
            hint="identify it again",
        )
    for names, numbers in (
        (PARAMETERS, values),
        (("lowest_hz", "highest_hz", "fit_residual"), arrays.pop("fit", np.zeros(0))),
    ):
        attributes |= dict(zip(names, numbers.tolist(), strict=True))
    path = [one.name for one in fields(VoltagePath)]
    attributes["path"] = dict(zip(path, arrays.pop("path", np.zeros(0)).tolist(), strict=True))


@stored(upgrade=_upgrade)
@dataclass(frozen=True, eq=False, kw_only=True)
class Exciter(Result):
    """Amplifier, exciter and stinger of one rig; the module docstring has the equations.

    Raises `IdentificationError` if a value is not finite, the force per volt is zero, or the covariance has a wrong shape.

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
    stinger_damping_time_s
        T; zero for one without damping.
    covariance
        float[8, 8], covariance of the parameters in the order of `PARAMETERS`; zero where a value was given, NaN if unknown.
    lowest_hz, highest_hz
        Band in which the parameters were identified.
    fit_residual
        RMS of residual over expected error; 1 if only noise is left; NaN if unknown.
    path
        Path of a recorded voltage to the amplifier.
    source
        Rig and exciter of the parameters, which are not valid for any other.
    notes
        Remarks on the quality of the parameters, one line each.
    lines
        Measured lines of the identification; None if they were not kept.
    """

    force_per_volt_n_v: float
    coil_time_constant_s: float
    moving_mass_kg: float
    suspension_damping_n_s_m: float
    suspension_stiffness_n_m: float
    back_emf_damping_n_s_m: float
    stinger_compliance_m_n: float = 0.0
    stinger_damping_time_s: float = 0.0
    covariance: Float | None = None
    lowest_hz: float = np.nan
    highest_hz: float = np.nan
    fit_residual: float = np.nan
    path: VoltagePath = VoltagePath()
    source: str = ""
    notes: tuple[str, ...] = ()
    lines: ExciterLines | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "notes", tuple(self.notes))
        for name in PARAMETERS:
            if not np.isfinite(getattr(self, name)):
                raise IdentificationError(field=name, value=getattr(self, name), allowed="finite")
        if self.force_per_volt_n_v == 0.0:
            raise IdentificationError("must not be zero", field="force_per_volt_n_v", value=0)
        size = len(PARAMETERS)
        covariance = np.full((size, size), np.nan) if self.covariance is None else np.array(self.covariance, float)
        if covariance.shape != (size, size):
            raise IdentificationError(f"shape {covariance.shape}", field="covariance", allowed=f"{(size, size)}")
        covariance.setflags(write=False)
        object.__setattr__(self, "covariance", covariance)

    @property
    def values(self) -> Float:
        """float[8]: the parameters in the order of `PARAMETERS`."""
        return np.array([getattr(self, name) for name in PARAMETERS])

    @property
    def std(self) -> dict[str, float]:
        """Standard error of each parameter by name; 0 where a value was given, NaN if unknown."""
        return dict(zip(PARAMETERS, np.sqrt(np.diag(np.asarray(self.covariance))).tolist(), strict=True))

    def force_per_volt(self, s: ArrayLike) -> Complex:
        """complex, like ``s`` (rad/s): force per volt ``g_e`` of the blocked exciter, N/V."""
        return np.asarray(self.force_per_volt_n_v / (1.0 + np.asarray(s) * self.coil_time_constant_s))

    def dynamic_stiffness(self, s: ArrayLike) -> Complex:
        """complex, like ``s`` (rad/s): dynamic stiffness ``Z``, N/m, the force lost per armature displacement."""
        s = np.asarray(s, dtype=np.complex128)
        back_emf = self.back_emf_damping_n_s_m / (1.0 + s * self.coil_time_constant_s)
        mechanical = (s * self.moving_mass_kg + self.suspension_damping_n_s_m) * s + self.suspension_stiffness_n_m
        return np.asarray(mechanical + s * back_emf)

    def stinger_compliance(self, s: ArrayLike) -> Complex:
        """complex, like ``s`` (rad/s): compliance ``r_s`` of the stinger, m/N."""
        return np.asarray(self.stinger_compliance_m_n / (1.0 + np.asarray(s) * self.stinger_damping_time_s))

    @property
    def damping_n_s_m(self) -> tuple[float, float]:
        """``c + b`` at low frequency and its standard error, N s/m; accurate even if c and b cannot be separated."""
        both = [PARAMETERS.index("suspension_damping_n_s_m"), PARAMETERS.index("back_emf_damping_n_s_m")]
        variance = float(np.sum(np.asarray(self.covariance)[np.ix_(both, both)]))
        return float(np.sum(self.values[both])), float(np.sqrt(max(variance, 0.0)))

    def force(self, voltage: ArrayLike, acceleration: ArrayLike, frequency_hz: ArrayLike) -> Complex:
        """complex: force (N) for amplitudes of recorded voltage (V) and drive-point acceleration (m/s^2), broadcast together.

        ``(1 + Z r_s) F = g_e V - Z A / s^2``; the voltage is passed through ``path``.
        """
        frequency = np.asarray(frequency_hz, dtype=np.float64)
        s = 2j * np.pi * frequency
        stiffness = self.dynamic_stiffness(s)
        driving = self.force_per_volt(s) * self.path.factor(frequency) * np.asarray(voltage)
        reaction = stiffness * np.asarray(acceleration) / s**2
        return np.asarray((driving - reaction) / (1.0 + stiffness * self.stinger_compliance(s)))

    def electrical(self, amplifier_gain: float) -> dict[str, float]:
        """Return force factor, resistance and inductance for a known gain of a voltage amplifier (V/V).

        ``G = b gain / g``, ``R = b (gain / g)^2``, ``L = tau R``.
        """
        ratio = positive("amplifier_gain", amplifier_gain) / self.force_per_volt_n_v
        resistance = self.back_emf_damping_n_s_m * ratio**2
        return {
            "force_factor_n_a": self.back_emf_damping_n_s_m * ratio,
            "resistance_ohm": resistance,
            "inductance_h": self.coil_time_constant_s * resistance,
        }
