/* A device of the vibrolock wire protocol, versions 1 and 2: what a board describes, and what it calls.
 *
 * The core needs no heap, no operating system and no vendor library; of the C library memcpy, memmove, memset, memcmp and strlen, and
 * of the compiler's own library divisions of 64 bits and, in vl_begin alone, arithmetic in double. There is one device in a program.
 * A board provides the functions of board.h and calls, in this order,
 *
 *   vl_begin      once after a reset;
 *   vl_serve      again and again from its main loop, at least every millisecond;
 *   vl_output     at every sample instant, from the interrupt of the sampling timer: the count that goes on the converter now;
 *   vl_input      with the counts that the inputs had at that instant, from the same interrupt or later. Those of a block come
 *                 before vl_output is called for the first instant of the next block; where the loop runs on the device, those of
 *                 an instant before it is called for the next instant (vl_ahead).
 *
 * vl_output, vl_input, vl_miss and vl_watch may interrupt vl_serve anywhere but between board_lock and board_unlock. They must not
 * interrupt each other.
 */

#ifndef VIBROLOCK_H
#define VIBROLOCK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "limits.h"

/* An input channel, in the order of the samples. */
struct vl_channel {
    const char *name;    /* up to 32 characters of ASCII, as in the bench file */
    float range_v;       /* largest voltage that is read undistorted, V */
    float v_per_count;   /* V */
    uint32_t skew_ns;    /* delay behind the first channel, ns */
};

struct vl_wire;

extern const struct vl_wire vl_serial; /* bytes: board_read, board_write */
extern const struct vl_wire vl_can;    /* classical CAN: board_receive_frame, board_send_frame */
extern const struct vl_wire vl_can_fd; /* CAN FD: the same */

/* What a device says of itself. It must stay where it is, unchanged, for as long as the device lives. */
struct vl_description {
    const char *model;         /* these three: up to 32 characters of ASCII */
    const char *firmware;
    const char *serial_number;
    uint32_t simulated;        /* 0: a shaker moves; 1: nothing physical moves; 2: besides, same outputs give same samples */
    uint32_t n_channels;
    const struct vl_channel *channels;
    float output_range_v;      /* largest voltage put out, V */
    float output_v_per_count;  /* V */
    uint32_t bits;             /* 16 or 32: size of counts on the wire; 16 on CAN */
    uint32_t lowest_rate_mhz;  /* mHz */
    uint32_t highest_rate_mhz; /* mHz */
    uint32_t shortest_watchdog_us;
    uint32_t longest_watchdog_us;
    uint32_t filter_delay_ns;  /* mean delay of the converters' filters from output to input, ns */
    const double *filter_delay_s; /* the same to the last bit, for devices in software; else NULL */
    const struct vl_wire *wire;
    uint8_t node;              /* on a CAN bus, 0 to 15 */
};

/* The device after a reset: IDLE at 0 V. `boot` is another number after every reset, in its low byte, too. False, and nothing
 * else may be called, where the description does not fit limits.h, the wire or the protocol. */
bool vl_begin(const struct vl_description *description, uint32_t boot);

/* Take what has come over the wire, and send what is due. Never waits. */
void vl_serve(void);

/* The count to put on the converter at this sample instant. */
int32_t vl_output(void);

/* The counts [n_channels] of a sample instant. `overload`: one of them was beyond its range. */
void vl_input(const int32_t counts[], bool overload);

/* In place of both for a sample instant that went by without its interrupt, for instance because the timer has overrun. The index
 * of samples counts it, its output is passed over, and its block is dropped whole and counted. */
void vl_miss(void);

/* Trip the watchdog if its time is over. vl_output and vl_serve do this; a timer of its own may do it besides. */
void vl_watch(void);

/* Samples a block, and blocks of the queue, since the last START. */
uint32_t vl_block(void);
uint32_t vl_queue(void);

/* Instants for which vl_output may be called before the inputs of the first of them are handed to vl_input: a block, but 1 while the
 * loop runs on the device, for it needs the inputs of every instant for its next output. */
uint32_t vl_ahead(void);

/* For devices in software that wait for their host instead of a clock (lockstep): whether the next block can be measured, for
 * its outputs have come or none are needed; while the loop runs on the device, for there is room for its rows. */
bool vl_block_is_due(void);

/* What has happened since the reset, for a board's own diagnosis. */
struct vl_counters {
    uint32_t watchdog_trips;
    uint32_t emergency_stops;
    uint32_t held_blocks;          /* blocks of which an output was held */
    uint32_t dropped_blocks;       /* blocks that found no room, expired, or of which an instant was missed */
    uint32_t missed_instants;
    uint32_t bad_outputs;          /* outputs whose length or index makes no sense */
    uint32_t late_outputs;         /* outputs that came late altogether */
    uint32_t outputs_while_idle;
    uint32_t repeated_requests;
    uint32_t lost_answers;         /* answers and heartbeats that found no room */
    uint32_t damaged_frames;       /* COBS, CRC-32, or a CAN frame of another length */
    uint32_t oversize_frames;
    uint32_t malformed;            /* whole frames that are no message, or of another version */
    uint32_t foreign_frames;       /* CAN: identifiers that are not of this device */
    uint32_t repeated_frames;
    uint32_t incomplete_blocks;
    uint32_t resynchronised;
    uint32_t continued_blocks;     /* blocks in which the vibration went on without an output */
    uint32_t loop_failures;        /* times that the compiled tick has failed, each an emergency stop */
};

extern struct vl_counters vl_counters;

#endif
