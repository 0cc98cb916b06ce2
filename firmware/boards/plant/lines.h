/* The lines of a description. */

#ifndef PLANT_LINES_H
#define PLANT_LINES_H

#include "plant.h"

#define PLANT_LINE 128 /* characters of a line, with its end */

/* Note a line; false if it makes no sense. */
bool plant_take_line(struct plant *plant, const char *line);

/* Complete the description; false after one line on standard error that names one that has not. */
bool plant_is_described(struct plant *plant);

/* A double as float.hex() writes it; the rest of the text, or NULL if it is none. Own code, for strtod of newlib needs a heap. */
const char *plant_take_double(const char *text, double *value);

#endif
