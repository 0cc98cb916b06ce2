"""Work against error of integrators on both shipped rigs: ``python -m benchmarks.integrators [--figure FILE]``.

Each method drives the shipped plant, without sensors and converters, with a sine that is held over samples at 5 kHz, and
follows its phase resonance: after each stretch the frequency becomes that at which the real part of force over displacement
would vanish. Errors of frequency and damping at the same amplitude are against Runge and Kutta's method with 64 steps a sample,
which shares nothing with the others but the elements of the joints. Work is processor time a sample, the least of several
rounds, all methods in turn.
"""

import math
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import typer
from scipy.linalg import expm

from benchmarks.frame import in_turn, on_one_core
from simulators import VirtualRig
from simulators.kernels import advance, aligned, combine, local_forces, pad
from vibrolock.arrays import Float
from vibrolock.compiled import kernel
from vibrolock.lanes import greatest, least, load, multiply_add, spread, store
from vibrolock.width import WIDTH

RATE_HZ = 5000.0
STEPS = (1, 2, 4, 8, 16)
FINE = 64
"""Steps a sample of the truth."""
CASES = {"magnet-beam": (0, 2.0, 1.2), "friction-beam": (2, 2.0, 0.25)}
"""Mode, voltage (V) and length of a stretch (s)."""
STRETCHES, LAST, PERIODS, HIGHEST = 13, 3, 36, 9
"""Stretches, of which the last are averaged over so many periods each, with harmonics up to the highest."""
ROUNDS, SAMPLES = 7, 5000


@kernel
def clipped(joints: Any, table: Any, z: Any, committed: Any, out: Any, commit: bool) -> None:
    """Forces ``out`` [n_joint] of Jenkins elements ``table`` [2, n_element, n_joint] at deflections ``z``, from ``committed``.

    ``joints`` [n_joint] are the stuck stiffnesses; ``committed`` [1 + n_element, n_joint]: deflections, then forces.
    """
    _, n_element, n_joint = table.shape
    for s in range(0, n_joint, WIDTH):
        dz, total = load(z, s) - load(committed, s), spread(0.0)
        for e in range(n_element):
            at, limit = e * n_joint + s, load(table, (n_element + e) * n_joint + s)
            force = multiply_add(load(table, at), dz, load(committed, at + n_joint))
            force = greatest(least(force, limit), spread(0.0) - limit)
            if commit:
                store(committed, at + n_joint, force)
            total = total + force
        store(out, s, load(joints, s) * load(z, s) - total)
        if commit:
            store(committed, s, load(z, s))


@kernel
def forces_at(system: Any, state: Any, inputs: Any, first: int, commit: bool) -> None:
    """Write the forces of joints and local sites, from the coordinates of ``inputs``' x, to ``inputs[first:]``."""
    combine(system.sites, inputs, state.z)
    clipped(system.stuck, system.table, state.z, state.committed, state.joints, commit)
    local_forces(system.local, state.z, system.n_joint, state.forces)
    for s in range(system.n_joint):
        inputs[first + s] = state.joints[s]
    for s in range(system.local.size):
        inputs[first + system.n_joint + s] = state.forces[s]


@kernel
def seen(system: Any, x: Any, out: Any) -> None:
    """Force and displacement of the drive point."""
    out[0] = out[1] = 0.0
    for i in range(system.n):
        out[0] += system.observed[0, i] * x[i]
        out[1] += system.observed[1, i] * x[i]


@kernel
def runge_kutta(system: Any, state: Any, substeps: int, step_s: float, volts: Any, out: Any) -> None:
    """Classic steps of fourth order; elements move from their committed forces at each stage, and are committed at the end."""
    n, inputs, rows, begun, total = system.n, state.inputs, state.rows, state.first, state.second
    for k in range(volts.size):
        seen(system, inputs, out[k])
        inputs[n] = volts[k]
        for _ in range(substeps):
            for stage in range(4):
                if stage > 0:
                    forces_at(system, state, inputs, n + 1, False)
                combine(system.one, inputs, rows)
                weight = 1.0 if stage in (0, 3) else 2.0
                for i in range(n):
                    if stage == 0:
                        begun[i], total[i] = inputs[i], 0.0
                    total[i] += weight * rows[i]
                    inputs[i] = begun[i] + (step_s * rows[i] * (0.5 if stage < 2 else 1.0))
                if stage == 3:
                    for i in range(n):
                        inputs[i] = begun[i] + step_s / 6.0 * total[i]
            forces_at(system, state, inputs, n + 1, True)


