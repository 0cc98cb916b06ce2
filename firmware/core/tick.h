/* What the two parts of the loop on the device share: the records of a run (docs/reference/wire-protocol.md, "The loop on the device").
 * Only with the compiled tick, whose header and object `rig firmware tick` writes. */

#ifndef VL_TICK_H
#define VL_TICK_H

#include "device.h"

#ifdef VL_HAS_TICK
#include "vibrolock_tick.h"

/* The arrays by their place, as the protocol counts them. */
#define VL_TICK_PLACE(name, type) VL_A_##name,
enum { TICK_ARRAYS(VL_TICK_PLACE) VL_TICK_ARRAYS };

enum vl_tick_reason { VL_R_SIZE = 1, VL_R_NUMBER, VL_R_RANGE, VL_R_NOT_A_NUMBER, VL_R_RATE, VL_R_VOLTAGE };

static inline uint32_t vl_tick_fault(uint32_t place, enum vl_tick_reason reason)
{
    return 256 * place + (uint32_t)reason;
}

/* tick_check.c: 0, or why these records cannot be run by a device with this description and these settings. It has looked at all that
 * the tick takes for a place in memory or for the length of a loop, at all numbers, and at the limits. */
uint32_t vl_tick_check(const struct tick_arrays *t);

#endif
#endif
