/* Co-simulation: gearlib's Runge-Kutta methods with events, compiled from the text that gearlib itself runs. */
#include "stepping.h"
#include <math.h>
#include <string.h>

extern int32_t advance(int64_t record);
extern int32_t rk_step(int64_t record, double stop);
extern int32_t rk_interpolate(int64_t record, double t, int64_t out);
extern int32_t rk_accept(int64_t record);
extern int32_t rk_restart(int64_t record, int32_t changed, int32_t why);

#define ADDRESS(thing) ((int64_t)(intptr_t)(thing))
#define STOPS 1000  /* times to stop at in one step of the importing tool: a longer one goes in parts */
#define BUDGET 1000
#define MOST 100000 /* budgets in one step */
enum { DONE, MORE, LOG_FULL };
enum { STEP_TOO_SMALL = -2, RHS_FAILED = -101, UPDATE_FAILED = -102, UNSETTLED = -103, CHATTER = -104 };

static int64_t capacity(void) { return 4 * (model.n_indicators + 2) + 256; }

typedef struct {
    double *k, *c, *x_new, *y, *atol, *phases, *g, *log_t, *stops;
    int64_t *log_root;
    int32_t *side, *fired;
} StepMemory;

static int64_t step_parts(double *numbers, StepMemory *part) {
    int64_t at = 0, n = blocks(model.n_states), roots_ = model.n_indicators + 1;
#define PART(field, kind, count) part->field = (kind *)(numbers + at); at += (count)
    PART(k, double, 16 * n);
    PART(c, double, 7 * n);
    PART(x_new, double, n);
    PART(y, double, n);
    PART(atol, double, n);
    PART(phases, double, 16);
    PART(g, double, 7 * roots_);
    PART(side, int32_t, roots_);
    PART(fired, int32_t, roots_);
    PART(log_t, double, capacity());
    PART(log_root, int64_t, capacity());
    PART(stops, double, STOPS + 1);
#undef PART
    return at;
}

int64_t step_numbers(void) {
    StepMemory part;
    return step_parts(NULL, &part);
}

/* The model's functions with inputs that move. */
static Instance *owner_of(const double *data) {
    Instance *m;
    memcpy(&m, data + model.n_data - 1, sizeof m); /* see point_record */
    return m;
}

static int32_t moving_rhs(double t, double *x, void *out, double *data, int64_t *index) {
    move_inputs(owner_of(data), t);
    return rhs(t, x, out, data, index);
}
static int32_t moving_roots(double t, double *x, void *out, double *data, int64_t *index) {
    move_inputs(owner_of(data), t);
    return roots(t, x, out, data, index);
}
static int32_t moving_update(double t, double *x, void *out, double *data, int64_t *index) {
    move_inputs(owner_of(data), t);
    return update(t, x, out, data, index);
}

/* Let the record point to this instance's numbers and to this process's functions. */
void point_record(Instance *m) {
    Record *r = &m->record;
    StepMemory part;
    int moves = m->extrapolates || m->ask != NULL;
    memcpy(m->data + model.n_data - 1, &m, sizeof m);
    if (!m->step_ready) return;
    step_parts(m->step_memory, &part);
    r->address = ADDRESS(r);
    r->step = ADDRESS(rk_step);
    r->interpolate = ADDRESS(rk_interpolate);
    r->accept = ADDRESS(rk_accept);
    r->restart = ADDRESS(rk_restart);
    r->rhs = moves ? ADDRESS(moving_rhs) : ADDRESS(rhs);
    r->roots = !model.n_indicators ? 0 : moves ? ADDRESS(moving_roots) : ADDRESS(roots);
    r->update = !model.has_events ? 0 : moves ? ADDRESS(moving_update) : ADDRESS(update);
    r->data = ADDRESS(m->data);
    r->index = ADDRESS(model.index);
    r->x = ADDRESS(m->x);
    r->fired = ADDRESS(part.fired);
    r->times = r->out = r->discrete = ADDRESS(part.stops);
    r->stops = ADDRESS(part.stops);
    r->log_t = ADDRESS(part.log_t);
    r->log_root = ADDRESS(part.log_root);
    r->x_new = ADDRESS(part.x_new);
    r->y = ADDRESS(part.y);
    r->atol = ADDRESS(part.atol);
    r->k = ADDRESS(part.k);
    r->c = ADDRESS(part.c);
    r->phases = ADDRESS(part.phases);
    r->g = ADDRESS(part.g);
    r->side = ADDRESS(part.side);
}

