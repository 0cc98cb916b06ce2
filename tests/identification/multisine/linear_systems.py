"""Linear systems with several inputs in their periodic steady state, for tests of the best linear approximation."""

import numpy as np

from identification import Channel, MultisineDesign, PeriodicSpectra, periodic_spectra

RATE_HZ = 1000.0
DESIGN = MultisineDesign(RATE_HZ, 500, 20.0, 200.0)


def response_of(n_outputs: int, n_inputs: int, frequency_hz: np.ndarray) -> np.ndarray:
    """Accelerance of two modes, complex[n_lines, n_outputs, n_inputs]; nothing symmetrical about it."""
    s = 2j * np.pi * np.asarray(frequency_hz, dtype=float)
    shapes = np.array([[1.0, 0.7], [0.6, -0.9], [-0.3, 1.1], [0.8, 0.2]])
    forces = np.array([[1.0, 0.5], [-0.4, 0.8]])
    omega, zeta = 2 * np.pi * np.array([60.0, 130.0]), np.array([0.02, 0.03])
    modal = s[:, None] ** 2 / (s[:, None] ** 2 + 2 * zeta * omega * s[:, None] + omega**2)
    return np.einsum("om,km,im->koi", shapes[:n_outputs], modal, forces[:n_inputs])


def channels_of(n_outputs: int, n_inputs: int) -> tuple[Channel, ...]:
    voltages = [Channel(f"voltage{i}" if n_inputs > 1 else "voltage", "monitor", "V") for i in range(n_inputs)]
    forces = [Channel(f"force{i}" if n_inputs > 1 else "force", "force", "N") for i in range(n_inputs)]
    motions = [Channel(f"a{o}", "drive" if o == 0 else "response", "m/s2") for o in range(n_outputs)]
    return (*voltages, *forces, *motions)


def shaken(period: np.ndarray, n_outputs: int) -> tuple[np.ndarray, np.ndarray]:
    """One steady period of forces and motions under voltages float[n_inputs, n]; shakers that act on each other's force."""
    n_inputs, n = period.shape
    frequency_hz = np.fft.rfftfreq(n, 1 / RATE_HZ)
    spectrum = np.fft.rfft(period)
    shaker = 1 / (1 + 1j * frequency_hz / 90.0)
    coupled = np.array([[2.0, 0.3], [-0.2, 1.5]])[:n_inputs, :n_inputs]
    force = shaker * (coupled @ spectrum)
    motion = np.einsum("koi,ik->ok", response_of(n_outputs, n_inputs, frequency_hz), force)
    return np.fft.irfft(force, n), np.fft.irfft(motion, n)


def measured(
    n_outputs: int,
    n_inputs: int,
    *,
    noise: float = 0.0,
    common: float = 0.0,
    cubic: float = 0.0,
    blocks: int = 3,
    periods: int = 3,
    seed: int = 0,
    design: MultisineDesign = DESIGN,
) -> PeriodicSpectra:
    """A recording: white ``noise`` on forces and motions, ``common`` to all of these, ``cubic`` times the force's cube."""
    random = np.random.default_rng([seed, 17])
    records = []
    for block in range(blocks):
        for experiment in design.orthogonal_realisation(seed, block, n_inputs):
            force, motion = shaken(experiment, n_outputs)
            motion = motion + cubic * force[:1] ** 3
            rows = np.tile(np.concatenate([experiment, force, motion]), periods)
            rows[n_inputs:] += noise * random.normal(size=rows[n_inputs:].shape)
            rows[n_inputs:] += common * random.normal(size=rows.shape[1])
            records.append(rows)
    return periodic_spectra(records, channels_of(n_outputs, n_inputs), design)


def instruments(n_inputs: int) -> tuple[str, ...]:
    return tuple(channel.name for channel in channels_of(1, n_inputs) if channel.role == "monitor")
