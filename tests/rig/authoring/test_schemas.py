"""JSON Schemas of benches, plans and virtual rigs: they accept what the program accepts, and refuse what they can express."""

import copy
import functools
import json
import tomllib

import pytest

from rig.authoring.schemas import schema_names, schema_of
from rig.bench import Bench
from rig.bench.bench import shipped_benches
from rig.bench.configuration import read_toml, validated
from rig.campaigns.kinds import KINDS
from rig.campaigns.plans import plan_from, shipped_plans
from rig.drivers import make_daq
from rig.errors import ConfigurationError
from simulators import shipped_specimens
from tests.docs.pages import ROOT, blocks, pages
from tests.refused import refused

jsonschema = pytest.importorskip("jsonschema", reason="jsonschema is not installed (pip install 'vibrolock[dev]')")

BENCHES, PLANS = ROOT / "rig" / "bench" / "shipped", ROOT / "rig" / "campaigns" / "shipped"
SPECIMENS = ROOT / "simulators" / "specimens"


@functools.cache
def of(name):
    return jsonschema.Draft7Validator(schema_of(name))


def read(path):
    """A table as an editor's checker sees it: dates are texts."""
    return json.loads(json.dumps(read_toml(path), default=str))


def bench_table():
    return read(BENCHES / "magnet-beam.toml")


def plan_table(name="magnet-beam/backbone"):
    return read(PLANS / f"{name}.toml")


@pytest.mark.parametrize("name", schema_names())
def test_a_schema_is_one_of_draft_7_and_nothing_in_it_is_beyond_that_draft(name):
    schema = of(name).schema
    jsonschema.Draft7Validator.check_schema(schema)
    text = json.dumps(schema)
    for word in ('"$defs"', '"prefixItems"', '"discriminator"', '"type": "null"', '"unevaluatedProperties"'):
        assert word not in text
    json.dumps(schema, allow_nan=False)


def inner(node):
    """All schemas inside a schema."""
    if isinstance(node, dict):
        yield node
        for value in node.values():
            yield from inner(value)
    elif isinstance(node, list):
        for value in node:
            yield from inner(value)


@pytest.mark.parametrize("name", schema_names())
def test_a_reference_stands_alone_and_leads_somewhere(name):
    schema = of(name).schema
    for node in inner(schema):
        if isinstance(node.get("$ref"), str):
            assert set(node) == {"$ref"}  # a reader of draft 7 ignores what stands beside it
            assert node["$ref"].removeprefix("#/definitions/") in schema["definitions"]


@pytest.mark.parametrize("name", schema_names())
def test_every_key_has_a_description_and_a_title(name):
    schema = of(name).schema
    tables = [node for node in inner(schema) if node.get("additionalProperties") is False]
    assert tables
    for table in tables:
        for key, field in table["properties"].items():
            assert field.get("description"), (table.get("description"), key)
            assert field["title"]


def test_titles_have_units_and_keys_their_defaults_and_ranges():
    limits = of("bench").schema["definitions"]["LimitsChanges"]["properties"]
    assert limits["voltage_v"]["title"] == "voltage (V)"
    assert limits["slew_v_per_s"]["title"] == "slew (V/s)"
    assert (limits["voltage_v"]["exclusiveMinimum"], limits["voltage_v"]["maximum"]) == (0, 100)
    assert limits["slew_v_per_s"]["default"] == 100.0
    assert limits["overload_s"]["description"] == "Time of uninterrupted overload that trips, s."


@pytest.mark.parametrize("name", shipped_benches())
def test_a_shipped_bench_is_accepted(name):
    of("bench").validate(read(BENCHES / f"{name}.toml"))


@pytest.mark.parametrize("name", shipped_plans())
def test_a_shipped_plan_is_accepted_by_the_schema_of_its_kind_and_by_that_of_all_plans(name):
    table = plan_table(name)
    of("plan").validate(table)
    of(table["kind"]).validate(table)


@pytest.mark.parametrize("kind", KINDS)
def test_a_plan_of_another_kind_is_refused(kind):
    assert of(kind).is_valid(plan_table()) == (kind == "backbone")


