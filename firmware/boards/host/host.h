/* The device as a process of a computer: a pseudo-terminal is its line, a virtual structure behind a pipe its converters. */

#ifndef HOST_H
#define HOST_H

#include <signal.h>

#include "plant.h"

enum { HOST_BAD_ARGUMENTS = 2, HOST_NO_STRUCTURE = 3 }; /* status that the process ends with */

extern struct plant host_structure;

/* -- instants.c: sample instants by the clock, or in lockstep with the host --------------------------------------------- */

bool sampling_open(void);
void sampling_close(void);
/* Bring the structure to rest if sampling has ended, and in lockstep measure a block if one is due. Whether one was. */
bool sampling_serve(void);
/* Without the structure there are no converters: 0 V, and the process ends. */
void sampling_end_without_structure(void);
extern uint64_t sampling_stalls;     /* times that this process was not scheduled for more than half the queue */
extern uint64_t sampling_stalled_ns; /* how long the device's clock stood still for it */

/* -- output_log.c: a line a block, and one at once where the output is set to 0 V ------------------------------------------ */

bool output_log_open(const char *path);
void output_log_begin(void);         /* sample 0 is next */
void output_log_note(int32_t count); /* the output of the next sample */
void output_log_block(void);         /* a block is complete */
void output_log_zero(void);

/* -- line.c: bytes over a descriptor that never waits ------------------------------------------------------------------------ */

bool line_open(int descriptor);
size_t line_read(uint8_t *bytes, size_t room);
size_t line_write(const uint8_t *bytes, size_t n);
/* Wait for something to do on the line, at most a millisecond, or for the end of the structure. */
void line_wait(void);

/* -- slcan.c: a CAN adapter on the line, and the bus behind it ------------------------------------------------------------------ */

extern uint32_t slcan_damaged_lines, slcan_garbage_bytes, slcan_other_frames;

#endif
