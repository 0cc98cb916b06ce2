"""Which laws fit a hysteresis? ``python -m benchmarks.friction_laws [--system NAME]``.

Systems are integrated by steps of Runge and Kutta, 48 in a sample, of Bouc and Wen's equation; one is that of the benchmark of
Noel and Schoukens (2016). Two multisines with 0.1 % noise are fitted with each law; errors are those on the data of the fit, on
another realisation, and on one of twice the level, both without noise.
"""

import time

import numpy as np
import typer
from numba import njit

from identification import Channel, Experiment, LinearModes, fit_structured
from identification.experiments import residual_over_noise
from identification.models import LAWS
from vibrolock.arrays import Float

RATE_HZ, SAMPLES, FINE, NOISE = 1500.0, 3000, 48, 1e-3
FORCE = Channel("force", "force", "N")
SYSTEMS = {
    # masses, springs and dampers to the left neighbour, alpha, beta, gamma, exponent, friction, force, band
    "benchmark": ([2.0], [5e4], [10.0], (5e4, 800.0, -1100.0, 1.0), 0.0, 50.0, (5.0, 150.0)),
    "softening": ([2.0, 1.0], [6e4, 3e4], [8.0, 4.0], (4e4, 6.0, 3.0, 2.0), 0.0, 12.0, (10.0, 60.0)),
    "opposite": ([2.0, 1.0], [6e4, 3e4], [8.0, 4.0], (4e4, 1500.0, -900.0, 1.0), 0.0, 12.0, (10.0, 60.0)),
    "coulomb": ([2.0, 1.0], [6e4, 3e4], [8.0, 4.0], (0.0, 0.0, 0.0, 1.0), 3.0, 12.0, (10.0, 60.0)),
}


@njit(cache=True)
def derivative(state, force, mass, stiffness, damping, law):
    """Return rates of displacements, velocities and the force of the hysteresis."""
    n = mass.size
    out = np.zeros(2 * n + 1)
    alpha, beta, gamma, power = law
    r, v = state[2 * n], state[n]
    out[2 * n] = alpha * v - beta * abs(v) * r * abs(r) ** (power - 1.0) - gamma * v * abs(r) ** power
    for i in range(n):
        out[i] = state[n + i]
        before = state[i - 1] if i else 0.0
        speed = state[n + i - 1] if i else 0.0
        link = stiffness[i] * (state[i] - before) + damping[i] * (state[n + i] - speed)
        out[n + i] -= link / mass[i]
        if i:
            out[n + i - 1] += link / mass[i - 1]
    out[n] -= r / mass[0]
    out[2 * n - 1] += force / mass[n - 1]
    return out