@kernel
def exponential_4(system: Any, state: Any, substeps: int, step_s: float, volts: Any, out: Any) -> None:
    """ETDRK4 (Cox & Matthews 2002): three stages over ``one`` (half a step), and the step itself over ``two``."""
    n, n_site, inputs, stage, rows = system.n, system.n_site, state.inputs, state.first, state.rows
    for k in range(volts.size):
        seen(system, inputs, out[k])
        inputs[n] = stage[n] = volts[k]
        for _ in range(substeps):
            for s in range(n_site):
                inputs[n + 1 + n_site + s] = 0.0
            for number in range(3):
                for i in range(n):
                    stage[i] = rows[i] if number == 2 else inputs[i]
                for s in range(n_site):
                    f_0, last = inputs[n + 1 + s], inputs[n + 1 + 2 * n_site + s]
                    stage[n + 1 + s] = (f_0, last, 2.0 * last - f_0)[number]
                if number == 2:
                    for i in range(n):
                        stage[i] = state.second[i]
                combine(system.one, stage, rows)
                for i in range(n):
                    stage[i] = rows[i]
                    if number == 0:
                        state.second[i] = rows[i]
                forces_at(system, state, stage, n + 1, False)
                for s in range(n_site):
                    inputs[n + 1 + 2 * n_site + s] = stage[n + 1 + s]
                    if number < 2:
                        inputs[n + 1 + n_site + s] += stage[n + 1 + s]
            combine(system.two, inputs, rows)
            for i in range(n):
                inputs[i] = rows[i]
            forces_at(system, state, inputs, n + 1, True)


@kernel
def implicit(system: Any, state: Any, substeps: int, step_s: float, volts: Any, out: Any) -> None:
    """Average acceleration (Newmark 1959, the trapezoidal rule), iterated until no force changes by 1e-12 of the largest."""
    n, n_site, inputs, new, rows = system.n, system.n_site, state.inputs, state.first, state.rows
    for k in range(volts.size):
        seen(system, inputs, out[k])
        inputs[n] = volts[k]
        for _ in range(substeps):
            for s in range(n_site):
                inputs[n + 1 + n_site + s] = inputs[n + 1 + s]
            for _ in range(20):
                combine(system.one, inputs, rows)
                for i in range(n):
                    new[i] = rows[i]
                forces_at(system, state, new, n + 1, False)
                largest = change = 0.0
                for s in range(n_site):
                    change = max(change, abs(new[n + 1 + s] - inputs[n + 1 + n_site + s]))
                    largest = max(largest, abs(new[n + 1 + s]))
                    inputs[n + 1 + n_site + s] = new[n + 1 + s]
                if change <= 1e-12 * largest:
                    break
            for i in range(n):
                inputs[i] = new[i]
            forces_at(system, state, inputs, n + 1, True)


@kernel
def products_steps(arrays: Any, state: Any, observed: Any, volts: Any, out: Any) -> None:
    """Steps of the product's own integrator."""
    for k in range(volts.size):
        out[k, 0] = out[k, 1] = 0.0
        for i in range(observed.shape[1]):
            out[k, 0] += observed[0, i] * state.inputs[i]
            out[k, 1] += observed[1, i] * state.inputs[i]
        advance(arrays, state, volts[k])


class System(NamedTuple):
    """The plant for a method: matrices of its step, and what is nonlinear."""

    n: int
    n_joint: int
    n_site: int
    one: Float
    two: Float
    sites: Float
    observed: Float
    table: Float
    stuck: Float
    local: Any


class State(NamedTuple):
    """State and scratch space of a method."""

    inputs: Float
    first: Float
    second: Float
    rows: Float
    z: Float
    joints: Float
    forces: Float
    committed: Float


