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

/* CRC-32 of the definition in a version of the protocol, as its page defines it. */
uint32_t vl_can_layout_crc(const struct vl_can_shape *shape, uint32_t version);

#endif
