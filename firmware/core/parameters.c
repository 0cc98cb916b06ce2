/* The dictionary: what the device tells of itself, and what the host may set. */

#include "bytes.h"
#include "device.h"

enum { TEXT_WORDS = 8 };

static uint32_t layout_crcs[1 + VL_VERSION]; /* by version */

uint32_t vl_largest_block(void)
{
    uint32_t of_the_wire = vl_about->wire->largest_block();
    uint32_t of_state = vl_settings.loop ? VL_STATE_BYTES : 0;
    uint32_t of_the_memory = (VL_SAMPLE_BYTES / 2 - of_state) / vl_sample_bytes(&vl_settings);
    uint32_t largest = of_the_wire < of_the_memory ? of_the_wire : of_the_memory;
    return vl_settings.loop || largest < VL_LARGEST_BLOCK ? largest : VL_LARGEST_BLOCK;
}

static uint32_t smaller(uint32_t one, uint32_t other)
{
    return one < other ? one : other;
}

static uint32_t within(uint32_t value, uint32_t lowest, uint32_t highest)
{
    return value < lowest ? lowest : smaller(value, highest);
}

/* The nearest rate that the timer makes and the description allows. */
static uint32_t nearest_rate(uint32_t rate_mhz)
{
    return board_nearest_rate_mhz(within(rate_mhz, vl_about->lowest_rate_mhz, vl_about->highest_rate_mhz));
}

void vl_begin_parameters(uint32_t boot)
{
    vl_boot = boot;
    for (uint32_t version = VL_LOWEST_VERSION; version <= VL_VERSION; version++)
        layout_crcs[version] = vl_about->wire->layout_crc(version);
    vl_settings = (struct vl_settings){
        .version = VL_LOWEST_VERSION,
        .rate_mhz = nearest_rate(vl_about->highest_rate_mhz),
        .block = 1,
        .queue = 1,
        .watchdog_us = within(100000, vl_about->shortest_watchdog_us, vl_about->longest_watchdog_us),
        .ramp_us = smaller(50000, vl_about->longest_watchdog_us),
        .tick_period = 1,
        .state_blocks = 1,
    };
    vl_in_force = vl_settings;
    vl_begin_tick();
}

static uint32_t float_word(float value)
{
    uint32_t word;
    memcpy(&word, &value, sizeof word);
    return word;
}

/* The low or the high word of the filter delay as a double. */
static uint32_t double_word(double value, uint8_t item)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    return (uint32_t)(item ? bits >> 32 : bits);
}

/* Four characters of a text from character 4 `word` on, zeros behind its end. */
static uint32_t text_word(const char *text, uint32_t word)
{
    uint8_t bytes[4 * TEXT_WORDS] = {0};
    for (uint32_t i = 0; i < sizeof bytes && text[i]; i++)
        bytes[i] = (uint8_t)text[i];
    return vl_u32(bytes + 4 * word);
}

/* A parameter with one value. False: it is another one. */
static bool get_single(uint8_t parameter, uint32_t *value)
{
    switch (parameter) {
    case VL_P_LOWEST_VERSION: *value = VL_LOWEST_VERSION; break;
    case VL_P_HIGHEST_VERSION: *value = VL_VERSION; break;
    case VL_P_VERSION: *value = vl_settings.version; break;
    case VL_P_BOOT: *value = vl_boot; break;
    case VL_P_SIMULATED: *value = vl_about->simulated; break;
    case VL_P_STATE: *value = vl_state(); break;
    case VL_P_N_CHANNELS: *value = vl_about->n_channels; break;
    case VL_P_OUTPUT_RANGE_V: *value = float_word(vl_about->output_range_v); break;
    case VL_P_OUTPUT_V_PER_COUNT: *value = float_word(vl_about->output_v_per_count); break;
    case VL_P_BITS: *value = vl_about->bits; break;
    case VL_P_LOWEST_RATE_MHZ: *value = vl_about->lowest_rate_mhz; break;
    case VL_P_HIGHEST_RATE_MHZ: *value = vl_about->highest_rate_mhz; break;
    case VL_P_LARGEST_BLOCK: *value = vl_largest_block(); break;
    case VL_P_LARGEST_QUEUE: *value = VL_LARGEST_QUEUE; break;
    case VL_P_SHORTEST_WATCHDOG_US: *value = vl_about->shortest_watchdog_us; break;
    case VL_P_LONGEST_WATCHDOG_US: *value = vl_about->longest_watchdog_us; break;
    case VL_P_FILTER_DELAY_NS: *value = vl_about->filter_delay_ns; break;
    case VL_P_LONGEST_PERIOD: *value = VL_LONGEST_PERIOD; break;
    case VL_P_RATE_MHZ: *value = vl_settings.rate_mhz; break;
    case VL_P_BLOCK: *value = vl_settings.block; break;
    case VL_P_QUEUE: *value = vl_settings.queue; break;
    case VL_P_WATCHDOG_US: *value = vl_settings.watchdog_us; break;
    case VL_P_RAMP_US: *value = vl_settings.ramp_us; break;
    case VL_P_LAYOUT_CRC: *value = layout_crcs[vl_settings.version]; break;
    default: return false;
    }
    return true;
}

