/* FMI 3.0. Functions for types that no variable has refuse; importing tools expect them to be there. */
#include "fmi3.h"
#include "stepping.h"
#include <stdlib.h>
#include <string.h>

#define M ((Instance *)instance)

static fmi3Status status(int code) { return code == FINE ? fmi3OK : code == REFUSED ? fmi3Discard : fmi3Error; }

static void say(Instance *m, int is_error, const char *text) {
    fmi3LogMessageCallback log = (fmi3LogMessageCallback)m->log;
    if (log) log(m->environment, is_error ? fmi3Error : fmi3OK, is_error ? "logStatusError" : "logEvents", text);
}

static fmi3Status refuse(fmi3Instance instance, const char *what) {
    fail(M, FAILED, "%s is not supported: no variable needs it", what);
    return fmi3Error;
}

EXPORT const char *fmi3GetVersion(void) { return fmi3Version; }

EXPORT fmi3Status fmi3SetDebugLogging(fmi3Instance instance, fmi3Boolean on, size_t n, const fmi3String categories[]) {
    (void)n, (void)categories;
    M->logging = on;
    return fmi3OK;
}

static fmi3Instance instantiate(fmi3String name, fmi3String token, fmi3Boolean logging, fmi3InstanceEnvironment environment,
                                fmi3LogMessageCallback log, int stepping) {
    Instance *m;
    if (!token || strcmp(token, model.token) != 0) {
        if (log) log(environment, fmi3Error, "logStatusError", "the instantiation token is that of another FMU");
        return NULL;
    }
    if (!(m = make_instance(name ? name : model.name, stepping))) return NULL;
    m->environment = environment;
    m->log = (void (*)(void))log;
    m->say = say;
    m->logging = logging;
    return m;
}

/* The intermediate update of co-simulation: inputs at the times at which the integrator evaluates the model. */
static void ask(Instance *m, double t) {
    fmi3IntermediateUpdateCallback update_ = (fmi3IntermediateUpdateCallback)m->asked;
    fmi3Boolean early = fmi3False;
    fmi3Float64 early_time = t;
    update_(m->environment, t, fmi3True, fmi3False, fmi3False, fmi3False, &early, &early_time);
}

EXPORT fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                                 fmi3Boolean logging, fmi3InstanceEnvironment environment,
                                                 fmi3LogMessageCallback log) {
    (void)resources, (void)visible;
    return instantiate(name, token, logging, environment, log, 0);
}

EXPORT fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                                fmi3Boolean logging, fmi3Boolean event_mode, fmi3Boolean early,
                                                const fmi3ValueReference required[], size_t n, fmi3InstanceEnvironment environment,
                                                fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update_) {
    fmi3Instance instance;
    int64_t first = 1 + model.n_parameters;
    (void)resources, (void)visible, (void)early;
    if (event_mode) {
        if (log) log(environment, fmi3Error, "logStatusError", "event mode is not supported in co-simulation");
        return NULL;
    }
    for (size_t i = 0; i < n; i++)
        if (required[i] < first || required[i] >= first + model.n_inputs) {
            if (log)
                log(environment, fmi3Error, "logStatusError",
                    "only inputs can be set within a step, and one of the variables required there is none");
            return NULL;
        }
    if (!(instance = instantiate(name, token, logging, environment, log, 1)) || n == 0) return instance;
    if (update_) {
        M->ask = ask;
        M->asked = (void (*)(void))update_;
    }
    return instance;
}

EXPORT fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                                      fmi3Boolean logging, fmi3InstanceEnvironment environment,
                                                      fmi3LogMessageCallback log, fmi3ClockUpdateCallback clock,
                                                      fmi3LockPreemptionCallback lock, fmi3UnlockPreemptionCallback unlock) {
    (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)clock, (void)lock, (void)unlock;
    if (log) log(environment, fmi3Error, "logStatusError", "scheduled execution is not supported");
    return NULL;
}

EXPORT void fmi3FreeInstance(fmi3Instance instance) { free_instance(M); }

EXPORT fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean has_tolerance, fmi3Float64 tolerance,
                                              fmi3Float64 start,
                                              fmi3Boolean has_stop, fmi3Float64 stop) {
    if (has_stop && !(stop >= start)) return status(fail(M, FAILED, "the stop time is before the start time"));
    return status(start_up(M, has_tolerance ? tolerance : 0.0, start, has_stop ? stop : start));
}

