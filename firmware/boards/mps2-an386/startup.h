/* What the program finds when it begins. */

#ifndef STARTUP_H
#define STARTUP_H

#include <stddef.h>

int main(void);

/* Bytes that the stack has taken at most since the reset. */
size_t stack_used(void);

/* newlib, before files are opened through semihosting */
void initialise_monitor_handles(void);

#endif
