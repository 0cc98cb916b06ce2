from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.integrate import solve_ivp

from simulators.scatter import Deviation
from simulators.simulation import Simulation, TimeSeries
from simulators.virtual_rig import VirtualRig
from simulators.wear import Wear
from tests.refused import refused
from tests.simulators.references import EquationsOfMotion, ideal

RATE_HZ = 5000.0
SOFTENING: dict[str, Any] = {
    "frequency_per_s": [-0.2],
    "damping_per_s": [0.5, 0, 0, 1],
    "until_s": 1.0,
    "every_s": 0.02,
}
VOLTAGES = 0.5 * np.sin(2 * np.pi * 24.0 / RATE_HZ * np.arange(450))


def driven(rig: VirtualRig, *blocks: int) -> TimeSeries:
    """A run in blocks of these sizes, again and again; joined."""
    simulation, parts, first = Simulation(rig, seed=5), [], 0
    while first < VOLTAGES.size:
        n = blocks[len(parts) % len(blocks)]
        parts.append(simulation.run(VOLTAGES[first : first + n]))
        first += n
    measured = {name: np.concatenate([part.measured[name] for part in parts]) for name in parts[0].measured}
    force_n = np.concatenate([part.force_n for part in parts])
    moved = {at: np.concatenate([part.displacement_m[at] for part in parts]) for at in parts[0].displacement_m}
    return TimeSeries(parts[0].time_s, VOLTAGES, measured, force_n, moved, np.concatenate([p.flags for p in parts]))


def same(one: TimeSeries, other: TimeSeries) -> bool:
    return all(np.array_equal(one.measured[name], other.measured[name]) for name in one.measured)


def test_rates_of_zero_are_a_rig_without_wear_bit_for_bit() -> None:
    plain = VirtualRig.shipped("magnet-beam")
    still = VirtualRig.shipped("magnet-beam", wear={"frequency_per_s": [0.0], "damping_per_s": [0.0] * 4})
    assert not still.wear.wears
    arrays, _ = still.build(5)
    ((held, part),) = still.pieces(arrays, 0, 10**9)
    assert held is arrays
    assert part == slice(0, 10**9)
    assert same(driven(plain, 450), driven(still, 450))
    assert np.array_equal(still.worn(3.0).plant.dynamics, plain.plant.dynamics)


@pytest.mark.parametrize("specimen", ["magnet-beam", "friction-beam"])
@pytest.mark.parametrize("blocks", [(1,), (7,), (50,), (100,), (99, 1, 101)])
def test_samples_do_not_depend_on_the_block(specimen: str, blocks: tuple[int, ...]) -> None:
    rig = VirtualRig.shipped(specimen, wear=SOFTENING | {"damping_per_s": [0.5], "frequency_per_s": [-0.05]})
    whole = driven(rig, 450)
    assert same(whole, driven(rig, *blocks))
    unworn = driven(VirtualRig.shipped(specimen), 450)
    for name, values in whole.measured.items():
        assert np.array_equal(values[:100], unworn.measured[name][:100])
        assert not np.array_equal(values[100:], unworn.measured[name][100:])


def test_linear_modes_of_the_worn_rig_are_moved_as_asked() -> None:
    rig = ideal(friction=(), elements=(), wear=SOFTENING)
    nominal = ideal(friction=(), elements=()).linear_modes
    for time_s, at_s in ((0.0, 0.0), (0.5, 0.5), (0.5198, 0.5), (0.52, 0.52), (1.0, 1.0), (7.0, 1.0)):
        modes = rig.worn(time_s).linear_modes
        assert modes.frequency_hz == pytest.approx(nominal.frequency_hz * (1.0 - 0.2 * at_s), rel=1e-9)
        damping = nominal.damping_ratio * (1.0 + np.array([0.5, 0.0, 0.0, 1.0]) * at_s)
        assert modes.damping_ratio == pytest.approx(damping, rel=1e-9)
        assert not rig.worn(time_s).wear.wears


