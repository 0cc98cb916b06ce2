/* What the fuzzer does with a device that has the loop: records of a plan, some of whose bytes are others, and what is asked of it. */

#include "records.h"

enum { RECORD_TYPE = 8, MOST_CHANGES = 8, LOOP_CHANNELS = 4, LOOP_RATE_MHZ = 5000000 };

static void set(uint8_t parameter, uint8_t item, uint32_t value)
{
    number++;
    send_request(VL_SET, parameter, item, value);
}

/* The records of the plan; most of the changes make them nonsense, which START refuses. */
static void upload(uint8_t changes)
{
    for (uint8_t place = 0; place < 16; place++)
        set(VL_P_TICK_BYTES, place, records[place].n);
    set(VL_P_TICK_PERIOD, 0, RECORDS_PERIOD);
    for (uint8_t place = 0; place < 16; place++)
        vl_take_record(place, 0, records[place].bytes, records[place].n);
    for (uint8_t i = 0; i < changes % MOST_CHANGES; i++) {
        uint8_t place = byte() % 16, n = byte() % 9, bytes[8];
        uint32_t offset = byte() | (uint32_t)byte() << 8;
        for (uint8_t k = 0; k < sizeof bytes; k++)
            bytes[k] = k < n ? byte() : 0;
        vl_take_record(place, offset % records[place].n, bytes, n);
    }
}

static void begin_with_loop(void)
{
    uint8_t changes = byte();
    set(VL_P_VERSION, 0, 2);
    set(VL_P_BLOCK, 0, 1 + changes % 7);
    set(VL_P_RATE_MHZ, 0, LOOP_RATE_MHZ);
    set(VL_P_LOOP, 0, 1);
    set(VL_P_STATE_BLOCKS, 0, 1 + changes % 5);
    upload(changes >> 4);
    number++;
    send_request(VL_START, 0, 0, 0);
    number++;
    send_request(VL_ARM, 0, 0, VL_ARM_KEY);
}

/* A piece of the records over the wire, whole or not. */
static void send_record(void)
{
    uint8_t payload[12 + 64 + 4] = {(uint8_t)vl_settings.version, RECORD_TYPE};
    uint8_t place = byte() % 18, n = byte() % 64, how = byte();
    uint32_t offset = byte() | (uint32_t)byte() << 8;
    for (uint8_t i = 0; i < n; i++)
        payload[12 + i] = byte();
    if (FUZZ_WIRE == BENCH_SERIAL) {
        payload[4] = place;
        vl_put(payload + 8, offset, 4);
        send_payload(payload, 12u + n);
        return;
    }
    uint8_t data[64] = {place, n};
    vl_put(data + 4, offset, 4);
    memcpy(data + 8, payload + 12, n < 56 ? n : 56);
    send_frame(0x070u + node, data, how & 1 ? 64 : vl_can_padded(8u + (n < 56u ? n : 56u)), !(how & 2));
}

static void act_with_loop(void)
{
    switch (byte() % 8) {
    case 0:
    case 1: begin_with_loop(); break;
    case 2: number++, send_request(VL_RAMP, 0, 0, 0); break;
    case 3: number++, send_request(VL_RELEASE, 0, 0, 0); break;
    case 4: send_record(); break;
    case 5: set((uint8_t)(VL_P_TICK_DIGEST + byte() % 8), byte() % 17, four_bytes()); break;
    case 6: number++, send_request(VL_GET, (uint8_t)(VL_P_TICK_DIGEST + byte() % 8), byte() % 17, 0); break;
    default: now_us += (uint64_t)byte() * 8 * STEP_US, bench_pass(now_us);
    }
}
