/* What a loop on the device tells and takes over CAN FD: the payloads that a serial line has too, State and Rows, cut into frames, and
 * pieces of the records, each a frame of its own. */

#include "can.h"

#include <string.h>

#include "bytes.h"
#include "rows.h"

enum { PLACE_SIZE = 2, PART_BYTES = 62, PART_BITS = 11, LENGTH_SIZE = 4, CRC_SIZE = 4, RECORD_HEAD = 8, RECORD_BYTES = 56 };
_Static_assert((VL_LARGEST_PAYLOAD + LENGTH_SIZE + CRC_SIZE) / PART_BYTES < 1 << PART_BITS, "a part's number needs more bits");

/* A message under way: its length, its payload, and the payload's CRC. */
static const struct vl_samples *block; /* NULL: there is none */
static bool is_state;                  /* its state is under way; then come its rows */
static uint32_t number;                /* of the next message, modulo 32 in a frame */
static uint8_t head[LENGTH_SIZE + VL_ROWS_HEAD], tail[CRC_SIZE];
static uint32_t n_head, n_body;
static uint32_t part, parts;

static const uint8_t *body(void)
{
    return is_state ? block->state : block->counts;
}

static void begin_message(void)
{
    n_head = LENGTH_SIZE + (is_state ? vl_put_state_head(head + LENGTH_SIZE, block) : vl_put_rows_head(head + LENGTH_SIZE, block));
    n_body = is_state ? block->state_bytes : vl_in_force.block * vl_row_bytes(&vl_in_force);
    const uint32_t payload = n_head - LENGTH_SIZE + n_body;
    vl_put(head, payload, LENGTH_SIZE);
    const uint32_t crc = vl_crc32(VL_CRC_START, head + LENGTH_SIZE, n_head - LENGTH_SIZE);
    vl_put(tail, vl_crc32(crc, body(), n_body), CRC_SIZE);
    part = 0;
    parts = (LENGTH_SIZE + payload + CRC_SIZE + PART_BYTES - 1) / PART_BYTES;
}

void vl_can_send_rows(const struct vl_samples *samples)
{
    block = samples;
    is_state = samples->state_bytes > 0;
    begin_message();
}

bool vl_can_next_of_rows(void)
{
    if (++part < parts)
        return true;
    number++;
    if (!is_state)
        return false;
    is_state = false;
    begin_message();
    return true;
}

/* Bytes of the message from `at` on, as far as they lie in one of its pieces. */
static uint32_t copy_of_piece(uint8_t *into, uint32_t at, uint32_t most)
{
    const uint8_t *from;
    uint32_t left;
    if (at < n_head) {
        from = head + at;
        left = n_head - at;
    } else if (at >= n_head + n_body) {
        from = tail + (at - n_head - n_body);
        left = n_head + n_body + CRC_SIZE - at;
    } else {
        from = body() + (at - n_head);
        left = n_head + n_body - at;
    }
    const uint32_t n = left < most ? left : most;
    memcpy(into, from, n);
    return n;
}

void vl_can_frame_of_rows(struct vl_frame *frame)
{
    const uint32_t whole = n_head + n_body + CRC_SIZE, first = part * PART_BYTES;
    const uint32_t last = first + PART_BYTES < whole ? first + PART_BYTES : whole;
    memset(frame, 0, sizeof *frame);
    vl_put(frame->data, number << PART_BITS | part, PLACE_SIZE);
    for (uint32_t at = first; at < last;)
        at += copy_of_piece(frame->data + PLACE_SIZE + (at - first), at, last - at);
    frame->fd = true;
    frame->length = vl_can_padded(PLACE_SIZE + (last - first));
    frame->identifier = (uint16_t)((is_state ? VL_CAN_STATE_ID : VL_CAN_ROWS_ID) + vl_about->node);
}

/* A piece of the records; false if it is none that can be taken. */
bool vl_can_take_record(const struct vl_frame *frame)
{
    const uint32_t n = frame->data[1];
    return frame->fd && n > 0 && n <= RECORD_BYTES && frame->length == vl_can_padded(RECORD_HEAD + n) && !vl_is_sampling()
           && vl_take_record(frame->data[0], vl_u32(frame->data + 4), frame->data + RECORD_HEAD, n);
}