/* A parameter with a value for every channel. False: it is another one, or there is no such channel. */
static bool get_by_channel(uint8_t parameter, uint8_t item, uint32_t *value)
{
    bool is_text = parameter == VL_P_CHANNEL_NAME || parameter == VL_P_CHANNEL_UNIT;
    uint32_t number = is_text ? item / TEXT_WORDS : item;
    if (number >= vl_about->n_channels)
        return false;
    const struct vl_channel *channel = &vl_about->channels[number];
    switch (parameter) {
    case VL_P_CHANNEL_NAME: *value = text_word(channel->name, item % TEXT_WORDS); break;
    case VL_P_CHANNEL_UNIT: *value = text_word("V", item % TEXT_WORDS); break;
    case VL_P_CHANNEL_RANGE_V: *value = float_word(channel->range_v); break;
    case VL_P_CHANNEL_V_PER_COUNT: *value = float_word(channel->v_per_count); break;
    case VL_P_SKEW_NS: *value = channel->skew_ns; break;
    default: return false;
    }
    return true;
}

/* A text of the whole device, or the filter delay in two words. False: it is another one, or there is no such word. */
static bool get_by_word(uint8_t parameter, uint8_t item, uint32_t *value)
{
    const char *text = parameter == VL_P_MODEL           ? vl_about->model
                       : parameter == VL_P_FIRMWARE      ? vl_about->firmware
                       : parameter == VL_P_SERIAL_NUMBER ? vl_about->serial_number
                                                         : NULL;
    if (text && item < TEXT_WORDS) {
        *value = text_word(text, item);
        return true;
    }
    if (parameter == VL_P_FILTER_DELAY_S && vl_about->filter_delay_s && item < 2) {
        *value = double_word(*vl_about->filter_delay_s, item);
        return true;
    }
    return false;
}

enum vl_status vl_get(uint8_t parameter, uint8_t item, uint32_t *value)
{
    *value = 0;
    bool is_known = parameter == VL_P_PING || (item == 0 && get_single(parameter, value))
                    || get_by_channel(parameter, item, value) || get_by_word(parameter, item, value)
                    || vl_tick_get(parameter, item, value);
    return is_known ? VL_DONE : VL_UNKNOWN;
}

/* Whether the ring and the wire have room for a block with the loop's rows: 1, or 0. */
static uint32_t holds_block_of_loop(void)
{
    const uint32_t before = vl_settings.loop;
    vl_settings.loop = 1;
    const uint32_t largest = vl_largest_block();
    vl_settings.loop = before;
    return vl_settings.block <= largest;
}

/* What may be set, and between what bounds. NULL: it cannot be set. */
static uint32_t *setting(uint8_t parameter, uint32_t *lowest, uint32_t *highest)
{
    uint32_t of_tick;
    const bool has_tick = vl_tick_get(VL_P_LOOP, 0, &of_tick);
    *lowest = 1;
    switch (parameter) {
    case VL_P_VERSION: *highest = VL_VERSION; return &vl_settings.version;
    case VL_P_RATE_MHZ: *highest = UINT32_MAX; return &vl_settings.rate_mhz;
    case VL_P_BLOCK: *highest = vl_largest_block(); return &vl_settings.block;
    case VL_P_QUEUE: *highest = VL_LARGEST_QUEUE; return &vl_settings.queue;
    case VL_P_WATCHDOG_US:
        *lowest = vl_about->shortest_watchdog_us;
        *highest = vl_about->longest_watchdog_us;
        return &vl_settings.watchdog_us;
    case VL_P_RAMP_US:
        *lowest = 0;
        *highest = vl_about->longest_watchdog_us;
        return &vl_settings.ramp_us;
    case VL_P_LOOP:
        *lowest = 0;
        *highest = holds_block_of_loop();
        return has_tick ? &vl_settings.loop : NULL;
    case VL_P_TICK_PERIOD:
        *highest = INT32_MAX;
        return has_tick ? &vl_settings.tick_period : NULL;
    case VL_P_STATE_BLOCKS:
        *highest = INT32_MAX;
        return has_tick ? &vl_settings.state_blocks : NULL;
    default: return NULL;
    }
}

enum vl_status vl_set(uint8_t parameter, uint8_t item, uint32_t *value)
{
    if (parameter == VL_P_TICK_BYTES)
        return vl_tick_resize(item, value);
    uint32_t lowest, highest, wanted = *value;
    uint32_t *set = setting(parameter, &lowest, &highest);
    if (!set || item) {
        *value = 0;
        return VL_UNKNOWN;
    }
    *value = parameter == VL_P_RATE_MHZ ? nearest_rate(wanted) : within(wanted, lowest, highest);
    if (*value != wanted)
        return VL_NOT_ALLOWED;
    *set = wanted;
    if (parameter == VL_P_VERSION)
        vl_settings.loop = 0; /* whoever comes next may know of none */
    return VL_DONE;
}
