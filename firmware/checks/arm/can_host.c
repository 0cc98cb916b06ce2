/* The host on a CAN bus, classical or FD (-DFD=1). */

#include <string.h>

#include "board.h"
#include "host.h"

#ifndef FD
#define FD 0
#endif
enum { NODE = 1, REQUEST = 0x020, OUTPUT_INDEX = 0x040, OUTPUT_PERIOD = 0x050, OUTPUT = 0x100, SAMPLES = 0x300, INBOX = 16 };
enum { COUNTS = FD ? 31 : 4, SEQUENCES = FD ? 256 : 32, ROWS = FD ? 7 : 1 };

static struct vl_frame inbox[INBOX];
static uint32_t arrived, taken;
static uint32_t rows; /* of samples that have come */
static uint32_t block = 1;
static uint32_t announced; /* group of the output that was announced last */

static uint8_t *next_frame(uint32_t identifier, uint32_t length)
{
    struct vl_frame *frame = &inbox[arrived++ % INBOX];
    memset(frame, 0, sizeof *frame);
    frame->identifier = (uint16_t)(identifier + NODE);
    frame->length = (uint8_t)length;
    frame->fd = FD && identifier >= OUTPUT;
    return frame->data;
}

void host_asks(uint8_t command, uint8_t parameter, uint32_t value)
{
    static uint8_t number;
    const uint8_t head[] = {++number, command, parameter, 0};
    uint8_t *data = next_frame(REQUEST, 8);
    memcpy(data, head, 4);
    memcpy(data + 4, &value, 4);
}

static uint32_t padded(uint32_t length)
{
    static const uint8_t LENGTHS[] = {8, 12, 16, 20, 24, 32, 48, 64};
    uint32_t i = 0;
    while (length > 8 && LENGTHS[i] < length)
        i++;
    return length > 8 ? LENGTHS[i] : length;
}

static void send_group(uint32_t sequence, uint32_t first, uint32_t n)
{
    uint8_t *data = FD ? next_frame(OUTPUT, padded(2 + 2 * n)) : next_frame(OUTPUT + 16 * sequence, 2 * n);
    if (FD)
        *data++ = (uint8_t)sequence, data++;
    for (uint32_t i = 0; i < n; i++) {
        const uint16_t count = (uint16_t)((first + i) * 37u);
        memcpy(data + 2 * i, &count, 2);
    }
}

void host_sends_outputs(uint32_t first, uint32_t n)
{
    const uint32_t groups = (n + COUNTS - 1) / COUNTS, numbers = SEQUENCES / groups * groups, group = first / n * groups;
    if (first / n == 2 || group + groups > announced + numbers / 2) {
        memcpy(next_frame(OUTPUT_INDEX, 4), &first, 4);
        announced = group;
    }
    block = n;
    for (uint32_t g = 0; g < groups; g++)
        send_group((group + g) % numbers, first + g * COUNTS, n - g * COUNTS < COUNTS ? n - g * COUNTS : COUNTS);
}

void host_tells_period(uint32_t period, uint32_t ramp)
{
    const uint32_t told[] = {period, ramp};
    memcpy(next_frame(OUTPUT_PERIOD, 8), told, 8);
}

uint32_t host_received_blocks(void)
{
    return rows / block;
}

/* -- the board's part ---------------------------------------------------------------------------------------------- */

bool board_receive_frame(struct vl_frame *frame)
{
    if (taken == arrived)
        return false;
    *frame = inbox[taken++ % INBOX];
    return true;
}

/* Four channels of 16 bits: with FD two bytes before the rows, and zeros behind the last of a block. */
bool board_send_frame(const struct vl_frame *frame)
{
    if (frame->identifier >= SAMPLES) {
        const uint32_t left = block - rows % block;
        rows += left < ROWS ? left : ROWS;
    }
    return true;
}
