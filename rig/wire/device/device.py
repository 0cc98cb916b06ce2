"""`Device`: the device's half of the protocol, over any link, in front of any plant, without a clock: time is handed in."""

import math
from collections import Counter

import numpy as np

from rig.wire.device.description import SETTINGS, Words
from rig.wire.device.faults import Faults
from rig.wire.device.outputs import OutputQueue
from rig.wire.device.plant import Plant
from rig.wire.device.sending import FaultySender
from rig.wire.link import Link
from rig.wire.messages import (
    ARM_KEY,
    NAME_WORDS,
    Answer,
    Command,
    DeviceFlag,
    DeviceState,
    EmergencyStop,
    Heartbeat,
    Message,
    Output,
    Parameter,
    Request,
    Samples,
    Status,
    Stream,
    text_words,
)

__all__ = ["Device"]

BEAT_S = 0.1
ROUNDING_SAMPLES = 1e-6  # an instant that falls on a sample is that sample's


class Device:
    """A device's state machine.

    Whoever runs it hands every message to `handle`, calls `advance` at the latest at ``wake_s``, and gives both the present
    time in seconds of any clock that only goes forward. With ``lockstep`` a block is measured once the outputs due for it
    have come, however long that takes: as fast as the host, without deadlines. Only the watchdog then minds the clock.
    """

    def __init__(
        self, plant: Plant, words: Words, link: Link, *, lockstep: bool = False, faults: Faults | None = None
    ) -> None:
        self.plant, self.words, self.link, self.lockstep = plant, dict(words), link, lockstep
        self.faults = faults or Faults()
        self.state = DeviceState.IDLE
        self.sampling = False
        self.measured = 0
        """Samples measured since START."""
        self.counts: Counter[str] = Counter()
        """What happened since the device was switched on."""
        self.output_v = np.zeros(0)
        """Output of the block that was measured last, V."""
        self._sender = FaultySender(link, self.faults)
        self._latch = 0
        self._rate_hz = self._watchdog_s = 1.0
        self._block = self._queue = 1
        self._origin_s = 0.0
        self._beat_s = -math.inf
        self._fed_s = math.inf
        self._cut = math.inf  # sample at which the output begins to go to 0 V
        self._ramp_samples = 0.0
        self._through = math.inf  # sample from which on outputs are let through
        self._last: tuple[Request, Answer] | None = None
        self._reset_s = math.inf
        self._deaf_s = math.inf
        self._pressed = False
        self._lie()
        self._at_rest = False
        self._rest()

    def _rest(self) -> None:
        """Bring the plant to rest while there is time: it may take long, and START has none."""
        if not self._at_rest:
            self.plant.reset()
        self._at_rest = True

    def _lie(self) -> None:
        if self.faults.version is not None:
            for parameter in (Parameter.LOWEST_VERSION, Parameter.HIGHEST_VERSION):
                self.words[parameter, 0] = self.faults.version
        for channel, name in enumerate(self.faults.channel_names or ()):
            for number, word in enumerate(text_words(name)):
                self.words[Parameter.CHANNEL_NAME, NAME_WORDS * channel + number] = word

    def setting(self, parameter: Parameter) -> int:
        """The value of a parameter in force."""
        return self.words[parameter, 0]

    @property
    def flags(self) -> int:
        """What has latched, as `DeviceFlag`."""
        return self._latch

    @property
    def wake_s(self) -> float:
        """When `advance` wants to be called."""
        due_s = self.due_s if self.sampling and not self.lockstep else math.inf
        return min(due_s, self._beat_s + BEAT_S, self._fed_s + self._watchdog_s, self._reset_s, self._sender.wake_s)

    @property
    def due_s(self) -> float:
        """When the block that is under way will be measured."""
        return self._origin_s + (self.measured + self._block) / self._rate_hz

    # -- messages in --------------------------------------------------------------------------------------------------

    def handle(self, message: Message, now_s: float) -> None:
        """Do what a message asks for."""
        if now_s >= self._deaf_s:
            return
        if self.sampling and not self.lockstep:
            self._mind_a_stall(now_s)
        self._watch(now_s)
        if isinstance(message, Output):
            self._take_output(message, now_s)
        elif isinstance(message, Request):
            self._answer(message, now_s)
        elif isinstance(message, EmergencyStop):
            self.emergency_stop(now_s)

    def _take_output(self, output: Output, now_s: float) -> None:
        if not self.sampling:
            self.counts["outputs_while_idle"] += 1
            return
        if not self._outputs.put(output.first, output.counts, self._present(now_s)):
            self.counts["bad_outputs"] += 1
            return
        if self.state is DeviceState.ARMED:
            self._fed_s = now_s
            self._has_output = True

    def _present(self, now_s: float) -> int:
        """Index of the first sample whose output is not on the converter yet."""
        if self.lockstep:
            return self.measured
        return max(self.measured, math.ceil((now_s - self._origin_s) * self._rate_hz - ROUNDING_SAMPLES))

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
        match request.command:
            case Command.GET:
                return self._get(request.parameter, request.item)
            case Command.SET:
                return self._set(request.parameter, request.item, request.value)
            case Command.START:
                return self._start(now_s)
            case Command.STOP:
                self._stop(now_s)
                return Status.DONE, int(self.state)
            case Command.ARM:
                return self._arm(request.value, now_s)
            case Command.DISARM:
                if self.state is DeviceState.ARMED:
                    self._bring_down(now_s, DeviceState.RUNNING)
                return Status.DONE, int(self.state)
            case Command.CLEAR:
                return self._clear(now_s)
        return Status.UNKNOWN, 0

    def _get(self, parameter: int, item: int) -> tuple[Status, int]:
        if parameter == Parameter.STATE:
            return Status.DONE, int(self.state)
        if parameter == Parameter.PING:
            return Status.DONE, 0
        word = self.words.get((parameter, item))
        return (Status.UNKNOWN, 0) if word is None else (Status.DONE, word)

    def _set(self, parameter: int, item: int, value: int) -> tuple[Status, int]:
        if self.sampling:
            return Status.WRONG_STATE, int(self.state)
        bounds = {int(one): both for one, both in SETTINGS.items()}.get(parameter)
        if bounds is None or item:
            return Status.UNKNOWN, 0
        lowest = self.setting(bounds[0]) if bounds[0] else int(parameter != Parameter.RAMP_US)
        nearest = min(max(value, lowest), self.setting(bounds[1]))
        if nearest != value:
            return Status.NOT_ALLOWED, nearest
        self.words[parameter, 0] = value
        return Status.DONE, value

    # -- life ---------------------------------------------------------------------------------------------------------

    def _start(self, now_s: float) -> tuple[Status, int]:
        if self.state is DeviceState.LATCHED:
            return Status.LATCHED, self._latch
        if self.state is not DeviceState.IDLE:
            return Status.WRONG_STATE, int(self.state)
        block, queue = self.setting(Parameter.BLOCK), self.setting(Parameter.QUEUE)
        self._rate_hz = 1e-3 * self.setting(Parameter.RATE_MHZ)
        self._block, self._queue = block, queue
        self._watchdog_s = 1e-6 * self.setting(Parameter.WATCHDOG_US)
        channels = self.faults.channels_sent or len(self.plant.names)
        self.link.configure(Stream(channels, block, self._rate_hz, self.plant.bits, queue))
        self._outputs = OutputQueue(block, queue)
        self._has_output = False
        self.measured = 0
        self._blocks = 0
        self._origin_s = now_s
        self._cut, self._through = math.inf, math.inf
        self.sampling = True
        faults = self.faults
        self._reset_s = now_s + faults.reset_after_s if faults.reset_after_s is not None else math.inf
        self._deaf_s = now_s + faults.deaf_after_s if faults.deaf_after_s is not None else math.inf
        self._sender.start(now_s)
        self._become(DeviceState.RUNNING, now_s)
        return Status.DONE, 0

    def _arm(self, key: int, now_s: float) -> tuple[Status, int]:
        if key != ARM_KEY:
            return Status.NOT_ALLOWED, 0
        if self.state is DeviceState.LATCHED:
            return Status.LATCHED, self._latch
        if self.state is not DeviceState.RUNNING:
            return Status.WRONG_STATE, int(self.state)
        self._through, self._cut = float(self._present(now_s)), math.inf
        self._fed_s = now_s
        self._become(DeviceState.ARMED, now_s)
        return Status.DONE, 0

    def _stop(self, now_s: float) -> None:
        self.sampling = False
        self._fed_s = self._reset_s = math.inf
        self.output_v = np.zeros(1)
        self._rest()
        if self.state is not DeviceState.LATCHED:
            self._become(DeviceState.IDLE, now_s)

    def _clear(self, now_s: float) -> tuple[Status, int]:
        if self.sampling:
            return Status.WRONG_STATE, int(self.state)
        self._latch = 0
        self._become(DeviceState.IDLE, now_s)
        return Status.DONE, 0

    def _become(self, state: DeviceState, now_s: float) -> None:
        changed = state is not self.state
        self.state = state
        if changed:
            self._beat(now_s)

    def _bring_down(self, at_s: float, state: DeviceState, ramp_s: float = 0.0) -> None:
        """Let the output go to 0 V from an instant on, and block what comes."""
        if self.lockstep:
            self._cut = float(self.measured)
        else:
            self._cut = max(0.0, (at_s - self._origin_s) * self._rate_hz - ROUNDING_SAMPLES)
        self._ramp_samples = ramp_s * self._rate_hz
        self._fed_s = math.inf
        self._become(state, at_s)

    def press_emergency_stop(self) -> None:
        """The device's own emergency stop; it acts with the next `advance`, and may be pressed from a signal handler."""
        self._pressed = True

    def switch_off(self, now_s: float) -> None:
        """Switch off: 0 V."""
        self._stop(now_s)

    def emergency_stop(self, now_s: float) -> None:
        """0 V at once, and latch: by a message, or by the device's own input."""
        self.counts["emergency_stops"] += 1
        self._latch |= DeviceFlag.EMERGENCY_STOP
        self._bring_down(now_s, DeviceState.LATCHED)

    def reset(self, now_s: float) -> None:
        """Start anew, as after a loss of supply."""
        self._stop(now_s)
        self._latch = 0
        self.words[Parameter.BOOT, 0] = (self.words[Parameter.BOOT, 0] + 1) & 0xFFFFFFFF
        self._last = None
        self.measured = 0
        self.state = DeviceState.IDLE
        self._beat(now_s)

    # -- time ---------------------------------------------------------------------------------------------------------

    def advance(self, now_s: float) -> None:
        """Measure and send what is due, let the watchdog bite, send heartbeats."""
        if self._pressed:
            self._pressed = False
            self.emergency_stop(now_s)
        if now_s >= self._reset_s:
            self.reset(now_s)
        if self.sampling and not self.lockstep:
            self._mind_a_stall(now_s)
        self._watch(now_s)
        if self.sampling and self.lockstep:
            while self._may_measure():
                self._measure(now_s)
        elif self.sampling:
            while self.due_s <= now_s:
                self._measure(now_s)
        if now_s >= self._beat_s + BEAT_S:
            self._beat(now_s)
        self._sender.flush(now_s)

    def _mind_a_stall(self, now_s: float) -> None:
        """Where nobody let us run for longer than the queue, our clock stood still: the host could do nothing meanwhile."""
        late_s = now_s - self.due_s
        if late_s > self._queue * self._block / self._rate_hz:
            self._origin_s += late_s
            self._fed_s += late_s
            self.counts["stalls"] += 1
            self.counts["stalled_us"] += round(1e6 * late_s)

    def _may_measure(self) -> bool:
        """In lockstep: whether the outputs of the next block are there, or not needed."""
        block = self._block
        if self.measured < self._queue * block or self._outputs.is_there(self.measured):
            return True
        return self._cut < math.inf and self.measured < self._cut + self._ramp_samples + block  # goes down by itself

    def _watch(self, now_s: float) -> None:
        bites_s = self._fed_s + self._watchdog_s
        if now_s >= bites_s and self.state is DeviceState.ARMED:
            self.counts["watchdog_trips"] += 1
            self._latch |= DeviceFlag.WATCHDOG
            self._bring_down(bites_s, DeviceState.LATCHED, 1e-6 * self.setting(Parameter.RAMP_US))

    def _measure(self, now_s: float) -> None:
        first, block = self.measured, self._block
        counts, held = self._outputs.take(first)
        volts = counts * self.plant.output_v_per_count
        if first < self._through:
            volts[: int(min(block, self._through - first))] = 0.0
        if first + block > self._cut:
            volts *= self._share_of_output(np.arange(first, first + block))
        flags = self._latch
        asked_for = self._has_output and first >= self._queue * block
        if held and asked_for and self.state is DeviceState.ARMED:
            flags |= DeviceFlag.OUTPUT_HELD
            self.counts["held_blocks"] += 1
        self._at_rest = False
        readings, seen = self.plant.step(volts)
        if self.faults.channels_sent is not None:
            readings = readings[:, : self.faults.channels_sent]
        self.output_v = volts
        self.measured = first + block
        self._blocks += 1
        clock_us = round(1e6 * now_s) & 0xFFFFFFFFFFFFFFFF
        sequence = (self._blocks - 1) & 0xFFFF
        samples = Samples(first, readings, flags | seen, self._sender.dropped_samples, clock_us, sequence)
        self._sender.send_samples(samples, self._blocks, now_s)

    def _share_of_output(self, index: np.ndarray) -> np.ndarray:
        """Part of the output that is let through at a sample: 1 before the cut, then down a ramp."""
        beyond = index - self._cut
        if self._ramp_samples == 0.0:
            return np.where(beyond >= 0.0, 0.0, 1.0)
        return np.clip(1.0 - beyond / self._ramp_samples, 0.0, 1.0)

    def _beat(self, now_s: float) -> None:
        self._beat_s = now_s
        boot = self.setting(Parameter.BOOT) & 0xFF
        beat = Heartbeat(int(self.state), self._latch, boot, self.measured & 0xFFFFFFFF, self._sender.dropped_samples)
        self._sender.send(beat, now_s)
