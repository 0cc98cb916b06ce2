/* How blocks are spread over CAN frames, shared by the frames and by the checksum of their definition. */

#ifndef VL_CAN_H
#define VL_CAN_H

#include "device.h"

enum { FD_WRAP = 256, CLASSICAL_SAMPLES = 64, CLASSICAL_OUTPUTS = 32, CLASSICAL_CHANNELS = 4, FD_COUNTS = 31 };

/* A group is what one sequence number counts: `rows` rows of all channels, in `parts` frames. */
struct vl_can_shape {
    bool fd;
    uint32_t n_channels;
    uint32_t parts;       /* frames of a group, each with up to `channels` channels */
    uint32_t channels;
    uint32_t rows;
    uint32_t wrap;        /* sequence numbers of samples, before they are cut to whole blocks */
    uint32_t output_rows; /* outputs of a frame */
    uint32_t output_wrap;
};

struct vl_can_shape vl_can_shape(uint32_t n_channels, bool fd);

/* The smallest length of a CAN FD frame that holds so many bytes, up to 64. */
uint8_t vl_can_padded(uint32_t length);

/* can_loop.c: the loop on the device over CAN FD. Its frames are no part of that definition, for few devices have them. */
enum { VL_CAN_RECORD_ID = 0x070, VL_CAN_STATE_ID = 0x080, VL_CAN_ROWS_ID = 0x090 };

/* Begin with a block of rows, and its state before it. */
void vl_can_send_rows(const struct vl_samples *samples);
void vl_can_frame_of_rows(struct vl_frame *frame); /* the present one */
bool vl_can_next_of_rows(void);                    /* false: that was the last */
bool vl_can_take_record(const struct vl_frame *frame);

/* CRC-32 of the definition in a version of the protocol, as its page defines it. */
uint32_t vl_can_layout_crc(const struct vl_can_shape *shape, uint32_t version);

#endif
