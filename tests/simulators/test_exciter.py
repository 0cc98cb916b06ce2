from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.integrate import solve_ivp

from simulators.exciter import Exciter
from simulators.layout import Flag
from simulators.simulation import Simulation
from simulators.virtual_rig import VirtualRig
from tests.refused import refused
from tests.simulators.references import ideal

RATE_HZ = 5000.0
EXCITER = VirtualRig.shipped("magnet-beam").exciter
DROOP = {"droop_per_m": -20.0, "droop_per_m2": -3e4}
STIFF = {"suspension_cubic_n_m3": 4e8}
N_STATE = 11
X_A, V_A, CURRENT = 8, 9, 10


def alone(substeps: int = 8, **exciter: Any) -> VirtualRig:
    """An exciter whose stinger is as good as absent; the beam is linear."""
    stinger = {"stiffness_n_m": 1e-9, "damping_n_s_m": 0.0}
    return ideal(friction=(), elements=(), stinger=stinger, exciter=exciter, converter={"substeps": substeps})


def states(rig: VirtualRig, voltages: np.ndarray) -> np.ndarray:
    """State at the end of every sample."""
    simulation, out = Simulation(rig), []
    for voltage in voltages:
        simulation.run([voltage])
        out.append(simulation.state.inputs[:N_STATE].copy())
    return np.array(out)


def reference(exciter: Exciter, voltage: float, t_s: np.ndarray) -> np.ndarray:
    """Armature position, velocity and current under a step of voltage, by DOP853 from the equations.

    Between its steps DOP853 interpolates, which its tolerances do not bound: steps as long as they allow were wrong by 7e-6.
    With four steps to a sample, interpolation is below the tolerance of 1e-12 a step, and all 800 together are below 1e-9.
    """

    def rates(_: float, x: np.ndarray) -> np.ndarray:
        position, velocity, current = x
        g = exciter.force_factor_n_a * (1 + exciter.droop_per_m * position + exciter.droop_per_m2 * position**2)
        spring = exciter.suspension_stiffness_n_m * position + exciter.suspension_cubic_n_m3 * position**3
        force = g * current - spring - exciter.suspension_damping_n_s_m * velocity
        if exciter.amplifier == "current":
            loop = 2 * np.pi * exciter.bandwidth_hz * (exciter.amplifier_gain * voltage - current)
        else:
            coil_v = exciter.amplifier_gain * voltage - exciter.resistance_ohm * current - g * velocity
            loop = coil_v / exciter.inductance_h
        return np.array([velocity, force / exciter.armature_mass_kg, loop])

    step_s = 0.25 / RATE_HZ
    return solve_ivp(rates, (0.0, t_s[-1]), np.zeros(3), "DOP853", t_s, rtol=1e-12, atol=1e-16, max_step=step_s).y.T


@pytest.mark.parametrize("changes", [DROOP, STIFF, DROOP | STIFF, DROOP | STIFF | {"amplifier": "current"}])
def test_nonlinear_exciter_follows_its_equations(changes: dict[str, Any]) -> None:
    changes = changes | {"amplifier_gain": 2.0}
    t_s = np.arange(1, 201) / RATE_HZ
    expected = reference(EXCITER.model_copy(update=changes), 2.0, t_s)
    errors = {}
    for substeps in (4, 8, 16):
        got = states(alone(substeps, **changes), np.full(200, 2.0))[:, [X_A, V_A, CURRENT]]
        errors[substeps] = np.max(np.max(np.abs(got - expected), axis=0) / np.max(np.abs(expected), axis=0))
    linear = reference(EXCITER.model_copy(update={"amplifier_gain": 2.0}), 2.0, t_s)
    assert np.max(np.abs(linear - expected), axis=0)[0] > 0.02 * np.max(np.abs(expected[:, 0]))
    assert errors[4] < 1e-5
    assert errors[16] > 1e-10  # still the integrator's error, not the reference's
    assert errors[4] / errors[16] > 4.0**2.7  # of third order: 64


def test_current_amplifier_answers_a_step_as_a_first_order_loop() -> None:
    t_s = np.arange(1, 20) / RATE_HZ
    current_a = states(alone(1, amplifier="current", amplifier_gain=0.7, bandwidth_hz=300.0), np.full(19, 2.0))[
        :, CURRENT
    ]
    assert current_a == pytest.approx(1.4 * (1 - np.exp(-2 * np.pi * 300.0 * t_s)), rel=1e-9)


def test_current_amplifier_does_not_feel_the_structure() -> None:
    # At the coupled resonance a voltage amplifier's current falls, a current amplifier's does not.
    voltages = np.sin(2 * np.pi * 24.4 / RATE_HZ * np.arange(3000))
    bound = states(ideal(friction=(), exciter={"amplifier": "current"}), voltages)[2000:, CURRENT]
    free = states(alone(amplifier="current"), voltages)[2000:, CURRENT]
    assert bound == pytest.approx(free, abs=1e-9)
    assert np.max(np.abs(bound)) == pytest.approx(1.0, rel=1e-3)


