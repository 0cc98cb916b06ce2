"""What the images of the held output do to readings, and to the damping and frequency that a phase resonance test finds.

A converter holds its output, so that the spectrum of an output at f has images at ``k f_s - f`` and ``k f_s + f``. Sampling at
``f_s`` folds what the filters of the inputs leave of them back to f, in force and acceleration. At the ``m`` instants within a
sample at which filters run, the held voltage gives ``y_0 ... y_(m-1)``, whose spectrum at ``f + k f_s`` is
``sum_p y_p exp(-i w_k p T/m) / m``. Each passes the filters. One instant in m is converted, which adds them up.

At phase resonance the force at f is small, that of the images is not. With R the ratio of force to displacement at the drive
point, ``R = (w0^2 - w^2 + 2 i D w0 w)/phi^2`` near a mode, a change of R to R' is taken for a change of the damping ratio by
``Im(R' - R)/Im(R)`` of itself, and of the frequency by ``D Re(R' - R)/Im(R)`` of itself.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from simulators.analysis.frequency_responses import check_below_half, frequency_response
from simulators.plant.compilation import phi_matrices
from simulators.sensing.filters import channel_sections
from simulators.virtual_rig import VirtualRig
from vibrolock.arrays import Complex, Float


@dataclass(frozen=True)
class ImageBias:
    """Relative errors of a mode's damping ratio and frequency at phase resonance."""

    damping: float
    frequency: float
    force_n_per_v: complex
    """Error of the force that amounts to this, per V of the output's amplitude, N/V: real in phase with the force at phase
    resonance, imaginary ahead of it. It hardly depends on the force, which is large where the damping is."""


def image_bias(rig: VirtualRig, near_hz: float, *, force: str, drive: str) -> ImageBias:
    """Return the bias in one linear mode of a rig.

    Not modelled: a reconstruction filter, a motion so large that the structure is nonlinear, other harmonics.

    Parameters
    ----------
    rig
        The virtual rig.
    near_hz
        Frequency next to which the mode is, Hz.
    force
        Name of the force sensor at the drive point.
    drive
        Name of the motion sensor there.
    """
    modes = rig.linear_modes
    mode = modes.nearest(near_hz)
    at_hz = [float(modes.frequency_hz[mode])]
    true, images = frequency_response(rig, at_hz), image_shares(rig, at_hz)
    stiffness = 1.0 / true.receptance_m_per_n[rig.stinger.at][0]
    wrong = stiffness * ((1.0 + images[force][0]) / (1.0 + images[drive][0]) - 1.0)
    error = wrong / stiffness.imag
    held = np.sinc(at_hz[0] / rig.converter.sample_rate_hz)
    moved = held * abs(true.displacement_m_per_v[rig.stinger.at][0])
    return ImageBias(
        damping=float(error.imag),
        frequency=float(modes.damping_ratio[mode] * error.real),
        force_n_per_v=complex(-1j * wrong * moved),  # the force is a quarter period ahead of the displacement
    )


def image_shares(rig: VirtualRig, frequencies_hz: ArrayLike) -> dict[str, Complex]:
    """Return the images in the readings of every sensor, relative to what it reads of the voltage itself, complex[n].

    The rig is linear, with elements at their linear stiffness and joints stuck. Not modelled: a reconstruction filter.

    Raises `ValueError` if a frequency is not above 0 and below half the sample rate.

    Parameters
    ----------
    rig
        The virtual rig.
    frequencies_hz
        Frequencies, float[n], Hz.
    """
    converter, true = rig.converter, frequency_response(rig, frequencies_hz)
    rate_hz, count, step_s = converter.sample_rate_hz, converter.oversampling, 1.0 / converter.internal_rate_hz
    check_below_half(true.frequency_hz, rate_hz)
    s = 2j * np.pi * (true.frequency_hz[:, None] + rate_hz * np.arange(count))
    turned = np.exp(-s[:, :, None] * step_s * np.arange(count)) / count
    hold = -np.expm1(-s[:, 0] / rate_hz) / s[:, 0] * rate_hz
    sections, states = channel_sections(rig.sensors, converter), _states_within_a_sample(rig, true.frequency_hz)
    shares = {}
    for channel, sensor in enumerate(rig.sensors):
        row = rig.output_row(sensor)
        instants = states @ row[: rig.plant.dynamics.shape[0]] + row[rig.plant.dynamics.shape[0]]
        passed = _filtered(sections[:, :, channel], np.exp(s * step_s))
        read = np.sum(passed * np.einsum("fkp,fp->fk", turned, instants), axis=1)
        shares[sensor.name] = read / (passed[:, 0] * hold * true.sensor_per_v[sensor.name]) - 1.0
    return shares


def _states_within_a_sample(rig: VirtualRig, frequency_hz: Float) -> Complex:
    """complex[n_frequency, n_instant, n]: states per held voltage, at the instants of a sample at which filters run."""
    plant, converter = rig.plant, rig.converter
    column, eye = plant.voltage_column[:, None], np.eye(plant.dynamics.shape[0])
    sample = phi_matrices(plant.dynamics, column, 1.0 / converter.sample_rate_hz)
    within = phi_matrices(plant.dynamics, column, 1.0 / converter.internal_rate_hz)
    z = np.exp(2j * np.pi * frequency_hz / converter.sample_rate_hz)
    state = np.linalg.solve(z[:, None, None] * eye - sample.transition, sample.held[None])[:, :, 0]
    found = [state]
    for _ in range(1, converter.oversampling):
        found.append(found[-1] @ within.transition.T + within.held[:, 0])
    return np.stack(found, axis=1)


def _filtered(sections: Float, z: Complex) -> Complex:
    """Response of filter sections, float[n_section, 5], at ``z``; of the shape of ``z``."""
    out = np.ones(z.shape, np.complex128)
    for b_0, b_1, b_2, a_1, a_2 in sections:
        out *= (b_0 + b_1 / z + b_2 / z**2) / (1.0 + a_1 / z + a_2 / z**2)
    return out
