/* The device on a NUCLEO-H743ZI2 (Cortex-M7, 480 MHz) over the debugger's serial line, or with NUCLEO_CAN over CAN FD. **It has not run on silicon.** What to check
 * first: docs/how-to/first-hour-with-a-nucleo.md. */

#include "board.h"
#include "chip.h"
#include "registers.h"
#include "vibrolock.h"

#ifndef BAUD
#define BAUD 3000000u
#endif
#ifndef NUCLEO_NODE
#define NUCLEO_NODE 1
#endif
#define FULL_V 10.0f  /* of the front end: +10 to -10 V become 0 to 3.3 V */
#define RANGE_V 9.4f  /* its amplifiers saturate 0.1 V from their supplies */

#define V_PER_COUNT (2.0f * FULL_V / 65536)

/* Names and order as in the bench file. */
static const struct vl_channel CHANNELS[N_CHANNELS] = {
    {.name = "force", .range_v = RANGE_V, .v_per_count = V_PER_COUNT},
    {.name = "drive", .range_v = RANGE_V, .v_per_count = V_PER_COUNT, .skew_ns = PER_CHANNEL_NS},
    {.name = "acc_drive", .range_v = RANGE_V, .v_per_count = V_PER_COUNT, .skew_ns = 2 * PER_CHANNEL_NS},
    {.name = "acc_magnet", .range_v = RANGE_V, .v_per_count = V_PER_COUNT, .skew_ns = 3 * PER_CHANNEL_NS},
};

static char serial_number[25];

static struct vl_description device = {
    .model = "NUCLEO-H743ZI2",
    .firmware = "1.0",
    .serial_number = serial_number,
    .simulated = 0, /* a shaker moves: a person arms it */
    .n_channels = N_CHANNELS,
    .channels = CHANNELS,
    .output_range_v = 8.6f, /* the converter's buffer ends 0.2 V from its supplies */
    .output_v_per_count = 2.0f * FULL_V / 4096,
    .bits = 16,
    .shortest_watchdog_us = 5000,
    .longest_watchdog_us = 600 * 1000 * 1000,
    .filter_delay_ns = 3 * PER_CHANNEL_NS / 2, /* of the converters alone: add that of your filters */
#ifdef NUCLEO_CAN
    .wire = &vl_can_fd,
    .node = NUCLEO_NODE,
#else
    .wire = &vl_serial,
#endif
};

static void tell_serial_number(void)
{
    static const char DIGITS[] = "0123456789ABCDEF";
    for (unsigned i = 0; i < 24; i++)
        serial_number[i] = DIGITS[UNIQUE_NUMBER[i / 8] >> 4 * (7 - i % 8) & 15u];
}

int main(void)
{
    clock_begin();
    converters_begin();
    tell_serial_number();
    device.lowest_rate_mhz = board_nearest_rate_mhz(1000u * 1000u);
    device.highest_rate_mhz = board_nearest_rate_mhz(10u * 1000u * 1000u);
#ifdef NUCLEO_CAN
    bus_begin(NUCLEO_NODE);
#else
    line_begin(BAUD);
#endif
    const bool fits = vl_begin(&device, clock_random());
    clock_begin_watchdog(); /* if the description does not fit, it resets the chip again and again, with the output at 0 V */
    while (fits)
        vl_serve();
    for (;;) {
    }
}