def matrices(rig: VirtualRig, method: str, step_s: float) -> tuple[Float, Float]:
    """The maps of a method's step over ``[x, u, forces ...]``, joints before local sites."""
    plant, n_joint = rig.plant, len(rig.friction)
    a, sites = plant.dynamics, np.roll(plant.site_columns, n_joint, axis=1)
    b, none = np.column_stack([plant.voltage_column, sites]), np.zeros((len(a), 1))
    if method == "runge-kutta":
        return np.hstack([a, b]), none
    if method == "implicit":
        left, half = np.linalg.inv(np.eye(len(a)) - step_s / 2.0 * a), step_s / 2.0 * sites
        right = np.hstack([np.eye(len(a)) + step_s / 2.0 * a, step_s * b[:, :1], half, half])
        return left @ right, none
    e, p = phis(a, step_s)
    half, q = phis(a, step_s / 2.0)
    last = [step_s * one @ sites for one in (p[0] - 3 * p[1] + 4 * p[2], 2 * (p[1] - 2 * p[2]), 4 * p[2] - p[1])]
    return np.hstack([half, step_s / 2.0 * q[0] @ b]), np.hstack([e, step_s * p[0] @ b[:, :1], *last])


def phis(a: Float, step_s: float) -> tuple[Float, list[Float]]:
    """The exponential of h A, and phi_1 to phi_3 of it."""
    n = len(a)
    augmented = np.zeros((4 * n, 4 * n))
    augmented[:n, :n] = step_s * a
    augmented[: 3 * n, n:] += np.eye(3 * n)
    whole = expm(augmented)
    return whole[:n, :n], [whole[:n, k * n : (k + 1) * n] for k in (1, 2, 3)]


Run = Callable[[Float], Float]
KERNELS = {"runge-kutta": runge_kutta, "etdrk4": exponential_4, "implicit": implicit}
NAMES = {
    "product": "exponential Adams 3, turning points (ours)",
    "runge-kutta": "Runge-Kutta 4",
    "etdrk4": "exponential Runge-Kutta 4",
    "implicit": "implicit, average acceleration",
}


def method(specimen: str, name: str, steps: int) -> Run:
    """A run of a method from rest, which goes on at each call: force and displacement [n, 2] for voltages [n]."""
    rig = VirtualRig.shipped(specimen, converter={"substeps": steps, "oversampling": 1, "anti_alias_hz": 0.0})
    plant, n_joint = rig.plant, len(rig.friction)
    observed = np.array([plant.stinger_row, np.pad(plant.drive_shape, (0, plant.n_mode + 3))])
    arrays, state = rig.build()
    run: Callable[..., None]
    if name == "product":
        run = partial(products_steps, arrays, state, observed)
    else:
        n, n_site = len(plant.dynamics), len(plant.site_rows)
        rows = np.roll(plant.site_rows, n_joint, axis=0)
        one, two = (pad(one.T) for one in matrices(rig, name, 1.0 / RATE_HZ / steps))
        system = System(
            n, n_joint, n_site, one, two, pad(np.hstack([rows, np.zeros((n_site, 1))]).T), observed,
            arrays.elements, arrays.stuck, arrays.sites,
        )  # fmt: skip
        size = arrays.stuck.size
        places = State(
            *(aligned(8 * WIDTH) for _ in range(5)), aligned(size), np.zeros(plant.n_local),
            aligned((1 + arrays.elements.shape[1], size)),
        )  # fmt: skip
        run = partial(KERNELS[name], system, places, steps, 1.0 / RATE_HZ / steps)

    def go(volts: Float) -> Float:
        out = np.empty((volts.size, 2))
        run(volts, out)
        return out

    return go


def fundamentals(values: Float, frequency_hz: float) -> Float:
    """Complex amplitudes of the fundamentals of columns, by least squares."""
    theta = 2.0 * np.pi * frequency_hz / RATE_HZ * np.arange(len(values))
    waves = [f(h * theta) for h in range(1, HIGHEST + 1) for f in (np.cos, np.sin)]
    found = np.linalg.lstsq(np.array([np.ones(theta.size), *waves]).T, values, rcond=None)[0]
    return np.asarray(found[1] - 1j * found[2])


