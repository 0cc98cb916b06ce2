"""A bench to begin with for a device that is connected to this computer."""

import re

from rig.bench import Bench
from rig.bench.configuration import Table, validated
from rig.drivers import make_daq
from rig.drivers.devices import Attached, Found, attached_devices, ni_devices
from rig.drivers.wire.driver import WireDAQ
from rig.drivers.wire.facts import DeviceFacts
from rig.errors import ConfigurationError, DaqError

ON_A_WIRE = ("serial", "can")
"""Drivers whose devices say what they have."""
SERVER = r"[^\s:/]+:[0-9]{1,5}"
"""Pattern of the address of an NI gRPC Device Server."""
DECIMATION = 4
"""Frames of a sound device in a sample of its bench; chosen: 12 kHz of 48 kHz."""
BLOCK_FRAMES = 128
"""Frames of a block; a period of the audio system by default."""
BRIEF_LOOPBACK = {"role": "monitor", "unit": "V", "sensitivity_v_per_unit": 1.0, "loopback": True}
"""Keys of a channel that the output is connected to."""


def device_named(text: str) -> Attached:
    """Return the connected device that ``DRIVER:NAME`` means, such as ``sound:Scarlett`` or ``serial:/dev/ttyACM0``.

    ``nidaqmx:cDAQ1@host:port`` is a device of an NI gRPC Device Server.
    Raises `ConfigurationError` where there is none, or several, with the names of those there are.
    """
    driver, _, name = text.partition(":")
    name, at, server = name.partition("@") if driver == "nidaqmx" else (name, "", "")
    if at and not re.fullmatch(SERVER, server):
        raise ConfigurationError(
            field="source", value=text, allowed="nidaqmx:NAME@HOST:PORT; a server's usual port is 31763"
        )
    found = Found(ni_devices(server), []) if server else attached_devices()
    devices = [f"{one.driver}:{one.name}" for one in found.devices]
    matching = [one for one in found.devices if one.driver == driver and name.casefold() in one.name.casefold()]
    exact = [one for one in matching if one.name == name]
    chosen = exact or matching
    if len(chosen) != 1:
        what = "several devices are called so" if chosen else "there is no such device"
        raise ConfigurationError(
            what, field="source", value=text, allowed=", ".join(devices) or "none is connected", further=found.missing
        )
    return chosen[0]


def bench_of_device(device: Attached, start: Table) -> Table:
    """Return the table of a bench for a device, from that of a new bench.

    Of a sound device it has a channel for each input, the last one for the loopback cable where there are three or more. A
    device on a wire is asked for its channels, ranges and rates; where it does not answer, the description says why.
    """
    table = {**start, "driver": {"name": device.driver, "options": dict(device.options)}}
    if device.driver in ON_A_WIRE:
        try:
            return _as_described(_asked(table), table)
        except DaqError as error:
            return {**table, "description": f"channels are examples, for the device did not say its own: {error}"}
    if device.driver != "sound":
        return table
    rate_hz = device.rate_hz / DECIMATION
    table |= {"sample_rate_hz": rate_hz, "block": max(1, round(BLOCK_FRAMES / DECIMATION)), "output_range_v": 1.0}
    channels = start["channels"]
    assert isinstance(channels, list)
    force, drive = channels
    rows: list[object] = [force, drive]
    rows += [{**drive, "name": f"input_{number}", "role": "response"} for number in range(3, device.inputs)]
    if device.inputs > 2:
        rows.append({"name": "loopback", **BRIEF_LOOPBACK, "range_v": force["range_v"]})
    table["channels"] = rows[: max(2, device.inputs)]
    return table


def _asked(table: Table) -> DeviceFacts:
    """Return what the device of a bench says of itself; raises `DaqError` where it does not answer."""
    daq = make_daq(validated(Bench, table, "bench"))
    assert isinstance(daq, WireDAQ)
    return daq.ask()


def _as_described(facts: DeviceFacts, table: Table) -> Table:
    """Return the table with the channels, ranges and rate of a device on a wire; the first two channels are force and drive.

    A channel that is called ``force``, ``drive`` or ``loopback`` is that.
    """
    if len(facts.names) < 2:
        raise DaqError(f"it has the channel {facts.names[0]!r} alone, and a bench needs force and drive")
    channels = table["channels"]
    assert isinstance(channels, list)
    force, drive = channels
    rate_hz = float(min(max(float(str(table["sample_rate_hz"])), facts.rate_hz[0]), facts.rate_hz[1]))
    roles = _roles(facts.names)
    rows = []
    for index, (name, role) in enumerate(zip(facts.names, roles, strict=True)):
        like = force if role == "force" else BRIEF_LOOPBACK if role == "monitor" else drive
        row = {**like, "name": name, "role": role, "range_v": _digits(facts.range_v[index])}
        row["resolution_v"] = _digits(facts.v_per_count[index])
        if skew := _digits(facts.skew_s[index] * rate_hz):
            row["skew_samples"] = skew
        rows.append(row)
    lowest, highest = facts.rate_hz
    return {
        **table,
        "description": f"{facts.model}, firmware {facts.firmware}, serial number {facts.serial_number}: {len(rows)} channels, "
        f"{lowest:g} to {highest:g} Hz; roles and sensors to be checked",
        "sample_rate_hz": rate_hz,
        "block": min(int(str(table["block"])), facts.largest_block),
        "output_range_v": _digits(facts.output_range_v),
        "channels": rows,
    }


def _roles(names: tuple[str, ...]) -> list[str]:
    """Return the role of each channel: by its name, else the first two that are left are force and drive."""
    roles = dict.fromkeys(names, "")
    for name in ("force", "drive"):
        if name in roles:
            roles[name] = name
    if "loopback" in roles:
        roles["loopback"] = "monitor"
    for role in ("force", "drive"):
        left = [name for name, known in roles.items() if not known]
        if role not in roles.values() and left:
            roles[left[0]] = role
    return [role or "response" for role in roles.values()]


def _digits(value: float) -> float:
    """Return a number of the wire, float32, with the digits that it has."""
    return float(f"{value:.7g}")
