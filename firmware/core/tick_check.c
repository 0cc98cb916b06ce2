/* Whether the records of a run make sense, before the tick takes them: it trusts them, and looks at nothing itself. */

#include "tick.h"

#ifdef VL_HAS_TICK

#include <math.h>
#include <string.h>

/* Codes that the kernels know (rig.tick.sequencer.layout, rig.tick.safety.layout, controller): the highest of each. */
enum { KINDS = 7, DRIVES = 3, AMPLITUDE_LAWS = 3, DETECTORS = 2, FORCE_LOOPS = 2, FREQUENCY_LAWS = 1, STAGES = 3, LOCK_STATES = 3 };
enum { MODES = 3, ROLES = 3, ADAPTIVE = 2, ON_FAILURE = 1, OUTCOMES = 13 };
enum { MOST_HARMONICS = 12, LONGEST_AVERAGE = 64 }; /* entries that the rings and the filters have room for */

#define LONG_ENOUGH INT64_C(0x1000000000000) /* samples, periods: more overflow nothing, and no run is as long */
/* Of a point: the tick may go through all of them within a sample, where segments have no length. Plans have up to 20. */
#define MOST_RETRIES 100

static bool is_within(int64_t value, int64_t lowest, int64_t highest)
{
    return value >= lowest && value <= highest;
}

static bool is_flag(int64_t value)
{
    return is_within(value, 0, 1);
}

/* -- how many there are --------------------------------------------------------------------------------------------------------- */

static uint32_t check_numbers(const struct tick_arrays *t)
{
    const int64_t channels = vl_about->n_channels;
    const struct {
        uint32_t place;
        int64_t n, due;
    } numbers[] = {
        {VL_A_law, t->n_law, 1},
        {VL_A_rule, t->n_rule, 1},
        {VL_A_limits, t->n_limits, 1},
        {VL_A_inputs, t->n_inputs, channels},
        {VL_A_expected, t->n_expected, 1},
        {VL_A_loop, t->n_loop, 1},
        {VL_A_control, t->n_control, 1},
        {VL_A_guard, t->n_guard, 1},
        {VL_A_watches, t->n_watches, channels},
        {VL_A_plausibility, t->n_plausibility, 1},
        {VL_A_settling, t->n_settling, 1},
        {VL_A_progress, t->n_progress, 1},
        {VL_A_outcomes, t->n_outcomes, t->n_segments},
    };
    for (uint32_t i = 0; i < sizeof numbers / sizeof numbers[0]; i++)
        if (numbers[i].n != numbers[i].due)
            return vl_tick_fault(numbers[i].place, VL_R_NUMBER);
    if (t->progress->segments != t->n_segments || t->n_segments > INT16_MAX)
        return vl_tick_fault(VL_A_segments, VL_R_NUMBER);
    if (!is_within(t->loop->delay_whole, 0, t->n_history) || t->n_history != t->loop->delay_whole + 2)
        return vl_tick_fault(VL_A_history, VL_R_NUMBER);
    return 0;
}

/* -- numbers that are none ------------------------------------------------------------------------------------------------------ */

/* Records that may hold infinity: a channel without a limit, harmonics that are not judged yet. NaN is allowed nowhere but where it
 * means that there was no reading and no result yet. */
static bool may_be_infinite(uint32_t place)
{
    return place == VL_A_inputs || place == VL_A_control;
}

static bool may_be_none(uint32_t place, size_t at)
{
    return place == VL_A_outcomes || (place == VL_A_watches && at == offsetof(struct tick_watches, last_v));
}

static bool are_numbers(uint32_t place, const uint8_t *record, size_t at, uint32_t n)
{
    for (; n > 0; n--, at += sizeof(double)) {
        double number;
        memcpy(&number, record + at, sizeof number);
        if (!isfinite(number) && !may_be_none(place, at) && !(may_be_infinite(place) && !isnan(number)))
            return false;
    }
    return true;
}

