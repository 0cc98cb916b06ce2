"""Sensitivities as data sheets have them, and sensors by serial number."""

from typing import ClassVar

import pytest

from rig.arming.arming import armed
from rig.bench import Bench, load_bench
from rig.bench.bench import shipped_benches
from rig.bench.configuration import validated
from rig.bench.sensors import Sensor
from rig.errors import ConfigurationError, NotArmed
from tests.refused import refused
from vibrolock.data_sheet import volts_per_unit

G = 9.80665  # m/s2, standard gravity


def unmarked(error):
    """The line of an error without marks around keys."""
    return str(error).replace("`", "")


@pytest.mark.parametrize(
    ("sensitivity", "gain", "volts", "unit"),
    [
        ("100 mV/g", "", 0.1 / G, "m/s^2"),
        ("10.2 mV/(m/s2)", "", 0.0102, "m/s^2"),
        ("10.2 mV/ms-2", "", 0.0102, "m/s^2"),
        ("10,2".replace(",", ".") + " mV/(m/s²)", "", 0.0102, "m/s^2"),
        ("22.4 mV/N", "", 0.0224, "N"),
        ("112.4 mV/N", "", 0.1124, "N"),
        ("50 mV/lbf", "", 0.05 / 4.4482216152605, "N"),
        ("-4 pC/N", "10 mV/pC", -0.04, "N"),
        ("3.9 pC/N", "0.1 V/nC", 0.00039, "N"),
        ("316 pC/g", "1 mV/pC", 0.316 / G, "m/s^2"),
        ("0.45 pC/(m/s2)", "10 mV/pC", 0.0045, "m/s^2"),
        ("4 V/(m/s)", "", 4.0, "m/s"),
        ("1 mm/V", "", 1000.0, "m"),
        ("5 mm/s/V", "", 200.0, "m/s"),
        ("5 (mm/s)/V", "", 200.0, "m/s"),
        ("0.5 N/mV", "", 0.002, "N"),
        ("100 mV/g", "10", 1.0 / G, "m/s^2"),
        ("100 mV/g", "10 V/V", 1.0 / G, "m/s^2"),
    ],
)
def test_a_sensitivity_of_a_data_sheet_in_volts_per_unit(sensitivity, gain, volts, unit):
    found, of = volts_per_unit(sensitivity, gain)
    assert found == pytest.approx(volts, rel=1e-15)
    assert of == unit


@pytest.mark.parametrize(
    ("keys", "fault"),
    [
        ({"sensitivity": "100"}, "sensitivity = '100'; allowed: a number and its unit"),
        ({"sensitivity": "0 mV/N"}, "sensitivity = '0 mV/N'; allowed:"),
        ({"sensitivity": "1e999 mV/N"}, "sensitivity = '1e999 mV/N'; allowed:"),
        ({"sensitivity": "50 mV/stone"}, "sensitivity = '50 mV/stone': the quantity: is 'stone'; allowed: m, mm"),
        ({"sensitivity": "100 mV/g"}, "sensitivity = '100 mV/g': is per m/s^2, the channel is in N"),
        ({"sensitivity": "4 pC/N"}, "amplifier_gain: is missing, sensitivity = '4 pC/N' is a charge"),
        ({"sensitivity": "4 pC/N", "amplifier_gain": "10"}, "amplifier_gain = '10': sensitivity = '4 pC/N'"),
        ({"sensitivity": "4 mV/N", "amplifier_gain": "1 mV/pC"}, "allowed: such as '10' or '10 V/V'"),
        ({"sensitivity": "4 mV/N", "amplifier_gain": "ten"}, "amplifier_gain = 'ten'; allowed: a number"),
        ({"sensitivity": 0.1}, "sensitivity = 0.1; allowed: a text with number and unit"),
        ({"sensitivity": "100 mV/N", "sensitivity_v_per_unit": 0.2}, "makes it 0.1; allowed: one of the two"),
        ({"sensitivity_v_per_unit": 0.1, "inverted": True}, "inverted: allowed: beside sensitivity"),
        ({"sensitivity_v_per_unit": 0.1, "amplifier_gain": "10"}, "amplifier_gain: allowed: beside sensitivity"),
        ({}, "sensitivity_v_per_unit: is missing"),
    ],
)
def test_what_is_wrong_with_a_sensitivity_is_said_in_one_line(keys, fault):
    table = load_bench("magnet-beam").model_dump(mode="json")
    del table["channels"][0]["sensitivity_v_per_unit"], table["channels"][0]["sensitivity"]
    table["channels"][0] |= keys
    with pytest.raises(ConfigurationError) as caught:
        validated(Bench, table, "bench.toml")
    line = unmarked(caught.value)
    assert fault in line
    assert line.startswith("bench.toml: channels[0]")
    assert "\n" not in line


@pytest.mark.parametrize("name", shipped_benches())
def test_a_bench_on_sheets_is_the_same_bench_and_stays_so_when_it_is_stored(name):
    bench = load_bench(name)
    table = bench.model_dump(mode="json")
    for channel in table["channels"]:
        volts, unit = channel.pop("sensitivity_v_per_unit"), channel["unit"]
        del channel["unit"]
        channel["sensitivity"] = f"{round(1e3 * volts, 9)!r} mV/({unit})"
    on_sheets = validated(Bench, table, "bench")
    assert [c.sensitivity_v_per_unit for c in on_sheets.channels] == [c.sensitivity_v_per_unit for c in bench.channels]
    assert [c.unit for c in on_sheets.channels] == [c.unit for c in bench.channels]
    assert validated(Bench, on_sheets.model_dump(mode="json"), "stored") == on_sheets


