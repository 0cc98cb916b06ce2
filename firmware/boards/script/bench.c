#include "bench.h"

#include <stdlib.h>
#include <string.h>

enum { MOST_SERVINGS = 100000, OVERLOAD_PER_MILLE = 500 };

static const char *const names[VL_MOST_CHANNELS] = {
    "channel-00", "channel-01", "channel-02", "channel-03", "channel-04", "channel-05", "channel-06", "channel-07",
    "channel-08", "channel-09", "channel-10", "channel-11", "channel-12", "channel-13", "channel-14", "channel-15",
    "channel-16", "channel-17", "channel-18", "channel-19", "channel-20", "channel-21", "channel-22", "channel-23",
    "channel-24", "channel-25", "channel-26", "channel-27", "channel-28", "channel-29", "channel-30",
};

static struct bench_choice chosen;
static struct vl_channel channels[VL_MOST_CHANNELS];
static struct vl_description about;
static const double filter_delay_s = 0.00025;

static uint64_t now_us;
static bool is_locked, is_pressed, is_open, is_fed;

static bool is_sampling;
static uint64_t origin_us;   /* of sample instant 0 */
static uint64_t instant;     /* index of the next sample instant */
static uint32_t rate_mhz;
static uint64_t instants_left = UINT64_MAX;
static bool is_missed;       /* the next instant will be */
static bool has_row;         /* a row was measured and is not handed over yet */
static int32_t output;       /* at the sample instant before */

static const uint8_t *waiting; /* bytes that have arrived */
static size_t n_waiting;
static const struct vl_frame *waiting_frame;
static bool has_sent;

/* -- the structure: counts of a channel from the output's count and the sample's index -------------------------------- */

static int32_t wrapped(int64_t value)
{
    if (chosen.bits == 16)
        return (int32_t)((value & 0xFFFF) ^ 0x8000) - 0x8000;
    return (int32_t)(((value & 0xFFFFFFFF) ^ 0x80000000) - 0x80000000);
}

/* Channel 0 reads the output itself. */
static int32_t reading(uint32_t channel, int32_t count, uint64_t index)
{
    int64_t c = channel;
    return wrapped((2 * c + 1) * count + 77 * c * (int64_t)(index % 1000003));
}

/* The inputs can be overloaded at half of full scale. */
static bool is_overloaded(int32_t count)
{
    int64_t full = chosen.bits == 16 ? 32768 : 2147483648;
    return llabs((long long)count) * 1000 > full * OVERLOAD_PER_MILLE;
}

static void hand_over_row(uint64_t index, int32_t count)
{
    int32_t row[VL_MOST_CHANNELS];
    for (uint32_t channel = 0; channel < chosen.n_channels; channel++)
        row[channel] = reading(channel, count, index);
    vl_input(row, is_overloaded(count));
}

/* -- what the core asks for --------------------------------------------------------------------------------------------- */

uint64_t board_clock_us(void)
{
    return now_us;
}

uint32_t board_nearest_rate_mhz(uint32_t wanted_mhz)
{
    return wanted_mhz;
}

void board_start_sampling(uint32_t wanted_mhz)
{
    is_sampling = true;
    has_row = false;
    rate_mhz = wanted_mhz;
    origin_us = now_us;
    instant = 0;
}

void board_stop_sampling(void)
{
    is_sampling = false;
}

void board_output(int32_t count)
{
    bench_output(now_us, count);
}

void board_lock(void)
{
    if (is_locked)
        abort();
    is_locked = true;
}

void board_unlock(void)
{
    if (!is_locked)
        abort();
    is_locked = false;
}

bool board_stop_is_pressed(void)
{
    return is_pressed;
}

void board_feed_watchdog(void)
{
    is_fed = true;
}

size_t board_read(uint8_t *bytes, size_t room)
{
    size_t n = n_waiting < room ? n_waiting : room;
    if (n == 0)
        return 0;
    memcpy(bytes, waiting, n);
    waiting += n;
    n_waiting -= n;
    return n;
}

size_t board_write(const uint8_t *bytes, size_t n)
{
    if (!is_open)
        return 0;
    bench_sent_bytes(now_us, bytes, n);
    has_sent = true;
    return n;
}

bool board_receive_frame(struct vl_frame *frame)
{
    if (!waiting_frame)
        return false;
    *frame = *waiting_frame;
    waiting_frame = NULL;
    return true;
}

bool board_send_frame(const struct vl_frame *frame)
{
    if (!is_open)
        return false;
    bench_sent_frame(now_us, frame);
    has_sent = true;
    return true;
}

/* -- time ---------------------------------------------------------------------------------------------------------------- */

static void put_out(void)
{
    output = vl_output();
    instants_left--;
    has_row = is_sampling;
    bench_output(now_us, output);
}

static void take_instant(void)
{
    if (has_row)
        hand_over_row(instant - 1, output);
    has_row = false;
    if (is_missed)
        vl_miss();
    else
        put_out();
    is_missed = false;
    instant++;
}

