/* Values, start and events of an instance. What is computed is computed when it is asked for, from what was set last. */
#include "stepping.h"
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define INDEX ((int64_t *)model.index)
#define HYSTERESIS 1e-10 /* of the largest value of an event function since the last event: how far it must cross zero */
#define SMALLEST 1e-6    /* what that largest value is taken for at least */

/* ------------------------------------------------------------ memory */

int64_t blocks(int64_t n) { return n > 0 ? (n + 3) / 4 * 4 : 4; }

/* Point the fields to their parts of the numbers; a copy of an instance does the same. */
static size_t arrange(Instance *m, double *numbers) {
    size_t at = 0;
    int64_t n = model.n_states;
#define PART(field, kind, count) m->field = (kind *)(numbers + at); at += (size_t)(count)
    PART(data, double, model.n_data);
    PART(x, double, blocks(n));
    PART(given, double, n);
    PART(is_given, int64_t, n);
    PART(rates, double, blocks(n));
    PART(observed, double, model.n_observed + 1);
    PART(entries, double, model.n_entries + 1);
    PART(g, double, model.n_indicators + 1);
    PART(side, double, model.n_indicators + 1);
    PART(scale, double, model.n_indicators + 1);
    PART(fired, int32_t, model.n_indicators + 1);
    PART(slopes, double, model.all_inputs + 1);
    PART(bases, double, model.all_inputs + 1);
    PART(step_memory, double, step_numbers());
#undef PART
    return at;
}

Instance *make_instance(const char *name, int stepping) {
    Instance *m = calloc(1, sizeof *m);
    if (!m) return NULL;
    m->n_numbers = arrange(m, NULL);
    m->numbers = calloc(m->n_numbers, sizeof(double));
    m->instance_name = malloc(strlen(name) + 1);
    if (!m->numbers || !m->instance_name) {
        free_instance(m);
        return NULL;
    }
    strcpy(m->instance_name, name);
    m->stepping = stepping;
    reset_instance(m);
    return m;
}

void free_instance(Instance *m) {
    if (!m) return;
    free(m->numbers);
    free(m->instance_name);
    free(m);
}

void reset_instance(Instance *m) {
    memset(m->numbers, 0, m->n_numbers * sizeof(double));
    arrange(m, m->numbers);
    memset(&m->record, 0, sizeof m->record);
    memcpy(m->data, model.data, (size_t)model.n_data * sizeof(double));
    m->t = m->start = 0.0;
    m->stop = model.stop_time;
    m->tolerance = model.tolerance;
    m->mode = INSTANTIATED;
    m->prepared = m->begun = m->step_ready = m->extrapolates = 0;
    m->events = 0;
    m->next_event = NEVER;
    moved(m);
}

struct Memory {
    Instance head;
    char token[40]; /* of this FMU: another one's numbers may be as many */
    double numbers[];
};

Memory *remember(const Instance *m) {
    Memory *memory = malloc(sizeof *memory + m->n_numbers * sizeof(double));
    if (!memory) return NULL;
    memory->head = *m;
    strncpy(memory->token, model.token, sizeof memory->token);
    memcpy(memory->numbers, m->numbers, m->n_numbers * sizeof(double));
    return memory;
}

void recall(Instance *m, const Memory *memory) {
    Instance own = *m;
    *m = memory->head;
    m->numbers = own.numbers;
    m->environment = own.environment;
    m->say = own.say;
    m->log = own.log;
    m->ask = own.ask;
    m->asked = own.asked;
    m->asking = 0;
    m->instance_name = own.instance_name;
    m->logging = own.logging;
    m->stepping = own.stepping;
    memcpy(m->numbers, memory->numbers, m->n_numbers * sizeof(double));
    arrange(m, m->numbers);
    point_record(m);
}

size_t memory_size(const Instance *m) { return sizeof(Memory) + m->n_numbers * sizeof(double); }

int to_bytes(Instance *m, const Memory *memory, unsigned char *bytes, size_t size) {
    size_t needed = memory_size(m);
    if (!memory) return fail(m, FAILED, "there is no state to serialize");
    if (size < needed)
        return fail(m, FAILED, "a serialized state takes %lu bytes; there is room for %lu", (unsigned long)needed,
                    (unsigned long)size);
    memcpy(bytes, memory, needed);
    return FINE;
}

