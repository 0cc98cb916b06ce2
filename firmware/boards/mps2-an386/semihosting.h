/* Calls to the program that runs the processor: QEMU, or a debugger. A board that stands on its own has none. */

#ifndef SEMIHOSTING_H
#define SEMIHOSTING_H

#include <stdint.h>

#define SEMIHOSTING_WRITE 0x04 /* a text */
#define SEMIHOSTING_COMMAND_LINE 0x15
#define SEMIHOSTING_EXIT 0x20

static inline int32_t semihosting(uint32_t operation, const void *argument) {
    register uint32_t r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
    return (int32_t)r0;
}

/* End the program with a status. */
static inline _Noreturn void semihosting_exit(int status) {
    const uint32_t why[] = {0x20026 /* the application ended */, (uint32_t)status};
    for (;;)
        semihosting(SEMIHOSTING_EXIT, why);
}

#endif
