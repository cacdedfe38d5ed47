/* FMI 2.0. Functions for types that no variable has refuse; importing tools expect them to be there. */
#include "fmi2.h"
#include "stepping.h"
#include <stdlib.h>
#include <string.h>

#define M ((Instance *)c)

typedef struct {
    fmi2CallbackLogger log;
    fmi2ComponentEnvironment environment;
    double tolerance, start, stop;
} Face;

#define FACE ((Face *)M->environment)

static fmi2Status status(int code) { return code == FINE ? fmi2OK : code == REFUSED ? fmi2Discard : fmi2Error; }

static void say(Instance *m, int is_error, const char *text) {
    Face *face = m->environment;
    if (face->log)
        face->log(face->environment, m->instance_name, is_error ? fmi2Error : fmi2OK, is_error ? "logStatusError" : "logEvents", "%s",
                  text);
}

static fmi2Status refuse(fmi2Component c, const char *what) {
    fail(M, FAILED, "%s is not supported: no variable needs it", what);
    return fmi2Error;
}

EXPORT const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
EXPORT const char *fmi2GetVersion(void) { return fmi2Version; }

EXPORT fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[]) {
    (void)n, (void)categories;
    M->logging = on;
    return fmi2OK;
}

EXPORT fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String token, fmi2String resources,
                                     const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging) {
    Instance *m;
    Face *face;
    (void)resources, (void)visible;
    if (!token || strcmp(token, model.token) != 0) {
        if (functions && functions->logger)
            functions->logger(functions->componentEnvironment, name, fmi2Error, "logStatusError", "the GUID is that of another FMU");
        return NULL;
    }
    if (!(m = make_instance(name ? name : model.name, type == fmi2CoSimulation))) return NULL;
    if (!(face = calloc(1, sizeof *face))) {
        free_instance(m);
        return NULL;
    }
    if (functions) {
        face->log = functions->logger;
        face->environment = functions->componentEnvironment;
    }
    m->environment = face;
    m->say = say;
    m->logging = logging;
    return m;
}

EXPORT void fmi2FreeInstance(fmi2Component c) {
    if (!c) return;
    free(M->environment);
    free_instance(M);
}

EXPORT fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start,
                                      fmi2Boolean has_stop, fmi2Real stop) {
    if (has_stop && !(stop >= start)) return status(fail(M, FAILED, "the stop time is before the start time"));
    FACE->tolerance = has_tolerance ? tolerance : 0.0;
    FACE->start = start;
    FACE->stop = has_stop ? stop : start;
    M->t = start;
    return fmi2OK;
}

EXPORT fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    return status(start_up(M, FACE->tolerance, FACE->start, FACE->stop));
}

EXPORT fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    return status(leave_initialisation(M));
}

EXPORT fmi2Status fmi2Terminate(fmi2Component c) {
    M->mode = STOPPED;
    return fmi2OK;
}

EXPORT fmi2Status fmi2Reset(fmi2Component c) {
    reset_instance(M);
    FACE->tolerance = FACE->start = FACE->stop = 0.0;
    return fmi2OK;
}

/* ------------------------------------------------------------ values */

EXPORT fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference references[], size_t n, fmi2Real values[]) {
    return status(get_values(M, references, n, values));
}

EXPORT fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference references[], size_t n, const fmi2Real values[]) {
    return status(set_values(M, references, n, values));
}

#define NO_TYPE(Name)                                                                                                      \
    EXPORT fmi2Status fmi2Get##Name(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2##Name v[]) {                      \
        (void)r, (void)v;                                                                                                  \
        return n ? refuse(c, #Name) : fmi2OK;                                                                              \
    }                                                                                                                      \
    EXPORT fmi2Status fmi2Set##Name(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2##Name v[]) {                \
        (void)r, (void)v;                                                                                                  \
        return n ? refuse(c, #Name) : fmi2OK;                                                                              \
    }
NO_TYPE(Integer)
NO_TYPE(Boolean)
NO_TYPE(String)

/* ------------------------------------------------------------ memory */

