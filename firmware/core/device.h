/* The device's parts as they know each other. Boards include vibrolock.h and board.h only. */

#ifndef VL_DEVICE_H
#define VL_DEVICE_H

#include <stdint.h> /* before stdatomic.h, for clang with newlib */

#include <stdatomic.h>

#include "board.h"
#include "vibrolock.h"

/* -- the protocol's numbers, as on its page ------------------------------------------------------------------------ */

enum { VL_LOWEST_VERSION = 1, VL_VERSION = 2, VL_HEARTBEAT_US = 100000 };
enum { VL_ARM_KEY = 0x41524D21 };

enum vl_request_code { VL_GET = 1, VL_SET, VL_START, VL_STOP, VL_ARM, VL_DISARM, VL_CLEAR, VL_RAMP, VL_RELEASE };
enum vl_status { VL_DONE, VL_UNKNOWN, VL_NOT_ALLOWED, VL_WRONG_STATE, VL_IS_LATCHED };
enum vl_state { VL_IDLE, VL_RUNNING, VL_ARMED, VL_LATCHED };
enum vl_flag { VL_OVERLOAD = 1, VL_OUTPUT_CLIPPED = 2, VL_OUTPUT_HELD = 4, VL_WATCHDOG = 8, VL_EMERGENCY_STOP = 16, VL_OUTPUT_CONTINUED = 32 };
enum { VL_LOST = 0x8000 }; /* of a sample, beside these flags, as the tick takes it */

enum vl_parameter {
    VL_P_LOWEST_VERSION = 1,
    VL_P_HIGHEST_VERSION = 2,
    VL_P_VERSION = 3,
    VL_P_MODEL = 4,
    VL_P_FIRMWARE = 5,
    VL_P_SERIAL_NUMBER = 6,
    VL_P_BOOT = 7,
    VL_P_SIMULATED = 8,
    VL_P_STATE = 9,
    VL_P_N_CHANNELS = 16,
    VL_P_CHANNEL_NAME = 17,
    VL_P_CHANNEL_UNIT = 18,
    VL_P_CHANNEL_RANGE_V = 19,
    VL_P_CHANNEL_V_PER_COUNT = 20,
    VL_P_OUTPUT_RANGE_V = 21,
    VL_P_OUTPUT_V_PER_COUNT = 22,
    VL_P_BITS = 23,
    VL_P_LOWEST_RATE_MHZ = 32,
    VL_P_HIGHEST_RATE_MHZ = 33,
    VL_P_LARGEST_BLOCK = 34,
    VL_P_LARGEST_QUEUE = 35,
    VL_P_SHORTEST_WATCHDOG_US = 36,
    VL_P_LONGEST_WATCHDOG_US = 37,
    VL_P_FILTER_DELAY_NS = 38,
    VL_P_SKEW_NS = 39,
    VL_P_FILTER_DELAY_S = 40,
    VL_P_LONGEST_PERIOD = 41,
    VL_P_RATE_MHZ = 48,
    VL_P_BLOCK = 49,
    VL_P_QUEUE = 50,
    VL_P_WATCHDOG_US = 51,
    VL_P_RAMP_US = 52,
    VL_P_LAYOUT_CRC = 64,
    VL_P_PING = 65,
    VL_P_TICK_DIGEST = 80,
    VL_P_TICK_ROOM = 81,
    VL_P_LOOP = 82,
    VL_P_TICK_BYTES = 83,
    VL_P_TICK_PERIOD = 84,
    VL_P_TICK_CRC = 85,
    VL_P_TICK_FAULT = 86,
    VL_P_STATE_BLOCKS = 87
};

/* A request or an answer: `code` is the command of one, the status of the other. */
struct vl_command {
    uint8_t number, code, parameter, item;
    uint32_t value;
};

struct vl_heartbeat {
    uint8_t state, flags, boot;
    uint32_t samples, dropped;
};

/* A block that has been measured. The counts are little-endian, as they go on the wire; so are readings, rows and state of the loop on
 * the device. */
struct vl_samples {
    uint64_t first, clock_us;
    uint32_t dropped;
    uint8_t flags;
    const uint8_t *counts;
    const uint8_t *put_out; /* counts of the converter, where an output was missing; NULL: as handed over */
    const uint8_t *state;   /* of the loop on the device, after the block: `counts` are readings and rows then */
    uint32_t state_bytes;   /* 0: none is told with this block */
};

/* -- state.c: what all parts know ------------------------------------------------------------------------------------- */

struct vl_settings {
    uint32_t version, rate_mhz, block, queue, watchdog_us, ramp_us;
    uint32_t loop;        /* 1: the loop runs on the device */
    uint32_t tick_period; /* entries of a waveform of its records */
    uint32_t state_blocks;/* blocks of rows, of which the last has the loop's state */
};

extern const struct vl_description *vl_about;
extern struct vl_settings vl_settings;
extern struct vl_settings vl_in_force; /* those of the last START; the ones above may be set anew once sampling has ended */
extern uint32_t vl_boot;
extern int32_t vl_held; /* the count on the converter */

