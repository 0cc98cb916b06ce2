"""Do structured models keep below their bounds? ``python -m benchmarks.structured_bounds RMS MODEL [MODEL ...]``.

For each model file (`rig identify --model structured`, or of the folder ``models`` of `rig reproduce`) random and resonant
forces: multisines of a random band, bursts of noise, impulses, sines and sweeps near a mode, and forces that follow the
velocity of the run before, which do most work. Their sizes are forty levels from one to a hundred times the training level
``RMS`` (N), as many in each decade; the size of a force is the largest root of its mean square that fades with the memory of
the bound. Every response is held against the bound of its own level. The last column is the bound of the
element's displacement at a hundred times the level over the largest response found.
"""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import numpy as np
import typer
from scipy.signal import lfilter

from identification import Bound, StructuredModel, bound_of
from rig.results.files import load_as
from rig.results.structured.model import IdentifiedStructured
from vibrolock.arrays import Float

HUNDRED, LEVELS, DECAYS = 100.0, 40, 12.0
"""Largest force over the training level, levels of the bound, and length of a run in time constants of the slowest mode."""
PLAUSIBILITY = 10
"""Runs of a chain in which every force follows the velocity of the run before."""


class Found(NamedTuple):
    """What one force did, over the bound of its size: 1 is the bound."""

    displacement: float
    velocity: float
    unsolved: int
    largest_m: float


def shapes(model: StructuredModel, samples: int, rng: np.random.Generator) -> dict[str, Float]:
    """Forces with a peak of 1 or so, one of each family."""
    rate, t = model.sample_rate_hz, np.arange(samples) / model.sample_rate_hz
    inside = model.frequency_hz[model.frequency_hz < 0.45 * rate]
    near = float(rng.choice(inside)) * rng.uniform(0.7, 1.5)
    low, high = np.sort(rng.uniform(0.0, 0.5 * rate, 2))
    frequency = np.fft.rfftfreq(samples, 1.0 / rate)
    lines = (frequency >= low) & (frequency <= high)
    spectrum = np.where(lines, np.exp(2j * np.pi * rng.random(frequency.size)), 0.0)
    length = int(rng.integers(1, samples))
    impulses = np.zeros(samples)
    impulses[rng.integers(0, samples, 20)] = rng.choice([-1.0, 1.0], 20)
    to = near * rng.uniform(0.5, 2.0)
    return {
        "multisine": np.fft.irfft(spectrum, samples),
        "burst": rng.standard_normal(samples) * (np.arange(samples) < length),
        "impulses": impulses,
        "sine": np.sin(2.0 * np.pi * near * t),
        "sweep": np.sin(2.0 * np.pi * (near * t + 0.5 * (to - near) * t**2 / t[-1])),
    }


def size_of(force: Float, memory_s: float, rate_hz: float) -> float:
    """Largest root of the mean square that fades with the memory of a bound."""
    keep = np.exp(-1.0 / (memory_s * rate_hz))
    return float(np.sqrt(np.max(lfilter([1.0 - keep], [1.0, -keep], force**2))))


class Trial:
    """A model and its bounds."""

    def __init__(self, model: StructuredModel, rms_n: float) -> None:
        self.model = model
        self.levels = rms_n * np.geomspace(1.0, HUNDRED, LEVELS)
        self.bounds: list[Bound] = [bound_of(model, float(level)) for level in self.levels]
        self.direction = np.array([element.direction for element in model.elements])
        slowest = float(np.min(2.0 * np.pi * model.frequency_hz * model.damping_ratio))
        self.samples = int(DECAYS / slowest * model.sample_rate_hz)

    def held(self, force: Float, level: int) -> tuple[Found, Float]:
        """Run a force, scaled to the size of a level; return what it did, and the velocity at the input."""
        bound = self.bounds[level]
        scaled = force * (bound.force_rms_n / size_of(force, bound.memory_s, self.model.sample_rate_hz))
        motion = self.model.simulate(scaled[None])
        z = np.max(np.abs(self.direction @ motion.displacement), axis=1)
        v = np.max(np.abs(self.model.output_shapes @ motion.velocity), axis=1)
        found = Found(
            float(np.max(z / bound.displacement_m)),
            float(np.max(v / bound.output_m_s)),
            motion.unsolved_steps,
            float(np.max(z)),
        )
        return found, self.model.input_shapes[:, 0] @ motion.velocity

    def batch(self, seed: int) -> dict[str, list[Found]]:
        """A force of each family, and every tenth time a chain of forces that follow the velocity."""
        rng = np.random.default_rng(seed)
        found = {
            name: [self.held(force, int(rng.integers(LEVELS)))[0]]
            for name, force in shapes(self.model, self.samples, rng).items()
        }
        found["following"] = []
        if seed % PLAUSIBILITY == 0:
            level, force = int(rng.integers(LEVELS)), rng.standard_normal(self.samples)
            for _ in range(PLAUSIBILITY):
                one, velocity = self.held(force, level)
                found["following"].append(one)
                force = np.sign(velocity) + (velocity == 0.0)
        return found


def main(rms: float, models: list[Path], forces: int = 10_000) -> None:
    """Hold so many ``forces`` for each model against its bounds; ``rms`` is the training level, N."""
    print(
        "model, forces, above the bound, unsolved steps, largest share of a bound (by family), bound over largest response"
    )
    for path in models:
        trial = Trial(load_as(IdentifiedStructured, path).model, rms)
        with ThreadPoolExecutor(2) as pool:  # compiled runs leave the interpreter free
            batches = list(pool.map(trial.batch, range(-(-forces // 6))))
        families = {name: [one for batch in batches for one in batch[name]] for name in batches[0]}
        every = [one for family in families.values() for one in family]
        above = sum(one.displacement > 1.0 or one.velocity > 1.0 for one in every)
        unsolved = sum(one.unsolved for one in every)
        shares = ", ".join(
            f"{name} {max(max(one.displacement, one.velocity) for one in family):.2f}"
            for name, family in families.items()
        )
        over = float(np.max(trial.bounds[-1].displacement_m)) / max(one.largest_m for one in every)
        print(f"{path.name}, {len(every)}, {above}, {unsolved}, {shares}, {over:.1f}", flush=True)


if __name__ == "__main__":
    typer.run(main)