Memory *from_bytes(Instance *m, const unsigned char *bytes, size_t size) {
    size_t needed = memory_size(m);
    Memory *memory = size < needed ? NULL : malloc(needed); /* what to_bytes has filled of a larger array, too */
    if (memory) memcpy(memory, bytes, needed);
    if (memory && strncmp(memory->token, model.token, sizeof memory->token) == 0) return memory;
    free(memory);
    fail(m, FAILED, "these %lu bytes are no serialized state of this FMU, which takes %lu", (unsigned long)size,
         (unsigned long)needed);
    return NULL;
}

/* ------------------------------------------------------------ messages */

int fail(Instance *m, int code, const char *format, ...) {
    char text[1000];
    va_list rest;
    va_start(rest, format);
    vsnprintf(text, sizeof text, format, rest);
    va_end(rest);
    if (m->say) m->say(m, 1, text);
    return code;
}

void note_event(Instance *m, double t, const char *what) {
    char text[400];
    m->events++;
    if (!m->logging || !m->say) return;
    snprintf(text, sizeof text, "event at t = %.12g s: %s", t, what);
    m->say(m, 0, text);
}

/* ------------------------------------------------------------ start */

int has_started(const Instance *m) { return m->mode > INITIALISING; }

void moved(Instance *m) { m->has_rates = m->has_observed = m->has_entries = 0; }

/* Parameters, start values and the discrete state, as far as something was set that they follow from. */
int ready(Instance *m) {
    int32_t code;
    if (m->prepared && (m->begun || has_started(m))) return FINE;
    moved(m);
    if (!has_started(m)) { /* nothing is remembered of earlier evaluations */
        memcpy(m->data + model.n_table, model.data + model.n_table, (size_t)(model.discrete_at - model.n_table) * sizeof(double));
        memcpy(m->data + model.discrete_at, model.data + model.discrete_at, (size_t)model.n_discrete * sizeof(double));
        int64_t rest = model.inputs_at + model.all_inputs;
        memcpy(m->data + rest, model.data + rest, (size_t)(model.n_data - rest) * sizeof(double));
    }
    if ((code = prepare(m->t, m->x, m->observed, m->data, INDEX)) != 0)
        return fail(m, FAILED, "%s", model.checks[code - 1]);
    m->prepared = 1;
    if (has_started(m)) return FINE;
    if ((code = begin(m->t, m->x, m->observed, m->data, INDEX)) != 0) return fail(m, FAILED, "%s", model.checks[code - 1]);
    for (int64_t i = 0; i < model.n_states; i++)
        if (m->is_given[i]) m->x[i] = m->given[i];
    if (model.has_events) settle(m->t, m->x, m->observed, m->data, INDEX);
    for (int64_t i = 0; i < model.n_indicators; i++) m->scale[i] = 0.0;
    m->begun = 1;
    return FINE;
}

int start_up(Instance *m, double tolerance, double start, double stop) {
    m->t = m->start = start;
    m->stop = stop > start ? stop : start + model.stop_time;
    if (tolerance > 0.0) m->tolerance = tolerance < 1e-13 ? 1e-13 : tolerance > 0.1 ? 0.1 : tolerance;
    m->mode = INITIALISING;
    m->begun = 0;
    return ready(m);
}

/* ------------------------------------------------------------ evaluation */

/* Inputs that follow slopes, or that the importing tool sets within the step, at a time. */
void move_inputs(Instance *m, double t) {
    if (m->ask) {
        m->asking = 1;
        m->ask(m, t);
        m->asking = 0;
    }
    if (!m->extrapolates) return;
    for (int64_t k = 0; k < model.all_inputs; k++)
        if (m->slopes[k] != 0.0) m->data[model.inputs_at + k] = m->bases[k] + m->slopes[k] * (t - m->extrapolated_from);
}

void set_time(Instance *m, double t) {
    if (m->t != t) moved(m);
    m->t = t;
}

static int take_rates(Instance *m) {
    int code = ready(m);
    if (code || m->has_rates) return code;
    if (rhs(m->t, m->x, m->rates, m->data, INDEX) != 0) return fail(m, REFUSED, "the equations have no solution at t = %.9g s", m->t);
    m->has_rates = 1;
    return FINE;
}

static int take_observed(Instance *m) {
    int code = ready(m);
    if (code || m->has_observed) return code;
    if (observe(m->t, m->x, m->observed, m->data, INDEX) != 0)
        return fail(m, REFUSED, "the outputs cannot be computed at t = %.9g s", m->t);
    m->has_observed = 1;
    return FINE;
}