static uint32_t check_doubles(const struct tick_arrays *t)
{
    static const struct {
        uint16_t place, at, n, times, stride;
    } doubles[] = {
#define DOUBLES(name, at, n, times, stride) {VL_A_##name, at, n, times, stride},
        TICK_DOUBLES(DOUBLES)
    };
#define ARRAY(name, type) {t->name, sizeof(type), t->n_##name},
    const struct {
        const void *first;
        size_t bytes;
        int64_t n;
    } arrays[] = {TICK_ARRAYS(ARRAY)};
    for (uint32_t i = 0; i < sizeof doubles / sizeof doubles[0]; i++) {
        const uint32_t place = doubles[i].place;
        const uint8_t *record = arrays[place].first;
        const int64_t n = place == VL_A_waveforms ? t->n_waveforms * t->waveforms_length : arrays[place].n;
        for (int64_t index = 0; index < n; index++, record += arrays[place].bytes)
            for (uint32_t time = 0; time < doubles[i].times; time++)
                if (!are_numbers(place, record, doubles[i].at + (size_t)time * doubles[i].stride, doubles[i].n))
                    return vl_tick_fault(place, VL_R_NOT_A_NUMBER);
    }
    return 0;
}

/* -- places, codes and lengths ----------------------------------------------------------------------------------------------------- */

static bool is_law_possible(const struct tick_law *law)
{
    const int64_t harmonics = law->harmonics.highest;
    return is_within(law->detector.kind, 0, DETECTORS) && is_within(law->detector.harmonics, 0, MOST_HARMONICS)
           && (law->detector.kind != ADAPTIVE || law->detector.harmonics >= 1)
           && (harmonics == 0 || is_within(harmonics, 2, MOST_HARMONICS)) && is_flag(law->harmonics.of_drive)
           && is_within(law->frequency.law, 0, FREQUENCY_LAWS) && is_within(law->amplitude.force.loop, 0, FORCE_LOOPS)
           && law->amplitude.largest_v > 0.0;
}

static bool is_rule_possible(const struct tick_rule *rule)
{
    return is_within(rule->average_periods, 1, LONGEST_AVERAGE) && is_within(rule->settled_periods, 1, LONG_ENOUGH)
           && rule->phase_rad > 0.0 && rule->amplitude > 0.0;
}

/* A limit that is not above 0 would trip at once, or never. */
static bool are_limits_possible(const struct tick_limits *limits)
{
    return limits->voltage_v > 0.0 && limits->displacement_m > 0.0 && limits->lowest_rad_s > 0.0
           && limits->highest_rad_s >= limits->lowest_rad_s && limits->slew_v_per_sample > 0.0 && limits->integrator_gain > 0.0
           && limits->integrator_leak >= 0.0 && limits->integrator_leak <= 1.0 && limits->resonance_rad_s > 0.0
           && is_within(limits->overload_samples, 1, LONG_ENOUGH) && is_within(limits->stuck_samples, 1, LONG_ENOUGH)
           && is_within(limits->lost_samples, 1, LONG_ENOUGH) && is_within(limits->ramp_down_samples, 1, LONG_ENOUGH);
}

static bool is_input_possible(const struct tick_inputs *input)
{
    return isfinite(input->unit_per_volt) && input->unit_per_volt != 0.0 && input->overload_v > 0.0 && input->limit > 0.0
           && is_within(input->role, 0, ROLES) && is_flag(input->watch_displacement) && is_flag(input->emergency_stop);
}

static bool is_segment_possible(const struct tick_arrays *t, int64_t index)
{
    const struct tick_segments *segment = &t->segments[index];
    return is_within(segment->kind, 0, KINDS) && is_within(segment->amplitude_law, 0, AMPLITUDE_LAWS)
           && is_within(segment->drive, 0, DRIVES) && is_within(segment->on_failure, 0, ON_FAILURE)
           && is_within(segment->on_lost_lock, 0, ON_FAILURE) && is_flag(segment->geometric) && is_flag(segment->logarithmic)
           && is_within(segment->waveform, 0, t->n_waveforms - 1) && is_within(segment->again, -1, index)
           && is_within(segment->samples, 0, LONG_ENOUGH) && segment->periods >= 0.0;
}

static bool is_loop_possible(const struct tick_arrays *t)
{
    const struct tick_loop *loop = t->loop;
    return loop->sample == 0 && is_within(loop->force_channel, 0, t->n_inputs - 1)
           && is_within(loop->drive_channel, 0, t->n_inputs - 1) && is_within(loop->queue_whole, 0, t->n_history)
           && is_within(loop->drive, 0, DRIVES) && is_within(loop->waveform, 0, t->n_waveforms - 1)
           && is_within(loop->play, 0, t->waveforms_length - 1) && is_within(loop->lost, 0, LONG_ENOUGH)
           && is_within(loop->uncertain, 0, LONG_ENOUGH) && is_within(loop->seen, 0, LONG_ENOUGH) && loop->delay_fraction >= 0.0
           && loop->delay_fraction < 1.0 && loop->dt_s > 0.0;
}