/* As gearlib.solvers.drive.driver and gearlib.solvers.rungekutta.rungekutta begin a run. */
static void get_ready(Instance *m) {
    Record *r = &m->record;
    StepMemory part;
    double span = m->stop - m->start, late = fabs(m->start) >= 2.0 * span ? m->start : 0.0;
    memset(r, 0, sizeof *r);
    memset(m->step_memory, 0, (size_t)step_numbers() * sizeof(double));
    m->step_ready = 1;
    point_record(m);
    step_parts(m->step_memory, &part);
    for (int64_t i = 0; i < blocks(model.n_states); i++)
        part.atol[i] = i < model.n_states ? m->tolerance * model.nominal[i] : 1.0;
    r->n = model.n_states;
    r->n_roots = model.n_indicators;
    r->n_discrete = model.n_discrete;
    r->first_discrete = model.discrete_at;
    r->capacity = capacity();
    r->budget = BUDGET;
    r->origin = late;
    r->t = r->burst_start = m->t - late;
    r->slack_share = 2.2e-14;
    r->order = m->tolerance >= 1e-6 ? 5 : 8;
    r->size = blocks(model.n_states);
    r->rtol = m->tolerance;
    r->patience = -1;
}

/* A share of the run, and of the shortest period of what time drives, which parameters may have changed. */
static void limit_steps(Instance *m) {
    double longest;
    longest_step(m->t, m->x, &longest, m->data, (int64_t *)model.index);
    m->record.h_max = fmin((model.n_indicators || model.driven || m->ask ? 0.01 : 0.1) * (m->stop - m->start), longest);
}

static const char *event_name(int64_t root) { return root < 0 ? "time" : model.indicator_names[root]; }

static void note_events(Instance *m) {
    Record *r = &m->record;
    StepMemory part;
    step_parts(m->step_memory, &part);
    for (int64_t i = 0; i < r->events; i++) note_event(m, r->origin + part.log_t[i], event_name(part.log_root[i]));
    r->events = 0;
}

static int told(Instance *m, int32_t code) {
    double t = m->record.origin + m->record.t;
    switch (code) {
        case STEP_TOO_SMALL: return fail(m, FAILED, "the step became too small at t = %.9g s: the solution goes to infinity or jumps", t);
        case RHS_FAILED: return fail(m, FAILED, "the equations have no solution beyond t = %.9g s", t);
        case UPDATE_FAILED:
        case UNSETTLED: return fail(m, FAILED, "the event at t = %.9g s does not settle", t);
        case CHATTER: return fail(m, FAILED, "events chatter at t = %.9g s", t);
        default: return fail(m, FAILED, "the integration failed at t = %.9g s (code %d)", t, (int)code);
    }
}

/* To a time; at most STOPS time events on the way, else as far as they go. */
static int go(Instance *m, double to, double *reached) {
    Record *r = &m->record;
    StepMemory part;
    int64_t n = 0;
    double t = m->t, next, rounding = 1.8e-15 * fmax(fabs(to), 1e-3); /* as in next_time, which passes over what is no later */
    step_parts(m->step_memory, &part);
    while (n < STOPS) {
        next_time(t, m->x, &next, m->data, (int64_t *)model.index);
        if (next >= NEVER || next > to + rounding) break;
        part.stops[n++] = fmin(next, to) - r->origin;
        t = next;
    }
    r->n_timed = n;
    *reached = n == STOPS ? fmin(t, to) : to;
    if (n == 0 || part.stops[n - 1] < *reached - r->origin) part.stops[n++] = *reached - r->origin;
    r->n_stops = n;
    r->stop = 0;
    for (int tries = 0; tries < MOST; tries++) {
        int32_t code = advance(r->address);
        note_events(m);
        if (code < 0) return told(m, code);
        if (code == DONE) return FINE;
    }
    return fail(m, FAILED, "too many steps at t = %.9g s", r->origin + r->t);
}

int do_step(Instance *m, double from, double h) {
    double to = from + h;
    int code = ready(m);
    if (code) return code;
    if (!(h > 0.0)) return fail(m, FAILED, "a communication step of %g s is not positive", h);
    if (!(fabs(from - m->t) <= 0.01 * h + 1e-12 * fabs(m->t)))
        return fail(m, FAILED, "a communication step begins at t = %.12g s, but the last one ended at %.12g s", from, m->t);
    if (!m->step_ready) get_ready(m);
    else point_record(m);
    Record *r = &m->record;
    r->span = fmin(m->stop - m->start, 1e3 * h); /* what rounding is taken for: the stop time may be any, for a run without an end */
    r->window = fmax(1e-9 * r->span, 2.2e-10 * fabs(to - r->origin));
    r->slack = 1e-16 * r->span;
    limit_steps(m);
    if (m->extrapolates) {
        memcpy(m->bases, m->data + model.inputs_at, (size_t)model.all_inputs * sizeof(double));
        m->extrapolated_from = m->t;
    }
    if (!r->started) {
        StepMemory part;
        step_parts(m->step_memory, &part);
        memset(part.fired, 0, (size_t)(model.n_indicators + 1) * sizeof(int32_t));
    }
    while (m->t < to) {
        double reached;
        if ((code = go(m, to, &reached))) return code;
        m->t = reached;
    }
    move_inputs(m, m->t);
    memset(m->slopes, 0, (size_t)(model.all_inputs + 1) * sizeof(double)); /* of this step only */
    m->extrapolates = 0;
    moved(m);
    return check_bounds(m, 10.0 * m->tolerance);
}
