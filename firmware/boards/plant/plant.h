/* A virtual structure behind two descriptors, for devices in software: what it says the device is, and its readings for outputs.
 *
 * First it sends the description as lines of ASCII, `name value`, up to a line `end`. Floats are hexadecimal, as Python's
 * float.hex() and C99's %a write them:
 *
 *   model TEXT, firmware TEXT, serial_number TEXT           up to 32 characters
 *   boot N, simulated N, bits N, rate_mhz N, shortest_watchdog_us N, longest_watchdog_us N, filter_delay_ns N, node N, lockstep N
 *   filter_delay_s X
 *   output RANGE_V V_PER_COUNT
 *   channel NAME RANGE_V V_PER_COUNT SKEW_NS                one line a channel, in the order of the samples
 *   wire serial|can|can-fd
 *
 * Then it answers requests. Request: u32 n, n output counts as i32. Answer: u32 flags (1: overload within the block), and n rows
 * of an i32 a channel. The request n = 0 brings the structure back to rest; its answer is flags alone. All little-endian. */

#ifndef PLANT_H
#define PLANT_H

#include "vibrolock.h"

#define PLANT_TEXT 33 /* characters of a text, with the zero behind */

struct plant {
    struct vl_description description;
    uint32_t boot;
    uint32_t lockstep;
    int32_t outputs[VL_LARGEST_BLOCK]; /* counts of the block under way: the board's to fill */

    /* what the description points at, and the lines that have come */
    char model[PLANT_TEXT];
    char firmware[PLANT_TEXT];
    char serial_number[PLANT_TEXT];
    char names[VL_MOST_CHANNELS][PLANT_TEXT];
    struct vl_channel channels[VL_MOST_CHANNELS];
    double filter_delay_s;
    uint32_t lines;
    int from;
    int to;
};

/* Read the description. False after one line on standard error that says what is wrong with it. */
bool plant_open(struct plant *plant, int from, int to);

/* Exchange the first n of `outputs` for readings, and hand these to vl_input. False once the structure is gone. */
bool plant_measure(struct plant *plant, uint32_t n);

/* Bring the structure back to rest, at sample 0. False once it is gone. */
bool plant_rest(struct plant *plant);

/* Write a line on standard error: the texts, one behind the other. Uses no heap, and may be called from a signal handler. */
void plant_complain(const char *what, const char *about);

#endif
