/* The parts of this board as they know each other. */

#ifndef CHIP_H
#define CHIP_H

#include <stddef.h>
#include <stdint.h>

#define FOR_DMA __attribute__((section(".dma"))) /* memory that the DMA reaches: not the tightly coupled one */

void clock_begin(void);
uint32_t clock_random(void);
void clock_begin_watchdog(void);

enum { N_CHANNELS = 4, PER_CHANNEL_NS = 1563 }; /* 25 cycles of 16 MHz: from one channel to the next (converters.c) */

void converters_begin(void);
void converters_to_middle(void); /* the output at 0 V, also in a fault */
void converters_interrupt(void); /* DMA1 stream 0: all channels of an instant are there */

void line_begin(uint32_t baud);
void bus_begin(uint8_t node);

int main(void);

#endif