/* The equations rely on least values: beyond them they go on without a word, as a freewheel that is overtaken. */
int check_bounds(Instance *m, double share) {
    int code = model.n_bounds ? take_observed(m) : FINE;
    for (int64_t i = 0; i < model.n_bounds && !code; i++) {
        double value = model.bound_signs[i] * m->observed[model.bound_slots[i]], size = fmax(model.bound_sizes[i], fabs(value));
        for (int64_t k = model.bound_from[i]; k < model.bound_from[i + 1]; k++)
            size = fmax(size, fabs(m->x[model.bound_states[k]]));
        if (value < model.bound_least[i] - share * size)
            code = fail(m, FAILED, "%s is %.9g at t = %.9g s, but it cannot be below %g", model.bound_names[i], value, m->t,
                        model.bound_least[i]);
    }
    return code;
}

int leave_initialisation(Instance *m) {
    int code = ready(m);
    if (!code) code = check_bounds(m, 1e-8);
    m->mode = m->stepping ? STEPPING : EVENT;
    return code;
}

static int take_g(Instance *m) {
    int code = ready(m);
    if (code || !model.n_indicators) return code;
    if (roots(m->t, m->x, m->g, m->data, INDEX) != 0)
        return fail(m, REFUSED, "the event indicators cannot be computed at t = %.9g s", m->t);
    return FINE;
}

/* An event function crosses zero where it has left its side by a little, so that it is beyond zero when the event is handled. Zero itself
   counts as negative: a signal may come to rest there. */
static double indicator(const Instance *m, int64_t i) {
    double scale = m->scale[i] > SMALLEST ? m->scale[i] : SMALLEST;
    return m->g[i] + (m->g[i] == 0.0 && m->side[i] > 0 ? -1 : m->side[i]) * HYSTERESIS * scale;
}

static int is_long(Instance *m, size_t n, int64_t expected, const char *things) {
    if ((int64_t)n == expected) return FINE;
    return fail(m, FAILED, "the model has %d %s, not %lu", (int)expected, things, (unsigned long)n);
}

int set_states(Instance *m, const double *x, size_t n) {
    int code = is_long(m, n, model.n_states, "states");
    if (code || memcmp(m->x, x, n * sizeof(double)) == 0) return code;
    memcpy(m->x, x, n * sizeof(double));
    moved(m);
    return FINE;
}

int get_states(Instance *m, double *x, size_t n) {
    int code = is_long(m, n, model.n_states, "states");
    if (!code && !(code = ready(m))) memcpy(x, m->x, n * sizeof(double));
    return code;
}

int get_rates(Instance *m, double *rates, size_t n) {
    int code = is_long(m, n, model.n_states, "states");
    if (!code && !(code = take_rates(m))) memcpy(rates, m->rates, n * sizeof(double));
    return code;
}

int get_nominals(Instance *m, double *nominals, size_t n) {
    int code = is_long(m, n, model.n_states, "states");
    if (!code) memcpy(nominals, model.nominal, n * sizeof(double));
    return code;
}

int get_indicators(Instance *m, double *z, size_t n) {
    int code = is_long(m, n, model.n_indicators, "event indicators");
    if (code || (code = take_g(m))) return code;
    for (int64_t i = 0; i < model.n_indicators; i++) z[i] = indicator(m, i);
    return FINE;
}

static int get_value(Instance *m, uint32_t reference, double *value) {
    int64_t k = reference;
    int code;
    if (k == 0) {
        *value = m->t;
        return FINE;
    }
    if ((k -= 1) < model.n_parameters) {
        if ((code = ready(m))) return code;
        *value = m->data[model.parameter_places[k]];
        return FINE;
    }
    if ((k -= model.n_parameters) < model.n_inputs) {
        *value = m->data[model.input_places[k]];
        return FINE;
    }
    if ((k -= model.n_inputs) < model.n_states) {
        if ((code = ready(m))) return code;
        *value = m->x[k];
        return FINE;
    }
    if ((k -= model.n_states) < model.n_states) {
        if ((code = take_rates(m))) return code;
        *value = m->rates[k];
        return FINE;
    }
    if ((k -= model.n_states) < model.n_outputs) {
        if (model.output_discrete[k] >= 0) {
            if ((code = ready(m))) return code;
            *value = m->data[model.discrete_at + model.output_discrete[k]];
        } else if (model.output_slots[k] >= 0) {
            if ((code = take_observed(m))) return code;
            *value = model.output_signs[k] * m->observed[model.output_slots[k]];
        } else
            *value = 0.0;
        return FINE;
    }
    if ((k -= model.n_outputs) < model.n_indicators) {
        if (!(code = take_g(m))) *value = indicator(m, k);
        return code;
    }
    return fail(m, FAILED, "there is no variable with the value reference %u", (unsigned)reference);
}

