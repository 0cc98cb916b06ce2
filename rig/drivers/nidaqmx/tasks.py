"""The two tasks of an NI device, inputs and output on one sample clock, through NI's public Python API.

The inputs' task is committed first, for it tells the terminals of its clock and of its start trigger. The output's task takes
both, so that sample k of the output and sample k of the inputs coincide. The output is started first and waits for them.
"""

from contextlib import suppress
from typing import Any, NamedTuple, Protocol

import numpy as np

from rig.drivers.nidaqmx.library import Session, as_ni_error, ni_errors, value_or
from rig.drivers.nidaqmx.options import NiDaqmxOptions
from rig.errors import DaqRefused
from vibrolock.arrays import Float

TERMINALS = {
    "": "DEFAULT",
    "differential": "DIFF",
    "RSE": "RSE",
    "NRSE": "NRSE",
    "pseudodifferential": "PSEUDO_DIFF",
}
"""NI's names of the terminal configurations."""
INPUT_BUFFER_S = 4.0
"""Time for which the device's buffer takes inputs that are not fetched, s; chosen: far above the longest lateness."""
SPARE_BLOCKS = 3
"""Room in the output buffer beyond the blocks that are ahead, so that no write waits."""
SAME_RATE = 1e-7
"""Relative difference up to which two rates are the same; chosen: above rounding, below the steps of any device."""


class Setting(NamedTuple):
    """What the tasks are made of; by input, in the order of the bench's channels."""

    options: NiDaqmxOptions
    rate_hz: float
    ranges_v: tuple[float, ...]
    """Largest voltage of each input."""
    output_range_v: float
    block: int
    """Samples of a block."""
    ahead: int
    """Blocks that lie ahead in the output buffer: the driver's own, and those of the loop's queue."""


class Facts(NamedTuple):
    """What the device says once the tasks are committed."""

    rate_hz: float
    """Rate to which it has coerced the one asked for."""
    input_delays_s: tuple[float, ...]
    """Delay of each input's filter, as far as it shifts samples."""
    output_delay_s: float
    """Delay of the output's filter."""
    ranges_v: tuple[float, ...]
    """Range that each input has taken."""
    clock: str
    """Terminal of the sample clock."""
    start: str
    """Terminal of the start trigger."""


class Stream(Protocol):
    """What the buffer thread needs of a device (`rig.drivers.nidaqmx.buffer`)."""

    def start(self) -> None:
        """Begin to sample."""

    def read(self, inputs: Float) -> None:
        """Wait for the next block of inputs [n_channels, n], V."""

    def write(self, volts: Float) -> None:
        """Append a block [n], V, to the output buffer."""

    def generated(self) -> int:
        """Return the number of samples that have been put out."""


def per_input(given: object, inputs: int, field: str) -> tuple[Any, ...]:
    """Return an option by input. Raises `DaqRefused` for another number of them."""
    values = given if isinstance(given, tuple) else (given,) * inputs
    if len(values) != inputs:
        raise DaqRefused(
            field=f"driver.options.{field}", value=list(values), allowed=f"one for all inputs, or {inputs} of them"
        )
    return values


