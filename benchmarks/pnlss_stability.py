"""Is what harmonic balance says of stability what simulations do? ``python -m benchmarks.pnlss_stability [--json]``.

Along the responses of hardening, softening, one-sided and saturating oscillators every fourth point and every unstable one is
simulated from a disturbance of a millionth; its growth or decay over the later periods is compared with ``stable`` and with the
largest multiplier. Stable points are also simulated for 300 periods and compared with the balance. Folds stand against the
frequencies at which simulations under a slowly changing frequency jump.
"""

import json
import sys
from math import comb

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from identification import Channel, Features, PnlssModel, SteadyStates, harmonic_response
from vibrolock.arrays import Float

HZ, DAMPING, RATE_HZ = 25.0, 0.01, 3200.0
EVERY, SHARE, PERIODS, SETTLED = 4, 1e-6, 60, 300
SWEEP_HZ_S, BESIDE_HZ = 0.01, 0.4


def oscillator(features: Features, force: list[float], middle: list[float]) -> PnlssModel:
    """``x'' + 2 z w x' + w^2 x = u + force . features``; ``middle`` are the coefficients at the middle of a sample."""
    w = 2 * np.pi * HZ
    block = np.array([[0.0, 1.0, 0.0], [-(w**2), -2 * DAMPING * w, 1.0], [0.0, 0.0, 0.0]])
    after = expm(block / RATE_HZ)
    return PnlssModel(
        a=after[:2, :2],
        b=after[:2, 2:],
        e=after[:2, 2:] @ np.array([middle]),
        c=np.array([[-(w**2), -2 * DAMPING * w]]),
        d=np.ones((1, 1)),
        f=np.array([force]),
        state_features=features,
        output_features=features,
        sample_rate_hz=RATE_HZ,
        inputs=(Channel("force", "force", "N"),),
        outputs=(Channel("drive", "drive", "m/s2"),),
        state_range=np.array([0.01, w * 0.01]),
        input_range=np.array([10.0]),
    )


def with_springs(cubic: float, quadratic: float = 0.0) -> PnlssModel:
    """Springs of second and third degree, at the displacement in the middle of a sample."""
    exponents, force, middle = [], [], []
    for degree, factor in ((2, quadratic), (3, cubic)):
        for power in range(degree + 1):
            exponents.append([degree - power, power, 0])
            force.append(-factor if power == 0 else 0.0)
            middle.append(-factor * comb(degree, power) * (0.5 / RATE_HZ) ** power)
    return oscillator(Features(variables=3, exponents=np.array(exponents)), force, middle)


def models() -> dict[str, tuple[PnlssModel, float]]:
    """Each with the force at which it is looked at, N."""
    saturating = Features.saturating([[400.0, 0.5, 0.0, 0.2]])
    return {
        "hardening": (with_springs(6e8), 2.0),
        "softening": (with_springs(-6e8), 0.9),
        "one-sided": (with_springs(6e8, 1e6), 1.2),
        "saturating": (oscillator(saturating, [-20.0], [-20.0]), 1.5),
    }


def waveform(harmonics: NDArray[np.complex128], theta: Float) -> Float:
    return np.asarray(np.real(harmonics.T @ np.exp(1j * np.arange(len(harmonics))[:, None] * theta)))