@njit(cache=True)
def integrated(u, step, mass, stiffness, damping, law, friction):
    """Accelerations at every sample, the first mass with Coulomb friction by an event at each stop. ``u`` at half steps."""
    n, count = mass.size, (u.size - 1) // 2
    state, found = np.zeros(2 * n + 1), np.zeros((n, count // FINE))
    for k in range(count):
        f = u[2 * k], u[2 * k + 1], u[2 * k + 2]
        if k % FINE == 0:
            found[:, k // FINE] = derivative(state, f[0], mass, stiffness, damping, law)[n : 2 * n]
            if friction > 0.0:
                pull = mass[0] * found[0, k // FINE]
                dry = friction * np.sign(state[n]) if state[n] != 0.0 else min(max(pull, -friction), friction)
                found[0, k // FINE] -= dry / mass[0]
        sign = np.sign(state[n])
        if friction > 0.0 and sign == 0.0:
            pull = mass[0] * derivative(state, f[0], mass, stiffness, damping, law)[n]
            sign = 0.0 if abs(pull) <= friction else np.sign(pull)
        k1 = derivative(state, f[0], mass, stiffness, damping, law)
        if friction > 0.0:
            dry_on(k1, sign, friction, mass, n)
        k2 = derivative(state + 0.5 * step * k1, f[1], mass, stiffness, damping, law)
        if friction > 0.0:
            dry_on(k2, sign, friction, mass, n)
        k3 = derivative(state + 0.5 * step * k2, f[1], mass, stiffness, damping, law)
        if friction > 0.0:
            dry_on(k3, sign, friction, mass, n)
        k4 = derivative(state + step * k3, f[2], mass, stiffness, damping, law)
        if friction > 0.0:
            dry_on(k4, sign, friction, mass, n)
        state = state + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        if friction > 0.0 and state[n] * sign < 0.0:
            state[n] = 0.0
    return found


@njit(cache=True)
def dry_on(rates, sign, friction, mass, n):
    """Friction that opposes the motion, or holds the mass."""
    if sign == 0.0:
        rates[0], rates[n] = 0.0, 0.0
    else:
        rates[n] -= sign * friction / mass[0]


def multisine(rms: float, band_hz: tuple[float, float], seed: int) -> Float:
    """Spectrum of one period."""
    frequency = np.fft.rfftfreq(SAMPLES, 1.0 / RATE_HZ)
    lines = (frequency >= band_hz[0]) & (frequency <= band_hz[1])
    phases = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, frequency.size)
    spectrum = np.where(lines, np.exp(1j * phases), 0.0)
    return np.asarray(spectrum * rms * SAMPLES / np.sqrt(2.0 * np.sum(lines)))


def experiment(name: str, level: float, seed: int, noise: float, periods: int = 4) -> Experiment:
    """Return periods after ten that are not recorded; the first recorded one is the transient of the fit."""
    mass, stiffness, damping, law, friction, rms, band = SYSTEMS[name]
    spectrum = multisine(level * rms, band, seed)
    fine = np.fft.irfft(spectrum, 2 * FINE * SAMPLES) * 2 * FINE
    u = np.tile(fine, 10 + periods)
    arrays = [np.array(one) for one in (mass, stiffness, damping)]
    moved = integrated(np.append(u, u[0]), 1.0 / (RATE_HZ * FINE), *arrays, law, friction)[:, -periods * SAMPLES :]
    moved = moved[::-1]
    force = np.tile(np.fft.irfft(spectrum, SAMPLES), periods)[None]
    rng = np.random.default_rng(1000 + seed)
    inputs, outputs = (
        one + noise * np.std(one, axis=1, keepdims=True) * rng.standard_normal(one.shape) for one in (force, moved)
    )
    whole = Experiment(
        inputs=inputs,
        outputs=outputs,
        sample_rate_hz=RATE_HZ,
        input_channels=(FORCE,),
        output_channels=outputs_of(len(mass)),
        period_samples=SAMPLES,
        excited_hz=band,
    )
    return whole.averaged(transient_samples=SAMPLES)


def outputs_of(n: int) -> tuple[Channel, ...]:
    """Accelerometers, the one at the force first."""
    return tuple(Channel(f"a{i + 1}", "drive" if i == 0 else "response", "m/s2") for i in range(n))


def modes(name: str) -> LinearModes:
    """Return what a test at a low level finds."""
    mass, stiffness, damping, law, _, _, band = SYSTEMS[name]
    n = len(mass)
    k, c = np.zeros((n, n)), np.zeros((n, n))
    for i in range(n):
        row = np.zeros(n)
        row[i] = 1.0
        if i:
            row[i - 1] = -1.0
        k, c = k + stiffness[i] * np.outer(row, row), c + damping[i] * np.outer(row, row)
    k[0, 0] += law[0]
    root = 1.0 / np.sqrt(np.array(mass))
    squared, vectors = np.linalg.eigh(k * np.outer(root, root))
    shapes = (root[:, None] * vectors)[::-1]
    omega = np.sqrt(squared)
    ratio = np.diag(vectors.T @ (c * np.outer(root, root)) @ vectors) / (2.0 * omega)
    return LinearModes(
        channels=outputs_of(n),
        frequency_hz=omega / (2.0 * np.pi),
        frequency_std_hz=np.zeros(n),
        damping_ratio=ratio,
        damping_ratio_std=np.zeros(n),
        shapes=shapes,
        shapes_std=np.zeros((n, n)),
        phase_collinearity=np.ones(n),
        lower=np.zeros(n, complex),
        upper=np.zeros(n, complex),
        lowest_hz=band[0],
        highest_hz=band[1],
        upper_hz=RATE_HZ,
    )


def main(system: str = "", laws: str = "bouc-wen,masing,iwan,jenkins", steps: int = 4) -> None:
    """Print errors in per cent, residual over noise and numbers of each fit."""
    for name in [system] if system else SYSTEMS:
        training = [experiment(name, 1.0, seed, NOISE) for seed in (1, 2)]
        fresh = {what: experiment(name, level, 7, 0.0) for what, level in (("held out", 1.0), ("twice", 2.0))}
        for law in laws.split(","):
            begun = time.perf_counter()
            element = tuple(LAWS[kind]() for kind in law.split("+"))
            fit = fit_structured(modes(name), training, laws=element, support=False, steps=steps)
            seconds = time.perf_counter() - begun
            errors = {}
            for what, one in fresh.items():
                simulated = fit.model.simulate_experiment(one).outputs[:, one.counted_from :]
                errors[what] = np.linalg.norm(simulated - one.counted_outputs) / np.linalg.norm(one.counted_outputs)
            ratio = max(
                float(
                    np.max(residual_over_noise(one, fit.model.simulate_experiment(one).outputs[:, one.counted_from :]))
                )
                for one in training
            )
            said = ", ".join(f"{what} {100.0 * error:.3f}" for what, error in errors.items())
            print(
                f"{name}, {law}: training {100.0 * fit.training_error:.3f}, ratio {ratio:.1f}, {said}, {seconds:.0f} s"
            )
            for number in fit.numbers:
                print(f"    {number.name} {number.value:.6g} ({number.low:.6g} to {number.high:.6g}) {number.unknown}")
            print("   ", fit.model.elements[0].direction, fit.model.elements[0].scale_m, flush=True)


if __name__ == "__main__":
    typer.run(main)
