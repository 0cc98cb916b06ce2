/* How the vibration goes on where an output is missing: the last period that the host has sent, again, by the rule of the protocol's
 * page (docs/reference/wire-protocol.md). Integers only.
 *
 * vl_keep_period runs in the main loop, vl_continue in the sampling interrupt. The main loop hands over a source between board_lock
 * and board_unlock, after the outputs that it is made of, and takes it back before it writes over one of them. */

#include "bytes.h"
#include "device.h"

enum { STEPS = 1 << 16 };              /* of a period in one sample */
enum { SHORTEST_PERIOD = 4, REACH = 4 }; /* samples; outputs that are read beside a period, the points of the cubic */
enum { PIECE = 32 };                   /* outputs of which the extremes are known */
enum { PIECES = (2 * VL_LONGEST_PERIOD + REACH + PIECE - 1) / PIECE, KEPT = PIECES * PIECE };
enum { NO_RUN = -1 };                  /* no block ends there */

_Static_assert(VL_LONGEST_PERIOD <= 65535, "a period has 32 bits, 16 of them for parts of a sample");

#if VL_MOST_COUNT_BYTES == 2
typedef int16_t kept;
#else
typedef int32_t kept;
#endif

static _Atomic kept ring[KEPT];        /* outputs by their index, as they came */
static struct {
    _Atomic kept lowest, highest;
} pieces[PIECES];                      /* of the ring, so that the interrupt need not look at every output */
static int64_t armed_at;               /* instant of ARM */
static int64_t run_begin, run_end;     /* consecutive outputs with a period */

/* The period before `end`, which is repeated. */
static struct {
    bool is_there;
    int64_t end;
    uint32_t place;                    /* of `end` in the ring */
    uint32_t period;                   /* steps */
    uint32_t ramp;                     /* samples from `end` to 0 V; 0: none */
} source;

static volatile bool is_bounded;       /* the two below are those of the source */
static int32_t lowest, highest;

/* -- the main loop's part ---------------------------------------------------------------------------------------------------- */

void vl_forget_period_locked(uint64_t instant)
{
    armed_at = (int64_t)instant;
    run_end = NO_RUN;
    source.is_there = false;
}

static void forget_source(void)
{
    board_lock();
    source.is_there = false;
    board_unlock();
}

static void hand_over_source(uint32_t period, uint32_t ramp)
{
    const uint32_t place = (uint32_t)((uint64_t)run_end % KEPT);
    board_lock();
    source.is_there = true;
    source.end = run_end;
    source.place = place;
    source.period = period;
    source.ramp = ramp;
    is_bounded = false;
    board_unlock();
}

static int32_t output_at(uint32_t place)
{
    return atomic_load_explicit(&ring[place], memory_order_relaxed);
}

static void look_through(uint32_t piece)
{
    const uint32_t from = piece * PIECE;
    int32_t low = output_at(from), high = low;
    for (uint32_t place = from + 1; place < from + PIECE; place++) {
        const int32_t count = output_at(place);
        low = count < low ? count : low;
        high = count > high ? count : high;
    }
    atomic_store_explicit(&pieces[piece].lowest, (kept)low, memory_order_relaxed);
    atomic_store_explicit(&pieces[piece].highest, (kept)high, memory_order_relaxed);
}

/* Write the outputs of a block that ends with the run or before it, but those that are older than what the ring holds. A piece that
 * the run has not filled yet is looked through when it has. */
static void write(int64_t first, const uint8_t *counts)
{
    const uint32_t block = vl_in_force.block, n_bytes = vl_count_bytes();
    const int64_t oldest = run_end - KEPT;
    const bool is_late = first + block < run_end;
    uint32_t place = (uint32_t)((uint64_t)first % KEPT);
    for (uint32_t i = 0; i < block; i++) {
        if (first + i >= oldest)
            atomic_store_explicit(&ring[place], (kept)vl_count(counts + i * n_bytes, n_bytes), memory_order_relaxed);
        if (place % PIECE == PIECE - 1 || (is_late && i + 1 == block))
            look_through(place / PIECE);
        if (++place == KEPT)
            place = 0;
    }
}

