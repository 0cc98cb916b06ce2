"""Multisine experiments on discrete-time systems that are known."""

import numpy as np

from identification import Channel, Experiment, PnlssModel, StateSpace

RATE_HZ = 800.0
PERIOD = 1024


def oscillator(frequency_hz: float = 60.0, damping: float = 0.03, inputs: int = 1, outputs: int = 1) -> StateSpace:
    """A mode with two states, sampled; gains of order one."""
    pole = np.exp(2 * np.pi * frequency_hz / RATE_HZ * (-damping + 1j * np.sqrt(1 - damping**2)))
    a = np.array([[pole.real, pole.imag], [-pole.imag, pole.real]])
    b = np.array([[0.2, -0.1], [0.1, 0.3]])[:, :inputs]
    c = np.array([[1.0, 0.3], [-0.5, 0.8], [0.2, 0.9], [0.7, -0.6]])[:outputs]
    return StateSpace(a, b, c, np.array([[0.1, 0.05], [0.02, -0.1], [0.0, 0.1], [0.3, 0.0]])[:outputs, :inputs])


def channels(inputs: int, outputs: int) -> tuple[tuple[Channel, ...], tuple[Channel, ...]]:
    forces = tuple(Channel(f"voltage{i}", "monitor", "V") for i in range(inputs))
    return forces, tuple(Channel(f"a{o}", "response", "m/s2") for o in range(outputs))


def linear_model(matrices: StateSpace) -> PnlssModel:
    inputs, outputs = channels(matrices.b.shape[1], matrices.c.shape[0])
    return PnlssModel.linear(matrices, sample_rate_hz=RATE_HZ, inputs=inputs, outputs=outputs)


def multisine(
    seed: object,
    *,
    inputs: int = 1,
    rms: float = 1.0,
    band_hz: tuple[float, float] = (5.0, 390.0),
    samples: int = PERIOD,
) -> np.ndarray:
    """Random phases, float[n_inputs, samples]."""
    random = np.random.default_rng(seed)  # type: ignore[arg-type]
    frequency = np.fft.rfftfreq(samples, 1 / RATE_HZ)
    lines = (frequency >= band_hz[0]) & (frequency <= band_hz[1])
    spectrum = lines * np.exp(2j * np.pi * random.random((inputs, frequency.size)))
    signal = np.fft.irfft(spectrum, samples)
    return np.asarray(rms * signal / np.std(signal, axis=1, keepdims=True))


def measured(
    model: PnlssModel,
    period: np.ndarray,
    *,
    periods: int = 1,
    settling: int = 4,
    noise: float = 0.0,
    seed: int = 0,
    name: str = "",
    level: float = float("nan"),
) -> Experiment:
    """Settled periods with one more ahead of them, noise on the outputs relative to their RMS."""
    u = np.tile(period, settling + periods)
    y = model.simulate(u).outputs
    y = y + noise * np.std(y) * np.random.default_rng([seed, 3]).normal(size=y.shape)
    n = period.shape[1]
    return Experiment(
        inputs=u[:, (settling - 1) * n :],
        outputs=y[:, (settling - 1) * n :],
        sample_rate_hz=model.sample_rate_hz,
        input_channels=model.inputs,
        output_channels=model.outputs,
        counted_from=n,
        period_samples=n,
        name=name,
        level=level,
    )
