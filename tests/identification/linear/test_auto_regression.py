"""Frequency responses by a regression, against those of the system that made the records."""

import numpy as np
import scipy

from identification import Channel, IdentificationError
from identification.linear.auto_regression import regressed_responses
from tests.refused import refused

RATE_HZ, F0, ZETA = 1000.0, 60.0, 0.01
FORCE, DRIVE, TIP = Channel("f", "force", "N"), Channel("x", "drive", "m"), Channel("a", "response", "m/s2")


def oscillator():
    """Displacement and acceleration of one mode, its force held between samples: (a, b, c, d) of the exact discrete system."""
    w = 2 * np.pi * F0
    a, b = np.array([[0.0, 1.0], [-(w**2), -2 * ZETA * w]]), np.array([[0.0], [1.0]])
    c, d = np.array([[1.0, 0.0], a[1]]), np.array([[0.0], [1.0]])
    return scipy.signal.cont2discrete((a, b, c, d), 1.0 / RATE_HZ)[:4]


def exact(frequency_hz):
    a, b, c, d = oscillator()
    z = np.exp(2j * np.pi * frequency_hz / RATE_HZ)
    return np.array([c @ np.linalg.solve(one * np.eye(2) - a, b) + d for one in z])


def records(noise, count=2, seed=0):
    random = np.random.default_rng(seed)
    found = []
    for number in range(count):
        u = scipy.signal.lfilter(*scipy.signal.butter(4, 0.4), random.normal(size=6000))
        begin = [[1e-5 * number, 1e-3]]  # not at rest
        _, y, _ = scipy.signal.dlsim((*oscillator(), 1.0 / RATE_HZ), u, x0=begin[0])
        y = y.T + noise * y.std(axis=0)[:, None] * random.normal(size=y.T.shape)
        found.append((u[None], y))
    return found


def responses(found, **more):
    return regressed_responses(found, sample_rate_hz=RATE_HZ, inputs=[FORCE], outputs=[DRIVE, TIP], **more)


def test_without_noise_the_responses_are_exact_whatever_the_state_at_the_beginning():
    found = responses(records(0.0))
    wanted = exact(found.frequency_hz)
    assert np.abs(found.value / wanted - 1.0).max() < 1e-6
    assert (found.estimator, found.inputs, found.outputs) == ("ARX", (FORCE,), (DRIVE, TIP))


def test_with_noise_errors_are_as_large_as_the_covariance_says():
    off = []
    for seed in range(6):
        found = responses(records(0.01, seed=seed), band_hz=(20.0, 120.0))
        off.append(np.abs(found.value - exact(found.frequency_hz)) ** 2 / found.noise_std**2)
    assert 0.5 < np.mean(off) < 2.0


def test_a_dead_channel_and_a_short_record_are_refused():
    u, y = records(0.0, 1)[0]
    with refused(IdentificationError, "channel-is-zero-throughout", field="inputs"):
        responses([(0.0 * u, y)])
    with refused(IdentificationError, "too-few-for-linear-model", field="experiments"):
        responses([(u[:, :6], y[:, :6])])
