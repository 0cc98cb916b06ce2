/* CAN frames as lines of text (slcan): this end is the adapter, and the device stands on the bus behind it.
 *
 * A line is a letter (t classical, d and b FD; capitals: identifier of 29 bits; r, R: remote frame), identifier and length code
 * in hexadecimal digits, the data, and a carriage return. S and Y choose bit rates, O and L open the bus, C closes it, V, N and F
 * ask for version, serial number and flags. Text that is none of these is skipped. Frames pass only while the bus is open. */

#include <string.h>

#include "board.h"
#include "host.h"

#define LONGEST_LINE 138   /* D, identifier, length, 64 bytes; without the end */
#define LONGEST_COMMAND 15
#define READS 4            /* bounds a call on a line full of garbage */

uint32_t slcan_damaged_lines, slcan_garbage_bytes, slcan_other_frames;

static const uint8_t LENGTHS[16] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};

static bool is_open;
static uint8_t input[4096];
static size_t n_input, at;
static char line[LONGEST_LINE + 1];
static size_t length;
static bool is_too_long;
static uint8_t tail[512]; /* what the line has not taken yet of a line that was begun */
static size_t n_tail;

static void write_tail(void)
{
    if (n_tail == 0)
        return;
    const size_t taken = line_write(tail, n_tail);
    n_tail -= taken;
    memmove(tail, tail + taken, n_tail);
}

static void keep(const char *text, size_t n)
{
    if (n <= sizeof tail - n_tail) {
        memcpy(tail + n_tail, text, n);
        n_tail += n;
    }
}

static void obey(char command)
{
    const char *reply = command == 'V' ? "V1013\r" : command == 'N' ? "N0001\r" : command == 'F' ? "F00\r" : "\r";
    if (command == 'O' || command == 'L')
        is_open = true;
    if (command == 'C')
        is_open = false;
    keep(reply, strlen(reply));
    write_tail();
}

static int digit_of(char text)
{
    if (text >= '0' && text <= '9')
        return text - '0';
    if (text >= 'A' && text <= 'F')
        return text - 'A' + 10;
    return text >= 'a' && text <= 'f' ? text - 'a' + 10 : -1;
}

/* The number in so many hexadecimal digits; -1 if they are none. */
static int64_t number(const char *text, size_t digits)
{
    int64_t out = 0;
    for (size_t i = 0; i < digits; i++) {
        const int digit = digit_of(text[i]); /* that of the line's end is -1 */
        if (digit < 0)
            return -1;
        out = 16 * out + digit;
    }
    return out;
}

/* The frame of the line; false if it is none. */
static bool decode(struct vl_frame *frame, bool is_fd, bool is_extended)
{
    const size_t digits = is_extended ? 8 : 3;
    const int64_t identifier = number(line + 1, digits);
    const int64_t code = identifier < 0 ? -1 : number(line + 1 + digits, 1);
    if (code < 0 || identifier > (is_extended ? 0x1FFFFFFF : 0x7FF) || (code > 8 && !is_fd))
        return false;
    frame->identifier = (uint16_t)(identifier & 0x7FF);
    frame->length = LENGTHS[code];
    frame->fd = is_fd;
    const char *data = line + 2 + digits;
    if (length != 2 + digits + 2u * frame->length)
        return false;
    for (size_t i = 0; i < frame->length; i++) {
        const int64_t byte = number(data + 2 * i, 2);
        if (byte < 0)
            return false;
        frame->data[i] = (uint8_t)byte;
    }
    return true;
}

/* Take the line; whether it is a frame for the device. */
static bool take_line(struct vl_frame *frame)
{
    const char kind = line[0];
    const bool is_extended = strchr("TDB", kind) != NULL;
    if (strchr("tTdDbB", kind) != NULL) {
        if (!decode(frame, strchr("dDbB", kind) != NULL, is_extended)) {
            slcan_damaged_lines++;
            return false;
        }
        slcan_other_frames += is_extended ? 1 : 0;
        return is_open && !is_extended;
    }
    if (strchr("SYOLCXZVNFsmM", kind) != NULL && length <= LONGEST_COMMAND)
        obey(kind);
    else if (kind == 'r' || kind == 'R')
        slcan_other_frames++;
    else
        slcan_damaged_lines++;
    return false;
}

/* Take a character; whether it ends a frame for the device. */
static bool take(char character, struct vl_frame *frame)
{
    if (character == '\r') {
        const bool is_frame = length > 0 && !is_too_long && take_line(frame);
        slcan_damaged_lines += is_too_long ? 1 : 0;
        length = 0;
        is_too_long = false;
        return is_frame;
    }
    if (length == 0 && character == '\a')
        return false; /* an error that an adapter reports has no end of line */
    if (length < LONGEST_LINE) {
        line[length++] = character;
        line[length] = '\0';
    } else {
        is_too_long = true;
        slcan_garbage_bytes++;
    }
    return false;
}

bool board_receive_frame(struct vl_frame *frame)
{
    write_tail();
    for (int reads = 0; reads <= READS; reads++) {
        while (at < n_input)
            if (take((char)input[at++], frame))
                return true;
        at = n_input = 0;
        if (reads < READS)
            n_input = line_read(input, sizeof input);
        if (n_input == 0)
            return false;
    }
    return false;
}

bool board_send_frame(const struct vl_frame *frame)
{
    static const char DIGITS[] = "0123456789ABCDEF";
    char text[LONGEST_LINE + 1];
    size_t n = 0, code = 0;
    if (!is_open)
        return true; /* as on a bus without listeners */
    write_tail();
    if (n_tail > 0)
        return false;
    while (LENGTHS[code] < frame->length)
        code++;
    text[n++] = frame->fd ? 'b' : 't';
    for (int shift = 8; shift >= 0; shift -= 4)
        text[n++] = DIGITS[frame->identifier >> shift & 0xF];
    text[n++] = DIGITS[code];
    for (size_t i = 0; i < frame->length; i++) {
        text[n++] = DIGITS[frame->data[i] >> 4];
        text[n++] = DIGITS[frame->data[i] & 0xF];
    }
    text[n++] = '\r';
    const size_t taken = line_write((const uint8_t *)text, n);
    if (taken > 0)
        keep(text + taken, n - taken); /* a line that was begun is ended before the next */
    return taken > 0;
}
