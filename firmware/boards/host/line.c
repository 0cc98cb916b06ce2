/* Bytes over the near end of a pseudo-terminal. A line that is full takes no bytes, and one without another end has none. */

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "board.h"
#include "host.h"

#define WAIT_MS 1

static int line = -1;
static bool is_full;

bool line_open(int descriptor)
{
    const int flags = fcntl(descriptor, F_GETFL);
    if (flags < 0 || fcntl(descriptor, F_SETFL, flags | O_NONBLOCK) < 0) {
        plant_complain("--line: cannot be used: ", strerror(errno));
        return false;
    }
    line = descriptor;
    return true;
}

size_t line_read(uint8_t *bytes, size_t room)
{
    const ssize_t n = read(line, bytes, room);
    return n > 0 ? (size_t)n : 0;
}

size_t line_write(const uint8_t *bytes, size_t n)
{
    const ssize_t taken = write(line, bytes, n);
    const size_t out = taken > 0 ? (size_t)taken : 0;
    is_full = out < n;
    return out;
}

void line_wait(void)
{
    struct pollfd waited[] = {
        {.fd = line, .events = (short)(is_full ? POLLIN | POLLOUT : POLLIN)},
        {.fd = host_structure.from}, /* that it is gone is told unasked */
    };
    const struct timespec moment = {.tv_nsec = 1000000 * WAIT_MS};
    if (poll(waited, 2, WAIT_MS) <= 0)
        return;
    if (waited[1].revents != 0)
        sampling_end_without_structure();
    if ((waited[0].revents & (POLLIN | POLLOUT)) == 0)
        nanosleep(&moment, NULL); /* nobody at the other end: poll does not wait */
}

size_t board_read(uint8_t *bytes, size_t room)
{
    return line_read(bytes, room);
}

size_t board_write(const uint8_t *bytes, size_t n)
{
    return line_write(bytes, n);
}
