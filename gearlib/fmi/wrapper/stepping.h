/* Between values and steps. */
#ifndef GEARLIB_STEPPING_H
#define GEARLIB_STEPPING_H

#include "instance.h"

int fail(Instance *m, int code, const char *format, ...);
void move_inputs(Instance *m, double t);
int64_t step_numbers(void);
void point_record(Instance *m);

#endif
