/* Messages as frames on a CAN bus, classical and FD: identifiers, sequence numbers, and blocks put together from frames that may be
 * lost, doubled or swapped. */

#include "can.h"

#include <string.h>

#include "bytes.h"
#include "rows.h"

enum { STOP_ID = 0x000, BEAT_ID = 0x010, REQUEST_ID = 0x020, ANSWER_ID = 0x030, INDEX_ID = 0x040, PERIOD_ID = 0x050, READBACK_ID = 0x060, OUTPUT_ID = 0x100, SAMPLES_ID = 0x300 };
enum { FUNCTION = 16, NODE_MASK = 0x00F, HIGHEST_ID = 0x7FF, HIGHEST_NODE = 15 };
enum { COMMAND_SIZE = 8, INDEX_SIZE = 4, PERIOD_SIZE = 8, FD_HEADER = 2, COUNT_BYTES = 2, READBACK_HEAD = 2, CLASSICAL_READBACK = 3 };
enum { CONTROL_US = 100000, SHORTEST_EXPIRY_US = 5000, MOST_DROPPED = 255, FRAMES_AT_A_TIME = 16 };

static struct vl_can_shape shape;

/* One direction's frames, for blocks of the size agreed on. */
struct stream {
    uint32_t rows;   /* of a group */
    uint32_t groups; /* of a block */
    uint32_t wrap;   /* sequence numbers, a multiple of `groups` */
};

static struct stream sent, received;

static struct stream stream_of(uint32_t rows, uint32_t wrap)
{
    uint32_t groups = (vl_in_force.block + rows - 1) / rows;
    return (struct stream){.rows = rows, .groups = groups, .wrap = wrap - wrap % groups};
}

static uint32_t rows_of(const struct stream *stream, uint32_t group)
{
    uint32_t before = group * stream->rows;
    return vl_in_force.block - before < stream->rows ? vl_in_force.block - before : stream->rows;
}

static uint16_t identifier(uint32_t base, uint32_t number)
{
    return (uint16_t)(base + FUNCTION * number + vl_about->node);
}

/* -- sending ---------------------------------------------------------------------------------------------------------------- */

static struct vl_frame control;         /* an answer or a heartbeat, before all else */
static bool has_control;
static const struct vl_samples *block;  /* under way; NULL: none */
static uint32_t read_back;              /* outputs of it that were read back */
static uint32_t group, part;            /* of its next frame */
static uint32_t sequence;               /* of its next group */
static uint64_t expires_us;
static bool was_given_up;
static uint8_t flags_told;              /* flags of the last heartbeat */
static uint64_t told_group;             /* group whose index the host was told last */
static bool was_told;

static void put_heartbeat(uint8_t flags, uint32_t samples, uint32_t dropped)
{
    control = (struct vl_frame){.identifier = identifier(BEAT_ID, 0), .length = 8};
    uint8_t most = dropped < MOST_DROPPED ? (uint8_t)dropped : MOST_DROPPED;
    uint8_t head[4] = {(uint8_t)vl_state(), flags, (uint8_t)vl_boot, most};
    memcpy(control.data, head, sizeof head);
    vl_put(control.data + 4, samples, 4);
    flags_told = flags;
    has_control = true;
}

static void send_heartbeat(const struct vl_heartbeat *beat)
{
    put_heartbeat(beat->flags, beat->samples, beat->dropped);
    control.data[0] = beat->state;
    expires_us = board_clock_us() + CONTROL_US;
}

static void send_answer(const struct vl_command *answer)
{
    control = (struct vl_frame){.identifier = identifier(ANSWER_ID, 0), .length = COMMAND_SIZE};
    uint8_t head[4] = {answer->number, answer->code, answer->parameter, answer->item};
    memcpy(control.data, head, sizeof head);
    vl_put(control.data + 4, answer->value, 4);
    has_control = true;
    expires_us = board_clock_us() + CONTROL_US;
}

