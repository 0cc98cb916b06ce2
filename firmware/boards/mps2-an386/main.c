/* The device on the mps2-an386 with a Cortex-M4, as QEMU emulates it: serial line, lockstep, and a virtual structure instead of
 * converters. QEMU's time is not real, and it counts no cycles: this board shows that the core runs as ARM machine code, not
 * how fast.
 *
 * The structure is reached through two FIFOs of the computer on which QEMU runs (boards/plant). Their names come by the command
 * line of semihosting: -semihosting-config enable=on,target=native,arg=mps2-an386,arg=FROM_STRUCTURE,arg=TO_STRUCTURE */

#include <fcntl.h>
#include <string.h>
#include <unistd.h>

#include "board.h"
#include "plant.h"
#include "semihosting.h"
#include "startup.h"
#include "uart.h"

/* -- the clock: timer 0 (CMSDK APB timer) counts down at 25 MHz ---------------------------------------------------- */

#define TICKS_PER_US 25u
#define TIMER0_CONTROL (*(volatile uint32_t *)0x40000000u)
#define TIMER0_VALUE (*(volatile uint32_t *)0x40000004u)
#define TIMER0_RELOAD (*(volatile uint32_t *)0x40000008u)
#define SYSTICK_CONTROL (*(volatile uint32_t *)0xE000E010u)
#define SYSTICK_RELOAD (*(volatile uint32_t *)0xE000E014u)
#define RUNS 1u
#define WITH_INTERRUPT_OF_THE_PROCESSORS_CLOCK 7u

static void begin_clock(void)
{
    TIMER0_RELOAD = TIMER0_VALUE = UINT32_MAX;
    TIMER0_CONTROL = RUNS;
    SYSTICK_RELOAD = 1000 * TICKS_PER_US - 1; /* wakes the main loop every millisecond */
    SYSTICK_CONTROL = WITH_INTERRUPT_OF_THE_PROCESSORS_CLOCK;
}

/* To be called within 171 s again, when the timer begins anew; here by the main loop only. */
uint64_t board_clock_us(void)
{
    static uint64_t now_us;
    static uint32_t before = UINT32_MAX;
    uint32_t passed_us = (before - TIMER0_VALUE) / TICKS_PER_US;
    before -= passed_us * TICKS_PER_US;
    return now_us += passed_us;
}

/* -- sample instants: in lockstep there is no timer ---------------------------------------------------------------- */

static struct plant plant;
static bool is_there;

uint32_t board_nearest_rate_mhz(uint32_t rate_mhz)
{
    (void)rate_mhz;
    return plant.description.lowest_rate_mhz; /* the only one */
}

void board_start_sampling(uint32_t rate_mhz)
{
    (void)rate_mhz;
}

void board_stop_sampling(void)
{
    is_there = plant_rest(&plant);
}

/* A converter would be set here. The structure gets its outputs with the next block, and none at the end of the program. */
void board_output(int32_t count)
{
    (void)count;
}

static void measure_a_block(void)
{
    const uint32_t n = vl_ahead();
    for (uint32_t left = vl_block(); left > 0 && is_there; left -= n) {
        for (uint32_t i = 0; i < n; i++)
            plant.outputs[i] = vl_output();
        is_there = plant_measure(&plant, n);
    }
}

/* -- what else the core asks for ----------------------------------------------------------------------------------- */

void board_lock(void)
{
    __asm__ volatile("cpsid i" ::: "memory");
}

void board_unlock(void)
{
    __asm__ volatile("cpsie i" ::: "memory");
}

bool board_stop_is_pressed(void)
{
    return false;
}

void board_feed_watchdog(void)
{
}

bool board_receive_frame(struct vl_frame *frame)
{
    (void)frame;
    return false; /* there is no CAN bus here */
}

bool board_send_frame(const struct vl_frame *frame)
{
    (void)frame;
    return false;
}

/* -- the program --------------------------------------------------------------------------------------------------- */

/* Open the FIFOs, in this order. O_TRUNC makes semihosting open for writing, and does nothing to a FIFO. */
static bool find_structure(void)
{
    static char line[1024];
    const struct { char *text; uint32_t size; } into = {line, sizeof line};
    initialise_monitor_handles();
    if (semihosting(SEMIHOSTING_COMMAND_LINE, &into) != 0)
        return false;
    char *rest = NULL;
    strtok_r(line, " ", &rest); /* the program's own name. strtok would need a heap */
    const char *from = strtok_r(NULL, " ", &rest), *to = strtok_r(NULL, " ", &rest);
    return from && to && plant_open(&plant, open(from, O_RDONLY), open(to, O_WRONLY | O_CREAT | O_TRUNC));
}

#define REFUSED 2 /* status where the description is none for this device */

/* Sleep until the next interrupt, unless one is pending. */
static void rest_a_while(void)
{
    board_lock();
    if (!uart_has_received())
        __asm__ volatile("wfi");
    board_unlock();
}

int main(void)
{
    board_output(0);
    begin_clock();
    if (!find_structure() || plant.description.wire != &vl_serial || !vl_begin(&plant.description, plant.boot))
        return REFUSED;
    uart_begin();
    is_there = plant_rest(&plant); /* by its first request the structure knows that the device can be reached */
    while (is_there) {
        vl_serve();
        if (vl_block_is_due())
            measure_a_block();
        else
            rest_a_while();
    }
    return 0;
}
