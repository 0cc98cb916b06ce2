/* The exchange with the virtual structure. */

#include "plant.h"

#include <errno.h>
#include <string.h>
#include <unistd.h>

#include "lines.h"

#define OVERLOAD 1u

/* counts go over the pipe as they lie in memory */
_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "the structure's counts are little-endian");

static int32_t answer[1 + VL_LARGEST_BLOCK * VL_MOST_CHANNELS];

/* All n bytes; false at the end of the file. */
static bool read_all(int from, void *into, size_t n)
{
    uint8_t *bytes = into;
    while (n > 0) {
        const ssize_t got = read(from, bytes, n);
        if (got < 0 && errno == EINTR)
            continue;
        if (got <= 0)
            return false;
        bytes += got;
        n -= (size_t)got;
    }
    return true;
}

static bool write_all(int to, const void *from, size_t n)
{
    const uint8_t *bytes = from;
    while (n > 0) {
        const ssize_t taken = write(to, bytes, n);
        if (taken < 0 && errno == EINTR)
            continue;
        if (taken <= 0)
            return false;
        bytes += taken;
        n -= (size_t)taken;
    }
    return true;
}

bool plant_open(struct plant *plant, int from, int to)
{
    char line[PLANT_LINE];
    memset(plant, 0, sizeof *plant);
    plant->from = from;
    plant->to = to;
    for (;;) {
        size_t n = 0;
        while (n < sizeof line - 1 && read_all(from, line + n, 1) && line[n] != '\n')
            n++;
        if (n == sizeof line - 1 || line[n] != '\n') {
            plant_complain("plant: the description ends, or a line of it is too long, before a line 'end'", "");
            return false;
        }
        line[n] = '\0';
        if (strcmp(line, "end") == 0)
            return plant_is_described(plant);
        if (!plant_take_line(plant, line)) {
            plant_complain("plant: a line of the description makes no sense: ", line);
            return false;
        }
    }
}

bool plant_measure(struct plant *plant, uint32_t n)
{
    const size_t channels = plant->description.n_channels;
    if (!write_all(plant->to, &n, sizeof n) || !write_all(plant->to, plant->outputs, n * sizeof plant->outputs[0]) ||
        !read_all(plant->from, answer, (1 + n * channels) * sizeof answer[0]))
        return false;
    const bool overload = ((uint32_t)answer[0] & OVERLOAD) != 0;
    for (size_t row = 0; row < n; row++)
        vl_input(&answer[1 + row * channels], overload);
    return true;
}

bool plant_rest(struct plant *plant)
{
    const uint32_t none = 0;
    return write_all(plant->to, &none, sizeof none) && read_all(plant->from, answer, sizeof answer[0]);
}
