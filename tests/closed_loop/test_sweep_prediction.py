"""Recorded sweeps of the virtual rigs, predicted from a recorded backbone and a recorded multisine.

The other modes are the rig's own, which a modal analysis of the same rig would give.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from identification import (
    Channel,
    Exciter,
    LinearModes,
    ModalProperties,
    NonlinearMode,
    Transient,
    compare,
    compare_sweep,
    identify_exciter,
    nonlinear_mode,
    predict_sweep,
    recorded_force_response,
    zero_crossings,
)
from rig.campaigns.plans import plan_from
from rig.measurements import point_rows
from simulators import VirtualRig
from tests.recorded import recorded_run
from tests.rig.rigs import bench_with

STINGER_N_M = {"magnet-beam": 6283185.0, "friction-beam": 9666439.0}
GAIN = {"magnet-beam": 1.0, "friction-beam": 10.0}


@cache
def exciter_of(bench: str, noise: float = 1.0) -> Exciter:
    with recorded_run(f"{bench}/exciter", bench_with(name=bench, noise_scale=noise), seed=3) as run:
        (spectra,) = run.spectra().values()
    return identify_exciter(
        spectra,
        sample_rate_hz=5000.0,
        stinger_stiffness_n_m=STINGER_N_M[bench],
        resistance_ohm=1.5,
        amplifier_gain=GAIN[bench],
        source=bench,
    )


@cache
def mode_of(bench: str) -> NonlinearMode:
    with recorded_run(f"{bench}/backbone") as run:
        return nonlinear_mode(run.backbone())


def properties_of(bench: str) -> ModalProperties:
    return ModalProperties.of(mode_of(bench))


@cache
def modes_of(bench: str) -> LinearModes:
    modes = VirtualRig.shipped(bench).linear_modes
    unknown, shape = np.full(modes.frequency_hz.size, np.nan), modes.drive_shape[None]
    return LinearModes(
        channels=(Channel("drive", "drive", "m/s2"),),
        frequency_hz=modes.frequency_hz,
        frequency_std_hz=unknown,
        damping_ratio=modes.damping_ratio,
        damping_ratio_std=unknown,
        shapes=shape,
        shapes_std=np.full(shape.shape, np.nan),
        phase_collinearity=unknown,
        lower=np.zeros(1, np.complex128),
        upper=np.zeros(1, np.complex128),
        lowest_hz=0.0,
        highest_hz=2500.0,
    )


def sweep_of(plan: str) -> Transient:
    with recorded_run(plan) as run:
        (sweep,) = run.sweeps().values()
    return sweep


@pytest.mark.parametrize("bench", ["magnet-beam", "friction-beam"])
@pytest.mark.parametrize("noise", [1.0, 10.0])
def test_the_shipped_multisine_tells_the_exciter_within_two_percent(bench: str, noise: float) -> None:
    shaker = VirtualRig.shipped(bench).exciter
    found = exciter_of(bench, noise)
    electrical = found.electrical(GAIN[bench])
    assert found.moving_mass_kg == pytest.approx(shaker.armature_mass_kg, rel=0.02)
    assert found.suspension_stiffness_n_m == pytest.approx(shaker.suspension_stiffness_n_m, rel=0.02)
    assert found.suspension_damping_n_s_m == pytest.approx(shaker.suspension_damping_n_s_m, rel=0.02)
    assert electrical["force_factor_n_a"] == pytest.approx(shaker.force_factor_n_a, rel=0.02)
    assert electrical["inductance_h"] == pytest.approx(shaker.inductance_h, rel=0.02)


@pytest.mark.parametrize(
    ("plan", "peak"),
    [
        ("magnet-beam/sweep-2", 0.01),
        ("magnet-beam/sweep-3", 0.01),
        ("friction-beam/sweep-1", 0.02),
        ("friction-beam/sweep-2", 0.02),
    ],
)
def test_with_the_exciter_coupled_the_peak_is_right_even_with_a_wrong_frequency(plan: str, peak: float) -> None:
    bench, sweep = plan.split("/")[0], sweep_of(plan)
    right = properties_of(bench)
    for change in (-0.002, 0.0, 0.002):
        p = ModalProperties.from_levels(
            right.modal_amplitude, (1.0 + change) * right.omega_rad_s, right.damping, right.drive_shape_at
        )
        prediction = predict_sweep(p, sweep, exciter=exciter_of(bench), linear_modes=modes_of(bench))
        error = compare_sweep(prediction, sweep)
        assert abs(error.peak_error) < peak
        assert abs(error.peak_frequency_error) < 0.004
        assert error.range_use < 1.0


def test_with_the_force_imposed_a_frequency_error_captures_the_slow_sweep() -> None:
    """Founding paper, magnet beam's second sweep: unbounded, or many times too large."""
    sweep = sweep_of("magnet-beam/sweep-2")
    p = replace(properties_of("magnet-beam"), largest_range_use=np.inf)
    wrong = ModalProperties.from_levels(
        p.modal_amplitude, 1.002 * p.omega_rad_s, p.damping, p.drive_shape_at, largest_range_use=np.inf
    )
    assert abs(compare_sweep(predict_sweep(p, sweep), sweep).peak_error) < 0.06
    captured = compare_sweep(predict_sweep(wrong, sweep), sweep)
    assert captured.peak_error > 1.0
    assert captured.verdict == "extrapolated far"


@pytest.mark.slow
def test_with_the_force_by_whole_periods_the_slow_sweep_is_captured_outright() -> None:
    """Founding paper, magnet beam's second sweep: six times too large and far beyond its frequency."""
    with recorded_run("magnet-beam/sweep-2") as run:
        ((number, sweep),) = run.sweeps().items()
        force = point_rows(run.recording, number)["inputs"][:, 0].astype(float)
    p = replace(properties_of("magnet-beam"), largest_range_use=np.inf)
    errors = {}
    for whole in (False, True):
        periods = zero_crossings(force, sample_rate_hz=5000.0, whole_periods=whole)
        errors[whole] = compare_sweep(predict_sweep(p, periods), sweep)
    assert 0.1 < errors[False].peak_error < 0.4
    assert abs(errors[False].peak_frequency_error) < 0.05
    assert 4.0 < errors[True].peak_error < 8.0
    assert errors[True].peak_frequency_error > 0.3


def test_a_constant_voltage_between_the_folds_is_predicted_on_the_states_it_held() -> None:
    plan = {"kind": "stepped-sine", "bench": "magnet-beam", "start_hz": 24.3, "stop_hz": 25.2, "steps": 10}
    with recorded_run(plan_from(plan | {"levels_v": [1.5], "record_periods": 10}, "plan")) as run:
        (reference,) = run.frequency_responses()
    predicted = recorded_force_response(mode_of("magnet-beam"), reference, linear_modes=modes_of("magnet-beam"))
    assert np.count_nonzero(~predicted.stable) >= 3
    error = compare(predicted, reference).error
    assert abs(error.peak_error) < 0.02
    assert error.envelope_error < 0.01
