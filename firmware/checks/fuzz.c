/* The core under libFuzzer, on the board of the script. An input is a list of short records; most become whole messages here, so
 * that the fuzzer need not find checksums, and others go on the wire as they are. FUZZ_WIRE: 0 serial, 1 CAN, 2 CAN FD.
 *
 * What is checked beside the sanitizers: the output is 0 in every state but ARMED and the watchdog's ramp, and within its range. */

#include <stdlib.h>
#include <string.h>

#include "../boards/script/bench.h"
#include "bytes.h"
#include "can.h"

enum { MOST_INSTANTS = 600, STEP_US = 211, LARGEST_COUNT_16 = 20480 };
enum { REQUEST = 1, OUTPUT = 4, EMERGENCY_STOP = 6 }; /* types of payloads on a serial line */
enum { CLASSICAL_ROWS = 4, CLASSICAL_CYCLE = 32, FD_ROWS = 31, FD_CYCLE = 256 };

static const uint8_t *at, *end;
static uint64_t now_us;
static uint8_t n_channels, bits, node, number;
static uint32_t period, ramp;
static bool range_is_less; /* than what a count can say */

static uint8_t byte(void)
{
    return at < end ? *at++ : 0;
}

static uint32_t four_bytes(void)
{
    uint32_t low = byte();
    low |= (uint32_t)byte() << 8;
    low |= (uint32_t)byte() << 16;
    return low | (uint32_t)byte() << 24;
}

/* In place of can_layout.c. */
uint32_t vl_can_layout_crc(const struct vl_can_shape *shape, uint32_t version)
{
    return shape->n_channels + version;
}

/* -- what the device does ---------------------------------------------------------------------------------------------------- */

void bench_sent_bytes(uint64_t time_us, const uint8_t *bytes, size_t n)
{
    if (time_us != now_us && time_us > now_us + (uint64_t)255 * STEP_US)
        abort();
    volatile uint8_t last = bytes[n - 1]; /* for AddressSanitizer to look at */
    (void)last;
}

void bench_sent_frame(uint64_t time_us, const struct vl_frame *frame)
{
    (void)time_us;
    if (frame->identifier > 0x7FF || frame->length > (frame->fd ? 64 : 8))
        abort();
}

void bench_output(uint64_t time_us, int32_t count)
{
    (void)time_us;
    bool may_be_on = vl_state() == VL_ARMED || (vl_latched() & VL_WATCHDOG);
    if (count != 0 && !may_be_on)
        abort();
    if (bits == 16 && range_is_less && (count < -LARGEST_COUNT_16 || count > LARGEST_COUNT_16))
        abort();
}

/* -- messages on a serial line ------------------------------------------------------------------------------------------------ */

static void send_payload(uint8_t *payload, size_t n)
{
    static uint8_t line[2 * VL_LARGEST_BLOCK * VL_MOST_COUNT_BYTES + 100];
    vl_put(payload + n, vl_crc32(VL_CRC_START, payload, n), 4);
    size_t code = 0, put = 1;
    for (size_t i = 0; i < n + 4; i++) {
        if (payload[i])
            line[put++] = payload[i];
        if (!payload[i] || put - code == 255) {
            line[code] = (uint8_t)(put - code);
            code = put++;
        }
    }
    line[code] = (uint8_t)(put - code);
    line[put++] = 0;
    bench_bytes(line, put);
}

static void send_raw_payload(void)
{
    uint8_t payload[64 + 4];
    size_t n = byte() % 64;
    for (size_t i = 0; i < n; i++)
        payload[i] = byte();
    send_payload(payload, n);
}

static void send_raw_bytes(void)
{
    size_t n = byte() % 64, there = (size_t)(end - at);
    n = n < there ? n : there;
    bench_bytes(at, n);
    at += n;
}

static void send_garbage(void)
{
    static uint8_t line[VL_LARGEST_BLOCK * VL_MOST_COUNT_BYTES + 200];
    memset(line, byte() | 1, sizeof line);
    line[sizeof line - 1] = byte();
    bench_bytes(line, sizeof line);
}

/* -- messages on a bus ---------------------------------------------------------------------------------------------------------- */

static void send_frame(uint32_t identifier, const uint8_t *data, size_t n, bool fd)
{
    struct vl_frame frame = {.identifier = (uint16_t)identifier, .length = (uint8_t)n, .fd = fd};
    memcpy(frame.data, data, n);
    bench_frame(&frame);
}

static void send_raw_frame(void)
{
    static const uint8_t lengths[] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};
    uint8_t how = byte(), data[64] = {0};
    uint32_t identifier = (how & 0x80) ? 0x100 + 16u * (byte() % 32) + node : (byte() | (uint32_t)byte() << 8) & 0x7FF;
    size_t n = lengths[how % ((how & 0x40) ? 16 : 9)];
    for (size_t i = 0; i < n; i++)
        data[i] = byte();
    send_frame(identifier, data, n, how & 0x40);
}

