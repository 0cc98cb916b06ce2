"""The devices of this computer that a driver can use, each with the options of a bench that name it."""

import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

from rig.bench.configuration import Table
from rig.errors import RigError

CAN_INTERFACES = ("socketcan", "pcan", "kvaser", "vector", "ixxat", "gs_usb")
"""Interfaces of python-can that are asked for their channels: those of adapters that one buys."""


class Attached(NamedTuple):
    """A device that was found."""

    driver: str
    """Driver that uses it."""
    name: str
    options: Table
    """``[driver.options]`` that name it."""
    about: str = ""
    """What else is known of it."""
    inputs: int = 0
    """Number of its inputs; 0 where it is not known."""
    rate_hz: float = 0.0
    """Rate at which it runs by default, Hz; 0 where it is not known."""


class Found(NamedTuple):
    """What was found, and where nothing could be looked for."""

    devices: list[Attached]
    missing: list[str]
    """For each kind of device that could not be looked for, why."""


def attached_devices() -> Found:
    """Look for serial ports, CAN interfaces, sound devices and NI devices; what is missing for it is told and ends nothing."""
    devices: list[Attached] = []
    missing = []
    looks = {"serial ports": _serial, "CAN interfaces": _can, "sound devices": _sound, "NI devices": ni_devices}
    for what, look in looks.items():
        try:
            with _quiet():
                devices += look()
        except (ImportError, OSError, RigError) as error:
            missing.append(f"{what}: {error}")
    return Found(devices, missing)


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep what libraries say of drivers that are not installed off the terminal."""
    before = logging.root.manager.disable
    logging.disable(logging.CRITICAL)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logging.disable(before)


def _serial() -> list[Attached]:
    from rig.wire.serial.port import port_names

    return [Attached("serial", name, {"port": name}) for name in port_names()]


def _can() -> list[Attached]:
    import can

    found = can.detect_available_configs([*CAN_INTERFACES])
    return [
        Attached(
            "can",
            f"{config['interface']} {config['channel']}",
            {"interface": str(config["interface"]), "channel": str(config["channel"])},
        )
        for config in found
    ]


def _sound() -> list[Attached]:
    from rig.drivers.sound.devices import sound_devices

    return [
        Attached(
            "sound",
            f"{device.name} ({device.host_api})",
            {"device": device.name, "host_api": device.host_api},
            f"{device.inputs} inputs, {device.outputs} outputs, {device.rate_hz:g} Hz",
            device.inputs,
            device.rate_hz,
        )
        for device in sound_devices()
        if device.inputs and device.outputs
    ]


def ni_devices(server: str = "") -> list[Attached]:
    """Return the NI devices of this computer, or of a device server; a chassis with its modules is one.

    Raises `rig.errors.DaqError` where the package, NI's driver or the server is missing.
    """
    from rig.drivers.nidaqmx.devices import chassis_of, devices_of
    from rig.drivers.nidaqmx.library import Session

    session = Session(server)
    try:
        _, found = devices_of(session)
    finally:
        session.close()
    return [
        Attached(
            "nidaqmx",
            chassis.name,
            {
                "output": next(iter(chassis.outputs)),
                "inputs": list(chassis.inputs),
                **({"server": server} if server else {}),
            },
            chassis.about,
            len(chassis.inputs),
        )
        for chassis in chassis_of(found)
    ]