class Tasks:
    """Both tasks, committed, with zeros ahead in the output buffer; a `Stream`.

    Errors: those of `rig.drivers.nidaqmx.library`; nothing is left behind then.
    """

    def __init__(self, session: Session, setting: Setting, timeout_s: float) -> None:
        self._session, self._setting, self._timeout_s = session, setting, timeout_s
        self._in: Any = None
        self._out: Any = None
        try:
            with ni_errors(setting.options.inputs[0].partition("/")[0]):
                self._make_inputs()
            with ni_errors(setting.options.output):
                self._make_output()
                self.facts = self._read_facts()
        except BaseException:
            self.close()
            raise

    def _make_inputs(self) -> None:
        from nidaqmx import constants, stream_readers

        options, setting = self._setting.options, self._setting
        number = len(options.inputs)
        couplings = per_input(options.coupling, number, "coupling")
        terminals = per_input(options.terminal, number, "terminal")
        currents_ma = per_input(options.excitation_ma, number, "excitation_ma")
        self._in = task = self._session.ni.Task(grpc_options=self._session.options)
        self._inputs = []
        for name, range_v, coupling, terminal, current_ma in zip(
            options.inputs, setting.ranges_v, couplings, terminals, currents_ma, strict=True
        ):
            with ni_errors(name):
                channel = task.ai_channels.add_ai_voltage_chan(
                    name,
                    terminal_config=constants.TerminalConfiguration[TERMINALS[terminal]],
                    min_val=-range_v,
                    max_val=range_v,
                )
                if coupling:
                    channel.ai_coupling = constants.Coupling[coupling]
                if current_ma:
                    channel.ai_excit_src = constants.ExcitationSource.INTERNAL
                    channel.ai_excit_voltage_or_current = constants.ExcitationVoltageOrCurrent.USE_CURRENT
                    channel.ai_excit_val = 1e-3 * current_ma
            self._inputs.append(channel)
        size = max(round(INPUT_BUFFER_S * setting.rate_hz), 16 * setting.block)
        self._clock(task, options.clock, size)
        task.in_stream.input_buf_size = size
        if options.trigger:
            task.triggers.start_trigger.cfg_dig_edge_start_trig(options.trigger)
        if options.export_clock:
            task.export_signals.samp_clk_output_term = options.export_clock
        task.control(constants.TaskMode.TASK_COMMIT)
        self._reader = stream_readers.AnalogMultiChannelReader(task.in_stream)
        self._reader.verify_array_shape = False  # would ask the device for the number of channels in every call

    def _make_output(self) -> None:
        from nidaqmx import constants, stream_writers

        options, setting = self._setting.options, self._setting
        inputs = self._in
        self._out = task = self._session.ni.Task(grpc_options=self._session.options)
        range_v = setting.output_range_v
        self._output = task.ao_channels.add_ao_voltage_chan(options.output, min_val=-range_v, max_val=range_v)
        size = (setting.ahead + SPARE_BLOCKS) * setting.block
        if options.shares == "timebase":
            self._clock(task, "", size)
            task.timing.samp_clk_timebase_src = inputs.timing.samp_clk_timebase_term
        else:
            self._clock(task, options.output_clock or options.clock or inputs.timing.samp_clk_term, size)
        task.out_stream.regen_mode = constants.RegenerationMode.DONT_ALLOW_REGENERATION
        task.out_stream.output_buf_size = size
        if options.output_trigger != "none":
            source = options.output_trigger or inputs.triggers.start_trigger.term
            task.triggers.start_trigger.cfg_dig_edge_start_trig(source)
        self._writer = stream_writers.AnalogSingleChannelWriter(task.out_stream, auto_start=False)
        self._writer.verify_array_shape = False
        self._writer.write_many_sample(np.zeros(setting.ahead * setting.block), self._timeout_s)
        task.control(constants.TaskMode.TASK_COMMIT)

    def _clock(self, task: Any, source: str, size: int) -> None:
        from nidaqmx.constants import AcquisitionType

        task.timing.cfg_samp_clk_timing(
            self._setting.rate_hz, source=source, sample_mode=AcquisitionType.CONTINUOUS, samps_per_chan=size
        )

    def _read_facts(self) -> Facts:
        timing = self._in.timing
        return Facts(
            rate_hz=float(timing.samp_clk_rate),
            input_delays_s=tuple(_input_delay_s(channel) for channel in self._inputs),
            output_delay_s=_output_delay_s(self._output),
            ranges_v=tuple(float(channel.ai_rng_high) for channel in self._inputs),
            clock=str(timing.samp_clk_term),
            start=str(self._in.triggers.start_trigger.term),
        )

    def start(self) -> None:
        """Start the output, which waits for the inputs' start, and then the inputs."""
        with ni_errors(self._setting.options.output):
            self._out.start()
        with ni_errors(self._setting.options.inputs[0]):
            self._in.start()

    def read(self, inputs: Float) -> None:
        """Wait for the next block of inputs [n_channels, n], V."""
        try:
            self._reader.read_many_sample(inputs, inputs.shape[1], self._timeout_s)
        except Exception as error:
            raise as_ni_error(error, self._setting.options.inputs[0]) from error

    def write(self, volts: Float) -> None:
        """Append a block [n], V, to the output buffer."""
        try:
            self._writer.write_many_sample(volts, self._timeout_s)
        except Exception as error:
            raise as_ni_error(error, self._setting.options.output) from error

    def generated(self) -> int:
        """Return the number of samples that have been put out."""
        with ni_errors(self._setting.options.output):
            return int(self._out.out_stream.total_samp_per_chan_generated)

    def close(self) -> None:
        """Stop both tasks and release what they have reserved; also where the device is gone."""
        for task in (self._out, self._in):
            if task is not None:
                with suppress(Exception):
                    task.stop()
                with suppress(Exception):
                    task.close()
        self._in = self._out = None


def put_zero(session: Session, output: str, range_v: float) -> None:
    """Put 0 V on an output at once, without a clock."""
    from nidaqmx.stream_writers import AnalogSingleChannelWriter

    with ni_errors(output), session.ni.Task(grpc_options=session.options) as task:
        task.ao_channels.add_ao_voltage_chan(output, min_val=-range_v, max_val=range_v)
        AnalogSingleChannelWriter(task.out_stream, auto_start=True).write_one_sample(0.0)


def _input_delay_s(channel: Any) -> float:
    """Return the delay of an input's filter; 0 where it has none, or where NI's driver takes it out."""
    from nidaqmx.constants import DigitalWidthUnits

    def delay() -> float:
        channel.ai_filter_delay_units = DigitalWidthUnits.SECONDS
        return float(channel.ai_filter_delay)

    removed = value_or(lambda: channel.ai_remove_filter_delay, False)
    return 0.0 if removed else float(value_or(delay, 0.0))


def _output_delay_s(channel: Any) -> float:
    """Return the delay of an output's filter; 0 where it has none."""
    from nidaqmx.constants import DigitalWidthUnits

    def delay() -> float:
        channel.ao_filter_delay_units = DigitalWidthUnits.SECONDS
        return float(channel.ao_filter_delay)

    return float(value_or(delay, 0.0))