static void send_groups(uint64_t block_number, const uint8_t *counts, uint8_t how)
{
    bool fd = FUZZ_WIRE == BENCH_CAN_FD;
    uint32_t block = vl_settings.block, rows = fd ? FD_ROWS : CLASSICAL_ROWS, groups = (block + rows - 1) / rows;
    uint32_t wrap = fd ? FD_CYCLE - FD_CYCLE % groups : CLASSICAL_CYCLE - CLASSICAL_CYCLE % groups;
    uint32_t sequence = (uint32_t)(block_number * groups % wrap);
    for (uint32_t group = 0; group < groups; group++) {
        uint32_t left = block - group * rows, n = 2 * (left < rows ? left : rows);
        uint8_t data[64] = {(uint8_t)(sequence + group), 0};
        memcpy(data + (fd ? 2 : 0), counts + 2 * group * rows, n);
        uint32_t length = fd ? 2 + n : n;
        while (fd && length > 8 && length % 4)
            length++;
        length = length > 48 ? 64 : length > 32 ? 48 : length > 24 ? 32 : length;
        uint32_t identifier = 0x100u + node + (fd ? 0 : 16 * (sequence + group));
        if (how != 2 * group + 1) /* one frame may be lost, */
            send_frame(identifier, data, length, fd);
        if (how == 2 * group + 2) /* or come twice */
            send_frame(identifier, data, length, fd);
    }
}

static void send_index(uint64_t first)
{
    uint8_t data[4];
    vl_put(data, first, 4);
    send_frame(0x040u + node, data, sizeof data, false);
}

/* -- messages on either ----------------------------------------------------------------------------------------------------------- */

static void send_request(uint8_t command, uint8_t parameter, uint8_t item, uint32_t value)
{
    uint8_t payload[12 + 4] = {(uint8_t)vl_settings.version, REQUEST, 0, 0, number, command, parameter, item};
    vl_put(payload + 8, value, 4);
    if (FUZZ_WIRE == BENCH_SERIAL)
        send_payload(payload, 12);
    else
        send_frame(0x020u + node, payload + 4, 8, false);
}

static void send_any_request(void)
{
    uint8_t how = byte(), parameter = byte();
    number += how & 1;
    if (how & 2)
        parameter %= 66;
    send_request((how >> 2) % 9, parameter, how & 128 ? byte() : 0, four_bytes());
}

static void send_setting(void)
{
    static const uint8_t settings[] = {VL_P_RATE_MHZ, VL_P_BLOCK, VL_P_QUEUE, VL_P_WATCHDOG_US, VL_P_RAMP_US, VL_P_VERSION, VL_P_VERSION};
    uint8_t which = byte() % 7;
    uint32_t value = byte() | (uint32_t)byte() << 8;
    number++;
    value = which > 4 ? 1 + value % 2 : value;
    send_request(VL_SET, settings[which], 0, which == 0 || which == 3 || which == 4 ? 40 * value : which == 1 && value & 0x8000 ? value % 20 : value);
}

/* Half of the hosts begin as a good one does, with outputs that can go on. */
static void begin_well(void)
{
    number += 3;
    send_request(VL_SET, VL_P_VERSION, 0, 2);
    number++;
    send_request(VL_START, 0, 0, 0);
    number++;
    send_request(VL_ARM, 0, 0, VL_ARM_KEY);
}

static void send_command(void)
{
    static const uint8_t commands[] = {VL_START, VL_ARM, VL_STOP, VL_CLEAR, VL_DISARM, VL_START, VL_ARM, VL_ARM};
    uint8_t command = commands[byte() % 8];
    number++;
    send_request(command, 0, 0, command == VL_ARM ? VL_ARM_KEY : 0);
}

/* Period and ramp of the outputs that follow; some that are soon complete, some at the bounds. */
static void choose_period(void)
{
    uint8_t what = byte();
    period = (what & 7) == 0   ? (uint32_t)(what >> 3) << 28
             : (what & 7) == 1 ? (4u << 16) - 1 + (what >> 3)
             : (what & 7) == 2 ? ((uint32_t)VL_LONGEST_PERIOD << 16) - 16 + (what >> 3)
                               : (uint32_t)what << 11 | byte();
    ramp = what & 0x80 ? (uint32_t)byte() * byte() : 0;
    if (FUZZ_WIRE == BENCH_SERIAL)
        return;
    uint8_t data[8];
    vl_put(vl_put(data, period, 4), ramp, 4);
    send_frame(0x050u + node, data, what == 77 ? 7 : 8, false);
}

