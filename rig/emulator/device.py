"""`Device`: the device's half of the protocol over any link, in front of any plant. It has no clock: time is an argument."""

import math
from collections import Counter

import numpy as np

from rig.emulator.faults import Faults, FaultySender
from rig.emulator.parameters import Parameters, Words, carried
from rig.emulator.plant import VirtualPlant
from rig.emulator.sampling import Sampling
from rig.emulator.states import StateMachine
from rig.wire.link import Link
from rig.wire.messages import (
    HEARTBEATS_HZ,
    LOWEST_VERSION,
    MISSED,
    Answer,
    Command,
    DeviceFlag,
    DeviceState,
    EmergencyStop,
    Heartbeat,
    Message,
    Output,
    Parameter,
    Readback,
    Request,
    Samples,
    Status,
    Stream,
)

BEAT_S = 1.0 / HEARTBEATS_HZ  # between two heartbeats
COUNTED = {int(DeviceFlag.OUTPUT_HELD): "held_blocks", int(DeviceFlag.OUTPUT_CONTINUED): "continued_blocks"}


class Device:
    """A device: it takes messages, and sends samples, answers and heartbeats when they are due.

    The caller passes every message to `handle` and calls `advance` no later than ``wake_s``, both with the present time in
    seconds of a monotonic clock. With ``lockstep`` a block is measured as soon as the outputs due for it have arrived, so the
    device runs as fast as the host; only the watchdog then depends on the clock.
    """

    def __init__(
        self, plant: VirtualPlant, words: Words, link: Link, *, lockstep: bool = False, faults: Faults | None = None
    ) -> None:
        self.plant, self.link = plant, link
        self.faults = faults or Faults()
        self.counts: Counter[str] = Counter()
        """Counts of events since the device was switched on."""
        self._parameters = Parameters(carried(words, plant, link), self.faults)
        self._sampling = Sampling(plant, lockstep=lockstep)
        self._speak()
        self._states = StateMachine(self._sampling, self._parameters, self.counts, self._beat)
        self._sender = FaultySender(link, self.faults)
        self._beat_s = -math.inf
        self._last: tuple[Request, Answer] | None = None
        self._reset_s = self._deaf_s = math.inf
        self._pressed = False
        self._sampling.rest()

    @property
    def words(self) -> Words:
        """The parameters as the device reports them."""
        return self._parameters.words

    @property
    def state(self) -> DeviceState:
        """Its present state."""
        return self._states.state

    @property
    def measured(self) -> int:
        """Samples measured since START."""
        return self._sampling.measured

    @property
    def output_v(self) -> np.ndarray:
        """Output of the block that was measured last, V."""
        return self._sampling.output_v

    @property
    def due_s(self) -> float:
        """When the block under way will be complete; never while it does not sample, or in lockstep."""
        return self._sampling.due_s

    @property
    def wake_s(self) -> float:
        """Time by which `advance` must be called."""
        states, sender = self._states, self._sender
        return min(self._sampling.due_s, self._beat_s + BEAT_S, states.bites_s, self._reset_s, sender.wake_s)

    def handle(self, message: Message, now_s: float) -> None:
        """Carry out a message."""
        if now_s >= self._deaf_s:
            return
        self._catch_up(now_s)
        if isinstance(message, Output):
            self._take_output(message, now_s)
        elif isinstance(message, Request):
            self._answer(message, now_s)
        elif isinstance(message, EmergencyStop):
            self._states.emergency_stop(now_s)

    def _take_output(self, output: Output, now_s: float) -> None:
        if not self._sampling.on:
            self.counts["outputs_while_idle"] += 1
            return
        in_time = self._sampling.take(output, now_s)
        if in_time is None:
            self.counts["bad_outputs"] += 1
        else:
            self._states.feed(now_s, in_time=in_time > 0)

    def _answer(self, request: Request, now_s: float) -> None:
        if self._last is not None and request == self._last[0]:
            answer = self._last[1]
            self.counts["repeated_requests"] += 1
        else:
            status, value = self._carry_out(request, now_s)
            answer = Answer(request.number, status, request.parameter, request.item, value)
            self._last = request, answer
        self._sender.send(answer, now_s)

    def _carry_out(self, request: Request, now_s: float) -> tuple[Status, int]:
        states, parameters = self._states, self._parameters
        match request.command:
            case Command.GET if request.parameter == Parameter.STATE and request.item == 0:
                return Status.DONE, int(states.state)
            case Command.GET:
                return parameters.get(request.parameter, request.item)
            case Command.SET if self._sampling.on:
                return Status.WRONG_STATE, int(states.state)
            case Command.SET:
                answer = parameters.set(request.parameter, request.item, request.value)
                self._speak()
                return answer
            case Command.START:
                return self._start(now_s)
            case Command.STOP:
                self._reset_s = math.inf
                return states.stop(now_s)
            case Command.ARM:
                return states.arm(request.value, now_s)
            case Command.DISARM:
                return states.disarm(now_s)
            case Command.CLEAR:
                return states.clear(now_s)
        return Status.UNKNOWN, 0

    def _speak(self) -> None:
        """Speak the version that was set; the definition of the wire's messages is that of the version."""
        version, told = self._parameters.value(Parameter.VERSION), self.words[Parameter.LAYOUT_CRC, 0]
        if version != self.link.version:
            is_true = told == self.link.layout_crc
            self.link.speak(version)
            self.words[Parameter.LAYOUT_CRC, 0] = self.link.layout_crc if is_true else told

    def _start(self, now_s: float) -> tuple[Status, int]:
        if self.state is DeviceState.IDLE:
            value, faults = self._parameters.value, self.faults
            channels = faults.channels_sent or len(self.plant.names)
            rate_hz = 1e-3 * value(Parameter.RATE_MHZ)
            bits, queue = self.plant.bits, value(Parameter.QUEUE)
            self.link.configure(Stream(channels, value(Parameter.BLOCK), rate_hz, bits, queue))
            self._reset_s = now_s + faults.reset_after_s if faults.reset_after_s is not None else math.inf
            self._deaf_s = now_s + faults.deaf_after_s if faults.deaf_after_s is not None else math.inf
            self._sender.start(now_s)
        return self._states.start(now_s)

    def press_emergency_stop(self) -> None:
        """Press the device's own emergency stop, also from a signal handler; it acts at the next `advance`."""
        self._pressed = True

    def set_emergency_stop(self, pressed: bool, now_s: float) -> None:
        """Press or release an emergency stop that stays as it is."""
        self._catch_up(now_s)
        self._states.is_pressed = pressed
        self._mind_the_switch(now_s)

    def _mind_the_switch(self, now_s: float) -> None:
        states = self._states
        if self._pressed or (states.is_pressed and not states.latch & DeviceFlag.EMERGENCY_STOP):
            self._pressed = False
            states.emergency_stop(now_s)

    def switch_off(self, now_s: float) -> None:
        """Switch off: output to 0 V."""
        self._states.stop(now_s)

    def reset(self, now_s: float) -> None:
        """Restart the device, as after a loss of supply."""
        self._states.begin_anew()
        self._parameters.begin_anew()
        self.words[Parameter.BOOT, 0] = (self.words[Parameter.BOOT, 0] + 1) & 0xFFFFFFFF
        self._speak()
        self._last = None
        self._reset_s = math.inf
        self._beat(now_s)

    def advance(self, now_s: float) -> None:
        """Measure and send blocks that are due, check the watchdog, send heartbeats."""
        self._mind_the_switch(now_s)
        if now_s >= self._reset_s:
            self.reset(now_s)
        self._catch_up(now_s)
        while self._sampling.is_due(now_s):
            self._measure(now_s)
        if now_s >= self._beat_s + BEAT_S:
            self._beat(now_s)
        self._sender.flush(now_s)

    def _catch_up(self, now_s: float) -> None:
        """Measure the blocks that were complete before a time, and before the watchdog bit; check the watchdog."""
        late_s = self._sampling.stand_still(now_s) if now_s > self._sampling.due_s else 0.0
        if late_s:
            self._states.stand_still(late_s)
            self.counts["stalls"] += 1
            self.counts["stalled_us"] += round(1e6 * late_s)
        while self._sampling.due_s < min(now_s, self._states.bites_s):
            self._measure(now_s)
        self._states.watch(now_s)

    def _measure(self, now_s: float) -> None:
        latch = self._states.latch
        first, readings, flags, put_out = self._sampling.measure()
        if flags & MISSED:
            for flag, name in COUNTED.items():
                self.counts[name] += bool(flags & flag)
        if self.faults.channels_sent is not None:
            readings = readings[:, : self.faults.channels_sent]
        number = self._sampling.blocks
        clock_us = round(1e6 * now_s) & 0xFFFFFFFFFFFFFFFF
        sequence = (number - 1) & 0xFFFF
        samples = Samples(first, readings, flags | latch, self._sender.dropped_samples, clock_us, sequence)
        reads_back = self.link.version > LOWEST_VERSION and flags & MISSED
        block = (Readback(first, put_out, sequence), samples) if reads_back else (samples,)
        self._sender.send_block(block, number, now_s)

    def _beat(self, now_s: float) -> None:
        self._beat_s = now_s
        boot = self._parameters.value(Parameter.BOOT) & 0xFF
        measured, dropped = self.measured & 0xFFFFFFFF, self._sender.dropped_samples
        self._sender.send(Heartbeat(int(self.state), self._states.latch, boot, measured, dropped), now_s)
