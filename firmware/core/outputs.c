/* Outputs kept until they are due: a ring with one slot a sample. vl_keep_outputs writes it from the main loop, and vl_next_output
 * reads it from the sampling interrupt, without a lock: a slot's count is valid only with the stamp of the sample that is due. */

#include "bytes.h"
#include "device.h"

struct slot {
    _Atomic uint32_t stamp; /* 0: nothing is there */
    int32_t count;
};

static struct slot slots[VL_OUTPUTS];
static uint32_t n_slots, at;   /* slots in use; that of the sample that is due next */
static uint64_t due;           /* index of that sample */

static uint32_t stamp_of(uint64_t index)
{
    return (uint32_t)(index << 1) | 1u;
}

void vl_clear_outputs(void)
{
    n_slots = vl_has_loop() ? 1 : (vl_in_force.queue + VL_BLOCKS_AHEAD) * vl_in_force.block; /* the loop keeps none */
    for (uint32_t i = 0; i < n_slots; i++)
        atomic_store_explicit(&slots[i].stamp, 0, memory_order_relaxed);
    at = 0;
    due = 0;
}

int32_t vl_keep_outputs(uint64_t first, const uint8_t *counts, uint64_t present)
{
    uint32_t block = vl_in_force.block, n_bytes = vl_count_bytes();
    if (first % block)
        return -1;
    uint64_t under_way = present - present % block;
    if (first > under_way && first - under_way > n_slots - block)
        return -1;
    uint32_t late = first >= present ? 0 : present - first < block ? (uint32_t)(present - first) : block;
    uint32_t place = (uint32_t)(first % n_slots);
    for (uint32_t i = late; i < block; i++) {
        struct slot *slot = &slots[place + i];
        atomic_store_explicit(&slot->stamp, 0, memory_order_relaxed);
        atomic_signal_fence(memory_order_seq_cst);
        slot->count = vl_count(counts + i * n_bytes, n_bytes);
        atomic_store_explicit(&slot->stamp, stamp_of(first + i), memory_order_release);
    }
    return (int32_t)(block - late);
}

bool vl_next_output(int32_t *count)
{
    struct slot *slot = &slots[at];
    bool is_there = atomic_load_explicit(&slot->stamp, memory_order_acquire) == stamp_of(due);
    if (is_there) {
        *count = slot->count;
        atomic_store_explicit(&slot->stamp, 0, memory_order_relaxed); /* a stamp comes again after 2^31 samples */
    }
    due++;
    if (++at == n_slots)
        at = 0;
    return is_there;
}

bool vl_has_next_block(void)
{
    for (uint32_t i = 0; i < vl_in_force.block; i++)
        if (atomic_load_explicit(&slots[(at + i) % n_slots].stamp, memory_order_relaxed) != stamp_of(due + i))
            return false;
    return true;
}

uint64_t vl_next_instant(void)
{
    return due;
}

uint64_t vl_present(void)
{
    board_lock();
    uint64_t present = due;
    board_unlock();
    return present;
}