@pytest.mark.parametrize("name", shipped_specimens())
def test_a_shipped_specimen_is_accepted_as_a_rig(name):
    of("rig").validate(read(SPECIMENS / f"{name}.toml"))


def files_of_pages():
    """Benches and plans that the documentation shows, by page and name."""
    for page in pages():
        for block in blocks(page):
            if block.file.endswith(".toml"):
                table = json.loads(json.dumps(tomllib.loads(block.text), default=str))
                is_plan = table.get("kind") in KINDS and "channels" not in table  # those are of a mapping
                name = "plan" if is_plan else "bench" if {"driver", "base"} & set(table) else ""
                if name:
                    yield pytest.param(name, table, id=f"{page.stem}: {block.file}")


@pytest.mark.parametrize(("name", "table"), list(files_of_pages()))
def test_what_the_documentation_shows_is_accepted(name, table):
    of(name).validate(table)


CHANGES = [
    {"base": "magnet-beam", "limits": {"voltage_v": 2.0}},
    {"base": "magnet-beam", "driver": {"options": {"exciter": {"resistance_ohm": 2.0}, "queue_blocks": 2}}},
    {"base": "magnet-beam", "driver": {"name": "serial", "options": {"port": "/dev/ttyACM0"}}},
    {"base": "friction-beam", "specimen": {"name": "another"}, "arming": {"automated": True}},
]


@pytest.mark.parametrize("table", CHANGES)
def test_changes_of_a_base_need_not_be_complete(table):
    of("bench").validate(table)
    incomplete = {key: value for key, value in table.items() if key != "base"}
    assert not of("bench").is_valid(incomplete)


def changed(table, path, value):
    """A table with the value at a dotted path replaced, or taken away where it is None."""
    out = copy.deepcopy(table)
    at = out
    *folders, last = [int(part) if part.isdigit() else part for part in path.split(".")]
    for part in folders:
        at = at.setdefault(part, {}) if isinstance(at, dict) else at[part]
    if value is None:
        del at[last]
    else:
        at[last] = value
    return out


BROKEN_BENCHES = [
    ("name", None), ("name", ""), ("name", 3), ("nmae", "x"), ("sample_rate_hz", None), ("sample_rate_hz", 0),
    ("sample_rate_hz", "fast"), ("sample_rate_hz", 2e6), ("block", 0), ("block", 1.5), ("block", True),
    ("output_range_v", -1.0),
    ("driver", None), ("driver.name", None), ("driver.name", ""), ("driver.nam", "virtual"), ("limits", None),
    ("limits.voltage_v", 0.0), ("limits.voltage_v", 101.0), ("limits.voltage_mv", 100.0), ("limits.force_n", None),
    ("limits.frequency_hz", [8.0]), ("limits.frequency_hz", [8.0, 20.0, 30.0]), ("limits.frequency_hz", [0.0, 20.0]),
    ("limits.frequency_hz", 20.0), ("limits.overload_fraction", 1.5), ("specimen.linear_frequency_hz", None),
    ("specimen.drive_mode_shape", 0.0), ("channels", []), ("channels", None), ("channels.0.role", "forces"),
    ("channels.0.role", "response"), ("channels.0.unit", "kN"), ("channels.1.unit", "g"), ("channels.0.name", "the force"),
    ("channels.0.sensitivity_v_per_unit", None), ("channels.0.sensitivity_v_per_unit", 0.0),
    ("channels.0.sensitivity_v_per_unit", "0.1"), ("channels.0.calibrated", "yesterday"), ("channels.2.range", 5.0),
    ("arming.automated", "yes"), ("arming.check_valid_h", 0), ("emergency_stop.channel", "stop"),
    ("emergency_stop", {"channel": "force", "above_v": 1.0, "below_v": -1.0}),
]  # fmt: skip


@pytest.mark.parametrize(("path", "value"), BROKEN_BENCHES)
def test_a_broken_bench_is_refused_by_the_program_and_by_the_schema(path, value):
    table = changed(bench_table(), path, value)
    with pytest.raises(ConfigurationError):
        validated(Bench, table, "bench.toml")
    assert not of("bench").is_valid(table)


