"""What do fits of right and wrong structures say, and do bands hold? ``python -m benchmarks.right_and_wrong [PART]``.

Structures of `benchmarks.true_structures`, integrated by another method, are fitted with the laws that they have and with
others: two multisines, the mean of three periods each, 0.1 % noise. Parts:

- ``told``: error in training, residual over noise, what a report says, and whether bands of a multisine (RMS, largest value and
  relative error) and of a sweep (largest amplitude and its frequency) at 1, 1.5 and 2 times the level hold the truth.
- ``right``: how many fits of right structures are called wrong.
- ``auto``: laws that are chosen, errors, and the time over that of a fit of the right law.
"""

import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import typer

from benchmarks.true_structures import (
    BOUC_WEN,
    CUBIC,
    FRICTION,
    MAGNET,
    QUADRATIC_DAMPING,
    RATE_HZ,
    SLIDER,
    STOP,
    Structure,
    experiment,
    iwan,
    modes,
    response,
)
from identification import (
    ElementPlan,
    ExtrapolationError,
    IdentificationError,
    StructuredFit,
    fit_structured,
    simulated_run,
)
from identification.experiments import lacks_something, unsettled
from identification.models import (
    BoucWen,
    Coulomb,
    Iwan,
    Jenkins,
    MagnetSpring,
    Masing,
    PolynomialDamper,
    PolynomialSpring,
    Stop,
    Stribeck,
    peak_band,
    run_band,
)
from vibrolock.arrays import Float

SECONDS, AVERAGED_S = 30.0, 0.125
"""Length of a sweep, and of the two means behind its demodulation."""
LEVELS = (1.0, 1.5, 2.0)
LOW = {"band_hz": (6.0, 20.0), "measured": 1, "rms_n": 2.5}
"""A band with one of the modes."""


def _joint(*rows: tuple[float, float]) -> tuple[tuple[int, int, tuple[float, float]], ...]:
    return tuple((SLIDER, 0, row) for row in rows)


_STUCK: Any = {"stuck_n_m": (1e4, 0.0, 0.0)}
_POLYNOMIALS: Any = {"laws": (PolynomialSpring(), PolynomialDamper())}
_CUBIC = PolynomialSpring((0.0, 0.0))
_HARD, _SOFT = ((BOUC_WEN, 0, (1e4, beta, gamma, 1.0)) for beta, gamma in ((300.0, -400.0), (1000.0, 400.0)))
STRUCTURES = {
    "cubic spring": Structure(((CUBIC, 0, (1e9,)),)),
    "damper": Structure(((QUADRATIC_DAMPING, 0, (3e4,)),)),
    "Jenkins": Structure(_joint((1e4, 5.0)), **_STUCK),
    "Iwan": Structure(_joint(*iwan(1e4, 2.5e-3, -0.3)), **_STUCK),
    "Bouc-Wen, hardening": Structure((_HARD,), **_STUCK),
    "Bouc-Wen, softening": Structure((_SOFT,), **_STUCK),
    "stop above": Structure(((STOP, 0, (1.5e4, 6e-4, 1.0)),)),
    "magnet": Structure(((MAGNET, 0, (-1.5, 6e-3)),)),
    "Coulomb": Structure(((FRICTION, 0, (1.0, 0.0, 0.0)),)),
    "Stribeck": Structure(((FRICTION, 0, (0.7, 1.2, 0.03)),)),
    "two springs": Structure(((CUBIC, 0, (6e8,)), (CUBIC, 2, (6e7,)))),
    "joint and spring": Structure((*_joint((1e4, 5.0)), (CUBIC, 2, (3e8,))), **_STUCK),
    "cubic spring, one mode": Structure(((CUBIC, 0, (1e9,)),), **LOW),
    "Jenkins, one mode": Structure(_joint((1e4, 5.0)), **LOW, **_STUCK),
    "Bouc-Wen, one mode": Structure((_SOFT,), **LOW, **_STUCK),
    "stop above, one mode": Structure(((STOP, 0, (1.5e4, 6e-4, 1.0)),), **LOW),
}
RIGHT: dict[str, dict[str, Any]] = {
    "cubic spring": _POLYNOMIALS,
    "damper": {"laws": (PolynomialDamper(),)},
    "Jenkins": {"laws": (Jenkins(),)},
    "Iwan": {"laws": (Iwan(),)},
    "Bouc-Wen, hardening": {"laws": (BoucWen(),)},
    "Bouc-Wen, softening": {"laws": (BoucWen(),)},
    "stop above": {"laws": (Stop(),)},
    "magnet": {"laws": (MagnetSpring(),)},
    "Coulomb": {"laws": (Coulomb(),), "between": ("root",)},
    "Stribeck": {"laws": (Stribeck(),), "between": ("root",)},
    "two springs": {"elements": (ElementPlan((_CUBIC,), ("root",)), ElementPlan((_CUBIC,), ("tip",)))},
    "joint and spring": {"elements": (ElementPlan((Jenkins(),), ("root",)), ElementPlan((_CUBIC,), ("tip",)))},
    "cubic spring, one mode": _POLYNOMIALS,
    "Jenkins, one mode": {"laws": (Jenkins(),)},
    "Bouc-Wen, one mode": {"laws": (BoucWen(),)},
    "stop above, one mode": {"laws": (Stop(),)},
}
WRONG: list[tuple[str, str, dict[str, Any]]] = [
    ("cubic spring", "square spring", {"laws": (PolynomialSpring((0.0,)),)}),
    ("Jenkins", "polynomials", _POLYNOMIALS),
    ("Iwan", "polynomials", _POLYNOMIALS),
    ("Bouc-Wen, hardening", "masing", {"laws": (Masing(),)}),
    ("Bouc-Wen, hardening", "iwan", {"laws": (Iwan(),)}),
    ("Bouc-Wen, hardening", "jenkins", {"laws": (Jenkins(),)}),
    ("Bouc-Wen, softening", "masing", {"laws": (Masing(),)}),
    ("Coulomb", "masing", {"laws": (Masing(),)}),
    ("Coulomb", "jenkins", {"laws": (Jenkins(),)}),
    ("Stribeck", "coulomb", {"laws": (Coulomb(),), "between": ("root",)}),
    ("stop above", "stop below", {"laws": (Stop(sides="below"),)}),
    ("stop above", "polynomials", _POLYNOMIALS),
    ("two springs", "one of them", {"laws": (_CUBIC,), "between": ("root",)}),
    ("joint and spring", "joint", {"laws": (Jenkins(),), "between": ("root",)}),
    ("magnet", "polynomial spring of degree 3", {"laws": (_CUBIC,)}),
]
SEVERAL_LEVELS = (0.5, 1.0)