def test_the_free_decay_of_a_run_has_frequency_and_damping_of_the_worn_modes() -> None:
    structure = {"kind": "modal", "frequency_hz": [20.0], "damping_ratio": [0.002], "shapes": {"drive": [1.0]}}
    loose = {"at": "drive", "stiffness_n_m": 0.01, "damping_n_s_m": 0.0}
    sensors = [ideal().sensors[1].model_dump() | {"at": "drive"}]
    wear = {"frequency_per_s": [-0.02], "damping_per_s": [0.25], "until_s": 3.5}
    rig = ideal(friction=(), elements=(), sensors=sensors).model_dump()
    rig = VirtualRig.model_validate(rig | {"structure": structure, "stinger": loose, "wear": wear})
    pulse = np.zeros(25_000)
    pulse[:50] = 1.0
    moved = Simulation(rig).run(pulse).displacement_m["drive"]
    for second, at_s in ((1, 1.0), (2, 2.0), (4, 3.5)):
        x = moved[second * 5000 : (second + 1) * 5000 : 25]  # 8 samples a period
        # x_k+1 = a x_k + b x_k-1 holds for a free oscillation alone: a = 2 r cos(w_d h), b = -r^2
        (a, b), *_ = np.linalg.lstsq(np.column_stack([x[1:-1], x[:-2]]), x[2:], rcond=None)
        pole = np.log((a + 1j * np.sqrt(-4.0 * b - a**2)) / 2.0) * RATE_HZ / 25
        modes = rig.worn(second).linear_modes
        assert abs(pole) / (2.0 * np.pi) == pytest.approx(modes.frequency_hz[0], rel=2e-6)
        assert modes.frequency_hz[0] == pytest.approx(20.0 * (1.0 - 0.02 * at_s), rel=1e-9)
        assert -pole.real / abs(pole) == pytest.approx(modes.damping_ratio[0], rel=2e-3)
        assert modes.damping_ratio[0] == pytest.approx(0.002 * (1.0 + 0.25 * at_s), rel=1e-9)


def test_a_run_follows_the_equations_of_motion_with_frequencies_and_damping_of_the_time() -> None:
    rig = ideal(friction=(), wear=SOFTENING)
    n, step, dt = VOLTAGES.size, 100, 1.0 / RATE_HZ
    truth, states = EquationsOfMotion(rig), np.zeros((n, 11))
    omega, zeta = truth.omega, truth.zeta
    for k in range(n - 1):
        t = k // step * step * dt
        truth.omega = omega * (1.0 - 0.2 * t)
        truth.zeta = zeta * (1.0 + np.array([0.5, 0.0, 0.0, 1.0]) * t)
        voltage = VOLTAGES[k]
        solved = solve_ivp(lambda _, x, u=voltage: truth(x, u), (0.0, dt), states[k], "DOP853", rtol=1e-9, atol=1e-13)
        states[k + 1] = solved.y[:, -1]
    moved = driven(rig, n).displacement_m
    for at in ("drive", "magnet"):
        expected = states[:, :4] @ rig.shape(at)
        unworn = driven(ideal(friction=()), n).displacement_m[at]
        assert np.max(np.abs(moved[at] - expected)) < 1e-3 * np.max(np.abs(expected))
        assert np.max(np.abs(unworn - expected)) > 0.02 * np.max(np.abs(expected))


@pytest.mark.parametrize("specimen", ["magnet-beam", "friction-beam"])
def test_a_run_has_the_plant_of_the_worn_rig_of_that_time(specimen: str) -> None:
    rig = VirtualRig.shipped(specimen, scatter={"frequency": 0.01}, wear=SOFTENING | {"damping_per_s": [0.5]})
    drawn = rig.realised(3)
    arrays, _ = drawn.build(3)
    for held, part in drawn.pieces(arrays, 0, 450):
        truth, _ = drawn.worn(part.start / RATE_HZ).build(3)
        late, _ = drawn.worn((part.stop - 1) / RATE_HZ).build(3)
        for name in ("step", "correct", "sense", "noise_keys", "elements"):
            assert np.array_equal(getattr(held, name), getattr(truth, name))
            assert np.array_equal(getattr(late, name), getattr(truth, name))


