import numpy as np
import pytest

import rig
from identification import nonlinear_mode
from rig.bench import Bench
from rig.campaigns.plans import load_plan
from simulators import VirtualRig
from simulators.ensemble import ensemble
from tests.rig.rigs import bench_with


def first_point(variant: tuple[Bench, int]) -> tuple[float, float]:
    bench, seed = variant
    plan = load_plan("magnet-beam/backbone")
    with rig.run(plan.model_copy(update={"levels_v": plan.levels_v[:2]}), bench=bench, seed=seed) as run:
        mode = nonlinear_mode(run.backbone())
    return float(mode.modal_frequency_hz[0]), float(mode.damping_ratio[0])


def test_whole_tests_run_in_parallel_and_show_the_scatter_of_the_specimen() -> None:
    # 1e-3 of the structure alone, of which the linear stiffness of the magnets leaves (21.4 / 24.4)^2.
    bench = bench_with(scatter={"frequency": 1e-3})
    variants = {f"run {seed}": (bench, seed) for seed in range(6)}
    found = dict(ensemble(variants, first_point, n_jobs=2))
    assert list(found) == list(variants)
    nominal = VirtualRig.model_validate(bench.driver.options)
    for name, (frequency_hz, damping) in found.items():
        specimen = nominal.realised(variants[name][1])
        moved = specimen.linear_modes.frequency_hz[0] / nominal.linear_modes.frequency_hz[0]
        assert frequency_hz / 24.3724 == pytest.approx(moved, abs=5e-5)
        assert damping == pytest.approx(0.00400, rel=0.02)
    assert found["run 0"] == first_point(variants["run 0"])
    assert np.ptp([frequency_hz for frequency_hz, _ in found.values()]) > 5e-4 * 24.37