def judged(fit: StructuredFit, runs: list[Any]) -> tuple[float, bool]:
    """Return the largest residual over noise, and whether a report says that the model lacks something."""
    found = [simulated_run(fit.model, one, steps_left=fit.steps_left) for one in runs]
    wrong = any(lacks_something(one.over_noise, one.error).any() for one in found)
    return max(float(np.nanmax(one.over_noise)) for one in found), wrong and not unsettled(runs)


def fitted(name: str, how: dict[str, Any], seed: int) -> tuple[StructuredFit, list[Any]]:
    """Return a fit to two multisines, and these."""
    runs = [experiment(STRUCTURES[name], 1.0, 10 * seed + k) for k in range(2)]
    return fit_structured(modes(STRUCTURES[name]), runs, support=False, **how), runs


def _sweep(structure: Structure, level: float) -> tuple[Any, Any]:
    """Force of a sweep over time, and the phase of it."""
    low, high = structure.band_hz[0] + 2.0, 22.0

    def phase(time_s: Float) -> Float:
        return np.asarray(2.0 * np.pi * (low * time_s + 0.5 * (high - low) / SECONDS * time_s**2))

    size = 0.5 * level * structure.rms_n
    return lambda time_s: size * np.sin(phase(time_s)) * np.clip(0.1 * low * time_s, 0.0, 1.0), phase


def _peak(acceleration: Float, structure: Structure) -> tuple[float, float]:
    """Largest amplitude of the fundamental of a sweep's displacement, m, and its frequency, Hz."""
    low, high = structure.band_hz[0] + 2.0, 22.0
    time_s = np.arange(acceleration.size) / RATE_HZ
    turned = 2.0 * acceleration * np.exp(-1j * _sweep(structure, 1.0)[1](time_s))
    count = round(AVERAGED_S * RATE_HZ)
    for _ in range(2):
        turned = np.convolve(turned, np.ones(count) / count, "same")
    hz = low + (high - low) / SECONDS * time_s
    amplitude = np.abs(turned) / (2.0 * np.pi * hz) ** 2
    amplitude[: 2 * count], amplitude[-count:] = 0.0, 0.0
    top = int(np.argmax(amplitude))
    return float(amplitude[top]), float(hz[top])


def _multisine_band(fit: StructuredFit, structure: Structure, level: float, seed: int) -> str:
    run = experiment(structure, level, 7000 + seed, noise=0.0, periods=2)

    def outputs(model: Any) -> Float:
        return np.asarray(model.simulate_experiment(run).outputs[:, run.counted_from :])

    own, true = outputs(fit.model), run.counted_outputs
    error = np.sqrt(np.mean((own - true) ** 2, axis=1) / np.mean(own**2, axis=1))
    use = fit.model.simulate_experiment(run).range_use
    try:
        rms, peak, at_most = run_band(fit, "multisine", use, own, outputs)
    except ExtrapolationError:
        return f"{100.0 * np.max(error):.3g} %: refused"
    size, largest = np.sqrt(np.mean(true**2, axis=1)), np.max(np.abs(true), axis=1)
    held = np.all(
        (rms[0] <= size) & (size <= rms[1]) & (peak[0] <= largest) & (largest <= peak[1]) & (error <= at_most)
    )
    return f"{100.0 * np.max(error):.3g} % of {100.0 * np.max(at_most):.3g}: {'held' if held else 'MISSED'}"


