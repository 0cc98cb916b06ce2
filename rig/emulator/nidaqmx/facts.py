"""What the emulated devices answer when they are asked for their attributes."""

from nidaqmx.constants import (
    AccelSensitivityUnits,
    ChannelType,
    ForceIEPESensorSensitivityUnits,
    ProductCategory,
    TerminalConfiguration,
    UsageTypeAI,
    UsageTypeAO,
)
from nidaqmx.error_codes import DAQmxErrors

from rig.bench.channels import Channel
from rig.emulator.nidaqmx.buffers import input_buffer
from rig.emulator.nidaqmx.devices import Device
from rig.emulator.nidaqmx.errors import NiError
from rig.emulator.nidaqmx.task import DEFAULTS, Task, Value
from rig.emulator.nidaqmx.tasks import Tasks
from vibrolock.quantities import GRAVITY_M_S2

VERSION = {"NIDAQ_MAJOR_VERSION": 24, "NIDAQ_MINOR_VERSION": 8, "NIDAQ_UPDATE_VERSION": 0}
"""Version of NI-DAQmx that is reported; from 24.5 on the client asks fewer questions."""
TEDS_SERIAL = 1000
"""Serial number of the first sensor with TEDS."""
MANUFACTURERS = {"PCB": 18}
"""Numbers of manufacturers in IEEE 1451.4."""
PSEUDO_DIFFERENTIAL, DIFFERENTIAL = 8, 4
"""Bits of terminal configurations, as in NI-DAQmx."""


