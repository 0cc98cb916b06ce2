"""The plant of every harmonic: known beforehand, or measured by one step of all harmonics at once."""

import math

from controller.harmonics.records import CONTROLLING, LISTENING, PROBING, WAITING
from controller.primitives import size
from vibrolock.compiled import Record, kernel

WAIT_PERIODS = 6  # for filter and exciter after the step
MOST_UNSTEADY = 8  # periods in a row, at a lock, that do not end the measurement of the plant
MEAN_PERIODS = 4  # of the averages before and under the step
LARGER, LARGEST_PROBE = 3.0, 0.04  # factor of the next step, and the largest, relative to the fundamental
CLEAR = 4.0  # times its scatter from period to period: the least change under the step from which a plant is learned


@kernel
def measure_plant(
    parameters: Record, state: Record, amplitude_v: float, locked: bool, steady: bool, free: bool
) -> None:
    """Advance the measurement by one oscillator period: wait, average without the step and under it, learn.

    The arguments are those of `controller.harmonics.periods.end_harmonics_period`.
    """
    state.periods += 1
    if state.probes == 0 and state.stage == WAITING and locked and knows_plant(parameters, state):
        begin_to_control(parameters, state)
        return
    state.unsteady = 0 if steady else state.unsteady + 1
    if not steady and (state.stage == WAITING or not (locked and free) or state.unsteady > MOST_UNSTEADY):
        if state.stage == PROBING:
            for order in range(2, parameters.highest + 1):
                state.aim[order] -= probe_of(parameters, state, order)
        state.stage = WAITING
        return
    if state.stage == WAITING:
        for order in range(2, parameters.highest + 1):
            state.probe[order] = 0.0 if parameters.left_alone[order] == 1 else parameters.probe
        first = state.probe_v == 0.0 and state.probes == 0  # else the loops have only now come to rest
        listen(parameters, state, WAIT_PERIODS if first else 0)
        return
    if state.periods <= WAIT_PERIODS:
        return
    for order in range(2, parameters.highest + 1):
        state.sum[order] += state.mean[order] / MEAN_PERIODS
    if state.periods < WAIT_PERIODS + MEAN_PERIODS:
        return
    if state.stage == LISTENING:
        state.stage, state.periods, state.probe_v = PROBING, 0, amplitude_v
        for order in range(2, parameters.highest + 1):
            state.before[order] = state.sum[order]
            state.aim[order] += probe_of(parameters, state, order)
            state.sum[order] = 0.0
    else:
        learn_plant(parameters, state)


@kernel
def probe_of(parameters: Record, state: Record, order: int) -> complex:
    """Return a harmonic of the step (V); the phases keep the sum of all low (Schroeder)."""
    angle = -math.pi * order * (order - 1) / parameters.highest
    volts = state.probe[order] * state.probe_v
    return complex(volts * math.cos(angle), volts * math.sin(angle))


@kernel
def listen(parameters: Record, state: Record, periods: int) -> None:
    """Begin to average the harmonics, after ``periods`` of the time that is waited have passed."""
    state.stage, state.periods = LISTENING, periods
    for order in range(2, parameters.highest + 1):
        state.sum[order] = 0.0


@kernel
def knows_plant(parameters: Record, state: Record) -> bool:
    """Take the plants that are known beforehand; return whether those of all controlled harmonics are."""
    all_known = True
    for order in range(2, parameters.highest + 1):
        state.plant[order] = parameters.plant[order]
        state.off[order] = parameters.left_alone[order]
        if parameters.plant[order] == 0.0 and parameters.left_alone[order] == 0:
            all_known = False
    return all_known


@kernel
def begin_to_control(parameters: Record, state: Record) -> None:
    """Close the loops."""
    state.stage, state.periods, state.miss_before = CONTROLLING, 0, math.inf
    for order in range(2, parameters.highest + 1):
        state.judged[order] = state.mean[order]
        state.square[order] = size(state.mean[order]) ** 2


@kernel
def learn_plant(parameters: Record, state: Record) -> None:
    """Take every harmonic's plant from its change under the step, and begin to control.

    Where a change is not clear, repeat with a larger step of that harmonic; leave it alone if the largest one shows nothing.
    """
    if state.bounded == 1:  # the step was held back: nothing is learned from it
        for order in range(2, parameters.highest + 1):
            state.aim[order] = 0.0
        state.stage = WAITING
        return
    again = False
    for order in range(2, parameters.highest + 1):
        change, step = state.sum[order] - state.before[order], probe_of(parameters, state, order)
        state.aim[order] -= step
        clear = size(change) > CLEAR * math.sqrt(state.scatter_square[order])
        state.off[order] = 0 if clear else 1
        if parameters.left_alone[order] == 1:
            state.off[order] = 1
        elif parameters.plant[order] != 0.0 and state.probes == 0:
            state.off[order] = 0  # known beforehand, and not found wrong
        elif clear:
            state.plant[order] = change / step
        elif state.probe[order] * LARGER <= LARGEST_PROBE:
            state.probe[order] *= LARGER
            again = True
    if again:
        listen(parameters, state, 0)
        return
    for order in range(2, parameters.highest + 1):
        if state.off[order] == 1:
            state.aim[order] = 0.0
    begin_to_control(parameters, state)
