/* Heads of the payloads that a loop on the device sends, on every wire: State and Rows (docs/reference/wire-protocol.md). */

#ifndef VL_ROWS_H
#define VL_ROWS_H

#include "bytes.h"
#include "device.h"

enum { VL_STATE = 9, VL_ROWS = 10, VL_PAYLOAD_HEAD = 4, VL_ROWS_HEAD = 28 };

/* Version, type and number of a block, modulo 65536. */
static inline uint8_t *vl_put_payload_head(uint8_t *into, uint8_t type, const struct vl_samples *samples)
{
    return vl_put(vl_put(vl_put(into, vl_in_force.version, 1), type, 1), samples->first / vl_in_force.block, 2);
}

/* All that goes before the state's number and pieces, and before readings and rows; both return how many bytes. */
static inline uint32_t vl_put_state_head(uint8_t *into, const struct vl_samples *samples)
{
    return (uint32_t)(vl_put_payload_head(into, VL_STATE, samples) - into);
}

static inline uint32_t vl_put_rows_head(uint8_t *into, const struct vl_samples *samples)
{
    uint8_t *end = vl_put_payload_head(into, VL_ROWS, samples);
    end = vl_put(vl_put(vl_put(end, samples->first, 8), samples->clock_us, 8), samples->dropped, 4);
    end = vl_put(vl_put(end, samples->flags, 2), 0, 2);
    return (uint32_t)(end - into);
}

#endif