EXPORT fmi3Status fmi3ExitInitializationMode(fmi3Instance instance) {
    return status(leave_initialisation(M));
}

EXPORT fmi3Status fmi3EnterEventMode(fmi3Instance instance) {
    M->mode = EVENT;
    return fmi3OK;
}

EXPORT fmi3Status fmi3Terminate(fmi3Instance instance) {
    M->mode = STOPPED;
    return fmi3OK;
}

EXPORT fmi3Status fmi3Reset(fmi3Instance instance) {
    reset_instance(M);
    return fmi3OK;
}

/* ------------------------------------------------------------ values */

EXPORT fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference references[], size_t n, fmi3Float64 values[],
                                 size_t count) {
    if (n != count) return status(fail(M, FAILED, "%lu values were asked of %lu variables", (unsigned long)count, (unsigned long)n));
    return status(get_values(M, references, n, values));
}

EXPORT fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference references[], size_t n, const fmi3Float64 values[],
                                 size_t count) {
    if (n != count) return status(fail(M, FAILED, "%lu values were given for %lu variables", (unsigned long)count, (unsigned long)n));
    return status(set_values(M, references, n, values));
}

#define NO_TYPE(Name, Type)                                                                                                 \
    EXPORT fmi3Status fmi3Get##Name(fmi3Instance instance, const fmi3ValueReference r[], size_t n, Type v[], size_t k) {             \
        (void)r, (void)v, (void)k;                                                                                          \
        return n ? refuse(instance, #Name) : fmi3OK;                                                                        \
    }                                                                                                                       \
    EXPORT fmi3Status fmi3Set##Name(fmi3Instance instance, const fmi3ValueReference r[], size_t n, const Type v[], size_t k) {       \
        (void)r, (void)v, (void)k;                                                                                          \
        return n ? refuse(instance, #Name) : fmi3OK;                                                                        \
    }
NO_TYPE(Float32, fmi3Float32)
NO_TYPE(Int8, fmi3Int8)
NO_TYPE(UInt8, fmi3UInt8)
NO_TYPE(Int16, fmi3Int16)
NO_TYPE(UInt16, fmi3UInt16)
NO_TYPE(Int32, fmi3Int32)
NO_TYPE(UInt32, fmi3UInt32)
NO_TYPE(Int64, fmi3Int64)
NO_TYPE(UInt64, fmi3UInt64)
NO_TYPE(Boolean, fmi3Boolean)
NO_TYPE(String, fmi3String)

EXPORT fmi3Status fmi3GetBinary(fmi3Instance instance, const fmi3ValueReference r[], size_t n, size_t sizes[], fmi3Binary v[],
                                size_t k) {
    (void)r, (void)sizes, (void)v, (void)k;
    return n ? refuse(instance, "Binary") : fmi3OK;
}
EXPORT fmi3Status fmi3SetBinary(fmi3Instance instance, const fmi3ValueReference r[], size_t n, const size_t sizes[],
                                const fmi3Binary v[],
                                size_t k) {
    (void)r, (void)sizes, (void)v, (void)k;
    return n ? refuse(instance, "Binary") : fmi3OK;
}
EXPORT fmi3Status fmi3GetClock(fmi3Instance instance, const fmi3ValueReference r[], size_t n, fmi3Clock v[]) {
    (void)r, (void)v;
    return n ? refuse(instance, "Clock") : fmi3OK;
}
EXPORT fmi3Status fmi3SetClock(fmi3Instance instance, const fmi3ValueReference r[], size_t n, const fmi3Clock v[]) {
    (void)r, (void)v;
    return n ? refuse(instance, "Clock") : fmi3OK;
}
EXPORT fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance instance, fmi3ValueReference r, size_t *n) {
    (void)r, (void)n;
    return refuse(instance, "the dependencies of a variable");
}
EXPORT fmi3Status fmi3GetVariableDependencies(fmi3Instance instance, fmi3ValueReference r, size_t a[], fmi3ValueReference b[],
                                              size_t c[],
                                              fmi3DependencyKind d[], size_t n) {
    (void)r, (void)a, (void)b, (void)c, (void)d, (void)n;
    return refuse(instance, "the dependencies of a variable");
}

