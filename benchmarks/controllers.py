"""Controllers side by side on both shipped rigs: ``python -m benchmarks.controllers [--json] [SPECIMEN...]``.

Every controller goes up the levels of the paper's backbone. A point counts as there when the phase error averaged over ten
periods is within 1 deg, the amplitude within 1 %, and both stay so for twenty periods; these twenty are not counted, the ramp
to the level is. Frequency and damping are compared with harmonic balance of the coupled rig at the force that was measured.

Gains come from the virtual rig's own noise-free frequency responses, as `rig tune` would find them on a quiet rig.
"""

import json
import math
import statistics
import sys
from typing import Any

import numpy as np

import rig
from controller import preset
from controller.tuning import PlantModel, complex_response_law, exact_phase_law, exact_scheduled_law, hippold_gains
from rig.bench import Bench, load_bench
from rig.campaigns.backbone.plan import BackbonePlan
from rig.campaigns.plans import load_plan
from simulators import VirtualRig
from simulators.analysis import PeriodicResponses, frequency_response, phase_resonance_backbone

HELD_PERIODS = 20
RULE = {
    "phase_deg": 1.0,
    "amplitude": 0.01,
    "average_periods": 10,
    "settled_periods": HELD_PERIODS,
    "longest_periods": 1500,
}
RAMP_PERIODS = {"magnet-beam": 10, "friction-beam": 10}
FREQUENCY_SHARE = {"magnet-beam": 1.0 / 8.0, "friction-beam": 1.0 / 12.0}  # of w_LP; a far coupled pole bears less


def plant_of(bench: Bench) -> PlantModel:
    """The plant at low level, from the virtual rig's frequency responses."""
    virtual = VirtualRig.shipped(bench.name)
    centre = bench.specimen.linear_frequency_hz
    frequency_hz = np.linspace(0.8 * centre, 1.2 * centre, 801)
    response = frequency_response(virtual, frequency_hz)
    return PlantModel.from_frequency_responses(
        frequency_hz,
        response.force_n_per_v,
        response.sensor_per_v["drive"],
        sample_rate_hz=bench.sample_rate_hz,
        latency_samples=1.5 + virtual.filter_delay_samples,
    )


def controllers(bench: Bench, plant: PlantModel) -> dict[str, dict[str, Any]]:
    """The controllers' tables, as in a plan."""
    f0 = bench.specimen.linear_frequency_hz
    corner = 2.0 * math.pi * f0 / 5.0
    frame = {"centre_frequency_hz": f0, "frequency_window_hz": [0.9 * f0, 1.1 * f0]}
    adaptive = frame | {"detector": "adaptive", "low_pass_rad_s": corner}
    paper = preset("magnet-beam" if bench.name == "magnet-beam" else "friction-beam")
    closed, exact = hippold_gains(plant, corner).law, exact_phase_law([plant], corner)
    scheduled, response = exact_scheduled_law([plant], corner), complex_response_law(plant, corner)
    pole = plant.pole_offset_rad_s(-90.0)
    gain = complex(plant.acceleration_per_v(1j * plant.lock_frequency_rad_s(-90.0)))
    complex_response = adaptive | {
        "frequency_law": "frequency-error",
        "frequency_integral_per_s": corner * FREQUENCY_SHARE[bench.name],
        "response_integral_per_s": response.integral_per_s,
        "plant_pole_rad_s": [pole.real, pole.imag],
    }
    return {
        "preset B": paper.model_dump(),
        "Hippold, w0/5": adaptive | {"k1": closed.proportional_per_s, "k2": closed.integral_per_s2},
        "exact T(s), w0/5": adaptive | {"k1": exact.proportional_per_s, "k2": exact.integral_per_s2},
        "exact T(s), scheduled": adaptive
        | {
            "frequency_law": "frequency-error",
            "frequency_proportional": scheduled.proportional,
            "frequency_integral_per_s": scheduled.integral_per_s,
        },
        "frequency error, complex response": complex_response,
        "the same by the force at rest": complex_response
        | {"rest_low_pass_rad_s": 2.0 * corner, "plant_gain_per_v": [gain.real, gain.imag]},
    }


