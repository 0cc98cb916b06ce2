import numpy as np
import pytest

from identification import Channel, PeriodicSpectra
from rig.campaigns.multisine.plan import MultisinePlan
from rig.campaigns.multisine.points import _change, measure_multisine_point
from tests.rig.rigs import bench_with

FREQUENCY_HZ = np.arange(10.0, 110.0, 0.05)


def spectra(periods: int, noise: float, transient: float) -> PeriodicSpectra:
    """White force; a vibration at 40 Hz that dies out within a period, white noise in every one."""
    random = np.random.default_rng(periods)
    shape = (1, periods, 1, FREQUENCY_HZ.size)
    value = 1.0 + noise * (random.normal(size=shape) + 1j * random.normal(size=shape)) / np.sqrt(2.0)
    decay = 1.0 / (2j * np.pi * (FREQUENCY_HZ - 40.0) + 4.0)
    value[0, 0, 0] += transient * decay * np.sqrt(decay.size) / np.linalg.norm(decay)
    return PeriodicSpectra((Channel("force", "force", "N"),), FREQUENCY_HZ, np.ones(FREQUENCY_HZ.size, bool), value)


@pytest.mark.parametrize("periods", [2, 3, 5])
def test_noise_alone_is_no_change(periods: int) -> None:
    assert _change(spectra(periods, 0.3, 0.0), "force") < 0.1


@pytest.mark.parametrize("periods", [2, 3, 5])
@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_a_transient_is_a_change_whatever_the_noise(periods: int, noise: float) -> None:
    assert _change(spectra(periods, noise, 0.1), "force") == pytest.approx(0.1, rel=0.1)


@pytest.mark.parametrize("constant", [0.0, 0.75])
def test_a_channel_that_stands_still_for_a_whole_record_is_refused_by_name(constant: float) -> None:
    bench = bench_with()
    plan = MultisinePlan(
        bench="magnet-beam", levels_rms_v=(0.1,), lowest_hz=10.0, highest_hz=50.0, resolution_hz=1.0, periods=2
    )
    played = np.tile(plan.design(bench.sample_rate_hz).realisation(0, 0), 2)
    row = np.dtype([("inputs", "f4", (len(bench.channels),)), ("output_v", "f4"), ("flags", "u4")])
    rows = np.zeros(played.size, row)
    rows["output_v"] = played
    rows["inputs"] = np.random.default_rng(1).normal(size=rows["inputs"].shape) + played[:, None]
    rows["inputs"][:, bench.index_of("drive")] = constant
    point = measure_multisine_point(bench, plan, plan.targets()[0], rows, np.zeros(1)[0])
    assert not point.accepted
    assert point.reason.startswith("channel drive does not change at all")