/* ------------------------------------------------------------ memory */

EXPORT fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *state) {
    free(*state);
    *state = remember(M);
    return *state ? fmi3OK : fmi3Error;
}
EXPORT fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState state) {
    if (!state) return status(fail(M, FAILED, "there is no state to return to"));
    recall(M, state);
    return fmi3OK;
}
EXPORT fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *state) {
    (void)instance;
    if (state) {
        free(*state);
        *state = NULL;
    }
    return fmi3OK;
}
EXPORT fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState state, size_t *size) {
    (void)state;
    *size = memory_size(M);
    return fmi3OK;
}
EXPORT fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState state, fmi3Byte bytes[], size_t size) {
    return status(to_bytes(M, state, bytes, size));
}
EXPORT fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte bytes[], size_t size, fmi3FMUState *state) {
    free(*state);
    *state = from_bytes(M, bytes, size);
    return *state ? fmi3OK : fmi3Error;
}

/* ------------------------------------------------------------ derivatives */

static fmi3Status wrong_lengths(fmi3Instance instance, size_t seeds, size_t n_seeds, size_t results, size_t n_results) {
    return status(fail(M, FAILED, "%lu seeds and %lu sensitivities, where %lu and %lu are needed", (unsigned long)seeds,
                       (unsigned long)results, (unsigned long)n_seeds, (unsigned long)n_results));
}
EXPORT fmi3Status fmi3GetDirectionalDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t n,
                                               const fmi3ValueReference knowns[], size_t k, const fmi3Float64 seed[], size_t n_seed,
                                               fmi3Float64 sensitivity[], size_t n_sensitivity) {
    if (n_seed != k || n_sensitivity != n) return wrong_lengths(instance, n_seed, k, n_sensitivity, n);
    return status(directional(M, unknowns, n, knowns, k, seed, sensitivity, 0));
}
EXPORT fmi3Status fmi3GetAdjointDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t n,
                                           const fmi3ValueReference knowns[], size_t k, const fmi3Float64 seed[], size_t n_seed,
                                           fmi3Float64 sensitivity[], size_t n_sensitivity) {
    if (n_seed != n || n_sensitivity != k) return wrong_lengths(instance, n_seed, n, n_sensitivity, k);
    return status(directional(M, unknowns, n, knowns, k, seed, sensitivity, 1));
}

/* ------------------------------------------------------------ modes without a use here */

EXPORT fmi3Status fmi3EnterConfigurationMode(fmi3Instance instance) { return refuse(instance, "configuration mode"); }
EXPORT fmi3Status fmi3ExitConfigurationMode(fmi3Instance instance) { return refuse(instance, "configuration mode"); }
EXPORT fmi3Status fmi3GetIntervalDecimal(fmi3Instance instance, const fmi3ValueReference r[], size_t n, fmi3Float64 v[],
                                         fmi3IntervalQualifier q[]) {
    (void)r, (void)v, (void)q;
    return n ? refuse(instance, "Clock") : fmi3OK;
}
EXPORT fmi3Status fmi3GetIntervalFraction(fmi3Instance instance, const fmi3ValueReference r[], size_t n, fmi3UInt64 c[],
                                          fmi3UInt64 v[],
                                          fmi3IntervalQualifier q[]) {
    (void)r, (void)c, (void)v, (void)q;
    return n ? refuse(instance, "Clock") : fmi3OK;
}
EXPORT fmi3Status fmi3GetShiftDecimal(fmi3Instance instance, const fmi3ValueReference r[], size_t n, fmi3Float64 v[]) {
    (void)r, (void)v;
    return n ? refuse(instance, "Clock") : fmi3OK;
}
EXPORT fmi3Status fmi3GetShiftFraction(fmi3Instance instance, const fmi3ValueReference r[], size_t n, fmi3UInt64 c[],
                                       fmi3UInt64 v[]) {
    (void)r, (void)c, (void)v;
    return n ? refuse(instance, "Clock") : fmi3OK;
}
EXPORT fmi3Status fmi3SetIntervalDecimal(fmi3Instance instance, const fmi3ValueReference r[], size_t n, const fmi3Float64 v[]) {
    (void)r, (void)v;
    return n ? refuse(instance, "Clock") : fmi3OK;
}
EXPORT fmi3Status fmi3SetIntervalFraction(fmi3Instance instance, const fmi3ValueReference r[], size_t n, const fmi3UInt64 c[],
                                          const fmi3UInt64 v[]) {
    (void)r, (void)c, (void)v;
    return n ? refuse(instance, "Clock") : fmi3OK;
}
EXPORT fmi3Status fmi3SetShiftDecimal(fmi3Instance instance, const fmi3ValueReference r[], size_t n, const fmi3Float64 v[]) {
    (void)r, (void)v;
    return n ? refuse(instance, "Clock") : fmi3OK;
}
EXPORT fmi3Status fmi3SetShiftFraction(fmi3Instance instance, const fmi3ValueReference r[], size_t n, const fmi3UInt64 c[],
                                       const fmi3UInt64 v[]) {
    (void)r, (void)c, (void)v;
    return n ? refuse(instance, "Clock") : fmi3OK;
}
EXPORT fmi3Status fmi3ActivateModelPartition(fmi3Instance instance, fmi3ValueReference clock, fmi3Float64 t) {
    (void)clock, (void)t;
    return refuse(instance, "scheduled execution");
}

