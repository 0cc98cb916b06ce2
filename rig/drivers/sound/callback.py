"""What PortAudio calls for each period of a duplex stream: machine code that copies between rings and never waits.

It runs in the audio system's thread, without Python and without its lock, so that no work of the interpreter delays it. Driver
and callback share the arrays of `Memory`. The driver hands over blocks of outputs as messages; all else is written by one side
only. Frames are counted from the start of the stream; an output is a count of the converter. Where an output has not come when
it is due, the last period is repeated by the rule that emulated devices and firmware keep (`rig.continuation`), or the last
output is held. The driver's watchdog is here too: if nothing has come for its time, the output fades to 0 V and stays there.
"""

import math
from functools import cache
from typing import Any

import numpy as np

from rig.continuation import SOURCE, begin, count_at, forget, keep, ring_for
from rig.drivers.sound.lost_time import CLOCK, IN_DOUBT, lost_frames
from vibrolock.array_at import array_at
from vibrolock.compiled import Record, kernel
from vibrolock.foreign_calls import INT, POINTER, UNSIGNED_LONG, compiled_for_c, fence, pointer

FULL_SCALE = 1 << 23
"""Counts of full scale: a converter of 24 bits."""
OVERLOAD_FROM = 1.0 - 2.0 / FULL_SCALE
"""Reading, in full scales, from which on an input counts as overloaded: the last count but one."""
MESSAGES = 1024
"""Blocks of outputs that may wait for the callback; chosen: more than the longest queue."""

HELD, CONTINUED, OVERLOAD, LOST_FRAME = 1, 2, 4, 8
"""Bits of a frame's flags: output held, output continued, an input at full scale, frame lost by the audio system."""
INTERRUPTED = 2 | 4
"""Bits of PortAudio's status that say that frames may be lost: paInputOverflow and paOutputUnderflow."""

_COUNTS = (
    "written",
    "read",
    "begin",
    "begun",
    "stop",
    "origin",
    "first",
    "put",
    "frame",
    "done",
    "calls",
    "interruptions",
    "lost",
)
_FADE = ("held", "fade_at", "fade_length", "watchdog", "tripped", "is_gapless")
_ADDRESSES = ("of_messages", "of_sent", "of_source", "of_history", "of_outputs", "of_due", "of_clock")
_RINGS = ("of_inputs", "of_flags", "of_put_out")
_SIZES = ("inputs", "outputs_channels", "output", "sent_size", "history_size", "outputs_size", "ring_size")
STATE = np.dtype([(name, "i8") for name in (*_COUNTS, *_FADE, *_ADDRESSES, *_RINGS, *_SIZES)] + [("latency_s", "f8")])
"""What driver and callback share (one record).

By the driver: ``written`` messages so far; ``begin``: how often a beginning was asked for; ``stop``: 1 where an end is;
``watchdog``: frames without outputs after which the output fades; ``fade_length``: frames of a fade. By the callback:
``read`` messages; ``begun``: beginnings made; ``origin``: frame of the first sample, -1 before; ``first`` and ``put``:
frames at which the first output is due and up to which outputs have come; ``frame``: the frame under way; ``done``: frames
that are over and may be read; ``calls``, ``interruptions`` and ``lost`` frames; ``held``: the last count; ``fade_at``:
frame at which a fade begins, -1 without one; ``tripped``: 1 after the watchdog; ``is_gapless``: by the driver, 1 where time
stamps do not tell what was lost, as over JACK;
``latency_s``: output time less input time by the stream's own time stamps. The rest are addresses and lengths of the arrays
of `Memory`."""

MESSAGE = np.dtype([("first", "i8"), ("size", "i8"), ("place", "i8"), ("period", "i8"), ("ramp", "i8")])
"""A block of outputs: due from frame ``first`` on after the origin, ``size`` of them from ``place`` in the ring of what was
sent; ``period`` and ``ramp`` as in `rig.continuation.keep`."""