static void lengthen_run(int64_t first, const uint8_t *counts, uint32_t period, uint32_t ramp)
{
    const int64_t end = first + vl_in_force.block;
    if (source.is_there && end > source.end + VL_LONGEST_PERIOD)
        forget_source();
    if (first > run_end)
        run_begin = first > armed_at ? first : armed_at;
    run_end = end;
    write(first, counts);
    if (run_end - run_begin >= period / STEPS + REACH)
        hand_over_source(period, ramp);
}

void vl_keep_period(uint64_t first, const uint8_t *counts, uint32_t period, uint32_t ramp)
{
    if (period < SHORTEST_PERIOD * STEPS || period > (uint32_t)VL_LONGEST_PERIOD * STEPS) {
        run_end = NO_RUN;
        forget_source();
    } else if ((int64_t)first >= run_end) {
        lengthen_run((int64_t)first, counts, period, ramp);
    } else {
        write((int64_t)first, counts);
        is_bounded = false;
    }
}

/* -- the interrupt's part ---------------------------------------------------------------------------------------------------- */

/* Place of an output of the source, `back` samples before its end. */
static uint32_t place_before_end(uint32_t back)
{
    return source.place >= back ? source.place - back : source.place + KEPT - back;
}

static int32_t output_before_end(uint32_t back)
{
    return output_at(place_before_end(back));
}

static void widen(int32_t low, int32_t high)
{
    lowest = low < lowest ? low : lowest;
    highest = high > highest ? high : highest;
}

/* The extremes of all that may be read: of whole pieces, and of the outputs before and behind them. */
static void find_bounds(void)
{
    uint32_t back = source.period / STEPS + REACH;
    lowest = highest = output_before_end(back);
    while (back > 0) {
        const uint32_t place = place_before_end(back);
        if (place % PIECE == 0 && back >= PIECE) {
            widen(atomic_load_explicit(&pieces[place / PIECE].lowest, memory_order_relaxed),
                  atomic_load_explicit(&pieces[place / PIECE].highest, memory_order_relaxed));
            back -= PIECE;
        } else {
            const int32_t count = output_at(place);
            widen(count, count);
            back--;
        }
    }
    is_bounded = true;
}

static int32_t within_bounds(int64_t count)
{
    if (!is_bounded)
        find_bounds();
    return count < lowest ? lowest : count > highest ? highest : (int32_t)count;
}

/* The cubic of Lagrange through four outputs, the first of them `back` samples before the end, `part` steps behind the second.
 * Shifts to the right round down, as both compilers do. */
static int64_t cubic(uint32_t back, uint32_t part)
{
    const int64_t p = output_before_end(back), q = output_before_end(back - 1), r = output_before_end(back - 2),
                  s = output_before_end(back - 3);
    int64_t value = (-p + 3 * q - 3 * r + s) * 256; /* 6 * 2^8 times the cubic, by Horner's rule */
    value = (value * part >> 16) + (3 * p - 6 * q + 3 * r) * 256;
    value = (value * part >> 16) + (-2 * p - 3 * q + 6 * r - s) * 256;
    value = (value * part >> 16) + 6 * q * 256 + 768;
    return value / 1536 - (value % 1536 < 0);
}

/* The host's ramp to 0 V is a raised cosine, which ends as the square of the time that is left. `back`: samples from the output
 * that is repeated to the end of the source. */
static int32_t ramped(int32_t count, int64_t beyond, uint32_t back)
{
    const int64_t one = 1 << 30, left = source.ramp - beyond;
    if (left <= 0)
        return 0;
    const int64_t share = left * one / (source.ramp + (int64_t)back), factor = share < one ? share : one;
    const int64_t size = (count < 0 ? -(int64_t)count : count) * factor / one * factor / one;
    return (int32_t)(count < 0 ? -size : size);
}

bool vl_continue(uint64_t index, int32_t *count)
{
    if (!source.is_there)
        return false;
    const int64_t beyond = (int64_t)index - source.end, period = source.period;
    int64_t phase = (beyond + 2) * STEPS % period;
    phase += phase < 0 ? period : 0;
    const uint64_t from = (uint64_t)(2 * STEPS + period - phase); /* steps from the place in the source to its end */
    const uint32_t back = (uint32_t)((from + STEPS - 1) / STEPS); /* samples from the output at or before it */
    *count = within_bounds(cubic(back + 1, (uint32_t)(back * (uint64_t)STEPS - from)));
    if (source.ramp)
        *count = ramped(*count, beyond, back);
    return true;
}
