"""A bench to begin with for the modules of an NI chassis, its sensors read from themselves where they have TEDS."""

from collections import Counter

from rig.authoring.device_bench import BRIEF_LOOPBACK
from rig.bench.configuration import Table
from rig.drivers.devices import Attached
from rig.drivers.nidaqmx.devices import Chassis, chassis_of, devices_of
from rig.drivers.nidaqmx.library import Session
from rig.drivers.nidaqmx.options import NiDaqmxOptions
from rig.drivers.nidaqmx.tasks import Setting, Tasks
from rig.drivers.nidaqmx.teds import TedsSensor, teds_sensors

RATE_HZ = 12_800.0
"""Sample rate that is asked for, Hz; chosen: a delta-sigma input delays by 3 ms then, at 5 kHz by 8 ms."""
BLOCK_S = 0.005
"""Duration of a block, s; chosen: a block costs a call for inputs and one for outputs."""
AC_COUPLING_HZ = {"NI 9234": 0.5}
"""Corner of the AC coupling of modules, Hz, which NI's driver does not tell (NI-9234 specifications, 377849B)."""
PATIENCE_S = 10.0
"""Longest wait for the device, s."""


def bench_of_chassis(device: Attached, start: Table) -> tuple[Table, Table | None]:
    """Return the table of a bench for an NI chassis from that of a new bench, and that of a file of sensors if any has TEDS.

    Channels are the sensors with TEDS, force and drive where none of these is one, and the last free input for the loopback
    cable. Ranges and currents are those of the modules, the rate is the one that the device takes for `RATE_HZ`.
    """
    session = Session(str(device.options.get("server", "")))
    try:
        _, found = devices_of(session)
        chassis = next(one for one in chassis_of(found) if one.name == device.name)
        sensors = teds_sensors(session, chassis.inputs)
        channels = _channels(chassis, sensors, start)
        table = _table(device, chassis, channels, start)
        table["sample_rate_hz"] = rate_hz = _coerced_hz(session, chassis, table)
    finally:
        session.close()
    table["block"] = round(BLOCK_S * rate_hz)
    known = [
        {
            "serial_number": number,
            "make": f"manufacturer {sensor.manufacturer} of the IEEE's list",
            "model": f"model {sensor.model}",
            "sensitivity": sensor.sensitivity,
        }
        for number, sensor in _numbered(sensors)
    ]
    return table, {"sensors": known} if known else None


def _numbered(sensors: list[TedsSensor]) -> list[tuple[str, TedsSensor]]:
    """Return each sensor with its serial number, made unique by maker and model where two have the same."""
    times = Counter(sensor.serial_number for sensor in sensors)
    return [
        (
            one.serial_number
            if times[one.serial_number] == 1
            else f"{one.manufacturer}-{one.model}-{one.serial_number}",
            one,
        )
        for one in sensors
    ]


def _channels(chassis: Chassis, sensors: list[TedsSensor], start: Table) -> dict[str, Table]:
    """Return the channels of the bench by the physical channel that they are read from."""
    begun = start["channels"]
    assert isinstance(begun, list)
    force, drive = begun
    free = [name for name in chassis.inputs if name not in {sensor.channel for sensor in sensors}]
    out: dict[str, Table] = {}
    forces = accelerations = 0
    for number, sensor in _numbered(sensors):
        name = sensor.channel.partition("/")[2]
        if sensor.is_force and not forces:
            name, role = "force", "force"
        elif not sensor.is_force and not accelerations:
            name, role = "drive", "drive"
        else:
            name, role = (
                f"{'force' if sensor.is_force else 'acc'}_{len(out) + 1}",
                "monitor" if sensor.is_force else "response",
            )
        forces, accelerations = forces + sensor.is_force, accelerations + (not sensor.is_force)
        unit = {"unit": "N"} if role == "monitor" else {}
        out[sensor.channel] = {"name": name, "role": role, **unit, "serial_number": number}
    for wanted, there in ((force, forces), (drive, accelerations)):
        if not there and free:
            out[free.pop(0)] = dict(wanted)
    if free:
        out[free[-1]] = {"name": "loopback", **BRIEF_LOOPBACK}
    for name, channel in out.items():
        channel["range_v"] = chassis.inputs[name].input_v
    order = {"force": 0, "drive": 1, "response": 2, "monitor": 3}
    return dict(sorted(out.items(), key=lambda item: order[str(item[1]["role"])]))


def _table(device: Attached, chassis: Chassis, channels: dict[str, Table], start: Table) -> Table:
    output = next(iter(chassis.outputs))
    currents = [
        0.0 if channel.get("loopback") or not chassis.inputs[name].currents_ma else chassis.inputs[name].currents_ma[0]
        for name, channel in channels.items()
    ]
    couplings = ["AC" if current else "" for current in currents]
    for (name, channel), coupling in zip(channels.items(), couplings, strict=True):
        if coupling and (corner_hz := AC_COUPLING_HZ.get(chassis.inputs[name].model)):
            channel["input_high_pass_hz"] = corner_hz
    options: Table = {**device.options, "output": output, "inputs": list(channels)}
    options |= {"excitation_ma": currents, "coupling": couplings}
    free = [name for name in chassis.inputs if name not in channels]
    return {
        **start,
        "description": f"{chassis.about}. Free inputs: {', '.join(free) or 'none'}",
        "driver": {"name": device.driver, "options": options},
        "output_range_v": chassis.outputs[output].output_v,
        "channels": list(channels.values()),
    }


def _coerced_hz(session: Session, chassis: Chassis, table: Table) -> float:
    """Return the sample rate that the device takes for the one asked for."""
    driver = table["driver"]
    assert isinstance(driver, dict)
    options = NiDaqmxOptions.model_validate(driver["options"])
    ranges_v = tuple(chassis.inputs[name].input_v for name in options.inputs)
    output_v = chassis.outputs[options.output].output_v
    tasks = Tasks(session, Setting(options, RATE_HZ, ranges_v, output_v, 64, 2), PATIENCE_S)
    tasks.close()
    return tasks.facts.rate_hz
