/* The lines of a description: a name, and what it says. */

#include "lines.h"

#include <float.h>
#include <string.h>

#define LARGEST_EXPONENT 1100

static const char *take_unsigned(const char *text, uint32_t *value)
{
    uint64_t sum = 0;
    if (*text < '0' || *text > '9')
        return NULL;
    for (; *text >= '0' && *text <= '9'; text++) {
        sum = 10 * sum + (uint64_t)(*text - '0');
        if (sum > UINT32_MAX)
            return NULL;
    }
    *value = (uint32_t)sum;
    return text;
}

static int hexadecimal(char digit)
{
    if (digit >= '0' && digit <= '9')
        return digit - '0';
    return digit >= 'a' && digit <= 'f' ? digit - 'a' + 10 : -1;
}

static const char *take_exponent(const char *text, int *exponent)
{
    uint32_t size;
    if (*text != 'p' || (text[1] != '+' && text[1] != '-'))
        return NULL;
    const int sign = text[1] == '-' ? -1 : 1;
    text = take_unsigned(text + 2, &size);
    if (text == NULL || size > LARGEST_EXPONENT)
        return NULL;
    *exponent += sign * (int)size;
    return text;
}

const char *plant_take_double(const char *text, double *value)
{
    const bool negative = *text == '-';
    uint64_t mantissa = 0;
    int exponent = 0;
    bool behind_point = false;
    text += negative ? 1 : 0;
    if (text[0] != '0' || text[1] != 'x' || hexadecimal(text[2]) < 0)
        return NULL;
    for (text += 2; hexadecimal(*text) >= 0 || (*text == '.' && !behind_point); text++) {
        if (*text == '.') {
            behind_point = true;
        } else if (mantissa >> (DBL_MANT_DIG - 1) != 0) {
            return NULL; /* more digits than a double has */
        } else {
            mantissa = 16 * mantissa + (uint64_t)hexadecimal(*text);
            exponent -= behind_point ? 4 : 0;
        }
    }
    text = take_exponent(text, &exponent);
    double out = (double)mantissa;
    for (; exponent > 0; exponent--)
        out *= 2.0;
    for (; exponent < 0; exponent++)
        out *= 0.5;
    *value = negative ? -out : out;
    return text;
}

static const char *take_float(const char *text, float *value)
{
    double wide;
    text = plant_take_double(text, &wide);
    if (text == NULL || !(wide > 0.0) || wide > (double)FLT_MAX)
        return NULL; /* ranges and volts per count */
    *value = (float)wide;
    return text;
}

/* What stands between two values. */
static const char *take_blank(const char *text)
{
    return text != NULL && *text == ' ' ? text + 1 : NULL;
}

static bool is_end(const char *text)
{
    return text != NULL && *text == '\0';
}

/* A text of up to 32 characters, up to `stop` or the end of the line. */
static const char *take_text(const char *text, char stop, char into[PLANT_TEXT])
{
    size_t n = 0;
    for (; text[n] != '\0' && text[n] != stop; n++) {
        if (n == PLANT_TEXT - 1)
            return NULL;
        into[n] = text[n];
    }
    into[n] = '\0';
    return text + n;
}

static bool take_channel(struct plant *plant, const char *text)
{
    const uint32_t number = plant->description.n_channels;
    if (number == VL_MOST_CHANNELS)
        return false;
    struct vl_channel *channel = &plant->channels[number];
    text = take_blank(take_text(text, ' ', plant->names[number]));
    text = text ? take_blank(take_float(text, &channel->range_v)) : NULL;
    text = text ? take_blank(take_float(text, &channel->v_per_count)) : NULL;
    text = text ? take_unsigned(text, &channel->skew_ns) : NULL;
    channel->name = plant->names[number];
    plant->description.n_channels = number + 1;
    return is_end(text) && *channel->name != '\0';
}

static bool take_output(struct plant *plant, const char *text)
{
    text = take_blank(take_float(text, &plant->description.output_range_v));
    return text != NULL && is_end(take_float(text, &plant->description.output_v_per_count));
}

static bool take_delay(struct plant *plant, const char *text)
{
    return is_end(plant_take_double(text, &plant->filter_delay_s));
}

static bool take_wire(struct plant *plant, const char *text)
{
    const struct vl_wire **wire = &plant->description.wire;
    if (strcmp(text, "serial") == 0)
        *wire = &vl_serial;
    else if (strcmp(text, "can") == 0)
        *wire = &vl_can;
    else if (strcmp(text, "can-fd") == 0)
        *wire = &vl_can_fd;
    else
        return false;
    return true;
}

static bool take_node(struct plant *plant, const char *text)
{
    uint32_t node;
    if (!is_end(take_unsigned(text, &node)) || node > 15)
        return false;
    plant->description.node = (uint8_t)node;
    return true;
}

static bool take_rate(struct plant *plant, const char *text)
{
    struct vl_description *device = &plant->description;
    const bool is_rate = is_end(take_unsigned(text, &device->lowest_rate_mhz));
    device->highest_rate_mhz = device->lowest_rate_mhz;
    return is_rate;
}

#define TEXT(name)                                                        \
    static bool take_##name(struct plant *plant, const char *text)        \
    {                                                                     \
        return is_end(take_text(text, '\0', plant->name));                \
    }
#define NUMBER(name, where)                                               \
    static bool take_##name(struct plant *plant, const char *text)        \
    {                                                                     \
        return is_end(take_unsigned(text, &plant->where));                \
    }
TEXT(model)
TEXT(firmware)
TEXT(serial_number)
NUMBER(boot, boot)
NUMBER(lockstep, lockstep)
NUMBER(simulated, description.simulated)
NUMBER(bits, description.bits)
NUMBER(shortest_watchdog_us, description.shortest_watchdog_us)
NUMBER(longest_watchdog_us, description.longest_watchdog_us)
NUMBER(filter_delay_ns, description.filter_delay_ns)

static const struct {
    const char *name;
    bool (*take)(struct plant *plant, const char *text);
} LINES[] = {
    {"model ", take_model},
    {"firmware ", take_firmware},
    {"serial_number ", take_serial_number},
    {"boot ", take_boot},
    {"lockstep ", take_lockstep},
    {"simulated ", take_simulated},
    {"bits ", take_bits},
    {"rate_mhz ", take_rate},
    {"shortest_watchdog_us ", take_shortest_watchdog_us},
    {"longest_watchdog_us ", take_longest_watchdog_us},
    {"filter_delay_ns ", take_filter_delay_ns},
    {"filter_delay_s ", take_delay},
    {"output ", take_output},
    {"channel ", take_channel},
    {"wire ", take_wire},
    {"node ", take_node},
};
#define N_LINES (sizeof LINES / sizeof LINES[0])

bool plant_take_line(struct plant *plant, const char *line)
{
    for (size_t i = 0; i < N_LINES; i++) {
        const size_t length = strlen(LINES[i].name);
        if (strncmp(line, LINES[i].name, length) == 0) {
            plant->lines |= 1u << i;
            return LINES[i].take(plant, line + length);
        }
    }
    return false;
}

bool plant_is_described(struct plant *plant)
{
    for (size_t i = 0; i < N_LINES; i++) {
        if ((plant->lines >> i & 1u) == 0) {
            plant_complain("plant: a line of the description is missing: ", LINES[i].name);
            return false;
        }
    }
    struct vl_description *device = &plant->description;
    device->model = plant->model;
    device->firmware = plant->firmware;
    device->serial_number = plant->serial_number;
    device->channels = plant->channels;
    device->filter_delay_s = &plant->filter_delay_s;
    return true;
}
