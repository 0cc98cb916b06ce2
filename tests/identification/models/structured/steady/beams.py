"""Structured models for steady responses: one with springs and dampers, one with friction."""

import numpy as np

from identification import Channel
from identification.models.structured.elements import NonlinearElement
from identification.models.structured.laws import BoucWen, Iwan, Jenkins, PolynomialDamper, PolynomialSpring, Stop
from identification.models.structured.model import StructuredModel

OUTPUTS = (Channel("drive", "drive", "m/s2"), Channel("tip", "response", "m/s"), Channel("middle", "response", "m"))


def beam(
    *elements: NonlinearElement, rate_hz: float = 1000.0, steps: int = 2, support_n_m: float = 0.0
) -> StructuredModel:
    return StructuredModel(
        frequency_hz=[25.0, 140.0],
        damping_ratio=[0.01, 0.02],
        input_shapes=[[0.9], [1.6]],
        output_shapes=[[0.9, 1.6], [1.4, -0.5], [0.5, 0.3]],
        direct=[[0.01], [0.0], [0.0]],
        elements=elements,
        sample_rate_hz=rate_hz,
        inputs=(Channel("force", "force", "N"),),
        outputs=OUTPUTS,
        steps=steps,
        support_n_m=support_n_m,
    )


def smooth(**changes) -> StructuredModel:
    """A hardening, asymmetric spring with a damper, a stop at another place, and the support."""
    spring = NonlinearElement(
        direction=[0.9, -0.1],
        scale_m=1e-3,
        laws=(PolynomialSpring((1.0, 2.5)), PolynomialDamper((0.4, 0.1))),
    )
    stop = NonlinearElement(direction=[1.4, 0.7], scale_m=2e-3, laws=(Stop(stiffness_n=4.0, gap=0.4),))
    return beam(spring, stop, **({"support_n_m": 800.0} | changes))


def friction(**changes) -> StructuredModel:
    """A slider and an Iwan joint."""
    slider = NonlinearElement(direction=[0.9, -0.1], scale_m=1e-3, laws=(Jenkins(stiffness_n=3.0, slip=0.2),))
    joint = NonlinearElement(direction=[0.3, 0.5], scale_m=1e-3, laws=(Iwan(stiffness_n=6.0, slip=0.8),))
    return beam(slider, joint, **changes)


def hysteresis(**changes) -> StructuredModel:
    """Two hystereses of Bouc and Wen, one that softens and one that hardens."""
    softening = NonlinearElement(direction=[0.9, -0.1], scale_m=1e-3, laws=(BoucWen(3.0, 0.3, 1.5, 0.5),))
    hardening = NonlinearElement(direction=[0.3, 0.5], scale_m=1e-3, laws=(BoucWen(6.0, 0.8, 1.0, -1.375),))
    return beam(softening, hardening, **changes)


def settled(model: StructuredModel, force_n: float, samples: int, periods: int) -> tuple[np.ndarray, float]:
    """Harmonics of the outputs in the last period of a run under a cosine, complex[H + 1, n_outputs], and their last change."""
    u = force_n * np.cos(2.0 * np.pi * np.arange(periods * samples) / samples)
    outputs = model.simulate(u[None]).outputs
    last, before = (outputs[:, -k * samples :][:, :samples] for k in (1, 2))
    harmonics = np.fft.rfft(last, axis=1).T / samples
    harmonics[1:] *= 2.0
    change = np.max(np.abs(last - before), axis=1) / np.max(np.abs(last), axis=1)
    return harmonics, float(np.max(change))
