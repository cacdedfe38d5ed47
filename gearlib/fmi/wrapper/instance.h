/* An instance of the model, without a word of FMI: values, events, steps. fmi2.c and fmi3.c are two faces of it. */
#ifndef GEARLIB_INSTANCE_H
#define GEARLIB_INSTANCE_H

#include <stddef.h>
#include "model.h"
#include "record.h" /* generated: the record of gearlib's Runge-Kutta loop */

typedef enum { INSTANTIATED, INITIALISING, EVENT, CONTINUOUS, STEPPING, STOPPED } Mode;

typedef struct Instance {
    Record record;
    double *numbers; /* all that follows, in one piece */
    double *data, *x, *given, *rates, *observed, *entries, *g, *side, *scale, *slopes, *bases, *step_memory;
    int64_t *is_given;
    int32_t *fired;
    size_t n_numbers;
    double t, start, stop, tolerance;
    double next_event;        /* s; of a condition of time */
    double extrapolated_from; /* s; inputs follow slopes from there */
    Mode mode;
    int stepping; /* co-simulation */
    int prepared, begun, has_rates, has_observed, has_entries, step_ready, extrapolates;
    int64_t events;
    /* messages */
    void *environment;
    void (*say)(struct Instance *, int is_error, const char *text);
    void (*log)(void);
    void (*ask)(struct Instance *, double t); /* lets the importing tool set inputs within a step; NULL: they are constant there */
    void (*asked)(void);                      /* the tool's function that ask calls */
    int asking;
    char *instance_name;
    int logging;
} Instance;

enum { FINE = 0, REFUSED = 1, FAILED = 2 }; /* REFUSED: the point cannot be evaluated, another one may */

Instance *make_instance(const char *name, int stepping);
void free_instance(Instance *m);
void reset_instance(Instance *m);
int has_started(const Instance *m);

int get_values(Instance *m, const uint32_t *references, size_t n, double *values);
int set_values(Instance *m, const uint32_t *references, size_t n, const double *values);
int set_slope(Instance *m, uint32_t reference, double slope);

int start_up(Instance *m, double tolerance, double start, double stop); /* tolerance, stop: 0 where not defined */
int ready(Instance *m);
void set_time(Instance *m, double t);
int set_states(Instance *m, const double *x, size_t n);
int get_states(Instance *m, double *x, size_t n);
int get_rates(Instance *m, double *rates, size_t n);
int get_nominals(Instance *m, double *nominals, size_t n);
int get_indicators(Instance *m, double *z, size_t n);
int handle_events(Instance *m, int *states_changed, double *next);
int after_step(Instance *m);
int leave_initialisation(Instance *m);
void moved(Instance *m);
int directional(Instance *m, const uint32_t *unknowns, size_t n, const uint32_t *knowns, size_t k, const double *seed,
                double *result, int adjoint);

int do_step(Instance *m, double from, double h);

typedef struct Memory Memory;
Memory *remember(const Instance *m);
void recall(Instance *m, const Memory *memory);
size_t memory_size(const Instance *m);
int to_bytes(Instance *m, const Memory *memory, unsigned char *bytes, size_t size);
Memory *from_bytes(Instance *m, const unsigned char *bytes, size_t size);

#endif
