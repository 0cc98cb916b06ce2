/* The log of the output, one line a block: time of CLOCK_MONOTONIC in s, sample, and largest |output| in V since the line before.
 *
 * It is the witness of when the output is at 0 V. Written from the sampling interrupt, too: no printf, no heap. */

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "board.h"
#include "host.h"

#define MICRO 1000000u

static int file = -1;
static uint64_t first;    /* sample of the block under way */
static uint64_t samples;  /* since START */
static uint32_t largest;  /* count since the line before */

bool output_log_open(const char *path)
{
    file = open(path, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
    if (file >= 0)
        return true;
    plant_complain("--log-output: cannot be written: ", strerror(errno));
    return false;
}

/* A number with at least so many digits. */
static char *put_number(char *into, uint64_t number, int digits)
{
    char backwards[20];
    int n = 0;
    for (; number > 0 || n < digits; number /= 10)
        backwards[n++] = (char)('0' + number % 10);
    while (n > 0)
        *into++ = backwards[--n];
    return into;
}

static char *put_millionths(char *into, uint64_t millionths)
{
    into = put_number(into, millionths / MICRO, 1);
    *into++ = '.';
    return put_number(into, millionths % MICRO, 6);
}

static void write_line(uint64_t sample)
{
    char line[80], *end = line;
    struct timespec now;
    if (file < 0)
        return;
    clock_gettime(CLOCK_MONOTONIC, &now);
    const double volts = (double)largest * (double)host_structure.description.output_v_per_count;
    end = put_millionths(end, (uint64_t)now.tv_sec * MICRO + (uint64_t)now.tv_nsec / 1000);
    *end++ = ' ';
    end = put_number(end, sample, 1);
    *end++ = ' ';
    end = put_millionths(end, (uint64_t)(volts * MICRO + 0.5));
    *end++ = '\n';
    if (write(file, line, (size_t)(end - line)) < 0)
        file = -1; /* a disk that is full ends the log and nothing else */
    largest = 0;
}

void output_log_begin(void)
{
    first = samples = 0;
    largest = 0;
}

void output_log_note(int32_t count)
{
    const uint32_t size = count < 0 ? 0u - (uint32_t)count : (uint32_t)count;
    largest = size > largest ? size : largest;
    samples++;
}

void output_log_block(void)
{
    write_line(first);
    first = samples;
}

void output_log_zero(void)
{
    if (largest > 0)
        write_line(first);
    write_line(samples);
}
