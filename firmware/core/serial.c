/* Messages as frames on a serial line: a payload with its CRC-32 behind it, COBS, and a zero. */

#include "bytes.h"
#include "device.h"
#include "rows.h"

enum { REQUEST = 1, ANSWER, SAMPLES, OUTPUT, HEARTBEAT, EMERGENCY_STOP, READBACK, RECORD };
enum { RECORD_HEAD = 12, MOST_OF_RECORD = 512 };
enum { HEADER = VL_PAYLOAD_HEAD, COMMAND_SIZE = 12, SAMPLES_HEAD = VL_ROWS_HEAD, READBACK_HEAD = 12, STOP_SIZE = 5, CRC_SIZE = 4 };
enum { FIRST_OUTPUT_HEAD = 12, OUTPUT_HEAD = 20 }; /* in version 1, and since then with the period and the ramp */
enum { AT_A_TIME = 128 }; /* bytes read at a call */

/* -- sending ---------------------------------------------------------------------------------------------------------------- */

/* The largest payload that a block fills, at most that of the protocol, and its frame. */
enum {
    OF_THE_MEMORY = SAMPLES_HEAD + VL_SAMPLE_BYTES / 2,
    MOST_SENT = OF_THE_MEMORY < VL_LARGEST_PAYLOAD ? OF_THE_MEMORY : VL_LARGEST_PAYLOAD,
    LONGEST_FRAME = 1 + MOST_SENT + CRC_SIZE + (MOST_SENT + CRC_SIZE) / 254 + 2
};

static uint8_t line[LONGEST_FRAME] VL_BULK;
static size_t n_line, n_sent; /* bytes of the frame, and those that the line has taken */
static size_t code_at;        /* where the length of the present piece goes */
static bool was_cut;          /* the piece before had 254 bytes, so that the present one may be left out */
static uint32_t crc;
static const struct vl_samples *next; /* to be sent after what was put out, or after the loop's state; NULL: none */

static void end_piece(void)
{
    line[code_at] = (uint8_t)(n_line - code_at);
    code_at = n_line++;
}

static void stuff(const uint8_t *bytes, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        was_cut = false;
        if (bytes[i])
            line[n_line++] = bytes[i];
        if (!bytes[i]) {
            end_piece();
        } else if (n_line - code_at == 255) {
            end_piece();
            was_cut = true;
        }
    }
}

static void put(const uint8_t *bytes, size_t n)
{
    crc = vl_crc32(crc, bytes, n);
    stuff(bytes, n);
}

/* A zero before what is no part of a stream ends a false frame that noise on an idle line may have begun. */
static void begin_frame(uint8_t type, uint16_t number)
{
    n_line = n_sent = 0;
    if (type == ANSWER || type == HEARTBEAT)
        line[n_line++] = 0;
    code_at = n_line++;
    was_cut = false;
    crc = VL_CRC_START;
    uint8_t header[HEADER] = {(uint8_t)vl_settings.version, type, (uint8_t)number, (uint8_t)(number >> 8)};
    put(header, sizeof header);
}

static void end_frame(void)
{
    uint8_t bytes[CRC_SIZE];
    vl_put(bytes, crc, CRC_SIZE);
    stuff(bytes, sizeof bytes);
    if (was_cut)
        n_line--;
    else
        line[code_at] = (uint8_t)(n_line - code_at);
    line[n_line++] = 0;
}

static void send_answer(const struct vl_command *answer)
{
    uint8_t body[COMMAND_SIZE - HEADER] = {answer->number, answer->code, answer->parameter, answer->item};
    vl_put(body + 4, answer->value, 4);
    begin_frame(ANSWER, 0);
    put(body, sizeof body);
    end_frame();
}

static void send_heartbeat(const struct vl_heartbeat *beat)
{
    uint8_t body[12] = {beat->state, beat->boot, beat->flags, 0};
    vl_put(vl_put(body + 4, beat->dropped, 4), beat->samples, 4);
    begin_frame(HEARTBEAT, 0);
    put(body, sizeof body);
    end_frame();
}

static uint16_t block_number(const struct vl_samples *samples)
{
    return (uint16_t)(samples->first / vl_in_force.block);
}

static void put_samples(const struct vl_samples *samples)
{
    uint8_t head[SAMPLES_HEAD - HEADER] = {0};
    vl_put(vl_put(vl_put(head, samples->first, 8), samples->clock_us, 8), samples->dropped, 4);
    head[20] = samples->flags;
    begin_frame(vl_has_loop() ? VL_ROWS : SAMPLES, block_number(samples));
    put(head, sizeof head);
    put(samples->counts, vl_in_force.block * vl_row_bytes(&vl_in_force));
    end_frame();
}

static void put_state(const struct vl_samples *samples)
{
    begin_frame(VL_STATE, block_number(samples));
    put(samples->state, samples->state_bytes);
    end_frame();
}

static void put_readback(const struct vl_samples *samples)
{
    uint8_t head[READBACK_HEAD - HEADER];
    vl_put(head, samples->first, 8);
    begin_frame(READBACK, block_number(samples));
    put(head, sizeof head);
    put(samples->put_out, vl_in_force.block * vl_count_bytes());
    end_frame();
}

static void send_samples(const struct vl_samples *samples)
{
    next = samples->put_out || samples->state_bytes ? samples : NULL;
    if (samples->state_bytes)
        put_state(samples);
    else if (next)
        put_readback(samples);
    else
        put_samples(samples);
}

