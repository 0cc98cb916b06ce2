import re
from typing import Any

import numpy as np
import pytest

from identification import nonlinear_mode
from rig.bench import Bench
from rig.conformance import with_loopback
from rig.drivers import make_daq
from rig.errors import ConfigurationError, DaqRefused
from rig.loop.loop import Loop
from tests.recorded import recorded_run
from tests.refused import refused
from tests.rig.rigs import bench_with, tick_for
from tests.simulators.references import UNFILTERED

SLOW_AND_FILTERED = {"oversampling": 10, "substeps": 20, "anti_alias_hz": 320.0}


def slow_bench(**converter: Any) -> Bench:
    return bench_with(
        {"sample_rate_hz": 800.0, "limits": {"frequency_hz": (20.0, 30.0)}},
        converter=UNFILTERED | {"sample_rate_hz": 800.0} | converter,
    )


def skewed_bench(declared: float, real: float) -> Bench:
    """The drive channel late by ``real`` samples, and what the bench knows of it."""
    plain = make_daq(bench_with()).rig
    sensors = [sensor.model_dump() for sensor in plain.sensors]
    sensors[1]["skew_samples"] = real
    channels = [channel.model_dump() for channel in bench_with().channels]
    channels[1]["skew_samples"] = declared
    return bench_with({"channels": channels}, sensors=sensors)


def last_damping(bench: Bench) -> np.ndarray:
    with recorded_run("magnet-beam/backbone", bench) as run:
        assert run.complete
        return nonlinear_mode(run.backbone()).damping_ratio