def _sweep_band(fit: StructuredFit, structure: Structure, level: float) -> str:
    force, _ = _sweep(structure, level)
    u = force(np.arange(round(SECONDS * RATE_HZ)) / RATE_HZ)
    true = np.array(_peak(response(structure, force, SECONDS)[0], structure))
    run = fit.model.simulate(u[None])
    own = _peak(run.outputs[0], structure)
    shape = float(np.max(np.abs(fit.model.linearised().output_shapes[0])))
    ratio = 0.25 * level * structure.rms_n * shape**2 / ((2.0 * np.pi * own[1]) ** 2 * own[0])
    try:
        band = peak_band(
            fit, "sweep", run.range_use, own, ratio, lambda one: _peak(one.simulate(u[None]).outputs[0], structure)
        )
    except ExtrapolationError:
        return f"{100.0 * (own[0] / true[0] - 1.0):+.2f} %: refused"
    held = np.all((band[0] <= true) & (true <= band[1]))
    half = 50.0 * (band[1, 0] - band[0, 0]) / own[0]
    return f"{100.0 * (own[0] / true[0] - 1.0):+.2f} % of {half:.3g}: {'held' if held else 'MISSED'}"


def told(seed: int, systems: str) -> Iterator[str]:
    """Rows of the table, of right structures and then of wrong ones."""
    yield "| truth, fitted | training, % | residual/noise | called wrong | multisine at 1, 1.5, 2 | sweep at 1, 1.5, 2 |"
    yield "|---|---|---|---|---|---|"
    cases = [(name, "the same", how) for name, how in RIGHT.items()] + WRONG
    for name, law, how in cases:
        if systems and name not in systems.split("; "):
            continue
        fit, runs = fitted(name, how, seed)
        ratio, wrong = judged(fit, runs)
        structure = STRUCTURES[name]
        of = [
            ", ".join(_multisine_band(fit, structure, level, seed) for level in LEVELS),
            ", ".join(_sweep_band(fit, structure, level) for level in LEVELS),
        ]
        said = "yes" if wrong else "no"
        yield f"| {name}, {law} | {100.0 * fit.training_error:.3g} | {ratio:.3g} | {said} | {of[0]} | {of[1]} |"


def right(seed: int, systems: str) -> Iterator[str]:
    """One line for each fit of a right structure."""
    for name, how in RIGHT.items():
        if systems and name not in systems.split("; "):
            continue
        try:
            fit, runs = fitted(name, how, seed)
        except IdentificationError as error:
            yield f"{name} {seed}: {error}"
            continue
        ratio, wrong = judged(fit, runs)
        yield f"{name} {seed}: {100.0 * fit.training_error:.3g} %, {ratio:.3g}{' WRONG' if wrong else ''}"


def auto(seed: int, systems: str) -> Iterator[str]:
    """Laws that are chosen, and what they cost."""
    yield "| truth | chosen | training, % | validation, % | residual/noise | called wrong | time over one fit's |"
    yield "|---|---|---|---|---|---|---|"
    for name, structure in STRUCTURES.items():
        how = RIGHT[name]
        if "elements" in how or (systems and name not in systems.split("; ")):
            continue
        runs = [experiment(structure, level, 10 * seed + k) for k, level in enumerate(SEVERAL_LEVELS)]
        held_out = [experiment(structure, level, 500 + 10 * seed + k) for k, level in enumerate(SEVERAL_LEVELS)]
        begun = time.process_time()
        fit_structured(modes(structure), runs, support=False, **how)
        alone_s = time.process_time() - begun
        begun = time.process_time()
        fit = fit_structured(modes(structure), runs, support=False, laws="auto", validation=held_out)
        auto_s = time.process_time() - begun
        ratio, wrong = judged(fit, runs)
        laws = " + ".join(law.kind for one in fit.model.elements for law in one.laws) or "none"
        errors = [np.max(simulated_run(fit.model, one).error) for one in held_out]
        yield (
            f"| {name} | {laws} | {100.0 * fit.training_error:.3g} | {100.0 * max(errors):.3g} | {ratio:.3g} "
            f"| {'yes' if wrong else 'no'} | {auto_s / alone_s:.1f} of {alone_s:.0f} s |"
        )


def main(part: str = "told", first: int = 1, seeds: int = 1, systems: str = "") -> None:
    """Print a part for some seeds of noise and phases; ``systems``: some structures, with ``; `` between them."""
    for seed in range(first, first + seeds):
        for line in {"told": told, "right": right, "auto": auto}[part](seed, systems):
            print(line, flush=True)


if __name__ == "__main__":
    typer.run(main)
