"""Structured models that tests share."""

import numpy as np

from identification import Channel, LinearModes
from identification.models.structured.elements import NonlinearElement
from identification.models.structured.laws import Iwan, Jenkins, PolynomialDamper, PolynomialSpring
from identification.models.structured.model import StructuredModel

FORCE = Channel("force", "force", "N")
OUTPUTS = (Channel("drive", "drive", "m/s2"), Channel("tip", "response", "m/s"), Channel("middle", "response", "m"))
RATE_HZ = 1000.0


def beam(**changes) -> StructuredModel:
    """Two modes and two elements of different kinds with sliders, the second one softening beyond its reach."""
    numbers = {
        "frequency_hz": [25.0, 140.0],
        "damping_ratio": [0.01, 0.02],
        "input_shapes": [[0.9], [1.6]],
        "output_shapes": [[0.9, 1.6], [1.4, -0.5], [0.5, 0.3]],
        "direct": [[0.01], [0.0], [0.0]],
        "elements": (
            NonlinearElement(
                direction=[0.9, -0.1],
                scale_m=1e-3,
                laws=(PolynomialSpring((3.0, 1.5, 0.5, 0.2)), PolynomialDamper((0.4, 0.1)), Jenkins(2.0, 0.3)),
            ),
            NonlinearElement(
                direction=[1.4, 0.7],
                scale_m=2e-3,
                laws=(PolynomialSpring((-1.0, -2.0)), Iwan(stiffness_n=3.0, slip=2.0, count=3)),
                reach=1.0,
            ),
        ),
        "sample_rate_hz": RATE_HZ,
        "inputs": (FORCE,),
        "outputs": OUTPUTS,
        "support_n_m": 800.0,
    }
    return StructuredModel(**(numbers | changes))


def linear_modes(model: StructuredModel, modes: int) -> LinearModes:
    """The lowest modes of a model, with the static receptance of the others as the residual above."""
    n, upper = (
        len(model.outputs),
        model.output_shapes[:, modes:] @ (model.input_shapes[modes:, 0] / model.omega[modes:] ** 2),
    )
    return LinearModes(
        channels=model.outputs,
        frequency_hz=model.frequency_hz[:modes],
        frequency_std_hz=np.zeros(modes),
        damping_ratio=model.damping_ratio[:modes],
        damping_ratio_std=np.zeros(modes),
        shapes=model.output_shapes[:, :modes],
        shapes_std=np.zeros((n, modes)),
        phase_collinearity=np.ones(modes),
        lower=np.zeros(n, complex),
        upper=upper.astype(complex),
        lowest_hz=15.0,
        highest_hz=35.0,
        upper_hz=float(model.frequency_hz[-1]) * 0.8,
    )


def multisine(
    rms_n: float, seed: int, samples: int = 2000, lowest_hz: float = 15.0, highest_hz: float = 35.0
) -> np.ndarray:
    """float[1, samples], one period with random phases."""
    spectrum = np.zeros(samples // 2 + 1, complex)
    frequency_hz = np.fft.rfftfreq(samples, 1.0 / RATE_HZ)
    lines = (frequency_hz >= lowest_hz) & (frequency_hz <= highest_hz)
    spectrum[lines] = np.exp(2j * np.pi * np.random.default_rng(seed).random(int(lines.sum())))
    u = np.fft.irfft(spectrum, samples)
    return (rms_n * u / np.std(u))[None]