class Facts:
    """Attributes of devices, channels and tasks. ``sensors`` are the rig's, by input in order."""

    def __init__(self, devices: dict[str, Device], sensors: tuple[Channel, ...], *, simulated: bool) -> None:
        self._devices, self._sensors, self._simulated = devices, sensors, simulated

    def of_system(self, name: str) -> Value:
        """An attribute of the system."""
        return _one_of(
            {**VERSION, "DEV_NAMES": ", ".join(self._devices), "TASKS": "", "SCALES": ""}, name, "the system"
        )

    def of_device(self, device: str, name: str) -> Value:
        """An attribute of a device."""
        return _one_of(self._of_device(self._device(device)), name, device)

    def of_input(self, physical: str, name: str) -> Value:
        """An attribute of a physical channel."""
        return _one_of(self._of_channel(physical), name, physical)

    def _device(self, name: str) -> Device:
        if name not in self._devices:
            raise NiError(DAQmxErrors.INVALID_DEVICE_ID, f"there is no device {name!r}")
        return self._devices[name]

    def _of_device(self, device: Device) -> dict[str, Value]:
        modules = [other.name for other in self._devices.values() if other.chassis == device.name]
        is_chassis, is_module = bool(modules), bool(device.chassis)
        category = (
            ProductCategory.COMPACT_DAQ_CHASSIS
            if is_chassis
            else ProductCategory.C_SERIES_MODULE
            if is_module
            else ProductCategory.X_SERIES_DAQ
        )
        known: dict[str, Value] = {
            "PRODUCT_TYPE": device.product,
            "PRODUCT_CATEGORY": category.value,
            "PRODUCT_NUM": 0,
            "SERIAL_NUM": device.serial,
            "IS_SIMULATED": self._simulated,
            "DEV_IS_SIMULATED": self._simulated,
            "DEV_SERIAL_NUM": device.serial,
            "CHASSIS_MODULE_DEV_NAMES": ", ".join(modules),
            "COMPACT_DAQ_CHASSIS_DEV_NAME": device.chassis,
            "COMPACT_DAQ_SLOT_NUM": device.slot,
            "AI_PHYSICAL_CHANS": ", ".join(device.channels("ai")),
            "AO_PHYSICAL_CHANS": ", ".join(device.channels("ao")),
            "TERMINALS": ", ".join(device.terminals),
            "TEDS_HWTEDS_SUPPORTED": device.inputs is not None and device.inputs.teds,
            "DIG_TRIG_SUPPORTED": True,
            "ANLG_TRIG_SUPPORTED": False,
        }
        if device.inputs is not None:
            group = device.inputs
            usages = [UsageTypeAI.VOLTAGE.value]
            if group.iepe_a:
                usages += [
                    UsageTypeAI.ACCELERATION_ACCELEROMETER_CURRENT_INPUT.value,
                    UsageTypeAI.FORCE_IEPE_SENSOR.value,
                    UsageTypeAI.TEDS.value,
                ]
            known |= {
                "AI_MAX_SINGLE_CHAN_RATE": group.highest_hz,
                "AI_MAX_MULTI_CHAN_RATE": group.highest_hz,
                "AI_MIN_RATE": group.lowest_hz,
                "AI_SIMULTANEOUS_SAMPLING_SUPPORTED": True,
                "AI_VOLTAGE_RNGS": [end for range_v in group.ranges_v for end in (-range_v, range_v)],
                "AI_CURRENT_INT_EXCIT_DISCRETE_VALS": [0.0, group.iepe_a] if group.iepe_a else [],
                "AI_COUPLINGS": 0b11 if group.high_pass_hz else 0b10,
                "AI_SUPPORTED_MEAS_TYPES": usages,
            }
        if device.outputs is not None:
            known |= {
                "AO_MAX_RATE": device.outputs.highest_hz,
                "AO_MIN_RATE": 0.0,
                "AO_SAMP_CLK_SUPPORTED": True,
                "AO_VOLTAGE_RNGS": [-device.outputs.range_v, device.outputs.range_v],
                "AO_SUPPORTED_OUTPUT_TYPES": [UsageTypeAO.VOLTAGE.value],
            }
        return known

    def sensor(self, physical: str) -> Channel | None:
        """The sensor at an input of the chassis that tells what it is, if there is one."""
        device = self._device(physical.partition("/")[0])
        if physical not in [*device.channels("ai"), *device.channels("ao")]:
            raise NiError(DAQmxErrors.PHYSICAL_CHAN_DOES_NOT_EXIST, f"{device.name} has no channel {physical!r}")
        if device.inputs is None or not device.inputs.teds or physical not in device.channels("ai"):
            return None
        before = [
            other for other in self._devices.values() if other.chassis == device.chassis and other.slot < device.slot
        ]
        index = sum(len(other.channels("ai")) for other in before) + device.channels("ai").index(physical)
        return self._sensors[index] if index < len(self._sensors) and self._sensors[index].sensor else None

    def _of_channel(self, physical: str) -> dict[str, Value]:
        device = self._device(physical.partition("/")[0])
        sensor = self.sensor(physical)
        known: dict[str, Value] = {
            "PHYSICAL_CHAN_AI_TERM_CFGS": PSEUDO_DIFFERENTIAL if device.chassis else DIFFERENTIAL,
            "PHYSICAL_CHAN_AO_TERM_CFGS": 1,
            "PHYSICAL_CHAN_AI_SUPPORTED_MEAS_TYPES": self._of_device(device).get("AI_SUPPORTED_MEAS_TYPES", []),
        }
        if sensor is not None:
            maker, _, model = (sensor.sensor or "").partition(" ")
            known |= {
                "PHYSICAL_CHAN_TEDS_MFG_ID": MANUFACTURERS.get(maker, 0),
                "PHYSICAL_CHAN_TEDS_MODEL_NUM": int("".join(c for c in model if c.isdigit()) or 0),
                "PHYSICAL_CHAN_TEDS_SERIAL_NUM": TEDS_SERIAL + self._sensors.index(sensor),
                "PHYSICAL_CHAN_TEDS_VERSION_NUM": 1,
                "PHYSICAL_CHAN_TEDS_VERSION_LETTER": "A",
                "PHYSICAL_CHAN_TEDS_TEMPLATE_IDS": [25],
            }
        elif device.inputs is not None and device.inputs.teds:
            known |= {"no_teds": True}
        return known

    def teds_sensitivity(self, physical: str, attribute: str) -> tuple[float, int]:
        """Sensitivity of the sensor at an input, and its unit, as NI-DAQmx reads it from TEDS."""
        sensor = self.sensor(physical)
        if sensor is None:
            raise NiError(DAQmxErrors.TEDS_SENSOR_NOT_DETECTED, f"no sensor at {physical} tells what it is")
        is_force = attribute.startswith("AI_FORCE")
        if (sensor.unit == "N") != is_force:
            raise NiError(
                DAQmxErrors.TEDS_INCOMPATIBLE_SENSOR_AND_MEAS_TYPE, f"{physical} has a sensor of {sensor.unit}"
            )
        if is_force:
            return 1000.0 * sensor.sensitivity_v_per_unit, ForceIEPESensorSensitivityUnits.MILLIVOLTS_PER_NEWTON.value
        return 1000.0 * sensor.sensitivity_v_per_unit * GRAVITY_M_S2, AccelSensitivityUnits.MILLIVOLTS_PER_G.value

    def of_channel(self, tasks: Tasks, task: Task, channel: str, name: str) -> Value:
        """An attribute of a channel of a task; of the first one if several are meant."""
        chosen = task.chosen(channel)
        if not chosen:
            raise NiError(DAQmxErrors.INVALID_TASK, f"{task.name} has no channel {channel!r}")
        first = chosen[0]
        largest_v = _range_v(first.device)
        limits = {f"{kind}_{end}": first.attributes.get(end, 0.0) for kind in ("AI", "AO") for end in ("MIN", "MAX")}
        known: dict[str, Value] = {
            **DEFAULTS,
            **limits,
            "PHYSICAL_CHAN_NAME": first.physical,
            "AI_FILTER_DELAY": tasks.filter_delay(task, first),
            "AI_REMOVE_FILTER_DELAY": False,
            "AO_FILTER_DELAY": 0.0,
            "AI_TERM_CFG": TerminalConfiguration.PSEUDO_DIFF.value,
            "AI_RNG_HIGH": largest_v,
            "AI_RNG_LOW": -largest_v,
            "CHAN_TYPE": (ChannelType.ANALOG_INPUT if task.kind == "ai" else ChannelType.ANALOG_OUTPUT).value,
        }
        return _one_of(known | first.attributes, name, first.name)

    def of_task(self, tasks: Tasks, task: Task, name: str) -> Value:
        """An attribute of a task: its timing, trigger, buffer, position."""
        timeline = tasks.timeline
        if name == "SAMP_CLK_RATE" and task.is_timed:
            tasks.verify(task)
        timeline.advance()
        own = f"/{task.devices[0].timed_by if task.devices else ''}/{task.kind}"
        generation = task.generation
        started = task.first is not None
        acquired = timeline.done - (task.first or 0) if started else 0
        known = {
            "SAMP_CLK_TERM": task.text("SAMP_CLK_SRC") or f"{own}/SampleClock",
            "START_TRIG_TERM": task.text("DIG_EDGE_START_TRIG_SRC") or f"{own}/StartTrigger",
            "SAMP_CLK_TIMEBASE_TERM": f"{own}/SampleClockTimebase",
            "HAS_EXPIRED": task.has_expired,
            "CHANNELS": ", ".join(c.name for c in task.channels),
            "NAME": task.name,
            "DEVICES": ", ".join(device.name for device in task.devices),
            "NUM_CHANS": len(task.channels),
            "NUM_DEVICES": len(task.devices),
            "INPUT_BUF_SIZE": input_buffer(task) if task.is_timed else 0,
            "OUTPUT_BUF_SIZE": generation.size if generation is not None else 0,
            "INPUT_ONBRD_BUF_SIZE": 0,
            "OUTPUT_ONBRD_BUF_SIZE": next((d.outputs.onboard_samples for d in task.devices if d.outputs), 0),
            "AVAIL_SAMP_PER_CHAN": acquired - task.position,
            "TOTAL_SAMP_PER_CHAN_ACQUIRED": acquired,
            "CURR_READ_POS": task.position,
            "CURR_WRITE_POS": generation.written if generation is not None else 0,
            "SPACE_AVAIL": generation.room(timeline.done) if generation is not None else 0,
            "TOTAL_SAMP_PER_CHAN_GENERATED": generation.generated if generation is not None else 0,
            "SAMP_CLK_MAX_RATE": min([group.highest_hz for group in task.inputs], default=0.0),
            **task.attributes,
        }
        return _one_of(DEFAULTS | known, name, task.name)


def _range_v(device: Device) -> float:
    if device.inputs is not None:
        return device.inputs.ranges_v[-1]
    return device.outputs.range_v if device.outputs is not None else 0.0


def _one_of(known: dict[str, Value], name: str, of: str) -> Value:
    if name in known:
        return known[name]
    if "TEDS" in name:
        code = DAQmxErrors.TEDS_SENSOR_NOT_DETECTED if "no_teds" in known else DAQmxErrors.TEDS_NOT_SUPPORTED
        raise NiError(code, f"no sensor at {of} tells what it is")
    raise NiError(DAQmxErrors.ATTRIBUTE_NOT_SUPPORTED_IN_TASK_CONTEXT, f"{name} of {of or 'the system'}")
