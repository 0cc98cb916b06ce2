/* What a host does over any wire, and what stands in for parts of the board that are not there. */

#include "host.h"
#include "semihosting.h"
#include "uart.h"

#define PAINT 0xA5A5A5A5u /* startup.c */

extern uint32_t end; /* memory.ld */

static uint32_t stack_used(const char *top)
{
    const uint32_t *word = &end;
    while (*word == PAINT)
        word++;
    return (uint32_t)(top - (const char *)word);
}

static void print(char *text, char *last, uint32_t number)
{
    for (char *digit = last; *digit == '0'; digit--, number /= 10)
        *digit = (char)('0' + number % 10);
    semihosting(SEMIHOSTING_WRITE, text);
}

void host_prints(uint32_t ticks, const char *top)
{
    static char of_timer[] = "ticks 0000000000, ", of_stack[] = "stack 000000\n";
    print(of_timer, of_timer + sizeof of_timer - 4, ticks);
    print(of_stack, of_stack + sizeof of_stack - 3, stack_used(top));
}

void uart_interrupt(void)
{
}
