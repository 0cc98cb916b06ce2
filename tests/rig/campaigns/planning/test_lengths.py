"""How many points a plan may have, and how long it may take: what is beyond is refused before anything is expanded."""

import time

import numpy as np
import pytest

from rig.bench import load_bench
from rig.campaigns.planning.lengths import check_length
from rig.campaigns.planning.plan import MOST_POINTS
from rig.campaigns.plans import bench_of, load_plan, plan_from, shipped_plans
from rig.errors import ConfigurationError
from tests.refused import refused


def changed(name, **changes):
    return plan_from({**load_plan(name).model_dump(mode="json", exclude_none=True), **changes}, "plan.toml")


@pytest.mark.parametrize(
    ("name", "changes", "said"),
    [
        ("magnet-beam/backbone", {"levels_v": np.linspace(0.1, 1.0, 10_001).tolist()}, "levels_v: 10001 (levels_v)"),
        ("magnet-beam/backbone", {"repeats": 1000, "levels_v": [0.1 * n for n in range(1, 12)]}, "repeats: "),
        (
            "magnet-beam/backbone",
            {"levels_v": np.linspace(0.1, 1.0, 5_001).tolist(), "direction": "up-down"},
            "levels_v",
        ),
        ("magnet-beam/stepped-sine-up", {"steps": 100_000}, "steps: "),
        ("magnet-beam/sweep-1", {"levels_v": np.linspace(0.1, 1.0, 10_001).tolist()}, "levels_v: "),
        ("magnet-beam/multisine-1", {"realisations": 1000, "levels_rms_v": [0.01 * n for n in range(1, 12)]}, "realis"),
        (
            "magnet-beam/response-controlled",
            {"phase_lags_deg": np.linspace(-170, -10, 9_999).tolist()},
            "phase_lags_deg",
        ),
        ("friction-beam/continuous-backbone", {"levels_m": np.linspace(1e-6, 1e-4, 10_001).tolist()}, "levels_m: "),
    ],
)
def test_more_points_than_anybody_measures_are_refused_at_once_by_key(name, changes, said):
    began = time.process_time()
    with refused(ConfigurationError, allowed="up to 10000", where="plan.toml") as caught:
        changed(name, **changes)
    assert time.process_time() - began < 1.0
    assert f"plan.toml: {said}" in str(caught.value).replace("`", "")


@pytest.mark.parametrize("step_deg", [1e-3, 1e-9, 1e-30])
def test_steps_of_a_lag_are_counted_before_they_are_made(step_deg):
    with refused(ConfigurationError, "points", field="step_deg", allowed="up to 10000"):
        changed(
            "magnet-beam/stepped-phase-paper", phase_lags_deg=None, start_deg=-170.0, stop_deg=-10.0, step_deg=step_deg
        )


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("magnet-beam/backbone", {"levels_v": np.linspace(0.01, 1.0, MOST_POINTS).tolist()}),
        (
            "magnet-beam/stepped-phase-paper",
            {"levels_rms_n": [0.1], "start_deg": -170.0, "stop_deg": -10.0, "step_deg": 0.04, "direction": "up-down"},
        ),
        ("magnet-beam/multisine-1", {"levels_rms_v": np.linspace(0.01, 0.1, 2_000).tolist(), "realisations": 5}),
        (
            "friction-beam/continuous-backbone",
            {"levels_m": np.linspace(2e-5, 3e-5, MOST_POINTS).tolist(), "repeats": 1},
        ),
        (
            "magnet-beam/response-controlled",
            {
                "levels_m": [1e-3],
                "phase_lags_deg": np.linspace(-150, -30, 4_999).tolist(),
                "plant": load_plan("magnet-beam/continuous-backbone").model_dump(mode="json")["plant"],
            },
        ),
    ],
)
def test_a_plan_of_the_most_points_is_ready_within_seconds(name, changes):
    began = time.process_time()
    plan = changed(name, **changes)
    bench = bench_of(plan, "")
    plan.check(bench)
    assert len(plan.segments(bench.sample_rate_hz)) > 0
    assert time.process_time() - began < 6.0  # a slow machine's; 47 s when every point took a Fourier transform


@pytest.mark.parametrize("name", shipped_plans())
def test_a_shipped_plan_is_not_too_long(name):
    plan = load_plan(name)
    check_length(plan, bench_of(plan, name))


@pytest.mark.parametrize(
    ("name", "changes", "said"),
    [
        (
            "magnet-beam/backbone",
            {"record_periods": 1_000_000},
            {"says": "up-to-samples-of-one-record", "field": "record_periods"},
        ),
        (
            "magnet-beam/backbone",
            {"settle": {"longest_periods": 1e6}, "repeats": 700},
            {"says": "the-plan-may", "field": "settle.longest_periods"},
        ),
        (
            "magnet-beam/backbone",
            {"ramp_periods": 1e5, "repeats": 700},
            {"says": "the-plan-may-take-days", "field": "ramp_periods"},
        ),
        (
            "magnet-beam/multisine-1",
            {"periods": 100_000},
            {"says": "up-to-samples-of-one-record-2", "field": "periods"},
        ),
    ],
)
def test_a_plan_of_absurd_length_is_refused_by_the_key_that_makes_it_so(name, changes, said):
    with refused(ConfigurationError, **said):
        check_length(changed(name, **changes), load_bench("magnet-beam"))


def test_a_run_of_absurd_length_leaves_no_file(tmp_path):
    import rig

    with refused(ConfigurationError, "samples-of-one-record", field="record_periods"):
        rig.run(changed("magnet-beam/backbone", record_periods=1_000_000), output=tmp_path / "run.h5")
    assert list(tmp_path.iterdir()) == []