class Memory:
    """The arrays that driver and callback share; they live as long as the stream.

    ``ahead``: frames of outputs that may wait; ``behind``: frames of inputs that may wait for the driver; ``longest_period``:
    longest period of a continuation, frames.
    """

    def __init__(self, inputs: int, outputs: int, output: int, *, ahead: int, behind: int, longest_period: int) -> None:
        self.messages = np.zeros(MESSAGES, MESSAGE)
        self.sent = np.zeros(ahead, np.int64)
        self.source = np.zeros(1, SOURCE)
        self.history = ring_for(longest_period)
        self.outputs = np.zeros(ahead, np.int64)
        self.due = np.full(ahead, -1, np.int64)
        self.clock = np.zeros(1, CLOCK)
        self.inputs = np.zeros((behind, inputs), np.float32)
        self.flags = np.zeros(behind, np.int64)
        self.put_out = np.zeros(behind, np.int64)
        self.state = np.zeros(1, STATE)
        self.record = self.state[0]
        begin(self.source[0], longest_period)
        for name in (*_ADDRESSES, *_RINGS):
            self.record[name] = getattr(self, name.removeprefix("of_")).ctypes.data
        sizes = (inputs, outputs, output, ahead, self.history.size, ahead, behind)
        for name, size in zip(_SIZES, sizes, strict=True):
            self.record[name] = size
        self.record["origin"] = self.record["fade_at"] = self.record["first"] = -1

    @property
    def address(self) -> int:
        """Address of the record, which the callback is handed."""
        return int(self.state.ctypes.data)


@kernel
def publish(state: Record) -> None:
    """Show the callback a message that was written."""
    fence()
    state.written += 1


@kernel
def _take_messages(
    state: Record,
    source: Record,
    messages: np.ndarray,
    sent: np.ndarray,
    history: np.ndarray,
    outputs: np.ndarray,
    due: np.ndarray,
) -> None:
    """Keep the outputs of all messages that have come, each until it is due; those that were due before are too late."""
    while state.read < state.written:
        fence()
        message = messages[state.read % messages.size]
        first = state.origin + message.first
        if state.first < 0:
            state.first = first
        for index in range(message.size):
            frame = first + index
            if frame >= state.frame:
                outputs[frame % outputs.size] = sent[(message.place + index) % sent.size]
                due[frame % outputs.size] = frame
        start = message.place % sent.size
        keep(source, history, message.first, sent[start : start + message.size], message.period, message.ramp)
        state.put = max(state.put, first + message.size)
        fence()
        state.read += 1


@kernel
def _skip(state: Record, inputs: np.ndarray, flags: np.ndarray, lost: int) -> None:
    """Pass over frames that the audio system has lost: their inputs are NaN."""
    for frame in range(state.frame, state.frame + lost):
        inputs[frame % flags.size, :] = math.nan
        flags[frame % flags.size] = LOST_FRAME
    state.frame += lost
    state.lost += lost


@kernel
def _begin_fade(state: Record, frames: int) -> None:
    """Begin to fade where the driver asks for it, or where it has been silent for the time of its watchdog."""
    if state.fade_at >= 0:
        return
    silent = state.first >= 0 and state.watchdog > 0 and state.frame + frames > state.put + state.watchdog
    if silent:
        state.tripped = 1
    if silent or state.stop:
        state.fade_at = state.frame


@kernel
def _faded(state: Record, count: int) -> int:
    """Return a count multiplied by the raised cosine of the fade under way."""
    share = (state.frame - state.fade_at) / state.fade_length
    return round(count * (0.5 + 0.5 * math.cos(math.pi * share))) if share < 1.0 else 0


