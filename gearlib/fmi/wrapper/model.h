/* What an FMU knows of its model: tables (in the generated model.c) and functions (object code of gearlib's compiler). */
#ifndef GEARLIB_MODEL_H
#define GEARLIB_MODEL_H

#include <stdint.h>

typedef int32_t ModelFunction(double t, double *x, void *values, double *data, int64_t *index);

/* Value references: 0 is time; then parameters, inputs, states, derivatives, outputs and event indicators follow each other. */
typedef struct {
    const char *name, *token;
    int64_t n_parameters, n_inputs, n_states, n_outputs, n_indicators;
    int64_t n_equations;       /* states of the model; an FMU has one at least */
    int64_t n_table;           /* entries of data that are parameters of any kind */
    int64_t inputs_at, all_inputs; /* where the inputs stand in data, and how many there are */
    int64_t discrete_at, n_discrete; /* the same for the discrete state */
    int64_t n_data, n_observed, n_entries;
    int has_events, has_derivatives;
    const int64_t *parameter_places; /* in data */
    const uint8_t *settable;         /* 0: constant or computed, 1: a parameter, 2: one that is fixed once the run has started */
    const double *lower, *upper;
    const char *const *parameter_names;
    const int64_t *input_places;
    const uint8_t *start_settable; /* whether a state's start value is its own */
    const double *nominal;
    const int64_t *output_slots, *output_discrete; /* -1 where it is the other one, or always zero */
    const double *output_signs;
    const int64_t *columns, *rows; /* pattern of the derivatives, compressed columns; rows: derivatives, then what is observed */
    const char *const *checks;     /* what prepare and begin find wrong */
    const char *const *indicator_names;
    int64_t n_bounds; /* variables with a least value: slot, sign, and the states from which they are computed */
    const int64_t *bound_slots, *bound_from, *bound_states;
    const double *bound_signs, *bound_least, *bound_sizes;
    const char *const *bound_names;
    const double *data;
    const int64_t *index;
    double tolerance, stop_time;
    int driven; /* whether time drives the model, so that steps must be short */
} Model;

extern const Model model;

extern ModelFunction rhs, observe, jac, roots, update, settle, prepare, begin, next_time, longest_step;

#endif
