/* host --plant-in FD --plant-out FD --line FD [--log-output PATH]
 *
 * All descriptors are open already. What the device is, the structure behind the plant's descriptors says. SIGUSR1 presses the
 * emergency stop; SIGTERM and SIGINT end the process, which then writes what it has counted, `name value` a line. */

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "board.h"
#include "host.h"

#define LOOKS 3 /* at a press, at most: one that has latched already does so no more */

static volatile sig_atomic_t told_to_end, looks_left;
static uint32_t stops_before; /* emergency stops that had latched before the press */

struct arguments {
    int plant_in, plant_out, line;
    const char *log_output;
};

static void end(int number)
{
    (void)number;
    told_to_end = 1;
}

static void press(int number)
{
    (void)number;
    stops_before = vl_counters.emergency_stops;
    looks_left = LOOKS;
}

bool board_stop_is_pressed(void)
{
    if (looks_left == 0 || vl_counters.emergency_stops != stops_before)
        return false;
    looks_left = looks_left - 1;
    return true;
}

static bool take_descriptor(const char *text, int *descriptor)
{
    char *rest;
    const long number = strtol(text, &rest, 10);
    *descriptor = (int)number;
    return *text != '\0' && *rest == '\0' && number >= 0 && number < 65536;
}

static bool take_arguments(int n, char **texts, struct arguments *given)
{
    *given = (struct arguments){-1, -1, -1, NULL};
    bool is_good = n % 2 == 1;
    for (int i = 1; i + 1 < n; i += 2) {
        if (strcmp(texts[i], "--plant-in") == 0)
            is_good = is_good && take_descriptor(texts[i + 1], &given->plant_in);
        else if (strcmp(texts[i], "--plant-out") == 0)
            is_good = is_good && take_descriptor(texts[i + 1], &given->plant_out);
        else if (strcmp(texts[i], "--line") == 0)
            is_good = is_good && take_descriptor(texts[i + 1], &given->line);
        else if (strcmp(texts[i], "--log-output") == 0)
            given->log_output = texts[i + 1];
        else
            is_good = false;
    }
    if (is_good && given->plant_in >= 0 && given->plant_out >= 0 && given->line >= 0)
        return true;
    plant_complain("usage: host --plant-in FD --plant-out FD --line FD [--log-output PATH]", "");
    return false;
}

static void handle(int number, void (*handler)(int))
{
    struct sigaction action = {.sa_handler = handler, .sa_flags = SA_RESTART};
    sigfillset(&action.sa_mask);
    sigaction(number, &action, NULL);
}

static void handle_signals(void)
{
    handle(SIGTERM, end);
    handle(SIGINT, end);
    handle(SIGUSR1, press);
    handle(SIGPIPE, SIG_IGN);
}

/* Everything open, and the device begun. */
static bool begin(const struct arguments *given)
{
    if (!plant_open(&host_structure, given->plant_in, given->plant_out) || !line_open(given->line) || !sampling_open())
        return false;
    if (given->log_output != NULL && !output_log_open(given->log_output))
        return false;
    if (vl_begin(&host_structure.description, host_structure.boot))
        return true;
    plant_complain("the description does not fit the wire, the protocol or the memory", "");
    return false;
}

static void print(const char *name, uint64_t count)
{
    printf("%s %llu\n", name, (unsigned long long)count);
}

#define PRINT(name) print(#name, vl_counters.name)

static void print_counters(void)
{
    PRINT(watchdog_trips);
    PRINT(emergency_stops);
    PRINT(held_blocks);
    PRINT(continued_blocks);
    PRINT(loop_failures);
    PRINT(dropped_blocks);
    PRINT(bad_outputs);
    PRINT(late_outputs);
    PRINT(outputs_while_idle);
    PRINT(repeated_requests);
    PRINT(lost_answers);
    PRINT(damaged_frames);
    PRINT(oversize_frames);
    PRINT(malformed);
    PRINT(foreign_frames);
    PRINT(repeated_frames);
    PRINT(incomplete_blocks);
    PRINT(resynchronised);
    print("stalls", sampling_stalls);
    print("stalled_us", sampling_stalled_ns / 1000);
    print("damaged_lines", slcan_damaged_lines);
    print("garbage_bytes", slcan_garbage_bytes);
    print("other_frames", slcan_other_frames);
}

int main(int n, char **texts)
{
    struct arguments given;
    if (!take_arguments(n, texts, &given) || !begin(&given))
        return HOST_BAD_ARGUMENTS;
    handle_signals();
    if (!plant_rest(&host_structure)) /* which also tells that the device can be reached */
        return HOST_NO_STRUCTURE;
    while (!told_to_end) {
        vl_serve();
        if (!sampling_serve())
            line_wait();
    }
    sampling_close();
    print_counters();
    return 0;
}