static void send_block(uint64_t block_number, uint8_t how, uint8_t level)
{
    static uint8_t payload[20 + VL_LARGEST_BLOCK * VL_MOST_COUNT_BYTES + 4];
    uint32_t block = vl_settings.block, size = bits / 8u, head = vl_settings.version == 1 ? 12 : 20;
    uint64_t first = block_number * block + (how == 255 ? 1 : 0);
    for (uint32_t i = 0; i < block; i++)
        vl_put(payload + head + i * size, ((uint32_t)level << (bits - 8)) + (i & 0xFF), size);
    if (FUZZ_WIRE == BENCH_SERIAL) {
        uint8_t header[4] = {(uint8_t)vl_settings.version, OUTPUT, 0, 0};
        memcpy(payload, header, sizeof header);
        vl_put(payload + 4, first, 8);
        if (head == 20)
            vl_put(vl_put(payload + 12, period, 4), ramp, 4);
        send_payload(payload, head + block * size - (how == 254 ? 1 : 0));
        return;
    }
    if (how & 64)
        send_index(first);
    send_groups(block_number, payload + head, how & 128 ? how & 127 : 0);
}

static void send_output(void)
{
    uint8_t ahead = byte(), how = byte(), level = byte();
    send_block((vl_present() / vl_settings.block + ahead % 80) - (ahead & 0x80 ? 40 : 0), how, level);
}

/* Some blocks in order, in time but where time goes too fast. */
static void drive(void)
{
    uint8_t blocks = byte() % 32, level = byte();
    uint64_t block_us = 1000000000ull * vl_settings.block / vl_settings.rate_mhz, first = vl_present() / vl_settings.block + vl_settings.queue;
    for (uint32_t i = 0; i < blocks; i++) {
        send_block(first + i, 0, (uint8_t)(level + 37 * i));
        now_us += level & 1 ? block_us : block_us / 2;
        bench_pass(now_us);
    }
}

static void stop(void)
{
    uint8_t payload[5 + 4] = {VL_VERSION, EMERGENCY_STOP, 0, 0, byte()};
    if (FUZZ_WIRE == BENCH_SERIAL)
        send_payload(payload, 5);
    else
        send_frame(0, payload + 4, payload[4] % 9 > 4, false);
}

static void pass_time(void)
{
    now_us += (uint64_t)byte() * STEP_US + byte();
    bench_pass(now_us);
    bench_serve();
}

static void send_raw(void)
{
    if (FUZZ_WIRE != BENCH_SERIAL)
        send_raw_frame();
    else if (byte() & 1)
        send_raw_bytes();
    else
        send_raw_payload();
}

#ifdef VL_HAS_TICK
#include "fuzz_loop.h"
#endif

static void act(uint8_t kind)
{
#ifdef VL_HAS_TICK
    if (kind & 0x40) {
        act_with_loop();
        return;
    }
#endif
    switch (kind % 16) {
    case 0:
    case 1:
    case 2: pass_time(); break;
    case 3:
    case 4: send_any_request(); break;
    case 5:
    case 6: send_setting(); break;
    case 7:
    case 8: send_command(); break;
    case 9: send_output(); break;
    case 10: drive(); break;
    case 11: choose_period(); break;
    case 12: send_raw(); break;
    case 13:
        if (byte() & 1)
            stop();
        else
            bench_press(byte() & 1, byte() & 1);
        break;
    case 14:
        if (kind & 0x80)
            bench_miss();
        else
            bench_open(byte() & 1);
        break;
    default:
        if (kind & 0x80)
            bench_reset();
        else if (FUZZ_WIRE == BENCH_SERIAL)
            send_garbage();
        else
            send_index(four_bytes());
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *input, size_t n);

int LLVMFuzzerTestOneInput(const uint8_t *input, size_t n)
{
    at = input;
    end = input + n;
    uint8_t what = byte();
    n_channels = byte() % 32;
#ifdef VL_HAS_TICK
    n_channels = n_channels & 1 ? LOOP_CHANNELS : n_channels; /* of the plan */
#endif
    bits = FUZZ_WIRE == BENCH_SERIAL && (what & 1) ? 32 : 16;
    node = what >> 4;
    range_is_less = what % 3 != 2;
    number = 0;
    period = ramp = 0;
    now_us = 1000000;
    struct bench_choice choice = {FUZZ_WIRE, n_channels, bits, node, what % 3, 0, what & 8, 1000, 20000000, 1000, 4000000000, 1};
    bench_limit(MOST_INSTANTS);
    if (!bench_begin(&choice, now_us))
        return 0;
#ifdef VL_HAS_TICK
    if (n_channels == LOOP_CHANNELS)
        begin_with_loop();
#endif
    if (what & 2)
        begin_well();
    while (at < end)
        act(byte());
    return 0;
}
