"""Frequency responses of the linear rig, with elements at their linear stiffness and joints stuck."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from simulators.analysis.conditions import positive
from simulators.plant.assembly import LinearPlant
from simulators.plant.compilation import phi_matrices
from simulators.virtual_rig import VirtualRig
from vibrolock.arrays import Complex, Float
from vibrolock.errors import InputError


@dataclass(frozen=True, eq=False, kw_only=True)
class FrequencyResponses:
    """Frequency responses of a rig, ``Y = H U`` for ``exp(i w t)``, to the true quantities, not to the sensors' signals."""

    frequency_hz: Float
    """Frequencies [n]."""
    held: bool
    """False: the plant itself, in continuous time. True: the voltage held between samples, outputs read at the samples."""
    force_n_per_v: Complex
    """Stinger force per voltage [n]."""
    sensor_per_v: dict[str, Complex]
    """True quantity at each sensor per voltage, by channel name [n], N/V or m/s^2/V."""
    displacement_m_per_v: dict[str, Complex]
    """Displacement of each named point per voltage [n]."""
    receptance_m_per_n: dict[str, Complex]
    """Displacement of each named point per force at the drive point, structure alone, continuous time [n].

    In continuous time the ratio of displacement to stinger force in the coupled rig is the same.
    """

    @property
    def accelerance_per_kg(self) -> dict[str, Complex]:
        """Return the acceleration of each named point per force at the drive point, structure alone [n] (m/s^2/N = 1/kg)."""
        omega = 2.0 * np.pi * self.frequency_hz
        return {at: -(omega**2) * receptance for at, receptance in self.receptance_m_per_n.items()}


def check_below_half(frequencies_hz: Float, rate_hz: float) -> None:
    """Raise `ValueError` if a frequency is not below half the sample rate."""
    if np.max(frequencies_hz) >= 0.5 * rate_hz:
        allowed = f"below {0.5 * rate_hz:g}, half the sample rate"
        raise InputError(field="frequencies_hz", value=np.max(frequencies_hz), allowed=allowed)


def frequency_response(rig: VirtualRig, frequencies_hz: ArrayLike, *, held: bool = False) -> FrequencyResponses:
    """Return the linear frequency responses at some frequencies.

    Raises `ValueError` if a frequency is not above 0 or, with ``held``, not below half the sample rate.

    Parameters
    ----------
    rig
        The virtual rig.
    frequencies_hz
        Frequencies, float[n], Hz.
    held
        Whether the voltage is held by the converter between samples. The images of the held voltage above half the sample
        rate, which sampling folds back, are then included. Near a lightly damped resonance the force is so small that these
        images matter.
    """
    frequencies = positive("frequencies_hz", frequencies_hz)
    plant, points, rate_hz = rig.plant, rig.structure.points, rig.converter.sample_rate_hz
    if held:
        check_below_half(frequencies, rate_hz)
    s = np.asarray(2j * np.pi * frequencies, dtype=np.complex128)
    if held:  # (e^{sT} - e^{AT})^-1 Gamma: state at the sample instants
        phi = phi_matrices(plant.dynamics, plant.voltage_column[:, None], 1.0 / rate_hz)
        states = _states(phi.transition, phi.held[:, 0], np.exp(s * (1.0 / rate_hz)))
    else:
        states = _states(plant.dynamics, plant.voltage_column, s)
    n = plant.dynamics.shape[0]
    shapes = {at: rig.shape(at) for at in points}

    def output(row: Float) -> Complex:
        return np.asarray(states @ row[:n] + row[n])

    return FrequencyResponses(
        frequency_hz=frequencies,
        held=held,
        force_n_per_v=output(plant.force_row()),
        sensor_per_v={sensor.name: output(rig.output_row(sensor)) for sensor in rig.sensors},
        displacement_m_per_v={at: output(plant.displacement_row(shape)) for at, shape in shapes.items()},
        receptance_m_per_n=_receptances(plant, shapes, s),
    )


def _states(transition: Float, column: Float, z: Complex) -> Complex:
    """Return ``(z - A)^-1 b`` for every z [n_frequency, n]."""
    left = z[:, None, None] * np.eye(column.size) - transition
    return np.asarray(np.linalg.solve(left, np.broadcast_to(column[:, None], (z.size, column.size, 1)))[..., 0])


def _receptances(plant: LinearPlant, shapes: dict[str, Float], s: Complex) -> dict[str, Complex]:
    """Return ``phi_p (s^2 + s C + K)^-1 phi_d`` for every point p."""
    m = plant.n_mode
    left = s[:, None, None] * np.diag(plant.modal_damping) + plant.modal_stiffness + (s**2)[:, None, None] * np.eye(m)
    drive = np.broadcast_to(plant.drive_shape[:, None], (s.size, m, 1))
    modal = np.linalg.solve(left, drive)[..., 0]
    return {at: np.asarray(modal @ shape) for at, shape in shapes.items()}