int get_values(Instance *m, const uint32_t *references, size_t n, double *values) {
    int code = FINE;
    for (size_t i = 0; i < n && !code; i++) code = get_value(m, references[i], &values[i]);
    return code;
}

static int set_value(Instance *m, uint32_t reference, double value) {
    int64_t k = (int64_t)reference - 1;
    if (m->asking) { /* the integrator goes on */
        if ((k -= model.n_parameters) < 0 || k >= model.n_inputs)
            return fail(m, FAILED, "only inputs can be set within a step, and value reference %u is none", (unsigned)reference);
        m->data[model.input_places[k]] = value;
        return FINE;
    }
    if (k >= 0 && k < model.n_parameters) {
        const char *name = model.parameter_names[k];
        double *place = m->data + model.parameter_places[k];
        if (!model.settable[k]) {
            if (value == *place) return FINE;
            return fail(m, FAILED, "%s cannot be set: it is constant, or follows from other parameters", name);
        }
        if (model.settable[k] == 2 && has_started(m) && value != *place)
            return fail(m, FAILED, "%s cannot be set during a run: instants repeat with it; set it before the start", name);
        if (!(value >= model.lower[k] && value <= model.upper[k]) || !isfinite(value))
            return fail(m, FAILED, "%s is %.9g; it must lie between %g and %g", name, value, model.lower[k], model.upper[k]);
        if (*place != value) {
            *place = value;
            m->prepared = m->begun = 0;
            m->record.started = 0;
            moved(m);
        }
        return FINE;
    }
    if ((k -= model.n_parameters) >= 0 && k < model.n_inputs) {
        double *place = m->data + model.input_places[k];
        if (*place != value) {
            *place = value;
            m->begun = 0;
            m->record.started = 0;
            moved(m);
        }
        return FINE;
    }
    if ((k -= model.n_inputs) >= 0 && k < model.n_states) {
        if (has_started(m)) {
            m->x[k] = value;
            m->record.started = 0;
        } else if (!model.start_settable[k]) {
            int code = ready(m);
            if (code || m->x[k] == value) return code;
            return fail(m, FAILED, "the start value of state %d follows from parameters and cannot be set", (int)k);
        } else {
            m->given[k] = value;
            m->is_given[k] = 1;
            m->begun = 0;
        }
        moved(m);
        return FINE;
    }
    if (reference == 0 && value == m->t) return FINE;
    return fail(m, FAILED, "the variable with the value reference %u cannot be set", (unsigned)reference);
}

int set_values(Instance *m, const uint32_t *references, size_t n, const double *values) {
    int code = FINE;
    for (size_t i = 0; i < n && !code; i++) code = set_value(m, references[i], values[i]);
    return code;
}

int set_slope(Instance *m, uint32_t reference, double slope) {
    int64_t k = (int64_t)reference - 1 - model.n_parameters;
    if (k < 0 || k >= model.n_inputs) return fail(m, FAILED, "value reference %u is no input", (unsigned)reference);
    k = model.input_places[k] - model.inputs_at;
    if (m->slopes[k] != slope) m->record.started = 0;
    m->slopes[k] = slope;
    m->extrapolates = 1;
    return FINE;
}

/* ------------------------------------------------------------ derivatives */

/* Columns of knowns, rows of unknowns: states and inputs by number, derivatives and observed slots by number; -1 for others. */
static int64_t column_of(uint32_t reference) {
    int64_t k = (int64_t)reference - 1 - model.n_parameters;
    if (k >= 0 && k < model.n_inputs) return model.n_equations + k;
    k -= model.n_inputs;
    return k >= 0 && k < model.n_equations ? k : -1;
}

static int is_known(uint32_t reference) {
    int64_t k = (int64_t)reference - 1 - model.n_parameters;
    return k >= 0 && k < model.n_inputs + model.n_states;
}

