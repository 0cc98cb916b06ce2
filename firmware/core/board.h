/* What the core asks of a board. Nothing here may wait.
 *
 * A board for a serial line needs board_read and board_write, one for CAN board_receive_frame and board_send_frame. */

#ifndef VL_BOARD_H
#define VL_BOARD_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Microseconds since some instant before vl_begin; never goes back. */
uint64_t board_clock_us(void);

/* The sample rate nearest to this one that the timer makes, in whole mHz. */
uint32_t board_nearest_rate_mhz(uint32_t rate_mhz);

/* Call vl_output and vl_input at this rate from now on, the first time at once or one sample later. */
void board_start_sampling(uint32_t rate_mhz);

/* Stop calling them. The output has been set to 0 before. */
void board_stop_sampling(void);

/* Put a count on the converter at once, between sample instants. The core asks for 0 only. */
void board_output(int32_t count);

/* Keep the interrupts that call vl_output, vl_input and vl_watch away until board_unlock. Never nested, for microseconds only. */
void board_lock(void);
void board_unlock(void);

/* Whether the emergency stop is pressed. A board without one returns false. Also called from vl_output. */
bool board_stop_is_pressed(void);

/* Feed the chip's own watchdog, which resets the chip if this is not called for some ten milliseconds. The core calls it from
 * vl_serve, while sampling only if sample instants go on. */
void board_feed_watchdog(void);

/* Bytes that have arrived, up to `room`; returns how many. */
size_t board_read(uint8_t *bytes, size_t room);

/* Send bytes; returns how many were taken, maybe none. */
size_t board_write(const uint8_t *bytes, size_t n);

/* A CAN frame with an identifier of 11 bits. */
struct vl_frame {
    uint16_t identifier;
    uint8_t length; /* bytes: 0 to 8, and 12, 16, 20, 24, 32, 48 or 64 with CAN FD */
    bool fd;        /* CAN FD with the data at the data bit rate */
    uint8_t data[64];
};

/* The next data frame that has arrived; false if there is none. Remote frames and identifiers of 29 bits are not passed on. */
bool board_receive_frame(struct vl_frame *frame);

/* Send a frame after those before; false if there is no room now. */
bool board_send_frame(const struct vl_frame *frame);

#endif