def resonance(run: Run, specimen: str, volts: float, start_hz: float) -> Float:
    """Frequency (Hz), amplitude (m) and damping ratio at phase resonance; not a number where the method is unstable."""
    mode, _, stretch_s = CASES[specimen]
    shape = VirtualRig.shipped(specimen).linear_modes.drive_shape[mode] ** 2
    n, phase, frequency_hz, found = int(stretch_s * RATE_HZ), 0.0, start_hz, []
    for stretch in range(STRETCHES):
        theta = phase + 2.0 * np.pi * frequency_hz / RATE_HZ * np.arange(n + 1)
        ramp = np.minimum(1.0, (stretch * n + np.arange(n)) / (2.0 * n))
        values, phase = run(volts * ramp * np.cos(theta[:-1])), theta[-1] % (2.0 * np.pi)
        if not np.all(np.abs(values) < 1e6):
            return np.full(3, np.nan)
        force, x = fundamentals(values[-min(n, round(PERIODS * RATE_HZ / frequency_hz)) :], frequency_hz)
        omega, ratio = 2.0 * np.pi * frequency_hz, shape * force / x
        natural = math.sqrt(max(omega**2 + ratio.real, (0.9 * omega) ** 2))
        found.append((natural / 2.0 / np.pi, abs(x), ratio.imag / (2.0 * natural * omega)))
        if stretch < STRETCHES - LAST - 1:
            frequency_hz = natural / 2.0 / np.pi
    return np.mean(found[-LAST:], axis=0)


def errors(specimen: str, name: str, steps: int, truth: Float, slope: Float) -> tuple[float, float]:
    """Errors of frequency and damping, % of themselves, at the amplitude that the method has."""
    found = resonance(method(specimen, name, steps), specimen, CASES[specimen][1], truth[0])
    off = found - truth - slope * (found[1] - truth[1])
    return float(100.0 * off[0] / truth[0]), float(100.0 * off[2] / truth[2])


def seconds_of(run: Run, volts: Float) -> float:
    """Processor time of one run, us per sample."""
    start = time.thread_time()
    run(volts)
    return 1e6 * (time.thread_time() - start) / volts.size


def measure(specimen: str) -> dict[str, list[tuple[int, float, float, float]]]:
    """For each method: steps a sample, us a sample, errors of frequency and damping in %."""
    mode, volts, _ = CASES[specimen]
    start_hz = float(VirtualRig.shipped(specimen).linear_modes.frequency_hz[mode])
    truth = resonance(method(specimen, "runge-kutta", FINE), specimen, volts, start_hz)
    more = resonance(method(specimen, "product", FINE // 4), specimen, 1.01 * volts, truth[0])
    same = resonance(method(specimen, "product", FINE // 4), specimen, volts, truth[0])
    slope = (more - same) / (more[1] - same[1])
    wave = volts * np.sin(2.0 * np.pi * start_hz / RATE_HZ * np.arange(SAMPLES))
    work = {(n, k): partial(seconds_of, method(specimen, n, k), wave) for n in NAMES for k in STEPS}
    times = in_turn(work, ROUNDS)
    return {name: [(k, min(times[name, k]), *errors(specimen, name, k, truth, slope)) for k in STEPS] for name in NAMES}


def draw(found: dict[str, dict[str, list[tuple[int, float, float, float]]]], file: Path) -> None:
    """Draw error over work, one row of axes a specimen."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(2, 2, figsize=(10.0, 7.0), sharex=True, layout="constrained")
    for row, (specimen, methods) in zip(axes, found.items(), strict=True):
        for axis, column, what in zip(row, (2, 3), ("frequency", "damping"), strict=True):
            for name, points in methods.items():
                axis.loglog([p[1] for p in points], [abs(p[column]) for p in points], "o-", label=NAMES[name])
            axis.axhline({2: 1e-3, 3: 0.1}[column], color="grey", linestyle=":")
            axis.set(title=f"{specimen}, {what}", ylabel="error, % of itself", xlabel="plant, µs a sample")
            axis.grid(alpha=0.3)
    axes[0, 0].legend(fontsize="small")
    figure.savefig(file, dpi=110)


def main(figure: Path | None = None) -> None:
    """Print work and errors of each method, and draw them."""
    on_one_core()
    found = {}
    for specimen in CASES:
        found[specimen] = measure(specimen)
        for name, points in found[specimen].items():
            for steps, us, frequency, damping in points:
                print(
                    f"{specimen:14} {NAMES[name]:44} {steps:3} {us:7.3f} us  {frequency:+.6f} %  {damping:+.5f} %",
                    flush=True,
                )
    if figure is not None:
        draw(found, figure)


if __name__ == "__main__":
    typer.run(main)
