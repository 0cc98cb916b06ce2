/* Sample instants: an output goes on the converter, and a row of counts comes in. Blocks wait in a ring until they are sent.
 *
 * vl_output and vl_input run in the sampling interrupt. The ring has one writer, the interrupt, and one reader, the main loop. */

#include "bytes.h"
#include "device.h"

static volatile bool is_on;
static volatile bool has_output; /* an output has come since START */
static volatile bool awaits_arm; /* the loop on the device begins with the first instant after ARM: until then nothing is counted */
static volatile uint32_t instants;

static int32_t lowest_count, highest_count; /* of the converter's range */
static uint64_t first_expected;  /* no output exists for samples before it */
static uint8_t seen;             /* flags of the block under way */
static bool is_spoilt;           /* an instant of the block under way was missed */
static uint8_t put_out[VL_LARGEST_BLOCK * VL_MOST_COUNT_BYTES]; /* counts of the block under way */

static uint8_t memory[VL_SAMPLE_BYTES] VL_BULK;
static struct vl_samples blocks[VL_MOST_BLOCKS];
static uint32_t n_blocks, block_bytes;
static uint32_t readback_bytes;  /* of them, for what was put out: none in version 1, and none with the loop on the device */
static bool has_failed;          /* the compiled tick */
static _Atomic uint32_t written, read; /* blocks, modulo 2^32 */
static uint32_t write_at, read_at; /* their places in the ring */
static uint64_t first;           /* of the block under way */
static uint32_t row;             /* of the block under way */
static uint8_t *into;            /* where its next row goes, with the loop where it begins; NULL: there is no room for this block */
static _Atomic uint32_t dropped;
static uint64_t handed_over;

/* The range in counts, to the nearest. Two's complement has one more below zero than above. */
static void find_range(void)
{
    double counts = (double)vl_about->output_range_v / (double)vl_about->output_v_per_count + 0.5;
    int64_t most = vl_about->bits == 16 ? INT16_MAX : INT32_MAX;
    int64_t range = counts > (double)most ? most + 1 : (int64_t)counts;
    lowest_count = (int32_t)-range;
    highest_count = (int32_t)(range < most ? range : most);
}

void vl_begin_sampling(void)
{
    is_on = false;
    vl_held = 0;
    handed_over = 0;
    atomic_store(&dropped, 0);
    atomic_store(&written, 0);
    atomic_store(&read, 0);
    find_range();
}

void vl_restart_sampling(void)
{
    vl_clear_outputs();
    vl_held = 0;
    has_output = false;
    awaits_arm = vl_has_loop();
    first_expected = (uint64_t)vl_in_force.queue * vl_in_force.block;
    seen = 0;
    is_spoilt = false;
    has_failed = false;
    readback_bytes = vl_in_force.version > 1 && !vl_has_loop() ? vl_in_force.block * vl_count_bytes() : 0;
    block_bytes = vl_in_force.block * vl_row_bytes(&vl_in_force) + (vl_has_loop() ? VL_STATE_BYTES : readback_bytes);
    if (vl_has_loop())
        vl_restart_tick();
    n_blocks = VL_SAMPLE_BYTES / block_bytes < VL_MOST_BLOCKS ? VL_SAMPLE_BYTES / block_bytes : VL_MOST_BLOCKS;
    atomic_store(&written, 0);
    atomic_store(&read, 0);
    write_at = read_at = 0;
    atomic_store(&dropped, 0);
    first = handed_over = 0;
    row = 0;
    is_on = true;
}

void vl_end_sampling(void)
{
    is_on = false;
    atomic_store(&read, atomic_load(&written));
    read_at = write_at;
}

bool vl_is_sampling(void)
{
    return is_on;
}

void vl_note_an_output(void)
{
    has_output = true;
}

uint32_t vl_instants(void)
{
    return instants;
}

uint32_t vl_dropped(void)
{
    return atomic_load(&dropped);
}

uint64_t vl_handed_over(void)
{
    return handed_over;
}

uint32_t vl_block(void)
{
    return vl_in_force.block;
}

uint32_t vl_ahead(void)
{
    return vl_has_loop() ? 1 : vl_in_force.block;
}

uint32_t vl_queue(void)
{
    return vl_in_force.queue;
}

static int32_t clipped(int32_t count)
{
    if (count >= lowest_count && count <= highest_count)
        return count;
    seen |= VL_OUTPUT_CLIPPED;
    return count < 0 ? lowest_count : highest_count;
}

/* The output of an armed device: the loop's, or the one that is due, or the vibration's next one, or the one before. */
static int32_t armed_output(bool has_come, int32_t count, uint64_t index)
{
    if (vl_has_loop())
        return clipped(vl_tick_output());
    if (has_come)
        return clipped(count);
    bool goes_on = vl_continue(index, &count);
    if (has_output && index >= first_expected)
        seen |= goes_on ? VL_OUTPUT_CONTINUED : VL_OUTPUT_HELD;
    return goes_on ? clipped(count) : vl_held;
}