/* ------------------------------------------------------------ model exchange */

EXPORT fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance instance) { return status(ready(M)); }

EXPORT fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, fmi3Boolean *again, fmi3Boolean *terminate, fmi3Boolean *nominals,
                                           fmi3Boolean *states, fmi3Boolean *has_next, fmi3Float64 *next) {
    int moved_states = 0;
    double t = NEVER;
    int code = handle_events(M, &moved_states, &t);
    *again = *terminate = *nominals = fmi3False;
    *states = moved_states != 0;
    *has_next = t < NEVER;
    *next = *has_next ? t : 0.0;
    return status(code);
}

EXPORT fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance instance) {
    M->mode = CONTINUOUS;
    return fmi3OK;
}

EXPORT fmi3Status fmi3CompletedIntegratorStep(fmi3Instance instance, fmi3Boolean no_return, fmi3Boolean *event,
                                              fmi3Boolean *terminate) {
    (void)no_return;
    *event = *terminate = fmi3False;
    return status(after_step(M));
}

EXPORT fmi3Status fmi3SetTime(fmi3Instance instance, fmi3Float64 t) {
    set_time(M, t);
    return fmi3OK;
}

EXPORT fmi3Status fmi3SetContinuousStates(fmi3Instance instance, const fmi3Float64 x[], size_t n) {
    return status(set_states(M, x, n));
}

EXPORT fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance instance, fmi3Float64 rates[], size_t n) {
    return status(get_rates(M, rates, n));
}

EXPORT fmi3Status fmi3GetEventIndicators(fmi3Instance instance, fmi3Float64 z[], size_t n) {
    return status(get_indicators(M, z, n));
}

EXPORT fmi3Status fmi3GetContinuousStates(fmi3Instance instance, fmi3Float64 x[], size_t n) {
    return status(get_states(M, x, n));
}

EXPORT fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance instance, fmi3Float64 nominals[], size_t n) {
    return status(get_nominals(M, nominals, n));
}

EXPORT fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance instance, size_t *n) {
    (void)instance;
    *n = (size_t)model.n_indicators;
    return fmi3OK;
}

EXPORT fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance instance, size_t *n) {
    (void)instance;
    *n = (size_t)model.n_states;
    return fmi3OK;
}

/* ------------------------------------------------------------ co-simulation */

EXPORT fmi3Status fmi3EnterStepMode(fmi3Instance instance) {
    M->mode = STEPPING;
    return fmi3OK;
}

EXPORT fmi3Status fmi3GetOutputDerivatives(fmi3Instance instance, const fmi3ValueReference r[], size_t n, const fmi3Int32 orders[],
                                           fmi3Float64 values[], size_t k) {
    (void)r, (void)orders, (void)values, (void)k;
    return n ? refuse(instance, "derivatives of outputs") : fmi3OK;
}

EXPORT fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 t, fmi3Float64 h, fmi3Boolean no_return, fmi3Boolean *event,
                             fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *last) {
    int code;
    (void)no_return;
    *event = *terminate = *early = fmi3False;
    code = do_step(M, t, h);
    *last = M->t;
    return code ? fmi3Error : fmi3OK;
}
