/* The functions of FMI 2.0 for co-simulation (https://fmi-standard.org) round an indicial_model.

   Value references: the inputs, then the speed, then the six coefficients. A step starts from the inputs as they are
   set and goes along their first derivatives, if the master gives them, else at constant inputs; inputs that are set
   anew between steps jump. Initialisation ends at rest under the inputs of that moment. */
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "indicial_model.h"

#define GUID "@guid@"
#define INPUTS INDICIAL_MODEL_INPUTS
#define SIGNALS (INPUTS + 1)
#define LOADS INDICIAL_MODEL_LOADS

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

typedef void *fmi2Component, *fmi2ComponentEnvironment, *fmi2FMUstate;
typedef unsigned int fmi2ValueReference;
typedef double fmi2Real;
typedef int fmi2Integer, fmi2Boolean, fmi2Type, fmi2StatusKind;
typedef char fmi2Char, fmi2Byte;
typedef const fmi2Char *fmi2String;
typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef struct {
  void (*logger)(fmi2ComponentEnvironment, fmi2String, fmi2Status, fmi2String, fmi2String, ...);
  void *(*allocateMemory)(size_t, size_t);
  void (*freeMemory)(void *);
  void (*stepFinished)(fmi2ComponentEnvironment, fmi2Status);
  fmi2ComponentEnvironment componentEnvironment;
} fmi2CallbackFunctions;

typedef struct {
  indicial_model flow;
  double signals[SIGNALS]; /* inputs and speed as set */
  double slopes[SIGNALS];  /* their derivatives over the coming step */
  double time;
  int initialised;
  const fmi2CallbackFunctions *functions;
  char name[128];
} Instance;

static const double start[SIGNALS] = {@start@, @speed@};

static fmi2Status fail(Instance *self, fmi2String message) {
  if (self->functions && self->functions->logger)
    self->functions->logger(self->functions->componentEnvironment, self->name, fmi2Error, "error", "%s", message);
  return fmi2Error;
}

static void restart(Instance *self) {
  memcpy(self->signals, start, sizeof start);
  memset(self->slopes, 0, sizeof self->slopes);
  self->time = 0.0;
  self->initialised = 0;
  indicial_model_settle(&self->flow, self->signals, self->signals[INPUTS]);
}

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }

EXPORT fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[]) {
  (void)c, (void)on, (void)n, (void)categories;
  return fmi2OK;
}

EXPORT fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                                     const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging) {
  Instance *self;
  (void)resources, (void)visible, (void)logging;
  if (type != 1 || !guid || strcmp(guid, GUID)) return NULL; /* 1: co-simulation */
  self = (Instance *)calloc(1, sizeof *self);
  if (!self) return NULL;
  self->functions = functions;
  if (name) strncpy(self->name, name, sizeof self->name - 1);
  restart(self);
  return self;
}

EXPORT void fmi2FreeInstance(fmi2Component c) { free(c); }

EXPORT fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerant, fmi2Real tolerance, fmi2Real begin,
                                      fmi2Boolean ends, fmi2Real end) {
  (void)tolerant, (void)tolerance, (void)ends, (void)end;
  ((Instance *)c)->time = begin;
  return fmi2OK;
}

EXPORT fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
  (void)c;
  return fmi2OK;
}

EXPORT fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
  Instance *self = (Instance *)c;
  if (indicial_model_settle(&self->flow, self->signals, self->signals[INPUTS])) return fail(self, "speed must be positive");
  self->initialised = 1;
  return fmi2OK;
}

EXPORT fmi2Status fmi2Terminate(fmi2Component c) {
  (void)c;
  return fmi2OK;
}

EXPORT fmi2Status fmi2Reset(fmi2Component c) {
  restart((Instance *)c);
  return fmi2OK;
}

EXPORT fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
  Instance *self = (Instance *)c;
  indicial_model now = self->flow;
  double loads[LOADS];
  size_t i;
  /* inputs that have been set since the last step: a jump, or the state at rest before the first */
  if (self->initialised ? indicial_model_step(&now, 0.0, self->signals, self->signals[INPUTS])
                        : indicial_model_settle(&now, self->signals, self->signals[INPUTS]))
    return fail(self, "speed must be positive");
  indicial_model_loads(&now, loads);
  for (i = 0; i < n; ++i) {
    if (vr[i] < SIGNALS)
      value[i] = self->signals[vr[i]];
    else if (vr[i] < SIGNALS + LOADS)
      value[i] = loads[vr[i] - SIGNALS];
    else
      return fail(self, "no such variable");
  }
  return fmi2OK;
}

