/* The serial line: a receive interrupt fills a ring, the main loop empties it. */

#include "uart.h"

#include "board.h"

#ifndef UART_RING
#define UART_RING 1024u /* bytes, a power of two; the core empties it every millisecond at least */
#endif

struct uart {
    uint32_t data, state, control, interrupt_clear, baud_divisor;
};
#define UART0 ((volatile struct uart *)0x40004000u)
#define TX_FULL 1u
#define RX_FULL 2u
#define TX_ENABLE 1u
#define RX_ENABLE 2u
#define RX_INTERRUPT_ENABLE 8u
#define RX_INTERRUPT 2u
#define SET_ENABLE_INTERRUPTS (*(volatile uint32_t *)0xE000E100u) /* NVIC; receiving by UART 0 is interrupt 0 */

static uint8_t ring[UART_RING];
static volatile uint32_t received, taken;

void uart_begin(void)
{
    UART0->baud_divisor = 16; /* QEMU sends at once, whatever stands here */
    UART0->control = TX_ENABLE | RX_ENABLE | RX_INTERRUPT_ENABLE;
    SET_ENABLE_INTERRUPTS = 1u;
}

void uart_interrupt(void)
{
    UART0->interrupt_clear = RX_INTERRUPT;
    uint8_t byte = (uint8_t)UART0->data;
    if (received - taken < UART_RING) /* else the byte is lost, and by its CRC the frame */
        ring[received++ % UART_RING] = byte;
}

bool uart_has_received(void)
{
    return taken != received;
}

size_t board_read(uint8_t *bytes, size_t room)
{
    size_t n = 0;
    while (n < room && uart_has_received())
        bytes[n++] = ring[taken++ % UART_RING];
    return n;
}

size_t board_write(const uint8_t *bytes, size_t n)
{
    size_t sent = 0;
    while (sent < n && !(UART0->state & TX_FULL))
        UART0->data = bytes[sent++];
    return sent;
}