/* How long a block may wait for the bus: its own duration. */
static uint64_t patience_us(void)
{
    uint64_t block_us = (uint64_t)vl_in_force.block * 1000000000 / vl_in_force.rate_mhz;
    return block_us > SHORTEST_EXPIRY_US ? block_us : SHORTEST_EXPIRY_US;
}

/* Before a block that would end more than half the sequence numbers after the last index, the host is told its index. */
static void send_samples(const struct vl_samples *samples)
{
    was_given_up = false;
    block = samples;
    if (vl_has_loop()) {
        vl_can_send_rows(samples);
        return;
    }
    uint64_t first_group = samples->first / vl_in_force.block * sent.groups;
    bool must_tell = !was_told || first_group + sent.groups - told_group > sent.wrap / 2;
    if (must_tell || (!shape.fd && samples->flags != flags_told)) {
        put_heartbeat(samples->flags, (uint32_t)samples->first, samples->dropped);
        told_group = first_group;
        was_told = true;
    }
    read_back = samples->put_out ? 0 : vl_in_force.block;
    group = part = 0;
    sequence = (uint32_t)(first_group % sent.wrap);
    expires_us = board_clock_us() + patience_us();
}

static uint8_t *put_rows(uint8_t *into, uint32_t first_channel, uint32_t width)
{
    for (uint32_t row = 0; row < rows_of(&sent, group); row++) {
        const uint8_t *counts = block->counts
                                + ((group * sent.rows + row) * shape.n_channels + first_channel) * COUNT_BYTES;
        memcpy(into, counts, width * COUNT_BYTES);
        into += width * COUNT_BYTES;
    }
    return into;
}

/* Outputs of the next frame of what was put out. */
static uint32_t outputs_read_back(void)
{
    const uint32_t most = shape.fd ? FD_COUNTS : CLASSICAL_READBACK, left = vl_in_force.block - read_back;
    return left < most ? left : most;
}

static void make_readback(struct vl_frame *frame)
{
    const uint32_t n_bytes = outputs_read_back() * COUNT_BYTES;
    memset(frame, 0, sizeof *frame);
    vl_put(frame->data, block->first + read_back, READBACK_HEAD);
    memcpy(frame->data + READBACK_HEAD, block->put_out + read_back * COUNT_BYTES, n_bytes);
    frame->fd = shape.fd;
    frame->length = shape.fd ? vl_can_padded(READBACK_HEAD + n_bytes) : 8;
    frame->identifier = identifier(READBACK_ID, 0);
}

static void make_samples(struct vl_frame *frame)
{
    uint32_t first_channel = part * shape.channels, rest = shape.n_channels - first_channel;
    memset(frame, 0, sizeof *frame);
    uint8_t *into = frame->data;
    if (shape.fd) {
        *into++ = (uint8_t)sequence;
        *into++ = block->flags;
    }
    into = put_rows(into, first_channel, rest < shape.channels ? rest : shape.channels);
    frame->fd = shape.fd;
    frame->length = vl_can_padded((uint32_t)(into - frame->data));
    frame->identifier = identifier(SAMPLES_ID, shape.fd ? part : sequence * shape.parts + part);
}

static void make_frame(struct vl_frame *frame)
{
    if (vl_has_loop())
        vl_can_frame_of_rows(frame);
    else if (read_back < vl_in_force.block)
        make_readback(frame);
    else
        make_samples(frame);
}

static void next_frame(void)
{
    if (vl_has_loop()) {
        if (!vl_can_next_of_rows())
            block = NULL;
        return;
    }
    if (read_back < vl_in_force.block) {
        read_back += outputs_read_back();
        return;
    }
    if (++part < shape.parts)
        return;
    part = 0;
    sequence++; /* within a block it never comes to the wrap */
    if (++group == sent.groups)
        block = NULL;
}

