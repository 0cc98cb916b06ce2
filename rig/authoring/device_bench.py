"""A bench to begin with for a device that is connected to this computer."""

from rig.bench.configuration import Table
from rig.drivers.devices import Attached, Found, attached_devices, ni_devices
from rig.errors import ConfigurationError

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
    name, _, server = name.partition("@") if driver == "nidaqmx" else (name, "", "")
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

    Of a sound device it has a channel for each input, the last one for the loopback cable where there are three or more. Of a
    device on a wire it names the device; `rig doctor --daq` then tells what the device says of its channels.
    """
    table = {**start, "driver": {"name": device.driver, "options": dict(device.options)}}
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