static bool is_idle(void)
{
    if (n_sent < n_line)
        n_sent += board_write(line + n_sent, n_line - n_sent);
    if (n_sent == n_line && next) {
        put_samples(next);
        next = NULL;
        n_sent = board_write(line, n_line);
    }
    return n_sent == n_line;
}

/* -- receiving -------------------------------------------------------------------------------------------------------------- */

enum {
    OF_OUTPUTS = OUTPUT_HEAD + VL_LARGEST_BLOCK * VL_MOST_COUNT_BYTES,
    OF_RECORD = RECORD_HEAD + MOST_OF_RECORD,
    MOST_RECEIVED = (OF_OUTPUTS > OF_RECORD ? OF_OUTPUTS : OF_RECORD) + CRC_SIZE
};

static uint8_t payload[MOST_RECEIVED + 1];
static size_t n_payload;
static uint8_t code, left;   /* of the present piece: its first byte, and how many of its bytes are still to come */
static bool is_skipping;     /* the frame is longer than any that is expected */
static size_t output_size;   /* 0 before the first START: no output is understood */

static void forget_frame(void)
{
    n_payload = 0;
    code = left = 0;
    is_skipping = false;
}

static void add(uint8_t byte)
{
    if (n_payload == sizeof payload)
        is_skipping = true;
    else
        payload[n_payload++] = byte;
}

/* A byte that is not zero. */
static void unstuff(uint8_t byte)
{
    if (left) {
        add(byte);
        left--;
        return;
    }
    if (code && code < 255)
        add(0); /* every shorter piece but the last stands before a zero */
    code = byte;
    left = (uint8_t)(byte - 1);
}

static bool is_intact(void)
{
    return !left && n_payload >= CRC_SIZE
           && vl_crc32(VL_CRC_START, payload, n_payload - CRC_SIZE) == vl_u32(payload + n_payload - CRC_SIZE);
}

static void take_command(void)
{
    struct vl_command request = {payload[4], payload[5], payload[6], payload[7], vl_u32(payload + 8)};
    vl_take_request(&request);
}

static void take_output(uint8_t version)
{
    const uint64_t first = vl_u64(payload + 4);
    if (version == 1)
        vl_take_output(first, payload + FIRST_OUTPUT_HEAD, 0, 0);
    else
        vl_take_output(first, payload + OUTPUT_HEAD, vl_u32(payload + 12), vl_u32(payload + 16));
}

/* A piece of the records of the loop on the device. */
static bool take_record(size_t size)
{
    return !vl_is_sampling() && size > RECORD_HEAD && size <= RECORD_HEAD + MOST_OF_RECORD
           && vl_take_record(payload[4], vl_u32(payload + 8), payload + RECORD_HEAD, (uint32_t)(size - RECORD_HEAD));
}

static void take_message(size_t size)
{
    uint8_t version = payload[0], type = payload[1];
    if (type == REQUEST && size == COMMAND_SIZE)
        take_command();
    else if (type == EMERGENCY_STOP && size == STOP_SIZE)
        vl_take_emergency_stop();
    else if (type == OUTPUT && version == vl_settings.version && output_size && size == output_size)
        take_output(version);
    else if (type != RECORD || version == VL_LOWEST_VERSION || version != vl_settings.version || !take_record(size))
        vl_counters.malformed++;
}

static void end_of_frame(void)
{
    if (is_skipping)
        vl_counters.oversize_frames++;
    else if (code && !is_intact())
        vl_counters.damaged_frames++;
    else if (code && n_payload >= HEADER + CRC_SIZE)
        take_message(n_payload - CRC_SIZE);
    else if (code)
        vl_counters.malformed++;
    forget_frame();
}

static void receive(void)
{
    uint8_t bytes[AT_A_TIME];
    size_t n = board_read(bytes, sizeof bytes);
    for (size_t i = 0; i < n; i++) {
        if (!bytes[i])
            end_of_frame();
        else if (!is_skipping)
            unstuff(bytes[i]);
    }
}

/* -- the wire ---------------------------------------------------------------------------------------------------------------- */

static bool fits(const struct vl_description *about)
{
    return about->n_channels * about->bits / 8 <= MOST_SENT - SAMPLES_HEAD;
}

static uint32_t largest_block(void)
{
    return (MOST_SENT - SAMPLES_HEAD) / vl_row_bytes(&vl_settings);
}

static uint32_t layout_crc(uint32_t version)
{
    (void)version;
    return 0;
}

static void begin(void)
{
    n_line = n_sent = 0;
    next = NULL;
    output_size = 0;
    forget_frame();
}

static void configure(void)
{
    next = NULL;
    output_size = (vl_in_force.version == 1 ? FIRST_OUTPUT_HEAD : OUTPUT_HEAD) + vl_in_force.block * vl_count_bytes();
}

static bool has_expired(void)
{
    return false;
}

const struct vl_wire vl_serial = {
    .fits = fits,
    .largest_block = largest_block,
    .layout_crc = layout_crc,
    .begin = begin,
    .configure = configure,
    .receive = receive,
    .is_idle = is_idle,
    .has_expired = has_expired,
    .send_answer = send_answer,
    .send_heartbeat = send_heartbeat,
    .send_samples = send_samples,
    .carries_rows = true,
};
