/* The core on a processor that has nothing else to do, for measures.py: blocks at 5 kHz, a clock and a host of its own, and a
 * board that throws away what is sent. Compiled for a WIRE and BLOCK, samples a block. */

#include "host.h"

#include "board.h"
#include "vibrolock.h"

#ifndef WIRE
#define WIRE vl_serial
#endif
#ifndef BLOCK
#define BLOCK 10
#endif
enum { PERIOD_US = 200, SAMPLES = 600, PING_EVERY = 250, QUEUE = 2, WATCHDOG_US = 20000, RAMP_US = 10000 };
/* Samples of a period, the longest in blocks of 10 alone, for its trace takes long; and outputs that do not come. */
enum { SHORT = 100, LONGEST = BLOCK < 10 ? SHORT : VL_LONGEST_PERIOD, STEPS = 65536, MISSING = 50 };

static const struct vl_channel CHANNELS[] = {
    {.name = "force", .range_v = 5.0f, .v_per_count = 1.5e-4f},
    {.name = "drive", .range_v = 5.0f, .v_per_count = 1.5e-4f},
    {.name = "response", .range_v = 5.0f, .v_per_count = 1.5e-4f},
    {.name = "voltage", .range_v = 10.0f, .v_per_count = 3e-4f},
};

static const struct vl_description DEVICE = {
    .model = "load",
    .firmware = "1.0",
    .serial_number = "1",
    .simulated = 1,
    .n_channels = N_CHANNELS,
    .channels = CHANNELS,
    .output_range_v = 10.0f,
    .output_v_per_count = 3e-4f,
    .bits = 16,
    .lowest_rate_mhz = 1000000,
    .highest_rate_mhz = 5000000,
    .shortest_watchdog_us = 1000,
    .longest_watchdog_us = 1000000,
    .wire = &WIRE,
    .node = 1,
};

/* -- the board ----------------------------------------------------------------------------------------------------- */

static uint64_t now_us;

uint64_t board_clock_us(void)
{
    return now_us;
}

uint32_t board_nearest_rate_mhz(uint32_t rate_mhz)
{
    return rate_mhz;
}

void board_start_sampling(uint32_t rate_mhz)
{
    (void)rate_mhz;
}

void board_stop_sampling(void)
{
}

void board_output(int32_t count)
{
    (void)count;
}

void board_lock(void)
{
    __asm__ volatile("cpsid i" ::: "memory");
}

void board_unlock(void)
{
    __asm__ volatile("cpsie i" ::: "memory");
}

bool board_stop_is_pressed(void)
{
    return false;
}

void board_feed_watchdog(void)
{
}

/* -- what is measured: calls from `steady`, `continued_...` and `ramp...` ------------------------------------------- */

static const char *stack_in_main_loop;
static uint32_t samples; /* since START */

static void sample_instant(int32_t *counts)
{
    now_us += PERIOD_US;
    for (uint32_t channel = 0; channel < N_CHANNELS; channel++)
        counts[channel] = counts[channel] * 5 + 77 - 65536 * (counts[channel] > 6000);
}

/* A timer that counts the virtual time of QEMU, 40 ns a tick. */
#define TIMER0_CONTROL (*(volatile uint32_t *)0x40000000u)
#define TIMER0_VALUE (*(volatile uint32_t *)0x40000004u)
#define TIMER0_RELOAD (*(volatile uint32_t *)0x40000008u)

/* Armed, outputs in time, a PING every 50 ms. Returns the ticks of the timer that it has taken. */
__attribute__((noinline)) uint32_t steady(void)
{
    int32_t counts[N_CHANNELS] = {1, 2, 3, 4};
    __asm__ volatile("mov %0, sp" : "=r"(stack_in_main_loop));
    uint32_t from = TIMER0_VALUE;
    host_tells_period(SHORT * STEPS + 1, 0);
    for (; samples < SAMPLES; samples++) {
        if (samples % BLOCK == 0)
            host_sends_outputs(samples + QUEUE * BLOCK, BLOCK);
        if (samples % PING_EVERY == 7)
            host_asks(1 /* GET */, 65 /* PING */, 0);
        sample_instant(counts);
        vl_output();
        vl_input(counts, false);
        vl_serve();
    }
    return from - TIMER0_VALUE;
}

