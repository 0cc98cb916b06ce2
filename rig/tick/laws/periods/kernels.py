"""Compiled means of every period, which lock state and settle rule go by."""

import math

from controller.layout import (
    LOCKED,
    RESPONSE,
    VOLTAGE,
)
from controller.lock.kernels import next_lock_state
from rig.tick.laws.amplitude.kernels import controlled_size
from rig.tick.layout import TickArrays
from rig.tick.safety.following.kernels import follow_level, see_frequency, silent_side
from rig.tick.safety.kernels import LEVEL_NOT_FOLLOWED, SENSOR_STUCK, shut_down
from rig.tick.safety.layout import ARMED
from rig.tick.sequencer.kernels import judge_period
from rig.tick.sequencer.layout import LOOP_DRIVE, TONE, WAVEFORM
from vibrolock.compiled import kernel


@kernel
def add_to_period(t: TickArrays) -> None:
    """Sums for the means of the period under way."""
    loop = t.loop[0]
    loop.sum_error += loop.error
    loop.sum_response += loop.response_size
    loop.sum_force += loop.force_size
    loop.sum_controlled += controlled_size(t)
    loop.sum_samples += 1


@kernel
def judge_following(t: TickArrays, held: float, force: float, response: float) -> None:
    """The means of a period: trip where a law that holds a level raises the output and what it holds stays away."""
    loop, law, guard, following = t.loop[0], t.loop[0].amplitude_law, t.guard[0], t.following[0]
    see_frequency(t.expected[0], following, loop.omega)
    if guard.mode != ARMED:
        return
    if loop.drive == LOOP_DRIVE and t.progress[0].unlocked == 1:
        side = silent_side(t.expected[0], following, force, response)
        if side > 0:
            channel = loop.force_channel if side == 1 else loop.drive_channel
            shut_down(guard, SENSOR_STUCK, channel, force if side == 1 else response, loop.sample, False)
    if law == VOLTAGE:
        return
    wanted, volts = t.progress[0].level, guard.amplitude_v
    slipping, tone = t.lock[0].state == LOCKED and t.lock[0].far_periods > 0, loop.drive == TONE
    if follow_level(t.expected[0], following, volts, wanted, held, force, response, law, slipping, tone):
        channel = loop.drive_channel if law == RESPONSE else loop.force_channel
        shut_down(guard, LEVEL_NOT_FOLLOWED, channel, response if law == RESPONSE else held, loop.sample, False)


@kernel
def close_period(t: TickArrays, present: bool) -> None:
    """An oscillator period has ended at the inputs: lock state and settle rule take its means."""
    loop = t.loop[0]
    n = loop.sum_samples
    if n > 0:
        loop.mean_error = loop.sum_error / n
    if n > 0 and loop.drive != WAVEFORM:
        error = loop.sum_error / n if present else math.nan
        open_loop = loop.drive == TONE
        if not open_loop:
            next_lock_state(t.lock[0], t.thresholds[0], present, loop.held == 1, error)
        # Where a loop holds the level, its own error says whether the output may; its ripple may be cut all the time.
        behind = loop.held_back == 1 and loop.amplitude_law == VOLTAGE
        locked = (open_loop or t.lock[0].state == LOCKED) and not behind
        judge_period(
            t.settling[0],
            t.rule[0],
            locked,
            error,
            loop.sum_response / n,
            loop.sum_force / n,
            t.progress[0].level if loop.amplitude_law != VOLTAGE else 0.0,
            loop.sum_controlled / n,
            loop.saturated == 1,
            loop.clamped == 1,
            open_loop or loop.amplitude_law == RESPONSE,
        )
        judge_following(t, loop.sum_controlled / n, loop.sum_force / n, loop.sum_response / n)
    loop.sum_error = 0.0
    loop.sum_response = 0.0
    loop.sum_force = 0.0
    loop.sum_controlled = 0.0
    loop.sum_samples = 0
