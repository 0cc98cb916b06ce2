/* Start of a Cortex-M in QEMU: floating point on, memory cleared, files by semihosting. */

#include <stdint.h>
#include <stdlib.h>

extern uint32_t data_in_flash, data_begin, data_end, bss_begin, bss_end, stack_top; /* sections.ld */
extern void initialise_monitor_handles(void);
extern int main(void);
void _init(void);
void _fini(void);

void _init(void) {}
void _fini(void) {} /* of newlib's exit */

#define COPROCESSOR_ACCESS (*(volatile uint32_t *)0xE000ED88u)
#define FPU_FOR_ALL (0xFu << 20)

void reset(void);
void reset(void) {
    COPROCESSOR_ACCESS |= FPU_FOR_ALL;
    __asm__ volatile("dsb\n isb");
    const uint32_t *from = &data_in_flash;
    for (uint32_t *to = &data_begin; to < &data_end;)
        *to++ = *from++;
    for (uint32_t *word = &bss_begin; word < &bss_end; word++)
        *word = 0;
    initialise_monitor_handles();
    exit(main());
}

static void fault(void) { _Exit(3); }

__attribute__((section(".vectors"), used)) static const struct {
    uint32_t *stack;
    void (*reset)(void), (*faults[14])(void);
} vectors = {&stack_top,
             reset,
             {fault, fault, fault, fault, fault, fault, fault, fault, fault, fault, fault, fault, fault, fault}};
