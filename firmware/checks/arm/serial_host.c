/* The host on a serial line. */

#include <string.h>

#include "board.h"
#include "host.h"

static uint8_t inbox[512];
static size_t arrived, taken;
static uint32_t blocks, place; /* samples that have come, and bytes of the frame that is coming */
static uint32_t told_period, told_ramp;
enum { VERSION = 2, REQUEST = 1, SAMPLES = 3, OUTPUT = 4 };

static uint32_t crc_of(const uint8_t *bytes, size_t n)
{
    uint32_t crc = UINT32_MAX;
    for (size_t i = 0; i < n; i++) {
        crc ^= bytes[i];
        for (int bit = 0; bit < 8; bit++)
            crc = crc & 1 ? crc >> 1 ^ 0xEDB88320u : crc >> 1;
    }
    return ~crc;
}

/* Frames of less than 254 bytes. */
static void send(uint8_t *payload, size_t n)
{
    uint32_t crc = crc_of(payload, n);
    for (int i = 0; i < 4; i++)
        payload[n++] = (uint8_t)(crc >> 8 * i);
    if (taken == arrived)
        taken = arrived = 0;
    uint8_t *code = inbox + arrived++;
    *code = 1;
    for (size_t i = 0; i < n; i++) {
        if (payload[i] == 0) {
            code = inbox + arrived;
            *code = 0;
        } else {
            inbox[arrived] = payload[i];
        }
        arrived++;
        ++*code;
    }
    inbox[arrived++] = 0;
}

static size_t put(uint8_t *bytes, uint32_t value, size_t n)
{
    for (size_t i = 0; i < n; i++)
        bytes[i] = (uint8_t)(value >> 8 * i);
    return n;
}

void host_asks(uint8_t command, uint8_t parameter, uint32_t value)
{
    static uint8_t number;
    uint8_t payload[16] = {VERSION, REQUEST, 0, 0, ++number, command, parameter, 0};
    put(payload + 8, value, 4);
    send(payload, 12);
}

void host_sends_outputs(uint32_t first, uint32_t n)
{
    uint8_t payload[64] = {VERSION, OUTPUT};
    size_t size = 4 + put(payload + 4, first, 4) + 4;
    size += put(payload + size, told_period, 4);
    size += put(payload + size, told_ramp, 4);
    put(payload + 2, first / n, 2);
    for (uint32_t i = 0; i < n; i++)
        size += put(payload + size, (first + i) * 37u, 2);
    send(payload, size);
}

void host_tells_period(uint32_t period, uint32_t ramp)
{
    told_period = period;
    told_ramp = ramp;
}

uint32_t host_received_blocks(void)
{
    return blocks;
}

/* -- the board's part ---------------------------------------------------------------------------------------------- */

size_t board_read(uint8_t *bytes, size_t room)
{
    size_t n = arrived - taken < room ? arrived - taken : room;
    memcpy(bytes, inbox + taken, n);
    taken += n;
    return n;
}

/* A frame is the first byte of COBS, version, type and so on. */
size_t board_write(const uint8_t *bytes, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        blocks += place == 2 && bytes[i] == SAMPLES;
        place = bytes[i] == 0 ? 0 : place + 1;
    }
    return n;
}
