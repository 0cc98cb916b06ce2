/* How blocks are spread over CAN frames. */

#include "can.h"

struct vl_can_shape vl_can_shape(uint32_t n_channels, bool fd)
{
    uint32_t a_frame = fd ? FD_COUNTS : CLASSICAL_CHANNELS;
    uint32_t parts = (n_channels + a_frame - 1) / a_frame;
    return (struct vl_can_shape){
        .fd = fd,
        .n_channels = n_channels,
        .parts = parts,
        .channels = (n_channels + parts - 1) / parts,
        .rows = fd ? FD_COUNTS / n_channels : 1,
        .wrap = fd ? FD_WRAP : CLASSICAL_SAMPLES / parts,
        .output_rows = fd ? FD_COUNTS : CLASSICAL_CHANNELS,
        .output_wrap = fd ? FD_WRAP : CLASSICAL_OUTPUTS,
    };
}

uint8_t vl_can_padded(uint32_t length)
{
    static const uint8_t LENGTHS[] = {8, 12, 16, 20, 24, 32, 48, 64};
    if (length <= 8)
        return (uint8_t)length;
    uint32_t i = 0;
    while (LENGTHS[i] < length)
        i++;
    return LENGTHS[i];
}
