/* One libm for two processors: a program of this computer notes what its functions return, in libm.bin, and an image for a
 * Cortex-M looks its values up there. Linked with --wrap for each function. What was not noted ends the image with status 4. */

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { SIN, COS, EXP, LOG, POW, ATAN2 };

struct note {
    int64_t function;
    double x, y, value;
};

#ifdef __arm__
#define MOST 32768
#define BEHIND 8 /* notes: the order within a sample differs a little */

/* Equal to the bit, or both no numbers, to which processors give different signs. */
static int same(double a, double b) { return memcmp(&a, &b, sizeof a) == 0 || (a != a && b != b); }

static double found(int function, double x, double y) {
    static struct note notes[MOST];
    static size_t n, at;
    if (n == 0) {
        FILE *file = fopen("libm.bin", "rb");
        n = file ? fread(notes, sizeof *notes, MOST, file) : 0;
    }
    at = at > BEHIND ? at - BEHIND : 0;
    for (size_t tried = 0; tried < n; tried++, at = at + 1 < n ? at + 1 : 0)
        if (notes[at].function == function && same(notes[at].x, x) && same(notes[at].y, y))
            return notes[at].value;
    exit(4);
}
#define WRAP1(name, function) \
    double __wrap_##name(double x); \
    double __wrap_##name(double x) { return found(function, x, 0.0); }
#define WRAP2(name, function) \
    double __wrap_##name(double x, double y); \
    double __wrap_##name(double x, double y) { return found(function, x, y); }
#else
static double noted(int function, double x, double y, double value) {
    static FILE *file;
    if (file == NULL && (file = fopen("libm.bin", "wb")) == NULL)
        exit(4);
    const struct note one = {function, x, y, value};
    fwrite(&one, sizeof one, 1, file);
    return value;
}
#define WRAP1(name, function) \
    double __real_##name(double x); \
    double __wrap_##name(double x); \
    double __wrap_##name(double x) { return noted(function, x, 0.0, __real_##name(x)); }
#define WRAP2(name, function) \
    double __real_##name(double x, double y); \
    double __wrap_##name(double x, double y); \
    double __wrap_##name(double x, double y) { return noted(function, x, y, __real_##name(x, y)); }
#endif

WRAP1(sin, SIN)
WRAP1(cos, COS)
WRAP1(exp, EXP)
WRAP1(log, LOG)
WRAP2(pow, POW)
WRAP2(atan2, ATAN2)

#ifndef __arm__
void __wrap_sincos(double x, double *s, double *c);
void __wrap_sincos(double x, double *s, double *c) {
    *s = __wrap_sin(x);
    *c = __wrap_cos(x);
}
#endif
