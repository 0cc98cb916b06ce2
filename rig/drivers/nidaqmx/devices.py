"""The devices that NI-DAQmx knows: on this computer, or on a device server."""

from collections.abc import Callable
from typing import Any, NamedTuple

from rig.drivers.nidaqmx.library import Session, ni_errors, value_or


class NiDevice(NamedTuple):
    """A device, or a module of a chassis, with its analog channels."""

    name: str
    """Name by which NI-DAQmx knows it: ``cDAQ1Mod1``, ``Dev1``."""
    model: str
    serial_number: str
    """As printed on it: hexadecimal."""
    is_simulated: bool
    """Whether NI-DAQmx only simulates it."""
    chassis: str
    """Name of the chassis in which it is a module; its own otherwise."""
    inputs: tuple[str, ...]
    """Physical channels."""
    outputs: tuple[str, ...]
    input_v: float
    """Largest voltage of an input; 0 where it is not known."""
    output_v: float
    rates_hz: tuple[float, float]
    """Lowest and highest sample rate of the inputs; 0 where it is not known."""
    currents_ma: tuple[float, ...]
    """Currents for IEPE sensors, mA; none where it has none."""


def devices_of(session: Session) -> tuple[str, list[NiDevice]]:
    """Return the version of NI's driver, and the devices it knows.

    Raises `DaqRefused` where NI's driver is missing, `DaqDisconnected` where the device server does not answer.
    """
    with ni_errors(session.where):
        system = session.system()
        version = ".".join(str(part) for part in system.driver_version)
        return version, [_device(one) for one in system.devices]


def _device(device: Any) -> NiDevice:
    inputs, outputs = _channels(lambda: device.ai_physical_chans), _channels(lambda: device.ao_physical_chans)
    chassis = value_or(lambda: device.compact_daq_chassis_device.name, "")
    return NiDevice(
        name=str(device.name),
        model=str(value_or(lambda: device.product_type, "")),
        serial_number=f"{value_or(lambda: device.serial_num, 0):X}",
        is_simulated=bool(value_or(lambda: device.is_simulated, False)),
        chassis=chassis or str(device.name),
        inputs=inputs,
        outputs=outputs,
        input_v=max(value_or(lambda: device.ai_voltage_rngs, []), default=0.0) if inputs else 0.0,
        output_v=max(value_or(lambda: device.ao_voltage_rngs, []), default=0.0) if outputs else 0.0,
        rates_hz=(
            float(value_or(lambda: device.ai_min_rate, 0.0)) if inputs else 0.0,
            float(value_or(lambda: device.ai_max_multi_chan_rate, 0.0)) if inputs else 0.0,
        ),
        currents_ma=tuple(
            round(1e3 * current, 6)
            for current in (value_or(lambda: device.ai_current_int_excit_discrete_vals, []) if inputs else ())
            if current > 0.0
        ),
    )


def _channels(read: Callable[[], Any]) -> tuple[str, ...]:
    return tuple(str(name) for name in value_or(lambda: read().channel_names, ()))


class Chassis(NamedTuple):
    """The devices that stand in one chassis, or one device that stands alone."""

    name: str
    devices: tuple[NiDevice, ...]

    @property
    def inputs(self) -> dict[str, NiDevice]:
        """Input channels, and whose they are."""
        return {name: device for device in self.devices for name in device.inputs}

    @property
    def outputs(self) -> dict[str, NiDevice]:
        """Output channels, and whose they are."""
        return {name: device for device in self.devices for name in device.outputs}

    @property
    def about(self) -> str:
        """Its modules, in one line."""
        return "; ".join(_about(device) for device in self.devices if device.inputs or device.outputs)


def chassis_of(devices: list[NiDevice]) -> list[Chassis]:
    """Return the chassis and single devices that have an input and an output."""
    names = dict.fromkeys(device.chassis for device in devices)
    found = [Chassis(name, tuple(device for device in devices if device.chassis == name)) for name in names]
    return [one for one in found if one.inputs and one.outputs]


def _about(device: NiDevice) -> str:
    facts = []
    if device.inputs:
        facts.append(f"{len(device.inputs)} inputs of {device.input_v:g} V")
        facts += [f"IEPE {device.currents_ma[0]:g} mA"] if device.currents_ma else []
        facts += ["{:g} to {:g} Hz".format(*device.rates_hz)] if device.rates_hz[1] else []
    facts += [f"{len(device.outputs)} outputs of {device.output_v:g} V"] if device.outputs else []
    simulated = " (simulated)" if device.is_simulated else ""
    return f"{device.name} {device.model}{simulated}: {', '.join(facts)}"