@pytest.mark.parametrize(
    ("exciter", "clip_v"),
    [
        ({"voltage_limit_v": 3.0}, 3.0),
        ({"voltage_limit_v": 3.0, "amplifier_gain": 2.0}, 1.5),
        ({"amplifier": "current", "current_limit_a": 0.8, "amplifier_gain": 0.4}, 2.0),
    ],
)
def test_amplifier_clips_at_its_limit_and_says_so(exciter: dict[str, Any], clip_v: float) -> None:
    voltages = 4.0 * np.sin(2 * np.pi * 20.0 / RATE_HZ * np.arange(2000))
    clipped = Simulation(ideal(exciter=exciter)).run(voltages)
    unlimited = {key: value for key, value in exciter.items() if "limit" not in key}
    expected = Simulation(ideal(exciter=unlimited)).run(np.clip(voltages, -clip_v, clip_v))
    assert np.array_equal(clipped.force_n, expected.force_n)
    assert np.array_equal((clipped.flags & Flag.AMPLIFIER_CLIPPED) != 0, np.abs(voltages) > clip_v)
    assert not expected.flag & Flag.AMPLIFIER_CLIPPED


def energy_j(rig: VirtualRig, x: np.ndarray) -> float:
    """Of beam, armature, suspension with its stiffening, stinger and coil."""
    e, m = rig.exciter, rig.plant.n_mode
    q, v = x[:m], x[m : 2 * m]
    twice = (
        v @ v + q @ rig.plant.modal_stiffness @ q + e.armature_mass_kg * x[V_A] ** 2 + e.inductance_h * x[CURRENT] ** 2
    )
    twice += e.suspension_stiffness_n_m * x[X_A] ** 2 + e.suspension_cubic_n_m3 * x[X_A] ** 4 / 2
    return float(twice + rig.stinger.stiffness_n_m * (x[X_A] - rig.shape("drive") @ q) ** 2) / 2


def test_droop_and_stiff_suspension_make_no_power() -> None:
    # A short-circuited coil without resistance, nothing that damps: what is there stays there.
    drifts, currents = {}, 0.0
    for substeps in (4, 8, 16):
        table = ideal().model_dump()
        lossless = {"resistance_ohm": 0.0, "suspension_damping_n_s_m": 0.0}
        rig = ideal(
            friction=(),
            elements=(),
            structure=table["structure"] | {"damping_ratio": [0.0] * 4},
            exciter=lossless | DROOP | STIFF,
            stinger={"damping_n_s_m": 0.0},
            converter={"substeps": substeps},
        )
        simulation, energies = Simulation(rig), []
        simulation.state.inputs[4:8] = [0.9, 0.1, 0.0, 0.0]
        start = energy_j(rig, simulation.state.inputs)
        for _ in range(200):
            simulation.run(np.zeros(5))
            energies.append(energy_j(rig, simulation.state.inputs))
            currents = max(currents, abs(simulation.state.inputs[CURRENT]))
        drifts[substeps] = np.max(np.abs(np.array(energies) / start - 1))
    assert currents > 1.0
    assert drifts[16] < 1e-4
    assert drifts[8] / drifts[16] > 3.0


@pytest.mark.parametrize(
    ("exciter", "message"),
    [
        (
            {"amplifier": "current", "voltage_limit_v": 10.0},
            {"field": "voltage_limit_v", "value": 10.0, "allowed": "current_limit_a, it holds a current"},
        ),
        (
            {"current_limit_a": 10.0},
            {"field": "current_limit_a", "value": 10.0, "allowed": "voltage_limit_v, it holds a voltage"},
        ),
        ({"amplifier": "charge"}, {"field": "exciter.amplifier", "value": "charge"}),
        ({"amplifier_gain": 0.0}, {"field": "exciter.amplifier_gain", "value": 0.0}),
        ({"suspension_cubic_n_m3": -1.0}, {"field": "exciter.suspension_cubic_n_m3", "value": -1.0}),
    ],
)
def test_bad_exciter_is_refused(exciter: dict[str, Any], message: dict[str, object]) -> None:
    with refused(ValidationError, **message):
        ideal(exciter=exciter)


@pytest.mark.parametrize(("curvature", "flagged"), [(-1e6, True), (-1e4, False), (1e6, False)])
def test_a_force_factor_down_to_a_half_is_flagged(curvature: float, flagged: bool) -> None:
    rig = ideal("magnet-beam", exciter={"droop_per_m2": curvature})
    voltages = 2.0 * np.sin(2.0 * np.pi * 22.0 * np.arange(5000) / 5000.0)
    run = Simulation(rig).run(voltages)
    travel_m = np.max(np.abs(run.displacement_m["drive"]))  # the stinger hardly gives way: that of the armature
    assert rig.exciter.droop_limit_m == (pytest.approx(np.sqrt(0.5 / -curvature)) if curvature < 0.0 else np.inf)
    assert bool(run.flag & Flag.LAW_RANGE) == flagged == (travel_m > rig.exciter.droop_limit_m)