/* A period of outputs in time, and then as many as are on their way. */
static void drive(uint32_t period, uint32_t ramp)
{
    int32_t counts[N_CHANNELS] = {1, 2, 3, 4};
    const uint32_t until = samples + period + 4 + BLOCK, end = until - until % BLOCK + QUEUE * BLOCK;
    host_tells_period(period * STEPS, ramp);
    for (; samples < end; samples++) {
        if (samples % BLOCK == 0 && samples + QUEUE * BLOCK < end)
            host_sends_outputs(samples + QUEUE * BLOCK, BLOCK);
        sample_instant(counts);
        vl_output();
        vl_input(counts, false);
        vl_serve();
    }
}

static inline __attribute__((always_inline)) void miss_outputs(void)
{
    int32_t counts[N_CHANNELS] = {1, 2, 3, 4};
    for (uint32_t until = samples - samples % BLOCK + MISSING; samples < until; samples++) {
        sample_instant(counts);
        vl_output();
        vl_input(counts, false);
        vl_serve();
    }
}

/* The vibration goes on without outputs. */
__attribute__((noipa)) void continued_short(void)
{
    miss_outputs();
}

/* The same with the longest period, while the host was on its way to 0 V. */
__attribute__((noipa)) void continued_longest(void)
{
    miss_outputs();
}

static bool is_until_after_the_ramp(uint32_t sample)
{
    return sample < (WATCHDOG_US + RAMP_US) / PERIOD_US + 100;
}

/* The host is silent: the vibration goes on, then the watchdog brings the output to 0 V. */
__attribute__((noinline)) void ramp(void)
{
    int32_t counts[N_CHANNELS] = {1, 2, 3, 4};
    for (uint32_t sample = 0; is_until_after_the_ramp(sample); sample++) {
        sample_instant(counts);
        vl_output();
        vl_input(counts, false);
        vl_serve();
    }
}

/* The same where the main loop notices first that the watchdog's time is over. */
__attribute__((noinline)) void ramp_by_main_loop(void)
{
    int32_t counts[N_CHANNELS] = {1, 2, 3, 4};
    for (uint32_t sample = 0; is_until_after_the_ramp(sample); sample++) {
        sample_instant(counts);
        vl_serve();
        vl_output();
        vl_input(counts, false);
    }
}

static void ask_and_serve(uint8_t command, uint8_t parameter, uint32_t value)
{
    host_asks(command, parameter, value);
    now_us += PERIOD_US;
    vl_serve();
    vl_serve();
}

static void set_up(void)
{
    samples = 0;
    ask_and_serve(2, 3, 2); /* the version */
    ask_and_serve(2, 48, 5000000);
    ask_and_serve(2, 49, BLOCK);
    ask_and_serve(2, 50, QUEUE);
    ask_and_serve(2, 51, WATCHDOG_US);
    ask_and_serve(2, 52, RAMP_US);
    ask_and_serve(3, 0, 0); /* START */
    ask_and_serve(5, 0, 0x41524D21u); /* ARM */
}

int main(void)
{
    TIMER0_RELOAD = TIMER0_VALUE = UINT32_MAX;
    TIMER0_CONTROL = 1;
    if (!vl_begin(&DEVICE, 1))
        return 1;
    set_up();
    uint32_t ticks = steady();
    const struct vl_counters *c = &vl_counters;
    bool all_well = host_received_blocks() == SAMPLES / BLOCK && c->held_blocks == 0 && c->continued_blocks == 0 && c->dropped_blocks == 0 && c->bad_outputs == 0
                    && c->late_outputs == 0 && c->damaged_frames == 0 && c->malformed == 0 && c->watchdog_trips == 0;
    drive(SHORT, 0);
    continued_short();
    drive(LONGEST, 20000);
    continued_longest();
    all_well = all_well && c->continued_blocks == 2 * MISSING / BLOCK + QUEUE && c->held_blocks == 0;
    ramp();
    all_well = all_well && c->watchdog_trips == 1;
    ask_and_serve(4, 0, 0); /* STOP */
    ask_and_serve(7, 0, 0); /* CLEAR */
    set_up();
    ramp_by_main_loop();
    all_well = all_well && c->watchdog_trips == 2;
    host_prints(ticks, stack_in_main_loop);
    return all_well ? 0 : 2;
}
