"""What the images of the held output do to a phase resonance test without an anti-alias filter.

A converter holds its output, so that the spectrum of an output at f has images at ``k f_s - f`` and ``k f_s + f``. Sampling at
``f_s`` folds their part of force and acceleration back to f. At phase resonance the force at f is small, that of the images is
not. With R the ratio of force to displacement at the drive point, ``R = (w0^2 - w^2 + 2 i D w0 w)/phi^2`` near a mode, a
change of R to R' is taken for a change of the damping ratio by ``Im(R' - R)/Im(R)`` of itself, and of the frequency by
``D Re(R' - R)/Im(R)`` of itself.
"""

from dataclasses import dataclass

import numpy as np

from simulators.analysis.frequency_responses import frequency_response
from simulators.virtual_rig import VirtualRig


@dataclass(frozen=True)
class ImageBias:
    """Relative errors of a mode's damping ratio and frequency at phase resonance."""

    damping: float
    frequency: float
    force_n_per_v: complex
    """Error of the force that amounts to this, per V of the output's amplitude, N/V: real in phase with the force at phase
    resonance, imaginary ahead of it. It hardly depends on the force, which is large where the damping is."""


def image_bias(rig: VirtualRig, near_hz: float, *, force: str, drive: str) -> ImageBias:
    """Return the bias in one linear mode of a rig whose sensors have no filter.

    Not modelled: filters, a motion so large that the structure is nonlinear, other harmonics.

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
    true, sampled = frequency_response(rig, at_hz), frequency_response(rig, at_hz, held=True)
    change = (sampled.sensor_per_v[force] / sampled.sensor_per_v[drive]) * (
        true.sensor_per_v[drive] / true.sensor_per_v[force]
    )
    stiffness = 1.0 / true.receptance_m_per_n[rig.stinger.at][0]
    wrong = stiffness * (change[0] - 1.0)
    error = wrong / stiffness.imag
    held = np.sinc(at_hz[0] / rig.converter.sample_rate_hz)
    moved = held * abs(true.displacement_m_per_v[rig.stinger.at][0])
    return ImageBias(
        damping=float(error.imag),
        frequency=float(modes.damping_ratio[mode] * error.real),
        force_n_per_v=complex(-1j * wrong * moved),  # the force is a quarter period ahead of the displacement
    )