static bool is_progress_possible(const struct tick_arrays *t)
{
    const struct tick_progress *progress = t->progress;
    return progress->segment == 0 && progress->entered == 0 && progress->finished == 0 && progress->sample == 0
           && progress->n_refused == 0 && is_flag(progress->held_back) && is_flag(progress->unlocked)
           && is_within(progress->retries, 0, MOST_RETRIES) && is_within(progress->tries_left, 0, MOST_RETRIES)
           && is_within(progress->point, -1, LONG_ENOUGH);
}

static bool is_control_possible(const struct tick_control *control)
{
    return is_within(control->amplitude.law, 0, AMPLITUDE_LAWS) && is_within(control->lock.state, 0, LOCK_STATES)
           && is_within(control->harmonics.stage, 0, STAGES) && control->frequency.omega > 0.0
           && isfinite(control->frequency.omega);
}

static bool is_guard_possible(const struct tick_arrays *t)
{
    const struct tick_guard *guard = t->guard;
    return is_within(guard->mode, 0, MODES) && is_within(guard->channel, -1, t->n_inputs - 1)
           && guard->amplitude_v == 0.0; /* the output begins at 0 V */
}

static bool are_all(const struct tick_arrays *t, uint32_t place, int64_t n)
{
    for (int64_t index = 0; index < n; index++) {
        if (place == VL_A_inputs && !is_input_possible(&t->inputs[index]))
            return false;
        if (place == VL_A_segments && !is_segment_possible(t, index))
            return false;
        if (place == VL_A_outcomes && !is_within(t->outcomes[index].outcome, 0, OUTCOMES))
            return false;
        if (place == VL_A_waveforms && !(fabs(t->waveforms[index]) <= 1.0)) /* more would pass the voltage limit */
            return false;
    }
    return true;
}

static uint32_t check_ranges(const struct tick_arrays *t)
{
    const struct {
        uint32_t place;
        bool is_possible;
    } found[] = {
        {VL_A_law, is_law_possible(t->law)},
        {VL_A_rule, is_rule_possible(t->rule)},
        {VL_A_limits, are_limits_possible(t->limits)},
        {VL_A_inputs, are_all(t, VL_A_inputs, t->n_inputs)},
        {VL_A_segments, are_all(t, VL_A_segments, t->n_segments)},
        {VL_A_waveforms, are_all(t, VL_A_waveforms, t->n_waveforms * t->waveforms_length)},
        {VL_A_loop, is_loop_possible(t)},
        {VL_A_control, is_control_possible(t->control)},
        {VL_A_guard, is_guard_possible(t)},
        {VL_A_settling, is_within(t->settling->count, 0, LONG_ENOUGH)},
        {VL_A_progress, is_progress_possible(t)},
        {VL_A_outcomes, are_all(t, VL_A_outcomes, t->n_outcomes)},
    };
    for (uint32_t i = 0; i < sizeof found / sizeof found[0]; i++)
        if (!found[i].is_possible)
            return vl_tick_fault(found[i].place, VL_R_RANGE);
    return 0;
}

/* -- against the device ------------------------------------------------------------------------------------------------------------ */

static uint32_t check_device(const struct tick_arrays *t)
{
    const double of_a_setting = 0.0005, rounding = 1e-9; /* mHz in Hz, to the nearest; of the numbers themselves */
    const double rate_hz = vl_settings.rate_mhz / 1000.0;
    if (!(fabs(1.0 / t->loop->dt_s - rate_hz) <= of_a_setting + rounding * rate_hz))
        return vl_tick_fault(VL_A_loop, VL_R_RATE);
    const double of_a_float = 1e-6; /* the range is told in single precision */
    if (!(t->limits->voltage_v <= (double)vl_about->output_range_v * (1.0 + of_a_float)))
        return vl_tick_fault(VL_A_limits, VL_R_VOLTAGE);
    return 0;
}

uint32_t vl_tick_check(const struct tick_arrays *t)
{
    uint32_t fault = check_numbers(t);
    if (!fault)
        fault = check_doubles(t);
    if (!fault)
        fault = check_ranges(t);
    return fault ? fault : check_device(t);
}

#endif
