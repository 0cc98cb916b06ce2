"""Structures of two masses with nonlinear elements, integrated by Runge and Kutta, for studies of structured models.

Nothing here is the product's: forces are written down anew, hystereses move along each stage's displacement, dry friction holds
and turns by events. A sine, a sweep or a multisine may drive the last mass.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numba import njit

from identification import Channel, Experiment, LinearModes
from vibrolock.arrays import Float

RATE_HZ, SAMPLES, FINE = 512.0, 1024, 64
FORCE = Channel("force", "force", "N")
OUTPUTS = (Channel("tip", "drive", "m/s2"), Channel("root", "response", "m/s2"))
MASS, STIFFNESS, DAMPING = np.array([2.0, 1.0]), np.array([3e4, 1.5e4]), np.array([12.0, 6.0])
CUBIC, QUADRATIC_DAMPING, STOP, MAGNET, SLIDER, BOUC_WEN, FRICTION = range(7)


@dataclass(frozen=True)
class Structure:
    """Two masses in a chain from the ground, with elements at their places."""

    elements: tuple[tuple[int, int, tuple[float, ...]], ...]
    """Kind, place (0: first mass to ground, 1: between the masses, 2: last mass to ground) and numbers of each."""
    rms_n: float = 4.0
    """RMS of the multisines of the training."""
    band_hz: tuple[float, float] = (6.0, 40.0)
    measured: int = 2
    """Modes that the modal test has."""
    stuck_n_m: tuple[float, float, float] = field(default=(0.0, 0.0, 0.0))
    """Stiffness that elements add in small vibrations at each place."""


def iwan(stiffness: float, slip: float, chi: float, count: int = 40) -> list[tuple[float, float]]:
    """Sliders of equal stiffness of a density ``phi^chi`` up to a slip: quantiles."""
    slips = slip * ((np.arange(count) + 0.5) / count) ** (1.0 / (1.0 + chi))
    return [(stiffness / count, stiffness / count * float(one)) for one in slips]


@njit(cache=True)
def _forces(kinds, places, numbers, x, v, memory, moved_from, found):
    """Forces of all elements on the two masses; memory is that at the beginning of the step."""
    found[:] = 0.0
    for e in range(kinds.size):
        kind, place, p = kinds[e], places[e], numbers[e]
        if place == 0:
            z, w = x[0], v[0]
        elif place == 1:
            z, w = x[1] - x[0], v[1] - v[0]
        else:
            z, w = x[1], v[1]
        force = 0.0
        if kind == 0:
            force = p[0] * z**3
        elif kind == 1:
            force = p[0] * abs(z) * w
        elif kind == 2:
            force = p[0] * max(z - p[1], 0.0) if p[2] > 0.0 else p[0] * min(z + p[1], 0.0)
        elif kind == 3:
            share = z / p[1]
            force = p[0] * ((1.0 - share) ** -4 - 1.0 - 4.0 * share)
        elif kind == 4:
            force = min(max(memory[e] + p[0] * (z - moved_from[e]), -p[1]), p[1])
        elif kind == 5:
            force = memory[e]
        if place != 1:
            found[place // 2] += force
        else:
            found[0] -= force
            found[1] += force


@njit(cache=True)
def _relative(place, x):
    return x[0] if place == 0 else (x[1] - x[0] if place == 1 else x[1])


@njit(cache=True)
def _dry(p, w):
    """Size of dry friction at a speed: Coulomb's, above it Stribeck's at rest."""
    return p[0] + (p[1] - p[0]) * np.exp(-((w / p[2]) ** 2)) if p[2] > 0.0 else p[0]


@njit(cache=True)
def integrated(u, step, kinds, places, numbers, mass, stiffness, damping, found):
    """Accelerations of the masses (last first), and displacements of all elements, at every FINE steps. u: at half steps.

    Bouc-Wen's force is a state of the integration; dry friction acts on the first mass.
    """
    n_e = kinds.size
    y = np.zeros(4 + n_e)
    rate, trial, nonlinear = np.zeros((4, 4 + n_e)), np.zeros(4 + n_e), np.zeros(2)
    memory, moved_from = np.zeros(n_e), np.zeros(n_e)
    dry = -1
    for e in range(n_e):
        if kinds[e] == 6:
            dry = e
    sign = 0.0
    for k in range((u.size - 1) // 2):
        if dry >= 0:
            sign = np.sign(y[2])
        for stage in range(4):
            f = u[2 * k] if stage == 0 else (u[2 * k + 2] if stage == 3 else u[2 * k + 1])
            if stage == 0:
                trial[:] = y
            else:
                trial[:] = y + (step if stage == 3 else 0.5 * step) * rate[stage - 1]
            x, v = trial[:2], trial[2:4]
            for e in range(n_e):
                if kinds[e] == 5:
                    memory[e] = trial[4 + e]
            _forces(kinds, places, numbers, x, v, memory, moved_from, nonlinear)
            link0 = stiffness[0] * x[0] + damping[0] * v[0]
            link1 = stiffness[1] * (x[1] - x[0]) + damping[1] * (v[1] - v[0])
            pull = -link0 + link1 - nonlinear[0]
            if dry >= 0:
                size = _dry(numbers[dry], v[0])
                if stage == 0 and sign == 0.0:
                    sign = 0.0 if abs(pull) <= _dry(numbers[dry], 0.0) else np.sign(pull)
                pull = 0.0 if sign == 0.0 else pull - sign * size
            rate[stage, 0], rate[stage, 1] = v[0], v[1]
            if dry >= 0 and sign == 0.0:
                rate[stage, 0] = 0.0
            rate[stage, 2] = pull / mass[0]
            rate[stage, 3] = (f - link1 - nonlinear[1]) / mass[1]
            for e in range(n_e):
                if kinds[e] == 5:
                    w = v[0] if places[e] == 0 else (v[1] - v[0] if places[e] == 1 else v[1])
                    alpha, beta, gamma, power = numbers[e, 0], numbers[e, 1], numbers[e, 2], numbers[e, 3]
                    r = trial[4 + e]
                    size = abs(r) ** (power - 1.0)
                    rate[stage, 4 + e] = alpha * w - beta * abs(w) * r * size - gamma * w * abs(r) * size
            if stage == 0 and k % FINE == 0:
                at = k // FINE
                found[0, at], found[1, at] = rate[0, 3], rate[0, 2]
                for e in range(n_e):
                    found[2 + e, at] = _relative(places[e], y)
        y += step / 6.0 * (rate[0] + 2.0 * rate[1] + 2.0 * rate[2] + rate[3])
        if dry >= 0 and y[2] * sign < 0.0:
            y[2] = 0.0
        for e in range(n_e):
            if kinds[e] == 4:
                z, p = _relative(places[e], y), numbers[e]
                memory[e] = min(max(memory[e] + p[0] * (z - moved_from[e]), -p[1]), p[1])
                moved_from[e] = z


def response(structure: Structure, force: Callable[[Float], Float], seconds: float) -> Float:
    """float[2 + n_elements, n]: accelerations and displacements of elements from rest, under a force of the time."""
    count = round(seconds * RATE_HZ)
    u = np.asarray(force(np.arange(2 * FINE * count + 1) / (2.0 * FINE * RATE_HZ)))
    width = max(len(one[2]) for one in structure.elements) if structure.elements else 1
    numbers = np.zeros((len(structure.elements), max(width, 4)))
    for row, (_, _, values) in zip(numbers, structure.elements, strict=True):
        row[: len(values)] = values
    kinds, places = (np.array([one[i] for one in structure.elements], dtype=np.int64) for i in (0, 1))
    found = np.zeros((2 + len(structure.elements), count))
    integrated(u, 1.0 / (RATE_HZ * FINE), kinds, places, numbers, MASS, STIFFNESS, DAMPING, found)
    return found


def multisine(rms_n: float, band_hz: tuple[float, float], seed: int) -> Callable[[Float], Float]:
    """Return a periodic force of random phases, exact at any time of the integration."""
    frequency = np.fft.rfftfreq(SAMPLES, 1.0 / RATE_HZ)
    lines = (frequency >= band_hz[0]) & (frequency <= band_hz[1])
    phases = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, frequency.size)
    spectrum = np.where(lines, np.exp(1j * phases), 0.0) * rms_n * SAMPLES / np.sqrt(2.0 * np.sum(lines))
    fine = np.fft.irfft(spectrum, 2 * FINE * SAMPLES) * 2 * FINE
    return lambda time_s: fine[np.round(time_s * 2 * FINE * RATE_HZ).astype(np.int64) % fine.size]


def experiment(
    structure: Structure, level: float, seed: int, noise: float = 1e-3, periods: int = 3, lead: int = 12
) -> Experiment:
    """Return the mean of periods after some that are not recorded; noise is relative to the RMS of each channel."""
    force = multisine(level * structure.rms_n, structure.band_hz, seed)
    kept = periods * SAMPLES
    moved = response(structure, force, (lead + periods) * SAMPLES / RATE_HZ)[:2, -kept:]
    both = np.vstack([force(np.arange(kept) / RATE_HZ), moved])
    random = np.random.default_rng(100_000 + seed)
    both = both + noise * np.std(both, axis=1, keepdims=True) * random.standard_normal(both.shape)
    whole = Experiment(
        inputs=both[:1],
        outputs=both[1:],
        sample_rate_hz=RATE_HZ,
        input_channels=(FORCE,),
        output_channels=OUTPUTS,
        period_samples=SAMPLES,
        excited_hz=structure.band_hz,
        level=level,
        name=f"multisine of {level * structure.rms_n:g} N, {seed}",
    )
    return whole.averaged(transient_samples=SAMPLES) if periods > 1 else whole


def modes(structure: Structure) -> LinearModes:
    """Return what a test at a low level finds: the modes in its band, and the receptance of the others."""
    at = structure.stuck_n_m
    k = np.array(
        [
            [STIFFNESS[0] + STIFFNESS[1] + at[0] + at[1], -STIFFNESS[1] - at[1]],
            [-STIFFNESS[1] - at[1], STIFFNESS[1] + at[1] + at[2]],
        ]
    )
    c = np.array([[DAMPING[0] + DAMPING[1], -DAMPING[1]], [-DAMPING[1], DAMPING[1]]])
    root = 1.0 / np.sqrt(MASS)
    squares, vectors = np.linalg.eigh(k * np.outer(root, root))
    shapes, omega = (root[:, None] * vectors)[::-1], np.sqrt(squares)
    shapes = shapes * np.sign(shapes[0])
    ratio = np.diag(vectors.T @ (c * np.outer(root, root)) @ vectors) / (2.0 * omega)
    n = structure.measured
    upper = shapes[:, n:] @ (shapes[0, n:] / omega[n:] ** 2) if n < 2 else np.zeros(2)
    return LinearModes(
        channels=OUTPUTS,
        frequency_hz=omega[:n] / (2.0 * np.pi),
        frequency_std_hz=np.zeros(n),
        damping_ratio=ratio[:n],
        damping_ratio_std=np.zeros(n),
        shapes=shapes[:, :n],
        shapes_std=np.zeros((2, n)),
        phase_collinearity=np.ones(n),
        lower=np.zeros(2, complex),
        upper=upper.astype(complex),
        lowest_hz=structure.band_hz[0],
        highest_hz=structure.band_hz[1],
        upper_hz=float(omega[-1] / (2.0 * np.pi)) if n < 2 else RATE_HZ,
    )
