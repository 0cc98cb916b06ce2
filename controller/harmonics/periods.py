"""The law of every period: the stage of the loop, and how far its errors are from their tolerances."""

import math

from controller.harmonics.plant import WAIT_PERIODS, measure_plant
from controller.harmonics.records import CONTROLLING, LISTENING, PROBING, WAITING
from controller.primitives import size
from vibrolock.compiled import Record, kernel

NOISY = 1.0  # times its scatter: judged error that noise may cause; about four of its standard errors
QUIET = 10.0  # times the smallest mean square of late: more scatter is no noise
LEAK = 1.01  # by which that smallest grows in a period
SWING = 4.0  # times the bound of the mean error: bound of its root mean square
PATIENCE = 40  # periods at a held level after which an error must have decayed
DECAYED = 0.7  # to this part, while all else is steady
GROWN = 4.0  # factor by which no error may grow at a held level
MOST_PROBES = 4  # times that errors may have the plant measured again; then the point does not settle (decision 70)
LOUDER = 1.5  # times the output at which a harmonic was found too quiet: where it is tried again
JUDGED = 0.2  # weight of the last period in the slow means


@kernel
def end_harmonics_period(
    parameters: Record, state: Record, amplitude_v: float, locked: bool, steady: bool, free: bool
) -> None:
    """Advance the loop's stage by one oscillator period, and judge the errors.

    ``locked``: the vibration is locked, or its frequency given. ``steady``: apart from harmonics it is also settled at its
    level. ``free``: the level is held and nothing is recorded, so that the plant may be measured.
    """
    end_means(parameters, state)
    if state.stage == CONTROLLING:
        judge_harmonics(parameters, state, amplitude_v, steady, free)
        return
    state.miss = math.inf
    measure_plant(parameters, state, amplitude_v, locked, steady, free)


@kernel
def end_means(parameters: Record, state: Record) -> None:
    """Take the means of the errors over the period that has ended; harmonics above the highest leave no ripple in them.

    Update their slow mean and mean square, and, except under the step and shortly after one, the mean square of their change
    from period to period, by which noise is told. Before a step only the periods count whose mean is taken.
    """
    n = max(state.samples, 1)
    weight = JUDGED
    if state.stage == PROBING:
        weight = 0.0
    elif state.stage == LISTENING:
        averaged = state.periods + 1 - WAIT_PERIODS
        weight = 1.0 / averaged if averaged > 0 else 0.0
    for order in range(2, parameters.highest + 1):
        mean = state.total[order] / n
        change = size(mean - state.mean[order])
        state.mean[order] = mean
        state.total[order] = 0.0
        state.judged[order] += JUDGED * (mean - state.judged[order])
        state.square[order] += JUDGED * (size(mean) ** 2 - state.square[order])
        if weight > 0.0:
            state.scatter_square[order] += weight * (change * change - state.scatter_square[order])
        if state.stage in (WAITING, CONTROLLING):
            scatter, quiet = state.scatter_square[order], state.quiet_square[order]
            state.quiet_square[order] = min(LEAK * quiet, scatter) if quiet > 0.0 else scatter
    state.samples = 0


@kernel
def judge_harmonics(parameters: Record, state: Record, amplitude_v: float, steady: bool, free: bool) -> None:
    """Compare the errors with their tolerances.

    Measure the plant again if at a held level they grow or do not decay, or if a harmonic was left alone at a lower level.
    """
    allowed = max(parameters.tolerance * size(state.filter[1]), parameters.smallest)
    state.miss = 0.0
    for order in range(2, parameters.highest + 1):
        if state.off[order] == 0:
            # A loop that swings scatters too: noise is not more than a few times what it was when all was quiet.
            noise = math.sqrt(min(state.scatter_square[order], QUIET * state.quiet_square[order]))
            bound = max(allowed, NOISY * noise)
            state.miss = max(
                state.miss, size(state.judged[order]) / bound, math.sqrt(state.square[order]) / (SWING * bound)
            )
    if steady and free and amplitude_v > LOUDER * state.probe_v and left_alone(parameters, state) != 0:
        state.stage = WAITING
        return
    if not free or state.miss <= 1.0:
        state.periods, state.miss_before = 0, math.inf
        return
    if state.periods == 0:
        state.miss_before = state.miss
    state.periods += 1
    grows = state.miss > GROWN * state.miss_before
    if state.periods > PATIENCE or grows:
        stays = grows or (steady and state.miss > DECAYED * state.miss_before)
        state.periods = 0
        if stays and state.probes < MOST_PROBES:
            state.stage = WAITING
            state.probes += 1
            for order in range(2, parameters.highest + 1):
                if state.bounded == 1:  # there is no room for a step
                    state.aim[order] = 0.0


@kernel
def left_alone(parameters: Record, state: Record) -> int:
    """Return the harmonics whose plant could not be told from noise, as bits: bit h for harmonic h."""
    bits = 0
    for order in range(2, parameters.highest + 1):
        if state.off[order] == 1 and parameters.left_alone[order] == 0:
            bits |= 1 << order
    return bits
