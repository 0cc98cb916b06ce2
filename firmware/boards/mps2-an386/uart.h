/* The serial line: UART 0 of the board (CMSDK APB UART). */

#ifndef UART_H
#define UART_H

#include <stdbool.h>

void uart_begin(void);

/* Whether bytes wait for board_read. */
bool uart_has_received(void);

/* The receive interrupt. */
void uart_interrupt(void);

#endif
