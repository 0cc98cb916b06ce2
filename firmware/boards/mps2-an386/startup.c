/* What the processor does at a reset and at a fault. */

#include "startup.h"

#include <stdint.h>
#include <string.h>

#include "board.h"
#include "semihosting.h"
#include "uart.h"

extern uint32_t data_in_flash, data_begin, data_end, bss_begin, bss_end, end, stack_top; /* memory.ld */

#define COPROCESSOR_ACCESS (*(volatile uint32_t *)0xE000ED88u)
#define FPU_FOR_ALL (0xFu << 20)
#define PAINT 0xA5A5A5A5u
#define BELOW_THE_FRAME 16 /* words */

/* A debugger, or a monitor as QEMU's, sees later how deep the stack has been. */
static void paint_stack(void)
{
    const uint32_t *top = (uint32_t *)__builtin_frame_address(0) - BELOW_THE_FRAME;
    for (volatile uint32_t *word = &end; word < top; word++)
        *word = PAINT;
}

void reset(void);
void reset(void)
{
    COPROCESSOR_ACCESS |= FPU_FOR_ALL;
    memcpy(&data_begin, &data_in_flash, (uintptr_t)&data_end - (uintptr_t)&data_begin);
    memset(&bss_begin, 0, (uintptr_t)&bss_end - (uintptr_t)&bss_begin);
    paint_stack();
    semihosting_exit(main());
}

/* Every fault, and every interrupt that nobody asked for. A chip would be reset then: SCB_AIRCR = 0x05FA0004. Here the program
 * ends, and so does the output of the structure. */
static void fault(void)
{
    board_output(0);
    semihosting_exit(1);
}

static void wake(void)
{
}

typedef void (*handler)(void);
#define EIGHT fault, fault, fault, fault, fault, fault, fault, fault

__attribute__((section(".vectors"), used)) static const struct {
    uint32_t *stack;
    handler reset, faults[13], systick, uart_received, others[31];
} vectors = {&stack_top, reset, {EIGHT, fault, fault, fault, fault, fault}, wake, uart_interrupt,
             {EIGHT, EIGHT, EIGHT, fault, fault, fault, fault, fault, fault, fault}};
