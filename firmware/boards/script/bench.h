/* A board whose clock is simulated, with a wire in memory and a structure that is a formula: the same in C and in Python
 * (tests/firmware). Nothing in it depends on the computer, so that every run of a script is the same. */

#ifndef SCRIPT_BENCH_H
#define SCRIPT_BENCH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "board.h"
#include "vibrolock.h"

enum bench_wire { BENCH_SERIAL, BENCH_CAN, BENCH_CAN_FD };

/* What the device is; the rest of its description is the same for all. */
struct bench_choice {
    uint8_t wire, n_channels, bits, node, simulated;
    uint8_t defect; /* of its description, which is refused; 0: none */
    bool lockstep;  /* measure a block once it is due, instead of by the clock */
    uint32_t lowest_rate_mhz, highest_rate_mhz;
    uint32_t shortest_watchdog_us, longest_watchdog_us;
    uint32_t boot;
};

/* Switch the device on at a time, us. False: vl_begin has refused the description. */
bool bench_begin(const struct bench_choice *choice, uint64_t time_us);

/* Let no more than so many sample instants come, however long they are waited for. */
void bench_limit(uint64_t instants);

/* Reset the device, as after a loss of supply: BOOT is one more. */
void bench_reset(void);

/* Let time pass until `time_us`: sample instants on the way, and one at that very time, come first. */
void bench_pass(uint64_t time_us);

/* Serve the device until it has taken everything and has nothing more to send. */
void bench_serve(void);

/* What comes over the wire; it must stay where it is until it has been served. */
void bench_bytes(const uint8_t *bytes, size_t n);
void bench_frame(const struct vl_frame *frame);

/* Press or release the emergency stop; it may be seen by the next sample instant only. */
void bench_press(bool is_pressed, bool is_served);

/* Let the next sample instant go by without its interrupt. */
void bench_miss(void);

/* Whether the wire takes what the device sends. */
void bench_open(bool is_open);

/* Called with what the device sends, and with its output at every sample instant; of the program around the bench. */
void bench_sent_bytes(uint64_t time_us, const uint8_t *bytes, size_t n);
void bench_sent_frame(uint64_t time_us, const struct vl_frame *frame);
void bench_output(uint64_t time_us, int32_t count);

#endif
