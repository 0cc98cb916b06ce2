/* The loop on the device: the records of a run, and the compiled tick that takes them, sample by sample.
 *
 * The records are filled by the main loop while nothing is sampled. While sampling they are the tick's, which runs in the sampling
 * interrupt; the main loop asks it for something between board_lock and board_unlock. */

#include "tick.h"

#ifdef VL_HAS_TICK

#include <math.h>

#include "bytes.h"

_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "records go over the wire as they lie in memory");
_Static_assert(sizeof(struct tick_rows) == VL_ROW_BYTES, "a row of telemetry has another size");
_Static_assert(VL_SAMPLE_BYTES / 2 >= 2 * VL_STATE_BYTES, "the ring has no room for two blocks with the loop's state");

/* Of vl_tick_state: a number, and pieces. */
enum {
    PIECE_HEAD = 8,
    PIECES = 10,
    STATE_MOST = 8 + PIECES * PIECE_HEAD + sizeof(struct tick_loop) + sizeof(struct tick_guard)
                 + offsetof(struct tick_progress, refused) + 2 * sizeof(struct tick_progress_refused)
                 + sizeof(struct tick_control_vibration) + sizeof(struct tick_control_frequency) + 3 * sizeof(struct tick_outcomes)
};
_Static_assert((int)STATE_MOST <= (int)VL_STATE_BYTES, "the loop's state needs more room in a block");

#define BYTES_OF(name, type) sizeof(type),
static const uint32_t RECORD[VL_TICK_ARRAYS] = {TICK_ARRAYS(BYTES_OF)};

static _Alignas(8) uint8_t pool[VL_TICK_BYTES];
static uint32_t begin[VL_TICK_ARRAYS], size[VL_TICK_ARRAYS]; /* bytes */
static uint32_t last_fault; /* of the last START */
static bool is_used;     /* the records are not those of a fresh run any more */

static struct tick_arrays t;
static double v_per_count[VL_MOST_CHANNELS], volts[VL_MOST_CHANNELS];
static float readings[VL_MOST_CHANNELS];
static struct tick_rows row;
static double output_v;
static double counts_per_v, lowest, highest;
static uint32_t in_turn, refused_in_turn; /* what is told again with the next state */
static uint32_t untold_blocks;   /* without a state, since the last one */
static int64_t segment_told, mode_told;

/* -- what is uploaded ------------------------------------------------------------------------------------------------------- */

static void forget_from(uint32_t place)
{
    for (uint32_t i = place; i < VL_TICK_ARRAYS; i++)
        size[i] = 0;
}

void vl_begin_tick(void)
{
    forget_from(0);
    last_fault = 0;
    is_used = false;
}

static uint32_t end_of(uint32_t place)
{
    return begin[place] + (size[place] + 7) / 8 * 8;
}

bool vl_tick_get(uint8_t parameter, uint8_t item, uint32_t *value)
{
    enum { DIGEST_WORDS = 16 };
    if (!vl_about->wire->carries_rows || vl_settings.version == VL_LOWEST_VERSION)
        return false;
    if (parameter == VL_P_TICK_DIGEST && item < DIGEST_WORDS)
        *value = vl_u32((const uint8_t *)vibrolock_tick_digest + 4 * item);
    else if (parameter == VL_P_TICK_ROOM && item == 0)
        *value = VL_TICK_BYTES;
    else if (parameter == VL_P_LOOP && item == 0)
        *value = vl_settings.loop;
    else if (parameter == VL_P_TICK_PERIOD && item == 0)
        *value = vl_settings.tick_period;
    else if (parameter == VL_P_TICK_FAULT && item == 0)
        *value = last_fault;
    else if (parameter == VL_P_STATE_BLOCKS && item == 0)
        *value = vl_settings.state_blocks;
    else if (parameter == VL_P_TICK_BYTES && item < VL_TICK_ARRAYS)
        *value = size[item];
    else if (parameter == VL_P_TICK_CRC && item < VL_TICK_ARRAYS)
        *value = vl_crc32(VL_CRC_START, pool + begin[item], size[item]);
    else
        return false;
    return true;
}

