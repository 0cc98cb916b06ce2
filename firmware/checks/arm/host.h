/* A host in the same program as the device: what it sends, board_read or board_receive_frame hands over. */

#ifndef HOST_H
#define HOST_H

#include <stdint.h>

#define N_CHANNELS 4

void host_asks(uint8_t command, uint8_t parameter, uint32_t value);
void host_sends_outputs(uint32_t first, uint32_t n);

/* The period (1/65536 sample) and the ramp to 0 V (samples from the end of a block) of all outputs from the next on; 0: none. */
void host_tells_period(uint32_t period, uint32_t ramp);

/* Blocks of samples that have come. */
uint32_t host_received_blocks(void);

/* Print through semihosting: ticks of a timer, and how many bytes of stack below `top` were ever used. */
void host_prints(uint32_t ticks, const char *top);

#endif
