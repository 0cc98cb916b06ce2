/* The core driven by a script: records from standard input, what the device does to standard output. All numbers are
 * little-endian.
 *
 * Header: u8 wire, n_channels, bits, node, simulated, lockstep, defect; u32 lowest rate, highest rate (mHz),
 * shortest watchdog, longest watchdog (us), boot; u64 time, us.
 * Record, in the order of time: u64 time, us; u8 kind; u32 length; data.
 *
 *   0  nothing but time      3  press the emergency stop      5  the wire takes nothing any more
 *   1  bytes on the line     4  release it                    6  the wire takes everything again
 *   2  a CAN frame: u16 identifier, u8 whether it is CAN FD, data
 *   7  a reset                8  the next sample instant goes by
 *
 * Records of the device: the same, of kinds 1 and 2, and last one of kind 9: the counters, u32 each. Times are those of the
 * sample instant or of the record that it answers. */

#include "bench.h"

#include <stdio.h>
#include <stdlib.h>

#include "bytes.h"

enum { HEADER_BYTES = 35, RECORD_BYTES = 13, FRAME_HEAD = 3, MOST_BYTES = 1 << 20 };
enum { NOTHING, BYTES, FRAME, PRESS, RELEASE, SHUT, OPEN, RESET, MISS, COUNTERS };

static uint8_t data[MOST_BYTES];

static void fail(const char *why)
{
    fprintf(stderr, "script: %s\n", why);
    exit(2);
}

/* -- what the device sends ------------------------------------------------------------------------------------------------ */

static void write_record(uint64_t time_us, uint8_t kind, const uint8_t *bytes, size_t n)
{
    uint8_t head[RECORD_BYTES];
    uint8_t *end = vl_put(head, time_us, 8);
    end = vl_put(end, kind, 1);
    vl_put(end, n, 4);
    if (fwrite(head, 1, sizeof head, stdout) != sizeof head || fwrite(bytes, 1, n, stdout) != n)
        fail("standard output takes nothing more");
}

void bench_sent_bytes(uint64_t time_us, const uint8_t *bytes, size_t n)
{
    write_record(time_us, BYTES, bytes, n);
}

void bench_sent_frame(uint64_t time_us, const struct vl_frame *frame)
{
    uint8_t record[FRAME_HEAD + sizeof frame->data];
    vl_put(record, frame->identifier, 2);
    record[2] = frame->fd;
    memcpy(record + FRAME_HEAD, frame->data, frame->length);
    write_record(time_us, FRAME, record, FRAME_HEAD + (size_t)frame->length);
}

void bench_output(uint64_t time_us, int32_t count)
{
    (void)time_us, (void)count; /* channel 0 reads it */
}

static void write_counters(uint64_t time_us)
{
    const uint32_t *counters = (const uint32_t *)&vl_counters;
    uint8_t bytes[sizeof vl_counters], *end = bytes;
    for (size_t i = 0; i < sizeof vl_counters / sizeof *counters; i++)
        end = vl_put(end, counters[i], 4);
    write_record(time_us, COUNTERS, bytes, sizeof bytes);
}

/* -- the script ----------------------------------------------------------------------------------------------------------- */

static uint64_t begin(void)
{
    uint8_t head[HEADER_BYTES];
    if (fread(head, 1, sizeof head, stdin) != sizeof head)
        fail("no header");
    struct bench_choice choice = {
        .wire = head[0],
        .n_channels = head[1],
        .bits = head[2],
        .node = head[3],
        .simulated = head[4],
        .lockstep = head[5],
        .defect = head[6],
        .lowest_rate_mhz = vl_u32(head + 7),
        .highest_rate_mhz = vl_u32(head + 11),
        .shortest_watchdog_us = vl_u32(head + 15),
        .longest_watchdog_us = vl_u32(head + 19),
        .boot = vl_u32(head + 23),
    };
    uint64_t time_us = vl_u64(head + 27);
    if (!bench_begin(&choice, time_us))
        fail("the description is refused");
    return time_us;
}

static void take_frame(size_t n)
{
    struct vl_frame frame = {.identifier = (uint16_t)(data[0] | data[1] << 8), .fd = data[2]};
    if (n < FRAME_HEAD || n > FRAME_HEAD + sizeof frame.data)
        fail("a frame of a length that no frame has");
    frame.length = (uint8_t)(n - FRAME_HEAD);
    memcpy(frame.data, data + FRAME_HEAD, frame.length);
    bench_frame(&frame);
}

static void act(uint8_t kind, size_t n)
{
    switch (kind) {
    case NOTHING: bench_serve(); break;
    case BYTES: bench_bytes(data, n); break;
    case FRAME: take_frame(n); break;
    case PRESS:
    case RELEASE: bench_press(kind == PRESS, true); break;
    case SHUT:
    case OPEN: bench_open(kind == OPEN); break;
    case RESET: bench_reset(); break;
    case MISS: bench_miss(); break;
    default: fail("a record of an unknown kind");
    }
}

int main(void)
{
    uint64_t time_us = begin();
    uint8_t head[RECORD_BYTES];
    while (fread(head, 1, sizeof head, stdin) == sizeof head) {
        uint32_t n = vl_u32(head + 9);
        if (n > sizeof data || fread(data, 1, n, stdin) != n)
            fail("a record is cut short");
        time_us = vl_u64(head);
        bench_pass(time_us);
        act(head[8], n);
    }
    write_counters(time_us);
    return fflush(stdout) ? 1 : 0;
}
