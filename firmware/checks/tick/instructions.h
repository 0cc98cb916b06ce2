/* What a Cortex-M in QEMU is asked: instructions, of which 40 pass in a tick of SysTick (one takes 1 ns), and depth of the stack. */

#ifndef INSTRUCTIONS_H
#define INSTRUCTIONS_H

#include <stdint.h>

#ifdef __arm__
#define SYSTICK ((volatile uint32_t *)0xE000E010u)
static inline void start_instruction_clock(void) {
    SYSTICK[1] = 0xFFFFFFu;
    SYSTICK[2] = 0;
    SYSTICK[0] = 5; /* from the processor's clock, without an interrupt */
}
/* Counts up, modulo 2^24 as its differences must be taken. */
static inline uint32_t instruction_clock(void) { return 0xFFFFFFu - SYSTICK[2]; }
#define DEEPEST (16 << 10) /* bytes below the caller */
#define PAINT 0xA5A5A5A5u
static inline void paint_stack(void) {
    uint32_t *top = __builtin_frame_address(0);
    for (volatile uint32_t *word = top - DEEPEST / 4; word < top - 128; word++)
        *word = PAINT;
}
static inline int64_t stack_used(void) {
    const uint32_t *top = __builtin_frame_address(0), *word = top - DEEPEST / 4;
    while (word < top && *word == PAINT)
        word++;
    return (top - word) * 4;
}
#else
static inline void paint_stack(void) {}
static inline int64_t stack_used(void) { return 0; }
static inline void start_instruction_clock(void) {}
static inline uint32_t instruction_clock(void) { return 0; }
#endif

#endif