BROKEN_OPTIONS = [
    ("specimen", None), ("specimne", "magnet-beam"), ("queue_blocks", 65), ("queue_blocks", "two"), ("faults.held_s", 0.0),
    ("exciter.resistance_ohm", -1.0), ("exciter.resistence_ohm", 1.0), ("noise_scale", -0.1), ("seed", 1),
    ("sensors", []), ("elements", [{"at": "tip"}]), ("elements", [{"kind": "magic", "at": "tip"}]),
    ("elements", [{"kind": "clearance", "at": "magnet", "gap_mm": 1.0}]), ("converter.adc_bits", "many"), ("exciter", 3),
]  # fmt: skip


@pytest.mark.parametrize(("path", "value"), BROKEN_OPTIONS)
def test_broken_options_of_a_virtual_rig_are_refused_by_the_program_and_by_the_schema(path, value):
    table = changed(bench_table(), f"driver.options.{path}", value)
    with pytest.raises(ConfigurationError):
        make_daq(validated(Bench, table, "bench.toml"))
    assert not of("bench").is_valid(table)
    if path not in ("queue_blocks", "faults.held_s", "seed"):
        assert not of("rig").is_valid(table["driver"]["options"])


@pytest.mark.parametrize(
    ("name", "options"),
    [("serial", {}), ("serial", {"port": ""}), ("serial", {"port": "/dev/ttyACM0", "baud": 1}), ("can", {"node": 1})],
)
def test_broken_options_of_a_wire_are_refused_by_the_program_and_by_the_schema(name, options):
    table = {**bench_table(), "driver": {"name": name, "options": options}}
    with pytest.raises(ConfigurationError):
        make_daq(validated(Bench, table, "bench.toml"))
    assert not of("bench").is_valid(table)


BROKEN_PLANS = {
    "magnet-beam/backbone": [
        ("kind", None), ("kind", "backbones"), ("bench", None), ("bench", ""), ("levels_v", None), ("levels_v", []),
        ("levels_v", [0.1, -0.2]), ("levels_v", [0.1, 0.1]), ("levels_v", ["0.1"]), ("levels_n", [1.0]), ("levels_mV", [100.0]),
        ("record_periods", 3), ("record_periods", 2.5), ("direction", "sideways"), ("repeats", 0), ("retries", 21),
        ("repeat_first", 1), ("controller", None), ("controller.centre_frequency_hz", None), ("controller.gain", 2.0),
        ("controller.detector", "three-phase"), ("controller.frequency_window_hz", [22.0]), ("controller.k1", -1.0),
        ("controller.lock.lost", 1), ("settle.phase_deg", 46), ("settle.amplitude", 0.0), ("telemetry_s", 61), ("rows", "some"),
    ],
    "magnet-beam/stepped-phase-paper": [("phase_lags_deg", []), ("step_deg", 0.0), ("on_failure", "retry")],
    "magnet-beam/response-controlled": [("levels_m", None), ("phase_lags_deg", None)],
    "magnet-beam/continuous-backbone": [("sweep_periods", None), ("sweep_periods", 5), ("margin", 2.0)],
    "magnet-beam/sweep-1": [("start_hz", 0.0), ("rate_octaves_per_min", 1.0), ("stop_hz", None)],
    "magnet-beam/multisine-1": [("levels_rms_v", []), ("grid", "even"), ("periods", 0)],
    "magnet-beam/stepped-sine-up": [("spacing", "cubic"), ("steps", 1)],
    "friction-beam/dwell": [("cycles", 5), ("on_failure", "skip"), ("repeats", 2), ("alarm.frequency", 2.0)],
}  # fmt: skip