/* Whether the next sample instant is at `time_us` or before. */
static bool has_come(uint64_t time_us)
{
    return is_sampling && instants_left && instant * 1000000000 <= (time_us - origin_us) * rate_mhz;
}

static void measure_block(void)
{
    static int32_t counts[VL_LARGEST_BLOCK];
    const uint32_t block = vl_block(), n = vl_ahead();
    instants_left -= block < instants_left ? block : instants_left;
    for (uint32_t left = block; left > 0; left -= n) {
        for (uint32_t i = 0; i < n; i++) {
            counts[i] = vl_output();
            bench_output(now_us, counts[i]);
        }
        for (uint32_t i = 0; i < n; i++)
            hand_over_row(instant++, counts[i]);
    }
}

static bool take_what_is_due(void)
{
    if (chosen.lockstep ? !(is_sampling && instants_left && vl_block_is_due()) : !has_come(now_us))
        return false;
    if (chosen.lockstep)
        measure_block();
    else
        take_instant();
    return true;
}

void bench_serve(void)
{
    bool goes_on = true;
    for (uint32_t i = 0; i < MOST_SERVINGS && goes_on; i++) {
        has_sent = false;
        vl_serve();
        goes_on = take_what_is_due() || has_sent || n_waiting || waiting_frame;
    }
}

/* The chip's watchdog is fed after a sample instant, and not again before the next. */
static void mind_the_watchdog(void)
{
    bool was_fed = is_fed;
    is_fed = false;
    vl_serve();
    if (!was_fed || (is_fed && is_sampling))
        abort();
}

void bench_pass(uint64_t time_us)
{
    while (!chosen.lockstep && has_come(time_us)) {
        now_us = origin_us + instant * 1000000000 / rate_mhz;
        is_fed = false;
        take_instant();
        bench_serve();
        mind_the_watchdog();
    }
    now_us = time_us;
}

/* -- from outside --------------------------------------------------------------------------------------------------------- */

void bench_bytes(const uint8_t *bytes, size_t n)
{
    waiting = bytes;
    n_waiting = n;
    bench_serve();
    n_waiting = 0;
}

void bench_frame(const struct vl_frame *frame)
{
    waiting_frame = frame;
    bench_serve();
    waiting_frame = NULL;
}

void bench_press(bool pressed, bool is_served)
{
    is_pressed = pressed;
    if (is_served)
        bench_serve();
}

void bench_miss(void)
{
    is_missed = true;
}

void bench_open(bool opened)
{
    is_open = opened;
    bench_serve();
}

static void describe(void)
{
    float v_per_count = chosen.bits == 16 ? 0x1p-11f : 0x1p-27f;
    for (uint32_t channel = 0; channel < VL_MOST_CHANNELS; channel++)
        channels[channel] = (struct vl_channel){names[channel], 10.0f, v_per_count, 1000 * channel};
    about = (struct vl_description){
        .model = "a formula behind a simulated clock", /* of which 32 characters are told */
        .firmware = "1.0",
        .serial_number = "0001",
        .simulated = chosen.simulated,
        .n_channels = chosen.n_channels,
        .channels = channels,
        .output_range_v = chosen.simulated == 2 ? 16.0f : 10.0f, /* all that a count can say, or less */
        .output_v_per_count = v_per_count,
        .bits = chosen.bits,
        .lowest_rate_mhz = chosen.lowest_rate_mhz,
        .highest_rate_mhz = chosen.highest_rate_mhz,
        .shortest_watchdog_us = chosen.shortest_watchdog_us,
        .longest_watchdog_us = chosen.longest_watchdog_us,
        .filter_delay_ns = 250000,
        .filter_delay_s = chosen.simulated ? &filter_delay_s : NULL,
        .wire = chosen.wire == BENCH_SERIAL ? &vl_serial : chosen.wire == BENCH_CAN ? &vl_can : &vl_can_fd,
        .node = chosen.node,
    };
}

static void make_a_mistake(void)
{
    switch (chosen.defect) {
    case 1: channels[0].name = NULL; break;
    case 2: channels[0].name = ""; break;
    case 3: channels[0].range_v = 0.0f; break;
    case 4: channels[0].v_per_count = 0.0f; break;
    case 5: about.output_range_v = 0.0f; break;
    case 6: about.output_v_per_count = 0.0f; break;
    default: break;
    }
}

/* An interrupt of the sampling timer that comes while nothing is sampled. */
static void be_early(void)
{
    int32_t row[VL_MOST_CHANNELS] = {0};
    if (vl_output() != 0 || vl_block_is_due())
        abort();
    vl_input(row, false);
    vl_miss();
}

bool bench_begin(const struct bench_choice *choice, uint64_t time_us)
{
    chosen = *choice;
    describe();
    make_a_mistake();
    now_us = time_us;
    is_locked = is_pressed = is_sampling = is_missed = false;
    is_open = true;
    if (!vl_begin(&about, chosen.boot))
        return false;
    be_early();
    bench_serve();
    return true;
}

void bench_limit(uint64_t instants)
{
    instants_left = instants;
}

void bench_reset(void)
{
    is_sampling = false;
    vl_begin(&about, ++chosen.boot);
    bench_serve();
}