EXPORT fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
  Instance *self = (Instance *)c;
  size_t i;
  for (i = 0; i < n; ++i) {
    if (vr[i] >= SIGNALS) return fail(self, "only inputs can be set");
    self->signals[vr[i]] = value[i];
  }
  return fmi2OK;
}

EXPORT fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                              const fmi2Integer order[], const fmi2Real value[]) {
  Instance *self = (Instance *)c;
  size_t i;
  for (i = 0; i < n; ++i) {
    if (vr[i] >= SIGNALS || order[i] != 1) return fail(self, "only first derivatives of inputs can be set");
    self->slopes[vr[i]] = value[i];
  }
  return fmi2OK;
}

EXPORT fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean no_return) {
  Instance *self = (Instance *)c;
  double end[SIGNALS];
  indicial_model next = self->flow;
  int i;
  (void)no_return;
  for (i = 0; i < SIGNALS; ++i) end[i] = self->signals[i] + step * self->slopes[i];
  if (indicial_model_step(&next, 0.0, self->signals, self->signals[INPUTS]) ||
      indicial_model_step(&next, step, end, end[INPUTS]))
    return fail(self, "speed must be positive, a step not negative");
  self->flow = next;
  memcpy(self->signals, end, sizeof end);
  memset(self->slopes, 0, sizeof self->slopes);
  self->time = time + step;
  return fmi2OK;
}

EXPORT fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
  if (!*state) *state = malloc(sizeof(Instance));
  if (!*state) return fail((Instance *)c, "out of memory");
  memcpy(*state, c, sizeof(Instance));
  return fmi2OK;
}

EXPORT fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
  memcpy(c, state, sizeof(Instance));
  return fmi2OK;
}

EXPORT fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) {
  (void)c;
  free(*state);
  *state = NULL;
  return fmi2OK;
}

/* What this model has none of. */
#define REFUSED(name, ...)                       \
  EXPORT fmi2Status name(fmi2Component c, __VA_ARGS__) { return fail((Instance *)c, #name " is not offered"); }
#define EMPTY(name, ...)                         \
  EXPORT fmi2Status name(fmi2Component c, __VA_ARGS__) { return n ? fail((Instance *)c, "no such variable") : fmi2OK; }

EMPTY(fmi2GetInteger, const fmi2ValueReference vr[], size_t n, fmi2Integer value[])
EMPTY(fmi2GetBoolean, const fmi2ValueReference vr[], size_t n, fmi2Boolean value[])
EMPTY(fmi2GetString, const fmi2ValueReference vr[], size_t n, fmi2String value[])
EMPTY(fmi2SetInteger, const fmi2ValueReference vr[], size_t n, const fmi2Integer value[])
EMPTY(fmi2SetBoolean, const fmi2ValueReference vr[], size_t n, const fmi2Boolean value[])
EMPTY(fmi2SetString, const fmi2ValueReference vr[], size_t n, const fmi2String value[])
REFUSED(fmi2SerializedFMUstateSize, fmi2FMUstate state, size_t *size)
REFUSED(fmi2SerializeFMUstate, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
REFUSED(fmi2DeSerializeFMUstate, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
REFUSED(fmi2GetDirectionalDerivative, const fmi2ValueReference unknown[], size_t n, const fmi2ValueReference known[],
        size_t m, const fmi2Real direction[], fmi2Real value[])
REFUSED(fmi2GetRealOutputDerivatives, const fmi2ValueReference vr[], size_t n, const fmi2Integer order[],
        fmi2Real value[])
REFUSED(fmi2GetStatus, const fmi2StatusKind kind, fmi2Status *value)
REFUSED(fmi2GetRealStatus, const fmi2StatusKind kind, fmi2Real *value)
REFUSED(fmi2GetIntegerStatus, const fmi2StatusKind kind, fmi2Integer *value)
REFUSED(fmi2GetBooleanStatus, const fmi2StatusKind kind, fmi2Boolean *value)
REFUSED(fmi2GetStringStatus, const fmi2StatusKind kind, fmi2String *value)

EXPORT fmi2Status fmi2CancelStep(fmi2Component c) { return fail((Instance *)c, "a step cannot be cancelled"); }