enum vl_status vl_tick_resize(uint8_t place, uint32_t *bytes)
{
    uint32_t wanted = *bytes, before;
    if (!vl_tick_get(VL_P_TICK_BYTES, place, &before)) {
        *bytes = 0;
        return VL_UNKNOWN;
    }
    forget_from(place);
    is_used = is_used && place > 0;
    begin[place] = place ? end_of(place - 1) : 0u;
    const uint32_t room = VL_TICK_BYTES - begin[place];
    *bytes = (wanted < room ? wanted : room) / RECORD[place] * RECORD[place];
    if (*bytes != wanted)
        return VL_NOT_ALLOWED;
    size[place] = wanted;
    memset(pool + begin[place], 0, end_of(place) - begin[place]);
    return VL_DONE;
}

bool vl_take_record(uint8_t place, uint32_t offset, const uint8_t *bytes, uint32_t n)
{
    if (place >= VL_TICK_ARRAYS || offset > size[place] || n > size[place] - offset)
        return false;
    memcpy(pool + begin[place] + offset, bytes, n);
    return true;
}

/* -- START ------------------------------------------------------------------------------------------------------------------- */

static void find_arrays(void)
{
#define FIND(name, type)                                    \
    t.name = (type *)(void *)(pool + begin[VL_A_##name]);   \
    t.n_##name = (int64_t)(size[VL_A_##name] / sizeof(type));
    TICK_ARRAYS(FIND)
    t.waveforms_length = vl_settings.tick_period;
    t.n_waveforms = t.waveforms_length > 0 ? t.n_waveforms / t.waveforms_length : 0;
}

static uint32_t look_for_a_fault(void)
{
    if (is_used)
        return vl_tick_fault(0, VL_R_SIZE);
    for (uint32_t place = 0; place < VL_TICK_ARRAYS; place++)
        if (size[place] == 0)
            return vl_tick_fault(place, VL_R_SIZE);
    if (vl_settings.tick_period == 0 || size[VL_A_waveforms] / sizeof(double) % vl_settings.tick_period != 0)
        return vl_tick_fault(VL_A_waveforms, VL_R_NUMBER);
    find_arrays();
    return vl_tick_check(&t);
}

bool vl_tick_is_ready(uint32_t *why_not)
{
    *why_not = last_fault = look_for_a_fault();
    return last_fault == 0;
}

void vl_restart_tick(void)
{
    is_used = true;
    output_v = 0.0;
    in_turn = refused_in_turn = untold_blocks = 0;
    segment_told = mode_told = INT64_MIN;
    for (uint32_t channel = 0; channel < vl_about->n_channels; channel++)
        v_per_count[channel] = (double)vl_about->channels[channel].v_per_count;
    counts_per_v = 1.0 / (double)vl_about->output_v_per_count;
    lowest = vl_about->bits == 16 ? INT16_MIN : INT32_MIN;
    highest = vl_about->bits == 16 ? INT16_MAX : INT32_MAX;
}

/* -- every sample --------------------------------------------------------------------------------------------------------------- */

int32_t vl_tick_output(void)
{
    const double counts = rint(output_v * counts_per_v); /* as the host does it */
    return (int32_t)(counts < highest ? counts > lowest ? counts : lowest : highest);
}

bool vl_tick(const int32_t counts[], uint16_t flags)
{
    double put_out = (double)NAN;
    struct tick_continuation continuation;
    const uint32_t n_channels = vl_about->n_channels;
    const struct tick_samples samples = {volts, &flags, readings, &row, &output_v, &put_out, &continuation};
    for (uint32_t channel = 0; channel < n_channels; channel++)
        volts[channel] = counts ? (double)counts[channel] * v_per_count[channel] : (double)NAN;
    if (vibrolock_tick(&t, &samples, 1, n_channels) == 0 && isfinite(output_v))
        return true;
    output_v = 0.0;
    return false;
}

void vl_keep_row(uint8_t *block, uint32_t index)
{
    const size_t of_readings = vl_about->n_channels * sizeof readings[0];
    memcpy(block + index * of_readings, readings, of_readings);
    memcpy(block + vl_in_force.block * of_readings + index * sizeof row, &row, sizeof row);
}

/* -- what the host is told of the loop's state ------------------------------------------------------------------------------------- */

static uint8_t *put_piece(uint8_t *into, uint32_t place, size_t offset, size_t length)
{
    into = vl_put(vl_put(vl_put(into, place, 2), length, 2), offset, 4);
    memcpy(into, pool + begin[place] + offset, length);
    return into + length;
}

static uint8_t *put_outcome(uint8_t *into, uint32_t index)
{
    return put_piece(into, VL_A_outcomes, index * sizeof *t.outcomes, sizeof *t.outcomes);
}

static uint8_t *put_refused(uint8_t *into, uint32_t number)
{
    const size_t entry = sizeof t.progress->refused[0], entries = sizeof t.progress->refused / entry;
    return put_piece(into, VL_A_progress, offsetof(struct tick_progress, refused) + number % entries * entry, entry);
}

static uint32_t next_of(uint32_t *turn, uint32_t n)
{
    *turn = *turn + 1 < n ? *turn + 1 : 0;
    return *turn;
}

enum { OFF = 3 }; /* of the guard: the host counts how long the output has been off */

/* A state is due with every so manieth block, with one in which a segment has ended or begun or the guard has changed, and once it is
   off. A segment that begins with a block has its first sample in the state of that block, not in that of the one before. */
static bool is_due(void)
{
    const int64_t segment = 2 * (int64_t)t.progress->segment + (int64_t)t.progress->entered, mode = (int64_t)t.guard->mode;
    if (++untold_blocks < vl_in_force.state_blocks && segment == segment_told && mode == mode_told && mode != OFF)
        return false;
    untold_blocks = 0;
    segment_told = segment;
    mode_told = mode;
    return true;
}

uint32_t vl_tick_state(uint8_t *into)
{
    if (!is_due())
        return 0;
    uint8_t *const first = into;
    const uint32_t segment = (uint32_t)t.progress->segment, last = (uint32_t)t.n_segments - 1;
    const uint32_t present = segment < last ? segment : last, refused = (uint32_t)t.progress->n_refused;
    into = vl_put(into, (uint64_t)t.loop->sample, 8);
    into = put_piece(into, VL_A_loop, 0, sizeof *t.loop);
    into = put_piece(into, VL_A_guard, 0, sizeof *t.guard);
    into = put_piece(into, VL_A_progress, 0, offsetof(struct tick_progress, refused));
    into = put_piece(into, VL_A_control, offsetof(struct tick_control, vibration), sizeof t.control->vibration);
    into = put_piece(into, VL_A_control, offsetof(struct tick_control, frequency), sizeof t.control->frequency);
    into = put_outcome(into, next_of(&in_turn, present + 1));
    if (present > 0)
        into = put_outcome(into, present - 1);
    into = put_outcome(into, present);
    if (refused > 0) {
        const uint32_t kept = refused < 64 ? refused : 64;
        into = put_refused(into, refused - 1 - next_of(&refused_in_turn, kept));
        into = put_refused(into, refused - 1);
    }
    return (uint32_t)(into - first);
}

/* -- what the host asks for while it runs ---------------------------------------------------------------------------------------- */

void vl_tick_ramp_locked(void)
{
    t.guard->stop_requested = 1;
}

void vl_tick_release_locked(void)
{
    t.progress->held_back = 0;
}

#endif
