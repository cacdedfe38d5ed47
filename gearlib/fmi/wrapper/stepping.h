/* Between values and steps. */
#ifndef GEARLIB_STEPPING_H
#define GEARLIB_STEPPING_H

#include "instance.h"

#define NEVER 1e300 /* s: a time that does not come */

int fail(Instance *m, int code, const char *format, ...);
void note_event(Instance *m, double t, const char *what);
void move_inputs(Instance *m, double t);
int64_t blocks(int64_t n); /* n numbers, in whole blocks of four */
int64_t step_numbers(void);
void point_record(Instance *m);
int check_bounds(Instance *m, double share);

#endif
