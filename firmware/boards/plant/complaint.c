/* Lines on standard error. */

#include <string.h>
#include <unistd.h>

#include "plant.h"

void plant_complain(const char *what, const char *about)
{
    const char *const texts[] = {what, about, "\n"};
    for (size_t i = 0; i < sizeof texts / sizeof texts[0]; i++)
        if (write(STDERR_FILENO, texts[i], strlen(texts[i])) < 0)
            return;
}
