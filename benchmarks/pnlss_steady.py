"""How long a frequency response of a nonlinear state-space model takes: ``python -m benchmarks.pnlss_steady [--json]``.

A curve by harmonic balance, with folds and stability, stands against the model's own simulation, in the same run, of a stepped
sine up and down with as many steps as the curve has points and enough periods at each for a transient to decay to 1e-3: what
one would do without the balance, and what shows no unstable vibration. Medians over interleaved rounds, of processor seconds.
"""

import json
import statistics
import sys
import time
from dataclasses import replace

import numpy as np

from identification import Channel, Exciter, Features, HarmonicResponse, PnlssModel, harmonic_response

ROUNDS = 5
HZ, DAMPING, RATE_HZ = 25.0, 0.004, 800.0


def oscillator(pairs: int) -> PnlssModel:
    """A hardening oscillator, with further pairs of states beside it, all monomials of degrees two and three in them."""
    w, step, states = 2 * np.pi * HZ, 1.0 / RATE_HZ, 2 * pairs
    a = np.zeros((states, states))
    for pair in range(pairs):
        pole = np.exp((-DAMPING + 1j * np.sqrt(1 - DAMPING**2)) * w * step * (1.0 + 1.5 * pair))
        a[2 * pair : 2 * pair + 2, 2 * pair : 2 * pair + 2] = [[pole.real, pole.imag], [-pole.imag, pole.real]]
    b = np.full((states, 1), 0.1)
    features = Features.monomials(states, 1, (2, 3))
    e = np.zeros((states, features.count))
    cubes = features.exponents.max(axis=1) == 3
    e[0, cubes] = np.where(features.exponents[cubes, 0] == 3, -3e-4, 1e-6)
    e[1, cubes] = np.where(features.exponents[cubes, 0] == 3, 4e-3, -1e-6)
    return PnlssModel(
        a=a,
        b=b,
        c=np.ones((4, states)),
        d=np.zeros((4, 1)),
        e=e,
        f=np.zeros((4, features.count)),
        state_features=features,
        output_features=features,
        sample_rate_hz=RATE_HZ,
        inputs=(Channel("force", "force", "N"),),
        outputs=(Channel("drive", "drive", "m"), *(Channel(f"acc{k}", "response", "m/s2") for k in range(3))),
        state_range=np.full(states, 10.0),
        input_range=np.ones(1),
    )


def stepped(model: PnlssModel, response: HarmonicResponse, force_n: float) -> None:
    """Simulate the stepped sine."""
    hz = np.linspace(response.points.frequency_hz.min(), response.points.frequency_hz.max(), response.points.count // 2)
    decay_s = np.log(1e3) / (DAMPING * 2 * np.pi * HZ)
    frequency = np.repeat(np.concatenate([hz, hz[::-1]]), int(decay_s * RATE_HZ))
    model.simulate(force_n * np.cos(2 * np.pi / RATE_HZ * np.cumsum(frequency))[None])


def exciter() -> Exciter:
    return Exciter(
        force_per_volt_n_v=4.0,
        coil_time_constant_s=3e-4,
        moving_mass_kg=1e-6,
        suspension_damping_n_s_m=1e-5,
        suspension_stiffness_n_m=1e-2,
        back_emf_damping_n_s_m=1e-5,
    )


def main() -> None:
    two, four = oscillator(1), oscillator(2)
    voltage = replace(two, outputs=(Channel("drive", "drive", "m"), *two.outputs[1:]))
    jobs = {
        "2 states, pure sine": (two, "pure-sine", None),
        "2 states, exciter": (voltage, "fundamental", exciter()),
        "4 states, pure sine": (four, "pure-sine", None),
        "4 states, exciter": (four, "fundamental", exciter()),
    }
    force_n = 0.15
    rows = {}
    for name, (model, held, shaker) in jobs.items():
        taken: dict[str, list[float]] = {"balance": [], "simulation": []}
        for _ in range(ROUNDS + 1):
            begin = time.process_time()
            found = harmonic_response(model, force_n, force=held, exciter=shaker, largest_range_use=3.0)  # type: ignore[arg-type]
            middle = time.process_time()
            stepped(model, found, force_n)
            taken["balance"].append(middle - begin)
            taken["simulation"].append(time.process_time() - middle)
        balance, simulation = (statistics.median(seconds[1:]) for seconds in taken.values())  # the first compiles
        rows[name] = {
            "points": found.points.count,
            "folds": found.folds.count,
            "seconds": balance,
            "of_the_simulation": balance / simulation,
        }
    if "--json" in sys.argv:
        print(json.dumps(rows, indent=1))
        return
    print(f"{'':24} {'points':>7} {'folds':>6} {'seconds':>9} {'of simulation':>14}")
    for name, row in rows.items():
        print(f"{name:24} {row['points']:7} {row['folds']:6} {row['seconds']:9.3f} {row['of_the_simulation']:14.4f}")


if __name__ == "__main__":
    main()