@pytest.mark.parametrize(
    ("plan", "path", "value"), [(plan, *change) for plan, changes in BROKEN_PLANS.items() for change in changes]
)
def test_a_broken_plan_is_refused_by_the_program_and_by_the_schemas(plan, path, value):
    table = plan_table(plan)
    kind = table["kind"]
    broken = changed(table, path, value)
    assert broken != table
    with pytest.raises(ConfigurationError):
        plan_from(broken, "plan.toml")
    assert not of(kind).is_valid(broken)
    assert not of("plan").is_valid(broken)


def test_the_table_of_a_controller_in_open_loop_has_two_names():
    table = plan_table("magnet-beam/stepped-sine-up")
    for name in ("controller", "demodulation"):
        of("plan").validate({**{k: v for k, v in table.items() if k != "controller"}, name: {"low_pass_rad_s": 3.0}})


def test_another_name_of_a_schema_is_refused():
    with refused(ConfigurationError, "allowed-bench-plan-rig-sensors-backbone", field="WHAT", value="benches"):
        schema_of("benches")


def test_a_driver_of_somebody_elses_has_options_of_its_own():
    table = {**bench_table(), "driver": {"name": "box", "options": {"serial_number": "B-0042"}}}
    of("bench").validate(table)


SENSORS = {"sensors": [{"serial_number": "1", "sensitivity": "100 mV/g", "calibrated": "2026-01-31"}]}


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("sensors", []), ("sensors", None), ("sensors.0.serial_number", None), ("sensors.0.serial_number", 1),
        ("sensors.0.sensitivity", None), ("sensors.0.sensitivity", 0.1), ("sensors.0.calibrated", "January"),
        ("sensors.0.calibration_interval_months", 0), ("sensors.0.sensitivty", "1 mV/g"),
    ],
)  # fmt: skip
def test_a_broken_file_of_sensors_is_refused_by_the_program_and_by_the_schema(path, value):
    from rig.bench.sensors import SensorFile

    assert of("sensors").is_valid(SENSORS)
    table = changed(SENSORS, path, value)
    with pytest.raises(ConfigurationError):
        validated(SensorFile, table, "sensors.toml")
    assert not of("sensors").is_valid(table)


def test_a_channel_gives_its_sensitivity_in_one_of_three_ways():
    for key, value in (("sensitivity", "112.4 mV/N"), ("serial_number", "1")):
        table = changed(changed(bench_table(), "channels.0.sensitivity_v_per_unit", None), "channels.0.unit", None)
        assert not of("bench").is_valid(table)
        assert of("bench").is_valid(changed(table, f"channels.0.{key}", value) | {"sensors": "sensors.toml"})


@pytest.mark.parametrize(
    ("given", "fits"),
    [
        ({"sensitivity": "22.4 mV/N"}, True),
        ({"sensitivity_v_per_unit": 0.0224}, True),
        ({}, False),
        ({"sensitivity": "22.4 mV/N", "sensitivity_v_per_unit": 0.0224}, False),
        ({"sensitivity": 22.4}, False),
    ],
)
def test_a_virtual_sensor_gives_its_sensitivity_in_one_of_two_ways(given, fits):
    table = read(SPECIMENS / "magnet-beam.toml")
    first = next(iter(table["sensors"]))
    table["sensors"][0] = {key: v for key, v in first.items() if key != "sensitivity_v_per_unit"} | given
    assert of("rig").is_valid(table) == fits


@pytest.mark.parametrize(
    ("stinger", "fits"),
    [
        ({"diameter_m": 0.002, "length_m": 0.1, "material": "steel"}, True),
        ({"diameter_m": 0.002, "material": "steel"}, False),
        ({"diameter_m": 0.002, "length_m": 0.1, "material": "wood"}, False),
        ({}, False),
    ],
)
def test_a_rig_of_all_parts_may_name_a_shaker_and_the_geometry_of_its_stinger(stinger, fits):
    table = read(SPECIMENS / "magnet-beam.toml")
    table["exciter"] = {"shaker": "lds-v203"}
    table["stinger"] = {"at": "drive", "damping_n_s_m": 1.0, **stinger}
    assert of("rig").is_valid(table) == fits
    assert not of("rig").is_valid({**table, "exciter": {"amplifier": "voltage"}})