def test_wear_comes_on_top_of_a_deviation() -> None:
    wear = Wear(frequency_per_s=(-0.01,), until_s=50.0)
    both = wear.deviation(10.0, 2, Deviation(frequency=(0.02, 0.0)))
    assert both.frequency == pytest.approx((1.02 * 0.9 - 1.0, -0.1), rel=1e-12)
    assert both.damping == (0.0, 0.0)
    assert wear.deviation(80.0, 1).frequency == pytest.approx((-0.5,), rel=1e-12)


def test_after_its_end_the_plant_is_not_computed_again() -> None:
    rig = VirtualRig.shipped("magnet-beam", wear=SOFTENING | {"until_s": 0.05})
    arrays, _ = rig.build()
    held = [piece for piece, _ in rig.pieces(arrays, 0, 600)]
    assert len(held) == 6
    assert [one is other for one, other in pairwise(held)] == [False, False, False, True, True]
    modes = VirtualRig.shipped("magnet-beam", friction=[], elements=[], wear=SOFTENING | {"until_s": 0.05}).worn(9.0)
    assert modes.deviation.frequency == pytest.approx((-0.01,) * 4, rel=1e-12)


def test_a_change_of_the_plant_takes_no_new_modes(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = VirtualRig.shipped("friction-beam", wear=SOFTENING | {"damping_per_s": [0.5]})
    arrays, _ = rig.build()
    monkeypatch.setattr("simulators.structures.structure.lap_joint_modes", None)
    steps = [held.step for held, _ in rig.pieces(arrays, 100, 1000)]
    assert len(steps) == 10
    assert not any(np.array_equal(one, other) for one, other in pairwise(steps))


@pytest.mark.parametrize(
    ("wear", "message"),
    [
        (
            {"frequency_per_s": [-1e-4, 0.0]},
            {"field": "until_s", "allowed": "below 10000, where frequency_per_s = -0.0001 reaches -100 %"},
        ),
        (
            {"frequency_per_s": [1e-4, 0.0]},
            {"field": "wear.frequency_per_s", "allowed": "4, one per mode, one for all, or none"},
        ),
        (
            {"damping_per_s": [0.0] * 5},
            {"field": "wear.damping_per_s", "allowed": "4, one per mode, one for all, or none"},
        ),
        (
            {"frequency_per_s": [-1e-2], "until_s": 100.0},
            {"field": "until_s", "value": 100.0, "allowed": "below 100, where frequency_per_s = -0.01 reaches -100 %"},
        ),
        (
            {"damping_per_s": [-0.5, 0, 0, 0], "until_s": 3.0},
            {"field": "until_s", "value": 3.0, "allowed": "below 2, where damping_per_s = -0.5 reaches -100 %"},
        ),
        (
            {"frequency_per_s": [-1e-2], "until_s": 99.0},
            {"field": "wear.until_s", "value": 99.0},
        ),
        ({"frequency_per_s": [-2.0]}, {"field": "wear.frequency_per_s.0", "value": -2.0}),
        ({"every_s": 0.0}, {"says": "greater-than"}),
        ({"every_s": -1.0}, {"says": "greater-than"}),
        ({"until_s": -1.0}, {"says": "greater-than"}),
        ({"every_s": 1e-4}, {"field": "wear.every_s", "value": 0.0001, "allowed": "from 0.0002, one sample"}),
    ],
)
def test_wear_that_is_not_physical_is_refused(wear: dict[str, Any], message: dict[str, object]) -> None:
    with refused(ValidationError, **message):
        VirtualRig.shipped("magnet-beam", wear=wear)


@pytest.mark.parametrize("time_s", [-1.0, float("nan"), float("inf")])
def test_a_time_before_the_run_is_refused(time_s: float) -> None:
    with refused(ValueError, field="time_s", allowed="from 0, finite"):
        VirtualRig.shipped("magnet-beam", wear=SOFTENING).worn(time_s)
