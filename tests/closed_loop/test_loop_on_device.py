"""Plans whose loop runs on the device: the firmware with the compiled loop, as a process, in lockstep."""

import numpy as np
import pytest

import rig
from rig.bench import load_bench
from rig.emulator.emulated import emulated
from tests.firmware.building import built_with_loop
from tests.recorded import changed, recorded_run as virtual

BENCH = load_bench("magnet-beam")
AT_EVERY_SAMPLE = BENCH.model_copy(update={"block": 1})


EXACT = {"frequency_hz": 1e-12, "damping_ratio": 1e-12, "amplitude_m": 1e-12}
CLOSE = {"frequency_hz": 5e-4, "damping_ratio": 0.1, "amplitude_m": 0.02}
"""Where the campaign judges the start while the device goes on: how much longer the start lasts depends on the computer, and
with it the noise. What that makes of points is a tenth of these."""


def require_equal(found, wanted, name):
    """All values are equal, but for some in 10 000 of a long run, which differ in their last bits: the virtual rig's loop is
    compiled together with the rig, and rounds the last bits of a double otherwise."""
    differs = ~((found == wanted) | (np.isnan(found) & np.isnan(wanted)))
    assert differs.sum() <= (differs.size // 2000 if differs.size > 300_000 else 0), name
    if differs.any():
        np.testing.assert_allclose(found[differs], wanted[differs], rtol=1e-5, err_msg=name)


def require_the_virtual_run(plan, seed, output, tolerance, wire="serial"):
    """Points are those of the virtual rig whose loop acts at every sample, and all rows where ``tolerance`` is `EXACT`."""
    with (
        emulated(BENCH, wire, firmware=built_with_loop("host"), seed=seed, options={"loop": "device"}) as bench,
        rig.run(plan, bench=bench, seed=seed, output=output) as there,
        virtual(plan, AT_EVERY_SAMPLE, seed=seed) as here,
    ):
        theirs, ours = there.recording.parts[0], here.recording.parts[0]
        if tolerance is EXACT:
            n = ours.n_rows
            assert 0 <= theirs.n_rows - n < 0.02 * BENCH.sample_rate_hz  # the last block is whole
            for name in ours.row_dtype.names:
                require_equal(theirs.rows(name, 0, n), ours.rows(name, 0, n), name)
        points = there.recording.points
        assert points[0]["accepted"]
        for point, wanted in zip(points, here.recording.points, strict=True):
            assert point["accepted"] == wanted["accepted"]
            for key, within in tolerance.items():
                assert point.get(key) == pytest.approx(wanted.get(key), rel=within, nan_ok=True), key
        assert theirs.information["about"]["device"]["loop"] == "device"
        counted = {name for name, count in theirs.end["counters"].items() if count}
        assert counted <= {"retries", "stray_answers"}


@pytest.mark.slow
@pytest.mark.parametrize("wire", ["serial", "can"])
def test_a_backbone_on_the_device_is_that_of_the_virtual_rig(wire, tmp_path):
    plan = changed("magnet-beam/backbone", levels_v=[0.4], record_periods=8)
    require_the_virtual_run(plan, 3, tmp_path / "there.h5", EXACT, wire)


@pytest.mark.slow
def test_the_shipped_backbone_over_can_fd_is_that_of_the_virtual_rig(tmp_path):
    require_the_virtual_run(changed("magnet-beam/backbone"), 0, tmp_path / "there.h5", EXACT, "can")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("plan", "changes", "tolerance"),
    [
        ("backbone-pure", {"levels_v": [0.8]}, EXACT),
        ("decay", {}, EXACT),
        ("stepped-phase-fast", {}, CLOSE),
        ("continuous-backbone", {}, CLOSE),
    ],
    ids=["harmonics controlled", "decay", "stepped phase", "continuous backbone"],
)
def test_other_plans_on_the_device_are_those_of_the_virtual_rig(plan, changes, tolerance, tmp_path):
    require_the_virtual_run(changed(f"magnet-beam/{plan}", **changes), 0, tmp_path / "there.h5", tolerance)
