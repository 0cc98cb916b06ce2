/* What the processor does at a reset and at a fault. */

#include <stdint.h>
#include <string.h>

#include "chip.h"
#include "registers.h"

extern uint32_t data_in_flash, data_begin, data_end, bss_begin, bss_end, stack_top; /* memory.ld */

void reset(void);
void reset(void)
{
    SCB_CPACR |= 0xFu << 20; /* the unit for floating point */
    __asm__ volatile("dsb\n isb" ::: "memory");
    SCB_VTOR = 0x08000000u;
    SCB_ICIALLU = 0; /* instructions are cached; data lie in tightly coupled memory, which needs no cache */
    __asm__ volatile("dsb\n isb" ::: "memory");
    SCB_CCR |= BIT(17);
    __asm__ volatile("dsb\n isb" ::: "memory");
    memcpy(&data_begin, &data_in_flash, (uintptr_t)&data_end - (uintptr_t)&data_begin);
    memset(&bss_begin, 0, (uintptr_t)&bss_end - (uintptr_t)&bss_begin);
    main();
}

/* Every fault, and every interrupt that nobody asked for: 0 V, then a reset. */
static void fault(void)
{
    converters_to_middle();
    SCB_AIRCR = 0x05FA0004u;
    for (;;) {
    }
}

typedef void (*handler)(void);
#define FOUR fault, fault, fault, fault
#define SIXTEEN FOUR, FOUR, FOUR, FOUR

__attribute__((section(".vectors"), used)) static const struct {
    uint32_t *stack;
    handler reset, faults[14], before[11], converters, after[138];
} vectors = {&stack_top, reset, {FOUR, FOUR, FOUR, fault, fault}, {FOUR, FOUR, fault, fault, fault}, converters_interrupt,
             {SIXTEEN, SIXTEEN, SIXTEEN, SIXTEEN, SIXTEEN, SIXTEEN, SIXTEEN, SIXTEEN, FOUR, FOUR, fault, fault}};
_Static_assert(sizeof vectors == 4 * (16 + 150), "the table of RM0433 19.1.2: 150 interrupts");