static int64_t row_of(uint32_t reference, double *sign) {
    int64_t k = (int64_t)reference - 1 - model.n_parameters - model.n_inputs - model.n_states;
    *sign = 1.0;
    if (k >= 0 && k < model.n_equations) return k;
    k -= model.n_states;
    if (k < 0 || k >= model.n_outputs || model.output_slots[k] < 0) return -1;
    *sign = model.output_signs[k];
    return model.output_slots[k];
}

int directional(Instance *m, const uint32_t *unknowns, size_t n, const uint32_t *knowns, size_t k, const double *seed,
                double *result, int adjoint) {
    int code = ready(m);
    double *row;
    if (code) return code;
    if (!m->has_entries && jac(m->t, m->x, m->entries, m->data, INDEX) != 0)
        return fail(m, REFUSED, "the derivatives cannot be computed at t = %.9g s", m->t);
    m->has_entries = 1;
    for (size_t j = 0; j < k; j++)
        if (!is_known(knowns[j]))
            return fail(m, FAILED, "derivatives are those by states and inputs; value reference %u is none", (unsigned)knowns[j]);
    for (size_t i = 0; i < n; i++)
        if ((int64_t)unknowns[i] >= model.n_parameters + model.n_inputs + 2 * model.n_states + model.n_outputs + 1)
            return fail(m, FAILED, "event indicators have no derivatives; value reference %u is one", (unsigned)unknowns[i]);
    if (!(row = calloc((size_t)model.n_observed + 1, sizeof(double)))) return FAILED;
    for (size_t i = 0; i < n && adjoint; i++) {
        double sign;
        int64_t r = row_of(unknowns[i], &sign);
        if (r >= 0) row[r] += sign * seed[i];
    }
    for (size_t j = 0; j < k; j++) {
        int64_t c = column_of(knowns[j]);
        double sum = 0.0;
        for (int64_t e = c < 0 ? 0 : model.columns[c]; c >= 0 && e < model.columns[c + 1]; e++) {
            if (adjoint)
                sum += m->entries[e] * row[model.rows[e]];
            else
                row[model.rows[e]] += m->entries[e] * seed[j];
        }
        if (adjoint) result[j] = sum;
    }
    for (size_t i = 0; i < n; i++) {
        double sign;
        int64_t r = row_of(unknowns[i], &sign);
        if (!adjoint) result[i] = r >= 0 ? sign * row[r] : 0.0;
        for (size_t j = 0; j < k && r < 0; j++) /* a state that is an output, say */
            if (unknowns[i] == knowns[j]) result[adjoint ? j : i] += seed[adjoint ? i : j];
    }
    free(row);
    return FINE;
}

/* ------------------------------------------------------------ events */

int after_step(Instance *m) {
    int code = take_g(m);
    if (code) return code;
    for (int64_t i = 0; i < model.n_indicators; i++)
        if (fabs(m->g[i]) > m->scale[i]) m->scale[i] = fabs(m->g[i]);
    return check_bounds(m, 1e-4); /* the importing tool's tolerance is its own */
}

int handle_events(Instance *m, int *states_changed, double *next) {
    int32_t did = 0;
    int code = take_g(m);
    if (code) return code;
    *states_changed = 0;
    for (int64_t i = 0; i < model.n_indicators; i++) {
        m->fired[i] = m->side[i] > 0 && m->g[i] <= 0.0 ? -1 : m->side[i] < 0 && m->g[i] > 0.0 ? 1 : 0;
        if (m->fired[i]) note_event(m, m->t, model.indicator_names[i]);
    }
    if (m->t >= m->next_event) note_event(m, m->t, "time");
    if (model.has_events) did = update(m->t, m->x, m->fired, m->data, INDEX);
    if (did < 0) return fail(m, FAILED, "the event at t = %.9g s does not settle", m->t);
    *states_changed = did == 2;
    moved(m);
    if ((code = take_g(m))) return code;
    for (int64_t i = 0; i < model.n_indicators; i++) {
        int told = m->fired[i] == 2 || m->fired[i] == -2;
        m->side[i] = told ? m->fired[i] / 2 : (m->g[i] > 0.0) - (m->g[i] < 0.0);
        m->scale[i] = fabs(m->g[i]); /* it may be another function from here on, and much smaller than the one before */
    }
    next_time(m->t, m->x, next, m->data, INDEX);
    m->next_event = *next;
    return FINE;
}
