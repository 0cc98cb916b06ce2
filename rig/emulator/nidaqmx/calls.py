"""The calls of NI's gRPC interface that are answered, by name."""

from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

import grpc
import numpy as np
from google.protobuf.message import Message
from nidaqmx._stubs import nidaqmx_pb2 as ni
from nidaqmx.constants import AcquisitionType, Coupling, ExcitationSource, FillMode
from nidaqmx.error_codes import DAQmxErrors
from session_pb2 import Session

from rig.emulator.nidaqmx.errors import NiError
from rig.emulator.nidaqmx.facts import Facts
from rig.emulator.nidaqmx.faults import Injection
from rig.emulator.nidaqmx.task import Task, Value
from rig.emulator.nidaqmx.tasks import Tasks

SERVICE = ni.DESCRIPTOR.services_by_name["NiDAQmx"]
"""NI's service with all its calls."""
ATTRIBUTES = {
    value.number: value.name.partition("_ATTRIBUTE_")[2]
    for kind in ni.DESCRIPTOR.enum_types_by_name.values()
    if kind.name.endswith("Attribute")
    for value in kind.values
}
"""Names of all attributes by their number."""

Answer = Callable[[Any, str], Message]
"""What answers a call: from a request and the connection that it came by to a response."""


class Calls(grpc.GenericRpcHandler):  # type: ignore[misc]
    """Answers the calls of clients. A call that it does not know is one that the server has not implemented."""

    def __init__(self, tasks: Tasks, facts: Facts, on_call: Callable[[str], None]) -> None:
        self._tasks, self._facts, self._on_call = tasks, facts, on_call
        self._handlers: dict[str, grpc.RpcMethodHandler] = {}
        self.injections: list[Injection] = []
        """Errors to raise, which tests may add to."""
        self.counts = {"refused_calls": 0}
        self._answers: dict[type[Message], Answer] = {
            ni.CreateTaskRequest: self._create_task,
            ni.ClearTaskRequest: self._clear_task,
            ni.StartTaskRequest: self._start_task,
            ni.StopTaskRequest: self._stop_task,
            ni.TaskControlRequest: self._control_task,
            ni.IsTaskDoneRequest: self._is_task_done,
            ni.ResetDeviceRequest: self._reset_device,
            ni.GetErrorStringRequest: self._error_string,
            ni.CreateAIVoltageChanRequest: self._create_ai_voltage,
            ni.CreateAOVoltageChanRequest: self._create_ao_voltage,
            ni.CreateTEDSAIAccelChanRequest: self._create_teds_accel,
            ni.CreateTEDSAIForceIEPEChanRequest: self._create_teds_force,
            ni.ConfigureTEDSRequest: self._configure_teds,
            ni.CfgSampClkTimingRequest: self._clock,
            ni.CfgDigEdgeStartTrigRequest: self._start_trigger,
            ni.ExportSignalRequest: self._export_signal,
            ni.ReadAnalogF64Request: self._read,
            ni.WriteAnalogF64Request: self._write,
            ni.WriteAnalogScalarF64Request: self._write_scalar,
            ni.CreateWatchdogTimerTaskExRequest: self._create_watchdog,
            ni.CfgWatchdogAOExpirStatesRequest: self._expiration_states,
            ni.ControlWatchdogTaskRequest: self._control_watchdog,
        }

    def service(self, handler_call_details: grpc.HandlerCallDetails) -> grpc.RpcMethodHandler | None:
        """Return the handler of a call; None for one that is not implemented."""
        service, _, name = handler_call_details.method.rpartition("/")
        if service != f"/{SERVICE.full_name}" or name not in SERVICE.methods_by_name:
            return None
        if name not in self._handlers:
            answer = self._answer_to(name)
            if answer is None:
                self._on_call(f"not implemented: {name}")
                return None
            self._handlers[name] = self._handler(name, answer)
        return self._handlers[name]

    def _answer_to(self, name: str) -> Answer | None:
        own = self._answers.get(getattr(ni, f"{name}Request"))
        if own is not None:
            return own
        for verb in ("Get", "Set", "Reset"):
            if name.startswith(verb) and "Attribute" in name:
                group = name.removeprefix(verb).partition("Attribute")[0]
                return partial(self._attribute, verb, group, getattr(ni, f"{name}Response"))
        return None

    def _handler(self, name: str, answer: Answer) -> grpc.RpcMethodHandler:
        def handle(request: Message, context: grpc.ServicerContext) -> Message:
            self._on_call(name)
            try:
                with self._tasks.timeline.lock:
                    self._inject(name)
                    return answer(request, context.peer())
            except NiError as error:
                self.counts["refused_calls"] += 1
                context.set_trailing_metadata(error.metadata)
                context.abort(grpc.StatusCode.UNKNOWN, str(error))
                raise  # abort has raised

        return grpc.unary_unary_rpc_method_handler(
            handle,
            request_deserializer=getattr(ni, f"{name}Request").FromString,
            response_serializer=getattr(ni, f"{name}Response").SerializeToString,
        )

    def _inject(self, name: str) -> None:
        for injection in self.injections:
            if injection.is_due(name):
                raise injection.error

    # Attributes

    def _attribute(self, verb: str, group: str, response: Callable[..., Message], request: Any, _peer: str) -> Message:
        name = ATTRIBUTES.get(request.attribute_raw, str(request.attribute_raw))
        if verb == "Get":
            value = self._value(group, name, request)
            fields = ni.DESCRIPTOR.message_types_by_name[response.__name__].fields_by_name
            return response(**{"value_raw" if "value_raw" in fields else "value": value})
        task = self._tasks.find(request.task.name)
        stores: Iterable[dict[str, Value]] = [task.attributes]
        if group == "Chan":
            stores = [channel.attributes for channel in task.chosen(request.channel)]
        for store in stores:
            store.pop(name, None)
            if verb == "Set":
                store[name] = request.value_raw if hasattr(request, "value_raw") else request.value
        if name == "SAMP_CLK_RATE":
            task.attributes["asked_hz"] = task.attributes[name]
        task.committed &= task.running
        return response()

    def _value(self, group: str, name: str, request: Any) -> Value:
        match group:
            case "SystemInfo":
                return self._facts.of_system(name)
            case "Device":
                return self._facts.of_device(request.device_name, name)
            case "PhysicalChan":
                return self._facts.of_input(request.physical_channel, name)
            case "Chan":
                return self._facts.of_channel(self._tasks, self._tasks.find(request.task.name), request.channel, name)
        return self._facts.of_task(self._tasks, self._tasks.find(request.task.name), name)

    # Tasks

    def _create_task(self, request: ni.CreateTaskRequest, peer: str) -> ni.CreateTaskResponse:
        task = self._tasks.create(request.session_name, peer)
        return ni.CreateTaskResponse(task=Session(name=task.name), new_session_initialized=True)

    def _clear_task(self, request: ni.ClearTaskRequest, _peer: str) -> ni.ClearTaskResponse:
        self._tasks.clear(self._task(request))
        return ni.ClearTaskResponse()

    def _start_task(self, request: ni.StartTaskRequest, _peer: str) -> ni.StartTaskResponse:
        self._tasks.start(self._task(request))
        return ni.StartTaskResponse()

    def _stop_task(self, request: ni.StopTaskRequest, _peer: str) -> ni.StopTaskResponse:
        self._tasks.stop(self._task(request))
        return ni.StopTaskResponse()

    def _control_task(self, request: ni.TaskControlRequest, _peer: str) -> ni.TaskControlResponse:
        self._tasks.control(self._task(request), request.action_raw)
        return ni.TaskControlResponse()

    def _is_task_done(self, request: ni.IsTaskDoneRequest, _peer: str) -> ni.IsTaskDoneResponse:
        return ni.IsTaskDoneResponse(is_task_done=self._tasks.is_done(self._task(request)))

    def _reset_device(self, request: ni.ResetDeviceRequest, _peer: str) -> ni.ResetDeviceResponse:
        self._tasks.reset(request.device_name)
        return ni.ResetDeviceResponse()

    def _error_string(self, request: ni.GetErrorStringRequest, _peer: str) -> ni.GetErrorStringResponse:
        known = {code.value: code.name for code in DAQmxErrors}
        return ni.GetErrorStringResponse(error_string=known.get(request.error_code, ""))

    def _task(self, request: Any) -> Task:
        return self._tasks.find(request.task.name)

    # Channels

    def _create_ai_voltage(self, request: ni.CreateAIVoltageChanRequest, _peer: str) -> ni.CreateAIVoltageChanResponse:
        self._add(request, "ai", {})
        return ni.CreateAIVoltageChanResponse()

    def _create_ao_voltage(self, request: ni.CreateAOVoltageChanRequest, _peer: str) -> ni.CreateAOVoltageChanResponse:
        self._add(request, "ao", {})
        return ni.CreateAOVoltageChanResponse()

    def _create_teds_accel(
        self, request: ni.CreateTEDSAIAccelChanRequest, _peer: str
    ) -> ni.CreateTEDSAIAccelChanResponse:
        self._add_teds(request, "AI_ACCEL_SENSITIVITY")
        return ni.CreateTEDSAIAccelChanResponse()

    def _create_teds_force(
        self, request: ni.CreateTEDSAIForceIEPEChanRequest, _peer: str
    ) -> ni.CreateTEDSAIForceIEPEChanResponse:
        self._add_teds(request, "AI_FORCE_IEPE_SENSOR_SENSITIVITY")
        return ni.CreateTEDSAIForceIEPEChanResponse()

    def _add_teds(self, request: Any, attribute: str) -> None:
        sensitivity, units = self._facts.teds_sensitivity(request.physical_channel, attribute)
        own = {attribute: sensitivity, f"{attribute}_UNITS": units}
        iepe = {"AI_COUPLING": Coupling.AC.value, "AI_EXCIT_SRC": ExcitationSource.INTERNAL.value}
        self._add(request, "ai", {**own, **iepe, "AI_EXCIT_VAL": request.current_excit_val})

    def _add(self, request: Any, kind: str, attributes: dict[str, Value]) -> None:
        limits = {"MIN": request.min_val, "MAX": request.max_val}
        added = self._tasks.add(self._task(request), kind, request.physical_channel, {**attributes, **limits})
        if request.name_to_assign_to_channel and len(added) == 1:
            added[0].name = request.name_to_assign_to_channel

    def _configure_teds(self, request: ni.ConfigureTEDSRequest, _peer: str) -> ni.ConfigureTEDSResponse:
        self._facts.of_input(request.physical_channel, "PHYSICAL_CHAN_TEDS_MFG_ID")
        return ni.ConfigureTEDSResponse()

    # Timing

    def _clock(self, request: ni.CfgSampClkTimingRequest, _peer: str) -> ni.CfgSampClkTimingResponse:
        task = self._task(request)
        if request.sample_mode_raw != AcquisitionType.CONTINUOUS.value:
            raise NiError(DAQmxErrors.INVALID_ATTRIBUTE_VALUE, "this emulator samples continuously only")
        task.attributes |= {
            "SAMP_CLK_SRC": request.source,
            "SAMP_CLK_RATE": request.rate,
            "asked_hz": request.rate,
            "SAMP_CLK_ACTIVE_EDGE": request.active_edge_raw,
            "SAMP_QUANT_SAMP_MODE": request.sample_mode_raw,
            "SAMP_QUANT_SAMP_PER_CHAN": request.samps_per_chan,
        }
        task.committed = False
        return ni.CfgSampClkTimingResponse()

    def _start_trigger(self, request: ni.CfgDigEdgeStartTrigRequest, _peer: str) -> ni.CfgDigEdgeStartTrigResponse:
        self._task(request).attributes["DIG_EDGE_START_TRIG_SRC"] = request.trigger_source
        return ni.CfgDigEdgeStartTrigResponse()

    def _export_signal(self, request: ni.ExportSignalRequest, _peer: str) -> ni.ExportSignalResponse:
        self._task(request).attributes["SAMP_CLK_OUTPUT_TERM"] = request.output_terminal
        return ni.ExportSignalResponse()

    # Data

    def _read(self, request: ni.ReadAnalogF64Request, _peer: str) -> ni.ReadAnalogF64Response:
        task, n = self._task(request), request.num_samps_per_chan
        if n * len(task.channels) > request.array_size_in_samps:
            raise NiError(DAQmxErrors.READ_BUFFER_TOO_SMALL, f"{n} samples of {len(task.channels)} channels", read=0)
        rows, error = self._tasks.buffers.read(task, n, request.timeout)
        by_channel = request.fill_mode_raw == FillMode.GROUP_BY_CHANNEL.value
        return ni.ReadAnalogF64Response(
            read_array=(rows if by_channel else rows.T).ravel().tolist(),
            samps_per_chan_read=rows.shape[1],
            status=0 if error is None else error.value,
        )

    def _write(self, request: ni.WriteAnalogF64Request, _peer: str) -> ni.WriteAnalogF64Response:
        volts = np.array(request.write_array, float)
        n = self._tasks.buffers.write(self._task(request), volts, request.timeout, auto_start=request.auto_start)
        return ni.WriteAnalogF64Response(samps_per_chan_written=n)

    def _write_scalar(self, request: ni.WriteAnalogScalarF64Request, _peer: str) -> ni.WriteAnalogScalarF64Response:
        volts = np.array([request.value])
        self._tasks.buffers.write(self._task(request), volts, request.timeout, auto_start=request.auto_start)
        return ni.WriteAnalogScalarF64Response()

    # Watchdog

    def _create_watchdog(
        self, request: ni.CreateWatchdogTimerTaskExRequest, peer: str
    ) -> ni.CreateWatchdogTimerTaskExResponse:
        task = self._tasks.watchdogs.create(request.session_name, peer, request.device_name, request.timeout)
        return ni.CreateWatchdogTimerTaskExResponse(task=Session(name=task.name), new_session_initialized=True)

    def _expiration_states(
        self, request: ni.CfgWatchdogAOExpirStatesRequest, _peer: str
    ) -> ni.CfgWatchdogAOExpirStatesResponse:
        self._task(request).attributes["AO_EXPIR_STATE"] = request.expir_state_array[0]
        return ni.CfgWatchdogAOExpirStatesResponse()

    def _control_watchdog(self, request: ni.ControlWatchdogTaskRequest, _peer: str) -> ni.ControlWatchdogTaskResponse:
        self._tasks.watchdogs.control(self._task(request), request.action_raw)
        return ni.ControlWatchdogTaskResponse()
