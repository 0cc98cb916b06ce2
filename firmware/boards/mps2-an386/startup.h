/* What the program finds when it begins. */

#ifndef STARTUP_H
#define STARTUP_H

int main(void);

/* newlib, before files are opened through semihosting */
void initialise_monitor_handles(void);

#endif
