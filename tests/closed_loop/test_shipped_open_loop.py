"""The shipped sweeps and multisines: forces as the paper states them, and the drop-out of the force that goes with them."""

import numpy as np
import pytest

import rig
from rig.campaigns.plans import load_plan, shipped_plans
from tests.recorded import recorded_run

SWEEPS = {
    # plan: force off resonance (N), smallest force as part of it; the paper's levels, PHYSICS.md's calibrated rig
    "magnet-beam/sweep-1": (0.4, 0.059, 0.002),
    "magnet-beam/sweep-2": (4.3, 0.061, 0.002),
    "friction-beam/sweep-1": (8.1, 0.19, 0.01),
    "friction-beam/sweep-2": (19.1, 0.049, 0.005),
}
FORCE_RMS_N = {
    "magnet-beam/multisine-1": 0.5,
    "magnet-beam/multisine-2": 2.6,
    "magnet-beam/multisine-3": 5.2,
    "friction-beam/multisine-1": 10.0,
    "friction-beam/multisine-2": 20.0,
    "friction-beam/multisine-3": 30.0,
    "friction-beam/multisine-4": 50.0,
}


def test_every_shipped_sweep_and_multisine_is_tested_here():
    tested = {*SWEEPS, *FORCE_RMS_N, "magnet-beam/sweep-3", "friction-beam/modal", "magnet-beam/modal"}
    tested |= {"magnet-beam/exciter", "friction-beam/exciter"}  # test_sweep_prediction
    held = {name for name in shipped_plans() if "/controlled-sweep" in name}  # test_shipped_held_force
    assert tested == {name for name in shipped_plans() if load_plan(name).kind in ("sweep", "multisine")} - held


@pytest.mark.parametrize("name", SWEEPS)
def test_the_force_of_a_slow_sweep_drops_at_resonance(name):
    force_n, smallest, tolerance = SWEEPS[name]
    with recorded_run(name) as run:
        assert run.complete
        point = run.recording.points[0]
    assert point["off_resonance_n"] == pytest.approx(force_n, rel=5e-3)
    assert point["minimum_ratio"] == pytest.approx(smallest, abs=tolerance)


def test_the_force_of_the_fast_sweep_drops_less_and_overshoots():
    with recorded_run("magnet-beam/sweep-3") as run:
        point = run.recording.points[0]
    assert point["off_resonance_n"] == pytest.approx(6.5, rel=5e-3)
    assert 0.13 < point["minimum_ratio"] < 0.18  # the narrower the window that is averaged over, the deeper
    assert point["overshoot_ratio"] == pytest.approx(1.2, abs=0.04)


@pytest.mark.parametrize("name", FORCE_RMS_N)
def test_a_multisine_has_the_force_it_is_named_after(name):
    plan = load_plan(name).model_copy(update={"realisations": 1, "periods": 2})
    with rig.run(plan, seed=5) as run:
        assert run.complete
        point = run.recording.points[0]
    assert f"{FORCE_RMS_N[name]:g} N RMS" in plan.description
    assert point["force_rms_n"] == pytest.approx(FORCE_RMS_N[name], rel=0.02)
    assert not point["warnings"]


@pytest.mark.parametrize("name", ["magnet-beam/modal", "friction-beam/modal"])
def test_a_modal_test_sees_every_listed_mode_well_above_the_noise_at_both_levels(name):
    with recorded_run(name, seed=3) as run:
        assert run.complete
        levels = run.spectra()
    assert tuple(levels) == load_plan(name).levels_rms_v
    modes_hz = {"magnet-beam": (24.37, 134.06), "friction-beam": (149.0, 564.3, 1138.3, 1496.5)}[name.split("/")[0]]
    for spectra, allowed in zip(levels.values(), (0.2, 0.1), strict=True):  # twice the level has half the noise
        response = spectra.frequency_response("drive")
        for mode_hz in modes_hz:
            near = abs(response.frequency_hz - mode_hz) < 0.02 * mode_hz
            height, noise = abs(response.value[near]), response.noise_std[near]
            assert response.frequency_hz[near][height.argmax()] == pytest.approx(mode_hz, rel=5e-3)
            high = height > 0.5 * height.max()  # where the force is smallest; a single line's noise is known poorly
            assert np.sqrt(np.mean(noise[high] ** 2)) < allowed * height.max()