def measured(bench: Bench) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Points of a backbone, accepted or not, and what its part says of itself."""
    with recorded_run("magnet-beam/backbone", bench) as run:
        return list(run.recording.latest.values()), run.recording.parts[0].information["about"]


def test_slow_bench_with_filters_reads_the_damping_of_a_fast_one() -> None:
    fast, slow = last_damping(bench_with()), last_damping(slow_bench(**SLOW_AND_FILTERED))
    assert slow == pytest.approx(fast, rel=2e-3)


@pytest.mark.slow
def test_slow_loop_over_a_device_without_filters_reads_it_too_if_the_device_is_quicker() -> None:
    slow = slow_bench(sample_rate_hz=6400.0).model_dump()
    oversampled = Bench.model_validate(slow | {"oversample": 8})
    assert last_damping(oversampled) == pytest.approx(last_damping(bench_with()), rel=2e-3)


def test_slow_bench_without_filters_reads_it_wrong_and_says_by_how_much() -> None:
    bench = slow_bench(substeps=20)
    (remark,) = make_daq(bench).remarks
    said = re.search(r"change the damping ratio of the linear mode by ([+-]\d+) % .* anti_alias_hz", remark)
    assert said is not None
    assert "; tests of damping refuse points with more than 10 %: the virtual device has no" in remark
    right, of_filtered = measured(bench_with())
    wrong, of_unfiltered = measured(bench)
    shares = [1.0 - one["damping_ratio"] / other["damping_ratio"] for one, other in zip(right, wrong, strict=True)]
    assert 100.0 * (1.0 / (1.0 - shares[0]) - 1.0) == pytest.approx(float(said[1]), abs=1.0)
    for share, point in zip(shares, wrong, strict=True):  # of nonlinear points too
        refusal = re.match(
            r"images of the held output are ([\d.]+) % of the damping, accepted up to 10", point["reason"]
        )
        assert refusal is not None
        assert float(refusal[1]) == pytest.approx(100.0 * share, rel=0.02)
    assert all(point["quality"] in ("good", "warned") for point in right)
    assert of_filtered["images"] == [[*image] for image in make_daq(bench_with()).images]
    assert of_unfiltered["images"] == [[*image] for image in make_daq(bench).images]


def test_a_filter_that_lets_images_pass_changes_the_damping_by_what_is_said_of_it() -> None:
    bench = slow_bench(**SLOW_AND_FILTERED, anti_alias_order=2)
    (remark,) = make_daq(bench).remarks
    said = re.search(
        r"change the damping ratio of the linear mode by (-[.\d]+) % .* pass the anti-alias filter at 320 Hz", remark
    )
    assert said is not None
    change = last_damping(bench)[0] / last_damping(bench_with())[0] - 1.0
    assert 100.0 * change == pytest.approx(float(said[1]), rel=0.1)


def test_images_of_every_linear_mode_are_known_and_filters_leave_little_of_them() -> None:
    open_, filtered = (make_daq(slow_bench(**one)).images for one in ({"substeps": 20}, SLOW_AND_FILTERED))
    assert [image.frequency_hz for image in open_] == pytest.approx([24.37, 134.06, 380.94], abs=0.01)
    for one, other in zip(open_[:2], filtered[:2], strict=True):
        assert abs(other.in_phase_n_per_v) < 0.1 * abs(one.in_phase_n_per_v)


def test_shares_of_images_are_those_of_the_rig_with_its_filters_and_none_behind_a_filter_of_the_output() -> None:
    at_hz = np.array([24.0, 300.0])
    open_, filtered = (make_daq(slow_bench(**one)).image_shares(at_hz) for one in ({"substeps": 20}, SLOW_AND_FILTERED))
    for name in ("force", "drive"):
        assert np.all(np.abs(filtered[name]) < 0.1 * np.abs(open_[name]))
    smooth = SLOW_AND_FILTERED | {"anti_alias_hz": 0.0, "reconstruction_hz": 320.0}
    assert make_daq(slow_bench(**smooth)).image_shares(at_hz) == {}


def test_slow_bench_without_filters_and_with_little_bias_still_says_that_the_output_aliases(monkeypatch) -> None:
    monkeypatch.setattr("rig.drivers.virtual.images.TOLERANCE", 1.0)
    (remark,) = make_daq(slow_bench(substeps=20)).remarks
    assert remark.startswith("sample_rate_hz = 800: the stairs of the held output alias")
    assert "anti_alias_hz" in remark


def test_a_reconstruction_filter_keeps_the_images_from_the_structure() -> None:
    filtered = SLOW_AND_FILTERED | {"anti_alias_hz": 0.0, "reconstruction_hz": 320.0}
    assert not [remark for remark in make_daq(slow_bench(**filtered)).remarks if "images" in remark]


def test_slow_bench_with_filters_gives_no_remark() -> None:
    assert make_daq(slow_bench(**SLOW_AND_FILTERED)).remarks == ()


def test_skew_that_the_bench_does_not_know_is_remarked() -> None:
    (remark,) = make_daq(skewed_bench(declared=0.0, real=2.5)).remarks
    assert remark == "channel drive: the bench says skew_samples = 0, the virtual sensor is 2.5 samples late"
    assert make_daq(skewed_bench(declared=2.5, real=2.5)).remarks == ()


def test_declared_skew_is_taken_out_of_the_points() -> None:
    plain, skewed = last_damping(bench_with()), last_damping(skewed_bench(declared=2.5, real=2.5))
    assert skewed == pytest.approx(plain, rel=2e-3)


def test_latency_holds_the_delay_of_the_filters() -> None:
    with make_daq(slow_bench(**SLOW_AND_FILTERED)) as daq:
        daq.start(1)
        # A Butterworth low-pass of sixth order is late by 3.864 / w_c; 0.5 for the hold.
        assert daq.latency_samples == pytest.approx(0.5 + 3.8637 / (2 * np.pi * 320.0) * 800.0, rel=5e-3)


@pytest.mark.parametrize("block", [1, 4])
def test_fused_and_exchanged_runs_agree_with_filters(block: int) -> None:
    bench = slow_bench(**SLOW_AND_FILTERED, reconstruction_hz=300.0, dac_noise_v=1e-3)
    rows = []
    for fused in (True, False):
        with make_daq(bench) as daq:
            daq.start(block)
            tick = tick_for(bench, block + daq.latency_samples, 0.3)
            rows.append(np.concatenate([*Loop(daq, tick, fused=fused).run()]))
    shortest = min(part.size for part in rows)
    assert shortest > 800
    for name in rows[0].dtype.names:
        np.testing.assert_array_equal(rows[0][name][:shortest], rows[1][name][:shortest])


def test_a_loopback_reads_the_same_fused_and_exchanged_and_changes_no_other_channel() -> None:
    plain = bench_with(queue_blocks=1)
    bench, rows = with_loopback(plain), []
    for chosen, fused in ((bench, True), (bench, False), (plain, True)):
        with make_daq(chosen) as daq:
            daq.start(4)
            rows.append(np.concatenate([*Loop(daq, tick_for(chosen, 4 + daq.latency_samples, 0.3), fused=fused).run()]))
    shortest = min(part.size for part in rows)
    inputs = [part["inputs"][:shortest] for part in rows]
    np.testing.assert_array_equal(inputs[0], inputs[1])
    np.testing.assert_array_equal(inputs[0][:, :-1], inputs[2])
    assert np.abs(inputs[0][:, -1]).max() == pytest.approx(0.3, rel=0.01)


def test_a_channel_that_the_rig_has_not_is_refused_unless_it_is_a_loopback() -> None:
    other = {"name": "estop", "role": "monitor", "unit": "V", "sensitivity_v_per_unit": 1.0}
    with refused(ConfigurationError, "in-this-order-and-loopbacks-behind", field="channels"):
        make_daq(bench_with({"channels": [*bench_with().model_dump()["channels"], other]}))


def test_facts_of_a_free_specimen_are_compared_with_a_mode_that_vibrates() -> None:
    free = {"boundary": "free-free", "damping_ratio": [0.0, 0.0, 0.002]}
    bench = bench_with(structure=free, friction=[], elements=[])
    mode = make_daq(bench).rig.linear_modes
    assert any(
        f"the virtual specimen has {mode.frequency_hz[2]:.6g} Hz" in remark for remark in make_daq(bench).remarks
    )


WEAR: dict[str, Any] = {"frequency_per_s": [-0.01], "damping_per_s": [0.1], "until_s": 2.0}


@pytest.mark.parametrize("block", [1, 7, 50])
@pytest.mark.parametrize("wear", [{"every_s": 0.113}, {"every_s": 2e-4, "until_s": 0.005}])
def test_fused_and_exchanged_runs_agree_while_the_specimen_wears(block: int, wear: dict[str, float]) -> None:
    rows = []
    for chosen, fused in ((WEAR | wear, True), (WEAR | wear, False), ({}, True)):
        bench = bench_with(wear=chosen, queue_blocks=1)
        with make_daq(bench) as daq:
            daq.start(block)
            tick = tick_for(bench, block + daq.latency_samples, 0.3)
            rows.append(np.concatenate([*Loop(daq, tick, fused=fused).run()]))
    fused_rows, exchanged, unworn = rows
    assert 0 <= exchanged.size - fused_rows.size < block
    for name in fused_rows.dtype.names:
        np.testing.assert_array_equal(fused_rows[name], exchanged[name][: fused_rows.size])
    assert not np.array_equal(fused_rows["inputs"][:5000], unworn["inputs"][:5000])


def test_exchanged_readings_of_a_worn_specimen_do_not_depend_on_the_block() -> None:
    bench = bench_with(wear=WEAR | {"every_s": 0.0266}, scatter={"frequency": 0.01})
    voltages = np.random.default_rng(2).uniform(-0.5, 0.5, 700)
    readings = []
    for block in (1, 7, 50, 700):
        with make_daq(bench, 4) as daq:
            daq.start(block)
            readings.append(np.vstack([daq.exchange(part) for part in voltages.reshape(-1, block)]))
    for other in readings[1:]:
        np.testing.assert_array_equal(readings[0], other)


def test_wear_that_leaves_nothing_is_refused_in_one_line() -> None:
    with pytest.raises(ConfigurationError) as error:
        make_daq(bench_with(wear={"frequency_per_s": [-0.01], "until_s": 200.0}))
    assert str(error.value) == (
        "driver.options: `wear.until_s` = 200 s; allowed: below 100, where frequency_per_s = -0.01 reaches -100 %"
    )


def test_outputs_of_any_type_and_memory_layout_are_the_same_voltages() -> None:
    voltages = np.array([0.5, -0.25, 1.0, 0.0])  # exact in every type
    forms = (voltages, voltages.astype(np.float32), np.repeat(voltages, 3)[::3], voltages[::-1].copy()[::-1])
    readings = []
    for form in forms:
        with make_daq(bench_with()) as daq:
            daq.start(4)
            readings.append(np.vstack([daq.exchange(form), daq.exchange(form)]))
    for other in readings[1:]:
        np.testing.assert_array_equal(other, readings[0])
    assert np.ptp(readings[0], axis=0).all()


@pytest.mark.parametrize("wrong", [np.nan, np.inf, -np.inf, 10.5, -10.5])
def test_an_output_beyond_the_range_is_refused_wherever_it_stands(wrong: float) -> None:
    with make_daq(bench_with({"output_range_v": 10.0})) as daq:
        daq.start(3)
        for place in range(3):
            voltages = np.array([1.0, -10.0, 10.0])
            voltages[place] = wrong
            with refused(DaqRefused, "was-demanded"):
                daq.exchange(voltages)
        assert daq.exchange(np.array([1.0, -10.0, 10.0])).shape[0] == 3


@pytest.mark.parametrize("how", ["open-circuit", "stinger-dropped"])
def test_a_rig_is_released_at_0_v_and_not_before(how: str) -> None:
    voltages = np.concatenate([np.random.default_rng(2).uniform(0.1, 0.5, 200), np.zeros(200)])
    readings = []
    for at_zero_v in ("attached", how):
        with make_daq(bench_with(at_zero_v=at_zero_v)) as daq:
            daq.start(voltages.size)
            readings.append(daq.exchange(voltages))
    attached, released = readings
    np.testing.assert_array_equal(released[:200], attached[:200])
    assert np.any(released[200:] != attached[200:])
