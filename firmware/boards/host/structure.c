/* The virtual structure behind the converters. */

#include "host.h"

struct plant host_structure;
