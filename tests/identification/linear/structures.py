"""Linear structures with known modes, and responses measured on them."""

import numpy as np

from identification import Channel, FrequencyResponseMatrix

FREQUENCY_HZ = np.array([20.0, 33.0, 61.0])
DAMPING = np.array([0.004, 0.008, 0.002])
SHAPES = np.array([[0.9, 0.7, 1.2], [1.3, -0.4, 0.5]])
FAR_HZ, FAR_SHAPE = 140.0, np.array([1.1, -0.8])
CHANNELS = (Channel("drive", "drive", "m/s2"), Channel("tip", "response", "m/s2"))
FORCE = (Channel("force", "force", "N"),)
LINES_HZ = np.arange(10.0, 80.0, 0.05)


def accelerance(
    frequency_hz: np.ndarray = LINES_HZ,
    poles_hz: np.ndarray = FREQUENCY_HZ,
    damping: np.ndarray = DAMPING,
    shapes: np.ndarray = SHAPES,
) -> np.ndarray:
    """complex[n, 2]: three modes, rigid-body motion of 3 kg and an undamped mode far above."""
    s = 2j * np.pi * frequency_hz[:, None]
    omega, far = 2 * np.pi * poles_hz, 2 * np.pi * FAR_HZ
    modal = s**2 / (s**2 + 2 * damping * omega * s + omega**2)
    return modal @ (shapes * shapes[0]).T + 1 / 3.0 + s**2 / (s**2 + far**2) * FAR_SHAPE * FAR_SHAPE[0]


def measured(
    seed: int = 0, noise: float = 0.0, exact: np.ndarray | None = None, realisations: int = 5
) -> FrequencyResponseMatrix:
    """Mean of noisy realisations with the covariance of the mean; the force's noise is common to both outputs.

    The force is small where the structure resonates, so that its noise counts most there.
    """
    random = np.random.default_rng(seed)
    exact = accelerance() if exact is None else exact
    if not noise:
        return FrequencyResponseMatrix(outputs=CHANNELS, inputs=FORCE, frequency_hz=LINES_HZ, value=exact[:, :, None])

    def normal(*shape: int) -> np.ndarray:
        return noise * (random.normal(size=shape) + 1j * random.normal(size=shape)) / np.sqrt(2.0)

    force = 1.0 / (1.0 + 0.2 * np.abs(exact[:, :1]))
    lines = exact.shape[0]
    each = exact + (normal(realisations, lines, 2) - exact * 0.1 * normal(realisations, lines, 1)) / force
    mean = each.mean(axis=0)
    off = each - mean
    covariance = np.einsum("rko,rkp->kop", off, np.conj(off)) / (realisations * (realisations - 1))
    return FrequencyResponseMatrix(
        outputs=CHANNELS,
        inputs=FORCE,
        frequency_hz=LINES_HZ,
        value=mean[:, :, None],
        total_covariance=covariance,
        input_rms=(1.0,),
    )