/* Send what the bus takes. What has expired is given up; rows of the loop on the device are never out of date. */
static bool is_idle(void)
{
    struct vl_frame frame;
    while (has_control || block) {
        if (has_control)
            frame = control;
        else
            make_frame(&frame);
        if (!board_send_frame(&frame)) {
            if (board_clock_us() < expires_us || (block && vl_has_loop()))
                return false;
            was_given_up = block != NULL;
            block = NULL;
            has_control = false;
        } else if (has_control) {
            has_control = false;
        } else {
            next_frame();
        }
    }
    return true;
}

static bool has_expired(void)
{
    return was_given_up;
}

/* -- receiving -------------------------------------------------------------------------------------------------------------- */

enum { OPEN_BLOCKS = 4 };             /* blocks that frames may belong to: the newest and those right before it */
enum { NONE = -1 };
enum { MOST_GROUPS = FD_WRAP / 2 };   /* frames of a block of outputs */

struct open {
    bool is_used, is_spoilt;
    int64_t number;
    uint32_t missing;
    bool seen[MOST_GROUPS];
    uint8_t counts[VL_LARGEST_BLOCK * COUNT_BYTES];
};

static struct open opened[OPEN_BLOCKS];
static int64_t oldest;                /* the first block that may still come */
static int64_t early;                 /* one that has come before the one right before it; NONE: there is no such block */
static int64_t next_group;            /* the one after the newest */
static bool has_mark;
static int64_t mark;                  /* a group that OutputIndex has told of, half the sequence numbers ahead or more */
static uint32_t period, ramp;         /* as OutputPeriod has told them, */
static uint64_t told_first;           /* of the block from this sample on, */
static bool is_told_anew;             /* which is the next one */
static bool is_configured;

/* Give up blocks before one. */
static void give_up_before(int64_t number)
{
    if (number > oldest)
        oldest = number;
    for (uint32_t i = 0; i < OPEN_BLOCKS; i++) {
        if (opened[i].is_used && opened[i].number < oldest) {
            opened[i].is_used = false;
            vl_counters.incomplete_blocks++;
        }
    }
}

/* An index is told modulo 2^32: take the one nearest to where the stream is. */
static void take_index(uint32_t first)
{
    int64_t n = vl_in_force.block, here = next_group / received.groups * n;
    int64_t sample = here + (int32_t)(first - (uint32_t)here);
    int64_t told = sample >= 0 ? sample / n * received.groups : -1;
    has_mark = sample >= 0 && sample % n == 0 && told - next_group >= (int64_t)(received.wrap / 2);
    mark = told;
}

/* The group that a sequence number stands for: the nearest ahead of the newest if less than half of the numbers away, else one
 * behind; negative before the first. */
static int64_t group_of(uint32_t number)
{
    bool is_marked = has_mark && number == mark % received.wrap;
    int64_t base = is_marked ? mark : next_group, wrap = received.wrap;
    int64_t ahead = (number % wrap - base % wrap + wrap) % wrap;
    return base + ahead - (ahead >= wrap / 2 ? wrap : 0);
}

static struct open *find(int64_t number)
{
    for (uint32_t i = 0; i < OPEN_BLOCKS; i++)
        if (opened[i].is_used && opened[i].number == number)
            return &opened[i];
    return NULL;
}

/* Open a block. There is room: older blocks than the OPEN_BLOCKS newest have been given up. */
static struct open *open_block(int64_t number)
{
    struct open *block_opened = opened;
    while (block_opened->is_used)
        block_opened++;
    memset(block_opened, 0, sizeof *block_opened);
    block_opened->is_used = true;
    block_opened->number = number;
    block_opened->missing = received.groups;
    return block_opened;
}

