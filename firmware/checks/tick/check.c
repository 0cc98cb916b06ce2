/* Runs the compiled tick over samples of a file, or functions of libm over numbers of one: in.bin, out.bin (images.py). */

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "instructions.h"
#include "vibrolock_tick.h"

#define POOL (2 << 20)

static FILE *in, *out;
static _Alignas(8) unsigned char pool[POOL];
static size_t used;

static void need(int fine) {
    if (!fine)
        exit(2);
}

static int64_t number(void) {
    int64_t value;
    need(fread(&value, sizeof value, 1, in) == 1);
    return value;
}

static void *room(int64_t bytes) {
    void *place = pool + used;
    used += ((size_t)bytes + 7) / 8 * 8;
    need(bytes >= 0 && used <= sizeof pool);
    return place;
}

static void *take(int64_t bytes) {
    void *place = room(bytes);
    need(fread(place, 1, (size_t)bytes, in) == (size_t)bytes);
    return place;
}

static void give(const void *from, int64_t bytes) {
    need(fwrite(from, 1, (size_t)bytes, out) == (size_t)bytes);
}

#define ALL_RECORDS(DO) \
    DO(law) DO(rule) DO(limits) DO(inputs) DO(expected) DO(segments) DO(loop) DO(control) DO(guard) DO(watches) \
    DO(plausibility) DO(settling) DO(progress) DO(outcomes) DO(history)

static void run_tick(void) {
    struct tick_arrays t;
    struct tick_samples s;
    const int64_t n = number(), channels = number(), block = number();
#define TAKE(name) t.n_##name = number(), t.name = take(t.n_##name * (int64_t)sizeof *t.name);
    ALL_RECORDS(TAKE)
    t.n_waveforms = number(), t.waveforms_length = number();
    t.waveforms = take(t.n_waveforms * t.waveforms_length * 8);
    s.volts = take(n * channels * 8), s.flags = take(n * 2), s.put_out = take(n * 8);
    s.readings = room(n * channels * 4), s.rows = room(n * (int64_t)sizeof *s.rows), s.outputs = room(n * 8);
    s.continuation = room(sizeof *s.continuation);
    uint32_t *counts = room(n * 4);
    paint_stack();
    for (int64_t at = 0; at < n; at += block) {
        const struct tick_samples part = {s.volts + at * channels, s.flags + at, s.readings + at * channels, s.rows + at,
                                          s.outputs + at, s.put_out + at, s.continuation};
        const uint32_t before = instruction_clock();
        need(vibrolock_tick(&t, &part, block, channels) == 0);
        counts[at] = instruction_clock() - before;
    }
    const int64_t stack = stack_used();
    give(vibrolock_tick_digest, 64), give(&stack, 8);
#define GIVE(name) give(t.name, t.n_##name * (int64_t)sizeof *t.name);
    ALL_RECORDS(GIVE)
    give(s.readings, n * channels * 4), give(s.rows, n * (int64_t)sizeof *s.rows), give(s.outputs, n * 8);
    give(counts, n * 4);
}

static double of_power(double x) { return pow(x, 1.7); }
static double of_angle(double x) { return atan2(x, 0.7); }

static void run_functions(void) {
    static double (*const functions[])(double) = {sin, cos, exp, log, of_power, of_angle};
    double (*function)(double) = functions[number()];
    const int64_t n = number();
    double *values = take(n * 8);
    for (int64_t index = 0; index < n; index++)
        values[index] = function(values[index]);
    give(values, n * 8);
}

int main(void) {
    need((in = fopen("in.bin", "rb")) != NULL && (out = fopen("out.bin", "wb")) != NULL);
    start_instruction_clock();
    for (int64_t what = number(); what != 0; what = number())
        (what == 1 ? run_tick : run_functions)(), used = 0;
    return fclose(out) != 0;
}