def plan_for(bench: Bench, controller: dict[str, Any], paper: BackbonePlan, truth: PeriodicResponses) -> BackbonePlan:
    """The paper's backbone with a controller; levels are responses where it has a loop for them."""
    levels: dict[str, Any] = {"levels_v": paper.levels_v}
    if "response_integral_per_s" in controller and controller["response_integral_per_s"] > 0.0:
        levels = {"levels_m": truth.amplitude_m.tolist(), "start_v": float(truth.voltage_v[0]), "start_periods": 5.0}
    return BackbonePlan.model_validate(
        {
            "bench": bench.name,
            "ramp_periods": RAMP_PERIODS[bench.name],
            "record_periods": 50,
            "settle": RULE,
            "on_lost_lock": "skip",
            "controller": controller,
            **levels,
        }
    )


def compared(bench: Bench, controller: dict[str, Any], truth: PeriodicResponses, seed: int) -> dict[str, Any]:
    """One backbone: periods a point, points that did not come to be, errors of frequency and damping."""
    paper = load_plan(f"{bench.name}/backbone")
    assert isinstance(paper, BackbonePlan)
    plan = plan_for(bench, controller, paper, truth)
    with rig.run(plan, bench=bench, seed=seed) as run:
        points = run.recording.points
    there = [point for point in points if point["accepted"]]
    forces = np.array([point["force_n"] for point in there])
    order = np.argsort(forces)
    exact = phase_resonance_backbone(VirtualRig.shipped(bench.name), forces_n=forces[order])
    frequency = np.array([point["modal_frequency_hz"] for point in there])[order]
    damping = np.array([point["damping_ratio"] for point in there])[order]
    periods = [plan.ramp_periods + point["settle_periods"] - HELD_PERIODS for point in there]
    return {
        "points": len(there),
        "asked_points": len(points),
        "lost_or_not_settled": [point["reason"] for point in points if not point["accepted"]],
        "least_periods": min(periods),
        "median_periods": statistics.median(periods),
        "most_periods": max(periods),
        "frequency_error_percent": 100.0 * float(np.abs(frequency / exact.modal_frequency_hz - 1.0).max()),
        "damping_error_percent": 100.0 * float(np.abs(damping / exact.damping_ratio - 1.0).max()),
    }


def measure(specimens: list[str], seed: int = 0) -> dict[str, dict[str, dict[str, Any]]]:
    """Every controller on every specimen."""
    out: dict[str, dict[str, dict[str, Any]]] = {}
    for name in specimens:
        bench = load_bench(name)
        paper = load_plan(f"{name}/backbone")
        assert isinstance(paper, BackbonePlan)
        truth = phase_resonance_backbone(VirtualRig.shipped(name), voltages_v=paper.levels_v)
        laws = controllers(bench, plant_of(bench))
        out[name] = {label: compared(bench, law, truth, seed) for label, law in laws.items()}
    return out


if __name__ == "__main__":
    chosen = [argument for argument in sys.argv[1:] if not argument.startswith("-")]
    results = measure(chosen or ["magnet-beam", "friction-beam"])
    if "--json" in sys.argv:
        print(json.dumps(results, indent=2))
    else:
        for name, rows in results.items():
            print(f"{name:36} points   periods: least median  most   worst error: frequency   damping")
            for label, row in rows.items():
                print(
                    f"  {label:34} {row['points']:3d}/{row['asked_points']:<3d}          {row['least_periods']:5.0f} "
                    f"{row['median_periods']:6.0f} {row['most_periods']:5.0f}"
                    f"{row['frequency_error_percent']:20.4f} % {row['damping_error_percent']:7.2f} %"
                )
                for reason in row["lost_or_not_settled"]:
                    print(f"      {reason}")
