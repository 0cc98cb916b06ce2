"""Sensors that describe themselves (TEDS, IEEE 1451.4), as NI's driver interprets what they hold."""

from collections.abc import Iterable
from typing import Any, NamedTuple

from rig.drivers.nidaqmx.library import Session
from vibrolock.quantities import POUND_N


class TedsSensor(NamedTuple):
    """A sensor and what it says of itself."""

    channel: str
    """Physical channel that it is connected to."""
    is_force: bool
    """Whether it measures a force, or else an acceleration."""
    manufacturer: int
    """Number of its manufacturer; the IEEE keeps the list."""
    model: int
    """Number of its model."""
    serial_number: str
    sensitivity: str
    """Number and unit: ``100.2 mV/g``, ``22.4 mV/N``."""


def teds_sensors(session: Session, channels: Iterable[str]) -> list[TedsSensor]:
    """Return the IEPE accelerometers and force sensors with TEDS at some physical channels; others are left out."""
    found = (_sensor(session, channel) for channel in channels)
    return [sensor for sensor in found if sensor is not None]


def _sensor(session: Session, channel: str) -> TedsSensor | None:
    from nidaqmx.errors import Error
    from nidaqmx.system.physical_channel import PhysicalChannel

    try:
        physical = PhysicalChannel(channel, grpc_options=session.options)
        physical.configure_teds()
        numbers = int(physical.teds_mfg_id), int(physical.teds_model_num)
        serial_number = str(physical.teds_serial_num)
    except Error:
        return None
    for is_force in (False, True):
        try:
            sensitivity = _sensitivity(session, channel, is_force)
        except Error:
            continue
        return TedsSensor(channel, is_force, *numbers, serial_number, sensitivity)
    return None


def _sensitivity(session: Session, channel: str, is_force: bool) -> str:
    """Return the sensitivity that NI's driver takes from the TEDS of a channel, in a task that is never started."""
    with session.ni.Task(grpc_options=session.options) as task:
        add = task.ai_channels.add_teds_ai_force_iepe_chan if is_force else task.ai_channels.add_teds_ai_accel_chan
        made: Any = add(channel)
        if not is_force:
            per = {"MILLIVOLTS_PER_G": "mV/g", "VOLTS_PER_G": "V/g"}[made.ai_accel_sensitivity_units.name]
            return f"{made.ai_accel_sensitivity:.6g} {per}"
        value = float(made.ai_force_iepe_sensor_sensitivity)
        in_pounds = made.ai_force_iepe_sensor_sensitivity_units.name == "MILLIVOLTS_PER_POUND"
        return f"{value / (POUND_N if in_pounds else 1.0):.6g} mV/N"