uint32_t vl_count_bytes(void);
uint32_t vl_row_bytes(const struct vl_settings *settings);    /* of a sample on the wire: its counts, or its readings and its row */
uint32_t vl_sample_bytes(const struct vl_settings *settings); /* of a sample in memory: these, and the count that was put out */

/* -- device.c: what happens to it, and when ------------------------------------------------------------------------- */

void vl_take_request(const struct vl_command *request);
/* The outputs of a block, what period they are the last of (1/65536 sample; 0: none), and how many samples their end is away from the
 * end of a ramp to 0 V (0: none). */
void vl_take_output(uint64_t first, const uint8_t *counts, uint32_t period, uint32_t ramp);
void vl_take_emergency_stop(void);

/* -- parameters.c: the dictionary ------------------------------------------------------------------------------------ */

void vl_begin_parameters(uint32_t boot);
uint32_t vl_largest_block(void);
enum vl_status vl_get(uint8_t parameter, uint8_t item, uint32_t *value);
enum vl_status vl_set(uint8_t parameter, uint8_t item, uint32_t *value);

/* -- life.c: states, what has latched, the watchdog ------------------------------------------------------------------- */

void vl_begin_life(void);
enum vl_state vl_state(void);
uint8_t vl_latched(void);
enum vl_status vl_start(uint32_t *value);
void vl_stop_locked(void);
enum vl_status vl_arm(uint32_t key, uint32_t *value);
enum vl_status vl_disarm(uint32_t *value);
enum vl_status vl_clear(uint32_t *value);
void vl_emergency_stop_locked(void);
void vl_feed(void);
/* In the sampling interrupt: the count of the watchdog's ramp; false if there is none under way. */
bool vl_ramp(int32_t *count);
/* Whether the output was brought down, and its ramp may still be under way at a sample. */
bool vl_is_coming_down(uint64_t index);
bool vl_take_change(void); /* whether state or latch have changed since the last call */

/* -- outputs.c: outputs kept until they are due ------------------------------------------------------------------------- */

void vl_clear_outputs(void);
/* Keep the outputs of a block; those due before `present` are too late. Returns how many are in time, -1 for nonsense. */
int32_t vl_keep_outputs(uint64_t first, const uint8_t *counts, uint64_t present);
/* The output due now; false if it has not come. Moves on by one sample. */
bool vl_next_output(int32_t *count);
/* Whether all outputs of the next block have come. Between blocks only. */
bool vl_has_next_block(void);
/* Index of the first sample whose output is not on the converter yet; the second for the interrupt, or locked. */
uint64_t vl_present(void);
uint64_t vl_next_instant(void);

/* -- continuation.c: the vibration goes on where an output is missing ------------------------------------------------------ */

/* Forget all that could be repeated: ARM is at this instant. */
void vl_forget_period_locked(uint64_t instant);
/* Keep the outputs of a valid block, late or not, so that they can be repeated. */
void vl_keep_period(uint64_t first, const uint8_t *counts, uint32_t period, uint32_t ramp);
/* In the sampling interrupt: the count with which the vibration goes on, beyond the converter's range or not; false if it cannot. */
bool vl_continue(uint64_t index, int32_t *count);

/* -- sampling.c: sample instants, and blocks until they are sent -------------------------------------------------------- */

void vl_begin_sampling(void);
void vl_restart_sampling(void);
void vl_end_sampling(void);
bool vl_is_sampling(void);
void vl_note_an_output(void);        /* a first output has come */
uint32_t vl_instants(void);          /* sample instants since the reset, as a sign of life */
uint32_t vl_dropped(void);           /* samples since START */
uint64_t vl_handed_over(void);       /* samples since START that were sent or dropped */
const struct vl_samples *vl_oldest_block(void);
void vl_forget_oldest_block(bool was_sent);

/* -- wires ---------------------------------------------------------------------------------------------------------------- */

/* How messages travel. What it takes it hands to vl_take_...; what it is given to send must not change until it is idle. */
struct vl_wire {
    bool (*fits)(const struct vl_description *about);
    uint32_t (*largest_block)(void);
    uint32_t (*layout_crc)(uint32_t version);
    void (*begin)(void);      /* after a reset */
    void (*configure)(void);  /* at START: block and queue are known */
    void (*receive)(void);    /* take some of what has come */
    bool (*is_idle)(void);    /* go on sending; whether all that was given has been sent */
    bool (*has_expired)(void);/* whether the block that was given was given up */
    void (*send_answer)(const struct vl_command *answer);
    void (*send_heartbeat)(const struct vl_heartbeat *beat);
    void (*send_samples)(const struct vl_samples *samples); /* and before them what was put out, if they have it */
    bool carries_rows;        /* send_samples takes the loop's rows and state as well: without that there is no loop on the device */
};

/* -- crc32.c, bytes.h ------------------------------------------------------------------------------------------------------ */

enum { VL_CRC_START = 0 };
uint32_t vl_crc32(uint32_t crc, const void *bytes, size_t n);

#include "loop.h"

#endif