@kernel
def _next_count(
    state: Record, source: Record, history: np.ndarray, outputs: np.ndarray, due: np.ndarray
) -> tuple[int, int]:
    """Return the count that is put out at the frame under way, and its flags."""
    frame = state.frame
    if state.first < 0 or frame < state.first:
        return 0, 0
    count, raised = state.held, HELD
    at = frame % outputs.size
    if due[at] == frame:
        count, raised = outputs[at], 0
    elif source.period > 0:
        count, raised = count_at(source, history, frame - state.origin), CONTINUED
    state.held = count
    if state.fade_at >= 0:
        return _faded(state, count), raised
    return count, raised


@kernel
def _period(
    state: Record,
    source: Record,
    messages: np.ndarray,
    sent: np.ndarray,
    history: np.ndarray,
    outputs: np.ndarray,
    due: np.ndarray,
    inputs: np.ndarray,
    flags: np.ndarray,
    put_out: np.ndarray,
    read: np.ndarray,
    written: np.ndarray,
    clock: Record,
    times: np.ndarray,
    status: int,
) -> None:
    """Exchange one period: ``read`` float32[frames, inputs] comes in, ``written`` float32[frames, outputs] goes out.

    ``times``: PortAudio's time stamps of the first frame, s: into the input converter, now, out of the output converter.
    """
    frames = read.shape[0]
    state.calls += 1
    interrupted = status & INTERRUPTED != 0 and state.calls > 1
    state.interruptions += interrupted
    lost = IN_DOUBT if interrupted else 0
    if not state.is_gapless:
        lost = lost_frames(clock, times[0], state.frame, frames, interrupted)
    if lost > 0:
        _skip(state, inputs, flags, min(lost, flags.size))
    state.latency_s = times[2] - times[0]
    if state.begun < state.begin:
        state.origin = state.put = state.frame
        state.first, state.held = -1, 0
        forget(source, 0)
        state.begun = state.begin
    if state.origin >= 0:
        _take_messages(state, source, messages, sent, history, outputs, due)
    _begin_fade(state, frames)
    for row in range(frames):
        count, raised = _next_count(state, source, history, outputs, due)
        written[row, :] = 0.0
        written[row, state.output] = count / FULL_SCALE
        at = state.frame % flags.size
        for column in range(inputs.shape[1]):
            reading = read[row, column]
            inputs[at, column] = reading
            if abs(reading) >= OVERLOAD_FROM:
                raised |= OVERLOAD
        if lost == IN_DOUBT:
            inputs[at, :] = math.nan
            raised = LOST_FRAME
        flags[at] = raised
        put_out[at] = count
        state.frame += 1
    fence()
    state.done = state.frame


def _callback(
    read: Any, written: Any, frames: int, times: Any, status: int, memory: Any
) -> int:  # pragma: no cover (machine code)
    state = array_at(memory, 1, STATE)[0]
    _period(
        state,
        array_at(pointer(state.of_source), 1, SOURCE)[0],
        array_at(pointer(state.of_messages), MESSAGES, MESSAGE),
        array_at(pointer(state.of_sent), state.sent_size, np.int64),
        array_at(pointer(state.of_history), state.history_size, np.int64),
        array_at(pointer(state.of_outputs), state.outputs_size, np.int64),
        array_at(pointer(state.of_due), state.outputs_size, np.int64),
        array_at(pointer(state.of_inputs), (state.ring_size, state.inputs), np.float32),
        array_at(pointer(state.of_flags), state.ring_size, np.int64),
        array_at(pointer(state.of_put_out), state.ring_size, np.int64),
        array_at(read, (frames, state.inputs), np.float32),
        array_at(written, (frames, state.outputs_channels), np.float32),
        array_at(pointer(state.of_clock), 1, CLOCK)[0],
        array_at(times, 3, np.float64),
        status,
    )
    return 0


@cache
def compiled_callback() -> Any:
    """Return the compiled callback, a ``PaStreamCallback`` of PortAudio; its ``address`` is what PortAudio is given."""
    return compiled_for_c(_callback, INT, POINTER, POINTER, UNSIGNED_LONG, POINTER, UNSIGNED_LONG, POINTER)