def rate_of(model: PnlssModel, points: SteadyStates, k: int) -> float:
    """Logarithm of what a disturbance grows by in a period."""
    samples = RATE_HZ / points.frequency_hz[k]
    theta = 2 * np.pi / samples * np.arange(int(PERIODS * samples))
    steady = waveform(points.states[k], theta)
    size = np.abs(steady).max(axis=1)
    run = model.simulate(
        waveform(points.inputs[k], theta), initial_state=steady[:, 0] + SHARE * size * np.array([1.0, 0.7])
    )
    away = np.max(np.abs(run.states - steady) / size[:, None], axis=0) / SHARE
    grown = np.log(np.maximum([part.max() for part in np.array_split(away, PERIODS)], 1e-30))[PERIODS // 4 :]
    used = np.isfinite(grown) & (grown < np.log(1e4))
    return float(np.polyfit(np.flatnonzero(used), grown[used], 1)[0])


def settled_error(model: PnlssModel, points: SteadyStates, k: int) -> float:
    """Largest error of the outputs in the last of many periods, over their largest value."""
    samples = RATE_HZ / points.frequency_hz[k]
    theta = 2 * np.pi / samples * np.arange(int(SETTLED * samples))
    run = model.simulate(waveform(points.inputs[k], theta), initial_state=waveform(points.states[k], np.zeros(1))[:, 0])
    exact, last = waveform(points.outputs[k], theta), slice(-int(samples), None)
    return float(np.max(np.abs(run.outputs - exact)[:, last]) / np.max(np.abs(exact)))


def jump_hz(model: PnlssModel, force_n: float, begin_hz: float, end_hz: float) -> float:
    """Where the amplitude changes most in a slow sweep, after its first tenth, Hz."""
    count = int(abs(end_hz - begin_hz) / SWEEP_HZ_S * RATE_HZ)
    hz = np.linspace(begin_hz, end_hz, count)
    run = model.simulate(force_n * np.cos(2 * np.pi / RATE_HZ * np.cumsum(hz))[None])
    width = int(RATE_HZ / min(begin_hz, end_hz)) + 1
    envelope = np.abs(run.outputs[0][: count // width * width]).reshape(-1, width).max(axis=1)
    ahead, first = 10, envelope.size // 10
    change = np.abs(np.log(envelope[ahead:] / envelope[:-ahead]))[first:]
    return float(hz[(first + int(np.argmax(change))) * width])


def main() -> None:
    rows = {}
    for name, (model, force_n) in models().items():
        found = harmonic_response(model, force_n, force="pure-sine", harmonics=11, largest_range_use=3.0)
        points = found.points
        chosen = np.union1d(np.arange(0, points.count, EVERY), np.flatnonzero(~points.stable))
        rates = np.array([rate_of(model, points, int(k)) for k in chosen])
        periods = RATE_HZ / points.frequency_hz[chosen]
        said = np.log(np.abs(points.multipliers[chosen]).max(axis=1)) * periods
        stable = points.stable[chosen]
        errors = [settled_error(model, points, int(k)) for k in chosen[stable]]
        folds = np.sort(found.folds.frequency_hz)
        jumps = []
        if folds.size == 2:
            low, high = folds - BESIDE_HZ * np.array([1.0, -1.0])
            jumps = [folds[0] - jump_hz(model, force_n, high, low), jump_hz(model, force_n, low, high) - folds[1]]
        rows[name] = {
            "points": int(chosen.size),
            "unstable": int(np.count_nonzero(~stable)),
            "agree": int(np.count_nonzero((rates < 0.0) == stable)),
            "rate_off_median": float(np.median(np.abs(rates - said))),
            "rate_off_worst": float(np.max(np.abs(rates - said))),
            "error_median": float(np.median(errors)),
            "error_worst": float(np.max(errors)),
            "folds_hz": folds.tolist(),
            "jumps_beyond_hz": jumps,
        }
    if "--json" in sys.argv:
        print(json.dumps(rows, indent=1))
        return
    heads = ("points", "unstable", "agree", "rate off: median", "worst", "error: median", "worst")
    print(
        f"{'':12} {heads[0]:>7} {heads[1]:>9} {heads[2]:>6} {heads[3]:>17} {heads[4]:>8} {heads[5]:>14} {heads[6]:>8}"
    )
    for name, row in rows.items():
        print(
            f"{name:12} {row['points']:7} {row['unstable']:9} {row['agree']:6} {row['rate_off_median']:17.1e} "
            f"{row['rate_off_worst']:8.1e} {row['error_median']:14.1e} {row['error_worst']:8.1e}"
        )
        for fold, beyond in zip(row["folds_hz"], row["jumps_beyond_hz"], strict=True):
            print(f"{'':12} fold {fold:.4f} Hz, a sweep of {SWEEP_HZ_S:g} Hz/s jumps {1e3 * beyond:+.1f} mHz beyond")
    total, agree = (sum(row[key] for row in rows.values()) for key in ("points", "agree"))
    print(f"{agree} of {total} points agree")


if __name__ == "__main__":
    main()