SENSORS = """
[[sensors]]
serial_number = "F1"
make = "Example"
model = "F20"
sensitivity = "112.4 mV/N"
calibrated = 2024-02-29
calibration_interval_months = 12
certificate = "no. 17"

[[sensors]]
serial_number = "A1"
sensitivity = "10.2 mV/(m/s2)"
"""
CHANNELS = """
channels = [
  { name = "force", role = "force", serial_number = "F1", range_v = 5.0, inverted = true },
  { name = "drive", role = "drive", serial_number = "A1", range_v = 5.0 },
  { name = "acc_drive", role = "response", sensitivity_v_per_unit = 0.0102, range_v = 5.0, serial_number = "elsewhere" },
  { name = "acc_magnet", role = "response", sensitivity_v_per_unit = 0.0102, range_v = 5.0 },
]
"""


def written(folder, channels=CHANNELS, sensors=SENSORS):
    (folder / "lab").mkdir(exist_ok=True)
    (folder / "lab" / "sensors.toml").write_text(sensors)
    (folder / "bench.toml").write_text(f'base = "magnet-beam"\nname = "b"\nsensors = "lab/sensors.toml"\n{channels}')
    return folder / "bench.toml"


def test_channels_take_what_the_file_of_sensors_says(tmp_path):
    force, drive, other, _ = load_bench(written(tmp_path)).channels
    assert (force.sensor, force.sensitivity, force.sensitivity_v_per_unit) == ("Example F20", "112.4 mV/N", -0.1124)
    assert (force.calibrated, force.calibration_due, force.certificate) == ("2024-02-29", "2025-02-28", "no. 17")
    assert (drive.unit, drive.sensitivity_v_per_unit, drive.calibrated) == ("m/s^2", 0.0102, "")
    assert other.serial_number == "elsewhere"


def test_a_bench_may_start_from_one_with_sensors_in_another_folder(tmp_path):
    written(tmp_path)
    (tmp_path / "other.toml").write_text('base = "bench.toml"\nname = "other"\n')
    assert load_bench(tmp_path / "other.toml").channels == load_bench(tmp_path / "bench.toml").channels


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        ('"A1"', '"A11"', "serial_number = 'A11': sensors.toml has no such sensor, did you mean 'A1'?; allowed: one"),
        ('"F1",', '"F1", calibrated = "2026-01-01",', "channels[0].calibrated = '2026-01-01': sensors.toml says it"),
        (
            '"A1",',
            '"A1", sensitivity_v_per_unit = 0.01,',
            "channels[1].sensitivity_v_per_unit = 0.01 V per N or m/s^2: sensors.toml says",
        ),
        (
            '"A1",',
            '"A1", sensitivity = "1 mV/g",',
            "channels[1].sensitivity = '1 mV/g': sensors.toml says it of sensor",
        ),
    ],
)
def test_nothing_is_said_twice_and_no_sensor_is_unknown(old, new, fault, tmp_path):
    with pytest.raises(ConfigurationError) as caught:
        load_bench(written(tmp_path, CHANNELS.replace(old, new)))
    assert fault in unmarked(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        ('"A1"', '"F1"', "sensors[1].serial_number = 'F1': is there twice"),
        ("10.2 mV", "10.2 mW", "sensors[1].sensitivity = '10.2 mW/(m/s2)'"),
        ("2024-02-29", '"2024-02-30"', "calibrated = '2024-02-30'; allowed: a day"),
        ("calibrated = 2024-02-29\n", "", "calibration_interval_months = 12; allowed: with calibrated"),
        ("= 12", "= 12\ncalibration_due = 2030-01-01", "and without calibration_due"),
        ("calibration_interval_months = 12", "calibration_due = 2020-01-01", "allowed: a day after calibrated"),
        ("make", "maker", "sensors[0].maker: unknown key, did you mean make?"),
    ],
)
def test_what_is_wrong_in_a_file_of_sensors_is_said_with_its_name(old, new, fault, tmp_path):
    with pytest.raises(ConfigurationError) as caught:
        load_bench(written(tmp_path, sensors=SENSORS.replace(old, new)))
    assert fault in unmarked(caught.value)
    assert "sensors.toml" in str(caught.value)


def test_a_file_of_sensors_that_is_none_is_refused(tmp_path):
    (tmp_path / "b.toml").write_text('base = "magnet-beam"\nsensors = 3\n')
    with refused(ConfigurationError, field="sensors", value=3, allowed="the path of a .toml file"):
        load_bench(tmp_path / "b.toml")
    (tmp_path / "b.toml").write_text('base = "magnet-beam"\nsensors = "none.toml"\n')
    with refused(ConfigurationError, "none-toml"):
        load_bench(tmp_path / "b.toml")


def test_an_interval_of_months_ends_on_the_last_day_of_a_shorter_month():
    one = Sensor(serial_number="1", sensitivity="1 mV/g", calibrated="2026-08-31", calibration_interval_months=18)
    assert one.due == "2028-02-29"


class Physical:
    """A session with a bench on which something moves."""

    class capabilities:  # noqa: N801
        virtual, safe_without_host = False, True

    identity: ClassVar[dict[str, str]] = {}
    latched = ""


def test_a_bench_that_asks_for_it_is_not_armed_while_a_calibration_is_overdue(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    path = written(tmp_path)
    assert armed(load_bench(path), Physical, "backbone", True)["how"] == "switch"
    path.write_text(path.read_text() + "[arming]\nrequire_calibration = true\n")
    with refused(NotArmed, "channel-force-calibration-was-due-on"):
        armed(load_bench(path), Physical, "backbone", True)
    assert armed(load_bench(path), Physical, "check", True)["how"] == "switch"
