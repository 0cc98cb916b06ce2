/* Sample instants. By the clock they are a POSIX timer's, whose signal handler is the sampling interrupt; it may come anywhere in
 * the core, as on a chip. In lockstep the main loop measures a block as soon as its outputs have come. While the loop runs on the
 * device, every instant is measured before the next.
 *
 * A computer may not schedule this process for a while. Beyond half the queue the device's clock stands still for that time, so
 * that the host has the other half to answer. Instants that are less late than that run at once. */

#include <errno.h>
#include <stdatomic.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "board.h"
#include "host.h"

#define SECOND_NS UINT64_C(1000000000)
#define MHZ_NS (1000 * SECOND_NS) /* period, ns, times rate, mHz */
#define BREATH_NS 50000           /* for the main loop where the structure is slower than its samples */

uint64_t sampling_stalls, sampling_stalled_ns;

static timer_t timer;
static sigset_t the_interrupt, before;
static volatile bool is_on, rest_is_due;
static uint64_t period_ns, period_rest;   /* of a sample: whole ns, and the rest in parts of a ns by rate */
static _Atomic uint64_t due_ns;           /* the next instant */
static uint64_t due_rest;
static uint64_t patience_ns;              /* half the queue: by how much instants may be late */
static uint32_t rate_mhz, collected;      /* collected: outputs for which nothing is measured yet */
static uint32_t logged;                   /* samples of the block under way that are measured */
static _Atomic uint64_t stalled_ns, told_us;

static uint64_t monotonic_ns(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t)now.tv_sec * SECOND_NS + (uint64_t)now.tv_nsec;
}

/* The time, which stands still where the next instant is later than it may be, until that has run. */
static uint64_t running_ns(void)
{
    const uint64_t now_ns = monotonic_ns(), latest_ns = atomic_load(&due_ns) + patience_ns;
    const bool by_the_clock = is_on && !host_structure.lockstep;
    return (by_the_clock && now_ns > latest_ns ? latest_ns : now_ns) - atomic_load(&stalled_ns);
}

uint64_t board_clock_us(void)
{
    const uint64_t now_us = running_ns() / 1000;
    uint64_t last_us = atomic_load(&told_us);
    while (now_us > last_us)
        if (atomic_compare_exchange_weak(&told_us, &last_us, now_us))
            return now_us;
    return last_us; /* it has stood still, and never goes back */
}

uint32_t board_nearest_rate_mhz(uint32_t rate)
{
    return rate;
}

void board_lock(void)
{
    sigprocmask(SIG_BLOCK, &the_interrupt, &before);
}

void board_unlock(void)
{
    sigprocmask(SIG_SETMASK, &before, NULL);
}

void board_output(int32_t count)
{
    (void)count; /* the structure holds an output for a whole sample */
    output_log_zero();
}

void board_feed_watchdog(void)
{
}

void sampling_end_without_structure(void)
{
    output_log_zero();
    plant_complain("the virtual structure is gone", "");
    _exit(HOST_NO_STRUCTURE);
}

static void measure(uint32_t n)
{
    logged += n;
    if (logged == vl_block()) {
        output_log_block();
        logged = 0;
    }
    if (!plant_measure(&host_structure, n))
        sampling_end_without_structure();
}

static void take_instant(void)
{
    const int32_t count = vl_output();
    output_log_note(count);
    host_structure.outputs[collected++] = count;
}

static void stand_still(uint64_t now_ns)
{
    const uint64_t late_ns = now_ns > due_ns ? now_ns - due_ns : 0;
    if (late_ns <= patience_ns)
        return;
    due_ns = now_ns;
    atomic_fetch_add(&stalled_ns, late_ns);
    sampling_stalls++;
    sampling_stalled_ns += late_ns;
}

static void set_timer(uint64_t at_ns)
{
    const struct itimerspec when = {
        .it_value = {.tv_sec = (time_t)(at_ns / SECOND_NS), .tv_nsec = (long)(at_ns % SECOND_NS)},
    };
    timer_settime(timer, TIMER_ABSTIME, &when, NULL);
}

/* The sampling interrupt. A block is measured one period after its last instant. */
static void interrupt(int number)
{
    const int error = errno;
    (void)number;
    if (is_on) {
        uint64_t now_ns = monotonic_ns();
        stand_still(now_ns);
        while (due_ns <= now_ns) {
            if (collected == vl_ahead()) {
                measure(collected);
                collected = 0;
            }
            take_instant();
            due_rest += period_rest;
            due_ns += period_ns + due_rest / rate_mhz;
            due_rest %= rate_mhz;
        }
        now_ns = monotonic_ns();
        set_timer(due_ns > now_ns ? due_ns : now_ns + BREATH_NS);
    }
    errno = error;
}

bool sampling_open(void)
{
    struct sigaction action = {.sa_handler = interrupt, .sa_flags = SA_RESTART};
    struct sigevent event = {.sigev_notify = SIGEV_SIGNAL, .sigev_signo = SIGRTMIN};
    sigemptyset(&the_interrupt);
    sigaddset(&the_interrupt, SIGRTMIN);
    sigemptyset(&action.sa_mask);
    if (sigaction(SIGRTMIN, &action, NULL) == 0 && timer_create(CLOCK_MONOTONIC, &event, &timer) == 0)
        return true;
    plant_complain("the system gives no timer: ", strerror(errno));
    return false;
}

void sampling_close(void)
{
    board_stop_sampling();
    board_output(0);
}

static void rest_if_due(void)
{
    if (rest_is_due && !plant_rest(&host_structure))
        sampling_end_without_structure();
    rest_is_due = false;
}

void board_start_sampling(uint32_t rate)
{
    rest_if_due();
    output_log_begin();
    rate_mhz = rate;
    period_ns = MHZ_NS / rate;
    period_rest = MHZ_NS % rate;
    patience_ns = (uint64_t)vl_queue() * vl_block() * period_ns / 2;
    collected = logged = 0;
    due_rest = 0;
    due_ns = monotonic_ns();
    is_on = true;
    if (!host_structure.lockstep)
        set_timer(due_ns);
}

void board_stop_sampling(void)
{
    const struct itimerspec never = {.it_value = {.tv_sec = 0}};
    rest_is_due = rest_is_due || is_on; /* later, for it takes longer than an answer may */
    is_on = false;                      /* first, for the interrupt sets the timer anew */
    if (!host_structure.lockstep)
        timer_settime(timer, 0, &never, NULL);
}

bool sampling_serve(void)
{
    if (!is_on)
        rest_if_due();
    if (!host_structure.lockstep || !vl_block_is_due())
        return false;
    const uint32_t n = vl_ahead();
    for (uint32_t left = vl_block(); left > 0; left -= n) {
        for (collected = 0; collected < n;)
            take_instant();
        measure(n);
    }
    return true;
}