/* The outputs of a block with what it is the last of. A ramp that is over leaves nothing to go on with. */
static void take_block(uint64_t first, const uint8_t *counts)
{
    if (is_told_anew)
        told_first = first;
    is_told_anew = false;
    const uint64_t passed = first > told_first ? first - told_first : 0;
    if (ramp == 0)
        vl_take_output(first, counts, period, 0);
    else if (passed < ramp)
        vl_take_output(first, counts, period, (uint32_t)(ramp - passed));
    else
        vl_take_output(first, counts, 0, 0);
}

/* Once a block is whole, the one right before it may still come, and none before that. */
static void hand_over(int64_t number, const uint8_t *counts)
{
    int64_t before = number - 1;
    if (before < oldest || before == early)
        before = number + 1 == early ? number + 2 : number + 1;
    early = before < number ? number : NONE;
    give_up_before(before);
    take_block((uint64_t)number * vl_in_force.block, counts);
}

static void add_to_block(int64_t number, uint32_t place, const uint8_t *counts, uint32_t n_bytes)
{
    struct open *into = find(number);
    if (!into)
        into = open_block(number);
    uint8_t *at = into->counts + place * received.rows * COUNT_BYTES;
    if (into->seen[place]) {
        vl_counters.repeated_frames++;
        into->is_spoilt = into->is_spoilt || memcmp(at, counts, n_bytes) != 0; /* either may be wrong */
        return;
    }
    into->seen[place] = true;
    memcpy(at, counts, n_bytes);
    if (--into->missing || into->is_spoilt)
        return;
    into->is_used = false;
    hand_over(number, into->counts);
}

static void take_group(int64_t taken, const uint8_t *counts, uint32_t n_bytes)
{
    if (has_mark && taken == mark) {
        vl_counters.resynchronised++;
        give_up_before(mark / received.groups);
    }
    has_mark = false;
    int64_t number = taken < 0 ? -1 : taken / received.groups;
    if (taken >= next_group) {
        next_group = taken + 1;
        give_up_before(number - OPEN_BLOCKS + 1);
    }
    if (number < oldest || number == early) {
        vl_counters.repeated_frames++;
    } else if (received.groups == 1) {
        hand_over(number, counts);
    } else {
        add_to_block(number, (uint32_t)(taken % received.groups), counts, n_bytes);
    }
}

static void take_outputs(const struct vl_frame *frame, uint32_t number)
{
    uint32_t header = shape.fd ? FD_HEADER : 0;
    if (frame->fd != shape.fd || frame->length < header) {
        vl_counters.damaged_frames++;
        return;
    }
    int64_t taken = group_of(shape.fd ? frame->data[0] : number), groups = received.groups;
    uint32_t place = (uint32_t)((taken % groups + groups) % groups);
    uint32_t n_bytes = rows_of(&received, place) * COUNT_BYTES;
    if (frame->length != (shape.fd ? vl_can_padded(header + n_bytes) : n_bytes))
        vl_counters.damaged_frames++;
    else
        take_group(taken, frame->data + header, n_bytes);
}

static void take_command(const struct vl_frame *frame)
{
    const uint8_t *data = frame->data;
    struct vl_command request = {data[0], data[1], data[2], data[3], vl_u32(data + 4)};
    if (frame->length == COMMAND_SIZE)
        vl_take_request(&request);
    else
        vl_counters.damaged_frames++;
}

static void take_output_index(const struct vl_frame *frame)
{
    if (frame->length != INDEX_SIZE)
        vl_counters.damaged_frames++;
    else if (is_configured)
        take_index(vl_u32(frame->data));
}

static void take_period(const struct vl_frame *frame)
{
    if (frame->length != PERIOD_SIZE) {
        vl_counters.damaged_frames++;
        return;
    }
    period = vl_u32(frame->data);
    ramp = vl_u32(frame->data + 4);
    is_told_anew = true;
}

