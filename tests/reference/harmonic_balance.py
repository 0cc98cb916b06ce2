"""Periodic states of the coupled rig, exciter included, driven by the voltage u = U cos(theta).

Harmonics of the force may be prescribed instead (`Balance`); the voltage then has those harmonics too.

Convention: y(t) = Re sum_h Y_h exp(i h theta); lag = arg F_1 - arg A_1 with the true drive-point acceleration, -90 deg
at phase resonance.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tests.reference.balance import Balance, Conditions
from tests.reference.coupled_rig import CoupledRig
from vibrolock.arrays import Complex, Float

HARMONICS = 15
SAMPLES = 256
RESONANCE_DEG = -90.0
# newtons or volts at which both rigs are linear enough for the linear start
LOW_LEVEL = 0.02


@dataclass(frozen=True, eq=False)
class Periodic:
    """One periodic state; harmonics are complex with shape (H + 1,), index 0 the mean.

    `voltages_v` holds the whole voltage: the fundamental, and what prescribed harmonics of the force take.
    """

    rig: CoupledRig
    omega_rad_s: float
    voltage_v: float
    voltages_v: Complex
    magnet_m: Complex
    delta: Complex
    force_n: Complex
    drive_m: Complex

    @property
    def frequency_hz(self) -> float:
        return self.omega_rad_s / (2.0 * np.pi)

    @property
    def force_amplitude_n(self) -> float:
        """Peak of the fundamental of the measured force."""
        return float(abs(self.force_n[1]))

    @property
    def lag_deg(self) -> float:
        """arg F_1 - arg A_1, wrapped to (-180, 180]."""
        return float(np.degrees(np.angle(-self.force_n[1] / self.drive_m[1])))

    @property
    def modal_amplitude(self) -> float:
        """|X_d1| / phi_d with the mode shape of the linear structure, magnets included, friction stuck."""
        return float(abs(self.drive_m[1])) / self.rig.linear_mode[1]

    @property
    def active_power_w(self) -> Float:
        """Mean power through the stinger per harmonic, shape (H + 1,)."""
        order = np.arange(self.force_n.size)
        return 0.5 * np.real(self.force_n * np.conj(1j * order * self.omega_rad_s * self.drive_m))

    @property
    def damping_ratio(self) -> float:
        """Active power of the fundamental over Omega^3 q^2."""
        return float(self.active_power_w[1]) / (self.omega_rad_s**3 * self.modal_amplitude**2)

    @property
    def damping_ratio_of_total_power(self) -> float:
        """Active power of all harmonics over Omega^3 q^2."""
        return float(self.active_power_w.sum()) / (self.omega_rad_s**3 * self.modal_amplitude**2)

    def waveform(self, harmonics: Complex, theta_rad: Float) -> Float:
        """Sum a harmonic series at the given phases."""
        order = np.arange(harmonics.size)
        return np.real(np.exp(1j * np.outer(theta_rad, order)) @ harmonics)


def solve(balance: Balance, conditions: Conditions, start: Float, tolerance: float = 1e-10) -> tuple[Float, Float]:
    """Newton from `start`; the unknowns and the Jacobian there. ArithmeticError when a dozen steps do not do."""
    y, scale = start.copy(), np.ones_like(start)
    # displacements and slips are of the order of millimetres
    scale[: 2 * balance.size] = 1e-3
    for _ in range(12):
        value, jacobian = balance.residual(y, conditions)
        if float(np.max(np.abs(value / scale))) < tolerance:
            return y, jacobian
        y = y - np.linalg.solve(jacobian, value)
    raise ArithmeticError(f"no convergence with {conditions}")


def linear_start(balance: Balance, conditions: Conditions) -> Float:
    """Solution of the rig with linearised magnets and stuck clamp, closing conditions met roughly."""
    rig = balance.rig
    k_lin = -float(rig.magnet_slope(np.zeros(1))[0])
    omega = conditions.omega_rad_s or rig.linear_mode[0]
    transfer = balance.transfer(omega)[0][1]
    z, delta, force, _ = transfer[:, 2] - transfer[:, 0] * k_lin * transfer[0, 2] / (1.0 + transfer[0, 0] * k_lin)
    voltage = conditions.voltage_v
    if voltage is None:
        voltage = float((conditions.force_n or 0.0) / abs(force))
    first = np.zeros(balance.harmonics + 1, complex)
    first[1] = voltage
    return balance.unknowns(z * first, delta * first, omega, voltage)


def periodic(balance: Balance, y: Float) -> Periodic:
    """Unknowns to a named state."""
    response = balance.responses(y)[0]
    magnet, delta, force, drive = response.T
    voltages = balance.voltages(y[-2], force, drive)
    voltages[1] = y[-1]
    return Periodic(balance.rig, float(y[-2]), float(y[-1]), voltages, magnet, delta, force, drive)


def sequence(balance: Balance, points: Sequence[Conditions]) -> list[Periodic]:
    """Solve one condition after the other, each continued from the last, the first from the nearly linear rig.

    The points share what closes the frequency; force or voltage is the path parameter, predicted along the tangent
    and stepped more finely where Newton does not arrive.
    """
    here = points[0].at_level(min(LOW_LEVEL, points[0].level))
    y, jacobian = solve(balance, here, linear_start(balance, here))
    states = []
    for goal in points:
        y, jacobian = _continue(balance, here, goal, y, jacobian)
        here = goal
        states.append(periodic(balance, y))
    return states


def _continue(
    balance: Balance, here: Conditions, goal: Conditions, y: Float, jacobian: Float, depth: int = 0
) -> tuple[Float, Float]:
    """One step of `sequence`, halved on failure."""
    by_level = np.zeros_like(y)
    by_level[-1] = 1.0 if goal.force_n is None else 2.0 / here.level
    try:
        return solve(balance, goal, y + np.linalg.solve(jacobian, by_level) * (goal.level - here.level))
    except ArithmeticError:
        if depth > 8:
            raise
    middle = goal.at_level(0.5 * (here.level + goal.level))
    y, jacobian = _continue(balance, here, middle, y, jacobian, depth + 1)
    return _continue(balance, middle, goal, y, jacobian, depth + 1)


def backbone(
    rig: CoupledRig,
    forces_n: Sequence[float],
    lag_deg: float = RESONANCE_DEG,
    force_ratios: Mapping[int, complex] | None = None,
) -> list[Periodic]:
    """Phase-resonant states with the given peaks of the fundamental force, lowest first."""
    points = [Conditions(force_n=force, lag_deg=lag_deg) for force in forces_n]
    return sequence(Balance(rig, HARMONICS, SAMPLES, force_ratios), points)


def backbone_at_voltages(
    rig: CoupledRig, voltages_v: Sequence[float], lag_deg: float = RESONANCE_DEG
) -> list[Periodic]:
    """Phase-resonant states at the given voltage amplitudes, lowest first."""
    points = [Conditions(voltage_v=voltage, lag_deg=lag_deg) for voltage in voltages_v]
    return sequence(Balance(rig, HARMONICS, SAMPLES), points)


def response_to_voltage(rig: CoupledRig, voltages_v: Sequence[float], frequency_hz: float) -> list[Periodic]:
    """States at one excitation frequency and the given voltage amplitudes, lowest first."""
    points = [Conditions(voltage_v=voltage, omega_rad_s=2.0 * np.pi * frequency_hz) for voltage in voltages_v]
    return sequence(Balance(rig, HARMONICS, SAMPLES), points)
