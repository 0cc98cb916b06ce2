"""Limits, sensors, block and ramp of a bench fit each other, or it is refused or said."""

import re

import numpy as np
import pytest

import rig
from rig.arming.arming import CHECK, cautions_of
from rig.arming.bench_memory import BenchMemory
from rig.arming.run_options import RunOptions
from rig.bench import Bench, load_bench, shipped_benches
from rig.bench.cross_checks import cautions, refuse
from rig.campaigns.plans import load_plan
from rig.check.run import check
from rig.errors import ConfigurationError
from rig.tick.safety.kernels import OVERTRAVEL_FACTOR
from tests.refused import refused
from tests.rig.rigs import bench_with


def bench_where(channel, **changes) -> Bench:
    channels = [
        given | (changes if given["name"] == channel else {}) for given in bench_with().model_dump()["channels"]
    ]
    return bench_with({"channels": channels})


@pytest.mark.parametrize("name", ["magnet-beam", "magnet-beam-symmetric"])
def test_what_drops_the_output_can_be_shown_by_the_sensors_of_the_shipped_magnet_beams(name):
    bench = load_bench(name)
    assert cautions(bench) == ()
    for channel in bench.channels:
        limit = bench.limits.force_n if channel.role == "force" else bench.limits.acceleration_m_s2
        assert OVERTRAVEL_FACTOR * limit < bench.limits.overload_fraction * channel.range_in_unit


def test_every_shipped_bench_may_run_and_only_the_friction_beam_has_no_room_above_its_limits():
    said = {name: [line.split(" = ")[0] for line in cautions(load_bench(name))] for name in shipped_benches()}
    assert {name: fields for name, fields in said.items() if fields} == {
        "friction-beam": ["`limits.force_n`", "`limits.acceleration_m_s2`"]
    }


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ("block = 65536", {"field": "block", "value": 65536, "allowed": "1 to 1000 (0.2 s)"}),
        ("[limits]\nramp_down_s = 1e-20", {"field": "limits.ramp_down_s", "value": 1e-20}),
        ("[limits]\nramp_down_s = 0.04", {"field": "limits.ramp_down_s", "value": 0.04}),
    ],
)
def test_a_bench_that_would_leave_the_rig_unwatched_or_kick_it_is_refused_when_it_is_loaded(tmp_path, changes, said):
    path = tmp_path / "mine.toml"
    path.write_text(f'base = "magnet-beam"\nname = "mine"\n{changes}\n')
    with refused(ConfigurationError, where=str(path), **said) as caught:
        load_bench(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("channel", "sensitivity", "allowed"),
    [
        ("force", 1e-300, r"5e-08 to 5e\+03"),
        ("force", -1e-9, r"5e-08 to 5e\+03"),
        ("drive", 1e-300, "5e-07 to 500"),
        ("acc_magnet", 1e-8, "5e-07 to 500"),
    ],
)
def test_a_sensitivity_that_no_sensor_has_is_refused(channel, sensitivity, allowed):
    with pytest.raises(ConfigurationError) as caught:
        refuse(bench_where(channel, sensitivity_v_per_unit=sensitivity))
    assert re.fullmatch(r"channels\[\d\]\.sensitivity_v_per_unit", caught.value.field)
    assert (caught.value.value, caught.value.unit[:6]) == (sensitivity, "V per ")
    assert re.fullmatch(f"{allowed}, of either sign", caught.value.allowed)


def test_the_sensitivity_of_a_monitor_in_any_unit_is_bounded_too():
    channels = [*bench_with().model_dump()["channels"], {"name": "room", "role": "monitor", "unit": "degC"}]
    for sensitivity in (1e-300, 1e300):
        bench = bench_with({"channels": [*channels[:-1], channels[-1] | {"sensitivity_v_per_unit": sensitivity}]})
        with refused(ConfigurationError, "channel-room-would-reach-beyond", field="channels[4].sensitivity_v_per_unit"):
            refuse(bench)


@pytest.mark.parametrize("sensitivity", [1e-6, -1e-3, 0.0102])
def test_sensitivities_of_real_accelerometers_pass(sensitivity):
    refuse(bench_where("acc_magnet", sensitivity_v_per_unit=sensitivity))


def test_a_bench_made_in_python_is_refused_before_anything_is_opened(tmp_path):
    bench = load_bench("magnet-beam").model_copy(update={"block": 65536})
    with refused(ConfigurationError, field="block", value=65536):
        rig.run(load_plan("magnet-beam/backbone"), bench=bench, output=tmp_path / "run.h5")
    assert list(tmp_path.iterdir()) == []


def test_a_single_sample_may_last_as_long_as_it_will():
    slow = {"sample_rate_hz": 4.0, "block": 1, "limits": {"frequency_hz": (0.1, 1.5), "ramp_down_s": 10.0}}
    refuse(bench_with(slow | {"specimen": {"linear_frequency_hz": 1.0}}))


def test_a_block_longer_than_samples_may_be_lost_is_a_caution():
    (line,) = cautions(bench_with({"block": 500}))
    assert line.startswith("`block` = 500: lasts 0.1 s, and so late a limit acts")
    assert "allowed: 1 to 250" in line
    assert cautions(bench_with({"block": 250})) == ()
    assert cautions(bench_with({"block": 500, "limits": {"lost_s": 0.1}})) == ()


def test_a_limit_near_the_end_of_the_sensors_range_is_said_before_a_person_arms_and_not_for_a_check():
    bench = bench_with({"limits": {"force_n": 40.0}})
    cautions_then = cautions_of(bench, BenchMemory(), "backbone", {})
    (said,) = [line for line in cautions_then if "`limits.force_n` = 40 N" in line]
    assert "1.25 times the limit" in said
    assert "shows up to 43.59 N" in said
    assert "allowed: up to 34.9 N" in said
    assert cautions_of(bench, BenchMemory(), CHECK, {}) == ()
    assert cautions_of(bench_with(), BenchMemory(), "backbone", {})[1:] == ()


def test_a_check_finds_limits_that_do_not_fit(tmp_path):
    found = check(bench_with({"block": 50, "limits": {"force_n": 40.0}}), tmp_path / "check.h5", RunOptions(seed=1))
    (limits,) = [finding for finding in found.findings if finding.name == "limits"]
    assert (limits.verdict, limits.value, limits.unit) == ("warn", 40.0, "N")
    assert "force_n" in limits.text
    assert found.verdict == "passed"


def test_an_old_recording_is_read_whatever_its_bench_was(tmp_path):
    bench = bench_with({"block": 10, "limits": {"force_n": 40.0}})
    short = load_plan("magnet-beam/backbone").model_copy(update={"levels_v": (0.3923,), "record_periods": 10})
    with rig.run(short, bench=bench, output=tmp_path / "run.h5") as run:
        table = dict(run.recording.configuration["bench"])
    old = Bench.model_validate(table | {"block": 65536, "limits": table["limits"] | {"ramp_down_s": 1e-3}})
    assert old.block == 65536
    assert np.isfinite(old.limits.ramp_down_s)