static void take(const struct vl_frame *frame)
{
    uint32_t function = frame->identifier & ~(uint32_t)NODE_MASK, outputs = shape.fd ? 1 : CLASSICAL_OUTPUTS;
    if (frame->identifier == STOP_ID)
        vl_take_emergency_stop(); /* of any length: a false stop is safer than a missed one */
    else if ((frame->identifier & NODE_MASK) != vl_about->node)
        vl_counters.foreign_frames++;
    else if (function == REQUEST_ID)
        take_command(frame);
    else if (function == INDEX_ID)
        take_output_index(frame);
    else if (is_configured && vl_in_force.version > 1 && function == PERIOD_ID)
        take_period(frame);
    else if (shape.fd && vl_settings.version > VL_LOWEST_VERSION && function == VL_CAN_RECORD_ID)
        vl_counters.malformed += vl_can_take_record(frame) ? 0 : 1;
    else if (is_configured && function >= OUTPUT_ID && function < OUTPUT_ID + FUNCTION * outputs)
        take_outputs(frame, (function - OUTPUT_ID) / FUNCTION);
    else
        vl_counters.foreign_frames++;
}

static void receive(void)
{
    struct vl_frame frame;
    for (int i = 0; i < FRAMES_AT_A_TIME && board_receive_frame(&frame); i++)
        take(&frame);
}

/* -- the wire ---------------------------------------------------------------------------------------------------------------- */

static bool fits(const struct vl_description *about, uint32_t most_channels)
{
    return about->bits == 16 && about->n_channels <= most_channels && about->node <= HIGHEST_NODE;
}

static bool classical_fits(const struct vl_description *about)
{
    return fits(about, 4 * CLASSICAL_CHANNELS);
}

static bool fd_fits(const struct vl_description *about)
{
    return fits(about, FD_COUNTS);
}

/* Half of the sequence numbers, so that a missing frame can be told from a repeated one; rows are bounded by their payload. */
static uint32_t largest_block(void)
{
    if (vl_settings.loop)
        return (VL_LARGEST_PAYLOAD - VL_ROWS_HEAD) / vl_row_bytes(&vl_settings);
    uint32_t samples = shape.wrap / 2 * shape.rows, outputs = shape.output_wrap / 2 * shape.output_rows;
    return samples < outputs ? samples : outputs;
}

static uint32_t layout_crc(uint32_t version)
{
    return vl_can_layout_crc(&shape, version);
}

static void begin_with(bool fd)
{
    shape = vl_can_shape(vl_about->n_channels, fd);
    is_configured = has_control = was_given_up = false;
    block = NULL;
    flags_told = 0;
}

static void begin_classical(void)
{
    begin_with(false);
}

static void begin_fd(void)
{
    begin_with(true);
}

static void configure(void)
{
    sent = stream_of(shape.rows, shape.wrap);
    received = stream_of(shape.output_rows, shape.output_wrap);
    block = NULL;
    was_told = has_mark = was_given_up = false;
    for (uint32_t i = 0; i < OPEN_BLOCKS; i++)
        opened[i].is_used = false;
    oldest = vl_in_force.queue;
    early = NONE;
    next_group = oldest * received.groups;
    period = ramp = 0;
    is_told_anew = false;
    told_first = 0;
    is_configured = true;
}

const struct vl_wire vl_can = {
    .fits = classical_fits,
    .largest_block = largest_block,
    .layout_crc = layout_crc,
    .begin = begin_classical,
    .configure = configure,
    .receive = receive,
    .is_idle = is_idle,
    .has_expired = has_expired,
    .send_answer = send_answer,
    .send_heartbeat = send_heartbeat,
    .send_samples = send_samples,
};

const struct vl_wire vl_can_fd = {
    .fits = fd_fits,
    .largest_block = largest_block,
    .layout_crc = layout_crc,
    .begin = begin_fd,
    .configure = configure,
    .receive = receive,
    .is_idle = is_idle,
    .has_expired = has_expired,
    .send_answer = send_answer,
    .send_heartbeat = send_heartbeat,
    .send_samples = send_samples,
    .carries_rows = true,
};