/* The counts of a block that was put out, for the host if an output was missing. */
static void note_put_out(uint64_t index)
{
    const uint32_t n_bytes = vl_count_bytes();
    if (readback_bytes && index - first < vl_in_force.block)
        vl_put_count(put_out + (uint32_t)(index - first) * n_bytes, vl_held, n_bytes);
}

int32_t vl_output(void)
{
    if (!is_on)
        return 0;
    instants++;
    if (board_stop_is_pressed() && !(vl_latched() & VL_EMERGENCY_STOP))
        vl_emergency_stop_locked();
    vl_watch();
    awaits_arm = awaits_arm && vl_state() != VL_ARMED;
    if (awaits_arm)
        return 0;
    uint64_t index = vl_next_instant();
    int32_t count = 0;
    bool has_come = vl_next_output(&count);
    if (vl_state() == VL_ARMED)
        vl_held = armed_output(has_come, count, index);
    else
        vl_held = vl_ramp(&count) ? count : 0;
    note_put_out(index);
    return vl_held;
}

static uint32_t after(uint32_t place)
{
    return place + 1 == n_blocks ? 0 : place + 1;
}

static bool has_room(void)
{
    return atomic_load_explicit(&written, memory_order_relaxed) - atomic_load(&read) < n_blocks;
}

/* Find room for a block, or note that there is none. */
static void begin_block(void)
{
    into = has_room() ? memory + write_at * block_bytes : NULL;
}

/* With the loop on the device: a sample goes through it, and its row into the block. */
static void run_loop(const int32_t counts[], uint16_t flags)
{
    if (!has_failed && !vl_tick(counts, flags)) {
        has_failed = true;
        vl_counters.loop_failures++;
        vl_emergency_stop_locked();
    }
    is_spoilt = is_spoilt || has_failed;
    if (into)
        vl_keep_row(into, row);
}

/* Behind the samples of a block, what was put out if it is not all that was handed over; else NULL. */
static const uint8_t *keep_readback(uint8_t *end)
{
    if (!readback_bytes || !(seen & (VL_OUTPUT_HELD | VL_OUTPUT_CONTINUED)))
        return NULL;
    return memcpy(end - readback_bytes, put_out, readback_bytes);
}

static void end_block(void)
{
    if (seen & VL_OUTPUT_HELD)
        vl_counters.held_blocks++;
    if (seen & VL_OUTPUT_CONTINUED)
        vl_counters.continued_blocks++;
    if (into && !is_spoilt) {
        uint8_t *const block = memory + write_at * block_bytes;
        uint8_t *const behind = block + vl_in_force.block * vl_row_bytes(&vl_in_force);
        blocks[write_at] = (struct vl_samples){
            .first = first,
            .clock_us = board_clock_us(),
            .dropped = atomic_load_explicit(&dropped, memory_order_relaxed),
            .flags = (uint8_t)(seen | vl_latched()),
            .counts = block,
            .put_out = keep_readback(block + block_bytes),
            .state = behind,
            .state_bytes = vl_has_loop() ? vl_tick_state(behind) : 0,
        };
        write_at = after(write_at);
        atomic_fetch_add_explicit(&written, 1, memory_order_release);
    } else {
        vl_counters.dropped_blocks++;
        atomic_fetch_add(&dropped, vl_in_force.block);
    }
    first += vl_in_force.block;
    row = 0;
    seen = 0;
    is_spoilt = false;
}

static void end_row(void)
{
    if (++row == vl_in_force.block)
        end_block();
}

void vl_miss(void)
{
    if (!is_on)
        return;
    vl_output();
    if (awaits_arm)
        return;
    if (row == 0)
        begin_block();
    vl_counters.missed_instants++;
    if (vl_has_loop())
        run_loop(NULL, VL_LOST);
    else
        is_spoilt = true;
    end_row();
}

void vl_input(const int32_t counts[], bool overload)
{
    if (!is_on || awaits_arm)
        return;
    if (row == 0)
        begin_block();
    if (overload)
        seen |= VL_OVERLOAD;
    if (vl_has_loop()) {
        run_loop(counts, overload ? VL_OVERLOAD : 0);
    } else if (into) {
        const uint32_t n_channels = vl_about->n_channels, n_bytes = vl_count_bytes();
        for (uint32_t channel = 0; channel < n_channels; channel++)
            into = vl_put_count(into, counts[channel], n_bytes);
    }
    end_row();
}

const struct vl_samples *vl_oldest_block(void)
{
    return atomic_load(&read) == atomic_load_explicit(&written, memory_order_acquire) ? NULL : &blocks[read_at];
}

void vl_forget_oldest_block(bool was_sent)
{
    handed_over = blocks[read_at].first + vl_in_force.block;
    if (!was_sent) {
        vl_counters.dropped_blocks++;
        atomic_fetch_add(&dropped, vl_in_force.block);
    }
    read_at = after(read_at);
    atomic_fetch_add_explicit(&read, 1, memory_order_release);
}

bool vl_block_is_due(void)
{
    uint64_t next = vl_next_instant();
    if (!is_on)
        return false;
    if (vl_has_loop())
        return has_room() && !(awaits_arm && vl_state() != VL_ARMED);
    if (next < first_expected || vl_has_next_block())
        return true;
    return vl_is_coming_down(next - vl_in_force.block);
}