EXPORT fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
    free(*state);
    *state = remember(M);
    return *state ? fmi2OK : fmi2Error;
}
EXPORT fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
    if (!state) return status(fail(M, FAILED, "there is no state to return to"));
    recall(M, state);
    return fmi2OK;
}
EXPORT fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) {
    (void)c;
    if (state) {
        free(*state);
        *state = NULL;
    }
    return fmi2OK;
}
EXPORT fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size) {
    (void)state;
    *size = memory_size(M);
    return fmi2OK;
}
EXPORT fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
    return status(to_bytes(M, state, (unsigned char *)bytes, size));
}
EXPORT fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state) {
    free(*state);
    *state = from_bytes(M, (const unsigned char *)bytes, size);
    return *state ? fmi2OK : fmi2Error;
}

EXPORT fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknowns[], size_t n,
                                               const fmi2ValueReference knowns[], size_t k, const fmi2Real seed[], fmi2Real sensitivity[]) {
    return status(directional(M, unknowns, n, knowns, k, seed, sensitivity, 0));
}

/* ------------------------------------------------------------ model exchange */

EXPORT fmi2Status fmi2EnterEventMode(fmi2Component c) {
    M->mode = EVENT;
    return fmi2OK;
}

EXPORT fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *info) {
    int moved_states = 0;
    double t = NEVER;
    int code = handle_events(M, &moved_states, &t);
    info->newDiscreteStatesNeeded = info->terminateSimulation = info->nominalsOfContinuousStatesChanged = fmi2False;
    info->valuesOfContinuousStatesChanged = moved_states ? fmi2True : fmi2False;
    info->nextEventTimeDefined = t < NEVER ? fmi2True : fmi2False;
    info->nextEventTime = t < NEVER ? t : 0.0;
    return status(code);
}

EXPORT fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c) {
    M->mode = CONTINUOUS;
    return fmi2OK;
}

EXPORT fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean no_return, fmi2Boolean *event, fmi2Boolean *terminate) {
    (void)no_return;
    *event = *terminate = fmi2False;
    return status(after_step(M));
}

EXPORT fmi2Status fmi2SetTime(fmi2Component c, fmi2Real t) {
    set_time(M, t);
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t n) {
    return status(set_states(M, x, n));
}

EXPORT fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real rates[], size_t n) {
    return status(get_rates(M, rates, n));
}

EXPORT fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real z[], size_t n) {
    return status(get_indicators(M, z, n));
}

EXPORT fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t n) {
    return status(get_states(M, x, n));
}

EXPORT fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real nominals[], size_t n) {
    return status(get_nominals(M, nominals, n));
}

/* ------------------------------------------------------------ co-simulation */

EXPORT fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference references[], size_t n,
                                              const fmi2Integer order[],
                                              const fmi2Real values[]) {
    for (size_t i = 0; i < n; i++) {
        int code = order[i] == 1 ? set_slope(M, references[i], values[i]) : fail(M, FAILED, "inputs have slopes of order 1 only");
        if (code) return status(code);
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Integer order[],
                                               fmi2Real values[]) {
    (void)r, (void)order, (void)values;
    return n ? refuse(c, "derivatives of outputs") : fmi2OK;
}

EXPORT fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean no_return) {
    (void)no_return;
    return do_step(M, t, h) ? fmi2Error : fmi2OK;
}

EXPORT fmi2Status fmi2CancelStep(fmi2Component c) { return refuse(c, "a step that goes on by itself"); }
EXPORT fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Status *value) {
    (void)kind, (void)value;
    return refuse(c, "a step that goes on by itself");
}
EXPORT fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value) {
    if (kind != fmi2LastSuccessfulTime) return refuse(c, "a step that goes on by itself");
    *value = M->t;
    return fmi2OK;
}
EXPORT fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value) {
    (void)kind, (void)value;
    return refuse(c, "a step that goes on by itself");
}
EXPORT fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value) {
    if (kind != fmi2Terminated) return refuse(c, "a step that goes on by itself");
    *value = fmi2False;
    return fmi2OK;
}
EXPORT fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind kind, fmi2String *value) {
    (void)kind, (void)value;
    return refuse(c, "a step that goes on by itself");
}
