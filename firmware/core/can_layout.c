/* The checksum by which host and device compare their definitions of the frames: over a line of text for every message. */

#include <string.h>

#include "can.h"

enum { FUNCTION = 16, OUTPUT_ID = 0x100, SAMPLES_ID = 0x300 };

static uint32_t crc;
static uint32_t place; /* of the next signal in its message, bytes */

static void text(const char *said)
{
    crc = vl_crc32(crc, said, strlen(said));
}

static void number(uint32_t value, bool is_hexadecimal, uint32_t digits)
{
    char said[11];
    uint32_t i = sizeof said - 1;
    said[i] = 0;
    while (value || digits) {
        said[--i] = "0123456789ABCDEF"[is_hexadecimal ? value & 15 : value % 10];
        value = is_hexadecimal ? value >> 4 : value / 10;
        digits -= digits > 0;
    }
    text(said + i);
}

static void begin_message(uint32_t identifier, const char *name)
{
    if (identifier)
        text("\n");
    number(identifier, true, 3);
    text(" ");
    text(name);
    place = 0;
}

static void begin_signals(uint32_t length, bool fd)
{
    text(" ");
    number(length, false, 1);
    text(fd ? " fd" : " classical");
}

static void end_signal(const char *type, uint32_t n_bytes)
{
    text(":");
    text(type);
    text("@");
    number(place, false, 1);
    place += n_bytes;
}

static void byte(const char *name)
{
    text(" ");
    text(name);
    end_signal("uint8", 1);
}

static void half_word(const char *name)
{
    text(" ");
    text(name);
    end_signal("uint16", 2);
}

static void word(const char *name)
{
    text(" ");
    text(name);
    end_signal("uint32", 4);
}

static void commands(void)
{
    begin_message(0x000, "EmergencyStop");
    begin_signals(1, false);
    byte("reason");
    begin_message(0x010, "Heartbeat");
    begin_signals(8, false);
    byte("state"), byte("flags"), byte("boot"), byte("dropped"), word("samples");
    for (uint32_t answer = 0; answer < 2; answer++) {
        begin_message(answer ? 0x030 : 0x020, answer ? "Answer" : "Request");
        begin_signals(8, false);
        byte("number"), byte(answer ? "status" : "command"), byte("parameter"), byte("item"), word("value");
    }
    begin_message(0x040, "OutputIndex");
    begin_signals(4, false);
    word("first");
}

/* Since version 2: what outputs are the last of, and what was put out. */
static void continuation(const struct vl_can_shape *shape)
{
    begin_message(0x050, "OutputPeriod");
    begin_signals(8, false);
    word("period"), word("ramp");
    begin_message(0x060, "Readback");
    begin_signals(shape->fd ? 64 : 8, shape->fd);
    half_word("index");
    for (uint32_t row = 0; row < (shape->fd ? 31u : 3u); row++) {
        text(" sample_"), number(row, false, 1);
        end_signal("int16", 2);
    }
}

static void outputs(const struct vl_can_shape *shape)
{
    uint32_t messages = shape->fd ? 1 : shape->output_wrap;
    for (uint32_t i = 0; i < messages; i++) {
        begin_message(OUTPUT_ID + FUNCTION * i, "Output");
        if (!shape->fd)
            text("_"), number(i, false, 2);
        begin_signals(shape->fd ? 64 : 8, shape->fd);
        if (shape->fd)
            byte("sequence"), byte("reserved");
        for (uint32_t row = 0; row < shape->output_rows; row++) {
            text(" sample_"), number(row, false, 1);
            end_signal("int16", 2);
        }
    }
}

static void samples_of(const struct vl_can_shape *shape, uint32_t first, uint32_t width)
{
    if (shape->fd)
        byte("sequence"), byte("flags");
    for (uint32_t row = 0; row < shape->rows; row++) {
        for (uint32_t channel = first; channel < first + width; channel++) {
            text(" channel_"), number(channel, false, 1);
            if (shape->fd)
                text("_sample_"), number(row, false, 1);
            end_signal("int16", 2);
        }
    }
}

static void samples(const struct vl_can_shape *shape)
{
    uint32_t messages = shape->fd ? shape->parts : shape->wrap * shape->parts;
    for (uint32_t i = 0; i < messages; i++) {
        uint32_t first = i % shape->parts * shape->channels, rest = shape->n_channels - first;
        uint32_t width = rest < shape->channels ? rest : shape->channels;
        uint32_t n_bytes = (shape->fd ? 2 : 0) + 2 * width * shape->rows;
        begin_message(SAMPLES_ID + FUNCTION * i, "Samples_");
        number(i, false, 2);
        begin_signals(shape->fd ? vl_can_padded(n_bytes) : n_bytes, shape->fd);
        samples_of(shape, first, width);
    }
}

uint32_t vl_can_layout_crc(const struct vl_can_shape *shape, uint32_t version)
{
    crc = VL_CRC_START;
    commands();
    if (version > 1)
        continuation(shape);
    outputs(shape);
    samples(shape);
    return crc;
}
