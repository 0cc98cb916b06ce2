/* A library with the calls of NI-DAQmx's C interface that the driver makes: a device whose inputs read its output.
 *
 * Signatures are those of NI's reference (NI-DAQmx C Reference Help). What each call was given is written to a file, by value and in the
 * type that the reference has for it, so that an argument of another type shows. */
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { CHANNELS = 16, BUFFER = 1 << 16, VOLTAGE = 10348, CONTINUOUS = 10123, RISING = 10280 };
enum { OK = 0, INVALID_ATTRIBUTE = -200233, NO_WATCHDOG = -200662, INVALID_TASK = -200088, NOT_YET = -200284, NO_DEVICE = -200220 };

typedef struct {
    char kind; /* 'i', 'o', or 0 without channels */
    int channels, running;
    double rate_hz;
    uint64_t position;
} Task;

static FILE *calls;
static double output_v[BUFFER];
static uint64_t written;
static char last_error[128];

void stub_open(const char *path) {
    calls = fopen(path, "w");
    setvbuf(calls, NULL, _IOLBF, 0);
    written = 0;
}

static int32_t failed(int32_t code, const char *why) {
    snprintf(last_error, sizeof last_error, "stub: %s", why);
    return code;
}

/* Tasks. A handle that is none of ours is an invalid task, as a handle cut to 32 bits would be. */
#define HANDLES 64
static Task *tasks[HANDLES];

static Task *task_of(void *handle) {
    for (int i = 0; i < HANDLES; i++)
        if (handle && tasks[i] == handle) return handle;
    return NULL;
}

#define TASK(handle) \
    Task *task = task_of(handle); \
    if (!task) return failed(INVALID_TASK, "no such task")

static int32_t create(void **handle) {
    for (int i = 0; i < HANDLES; i++)
        if (!tasks[i]) {
            *handle = tasks[i] = calloc(1, sizeof(Task));
            return OK;
        }
    return failed(INVALID_TASK, "too many tasks");
}

int32_t DAQmxCreateTask(const char *name, void **handle) {
    fprintf(calls, "CreateTask '%s'\n", name);
    return create(handle);
}

int32_t DAQmxClearTask(void *handle) {
    TASK(handle);
    for (int i = 0; i < HANDLES; i++)
        if (tasks[i] == task) tasks[i] = NULL;
    free(task);
    return OK;
}

int32_t DAQmxStartTask(void *handle) {
    TASK(handle);
    fprintf(calls, "StartTask %c\n", task->kind);
    task->running = 1;
    return OK;
}

int32_t DAQmxStopTask(void *handle) {
    TASK(handle);
    fprintf(calls, "StopTask %c\n", task->kind);
    task->running = 0;
    return OK;
}

int32_t DAQmxTaskControl(void *handle, int32_t action) {
    TASK(handle);
    fprintf(calls, "TaskControl %c %d\n", task->kind, action);
    return OK;
}

int32_t DAQmxCreateWatchdogTimerTaskEx(const char *device, const char *name, void **handle, double timeout_s) {
    fprintf(calls, "CreateWatchdogTimerTaskEx %s '%s' %g\n", device, name, timeout_s);
    (void)handle;
    return failed(NO_WATCHDOG, "no watchdog");
}

/* Channels and timing. */
int32_t DAQmxCreateAIVoltageChan(void *handle, const char *physical, const char *name, int32_t terminal, double low, double high, int32_t units,
                                 const char *scale) {
    TASK(handle);
    fprintf(calls, "CreateAIVoltageChan %s '%s' %d %g %g %d '%s'\n", physical, name, terminal, low, high, units, scale ? scale : "");
    task->kind = 'i';
    task->channels++;
    return OK;
}

int32_t DAQmxCreateAOVoltageChan(void *handle, const char *physical, const char *name, double low, double high, int32_t units, const char *scale) {
    TASK(handle);
    fprintf(calls, "CreateAOVoltageChan %s '%s' %g %g %d '%s'\n", physical, name, low, high, units, scale ? scale : "");
    task->kind = 'o';
    task->channels++;
    return OK;
}

int32_t DAQmxCfgSampClkTiming(void *handle, const char *source, double rate_hz, int32_t edge, int32_t mode, uint64_t samples) {
    TASK(handle);
    fprintf(calls, "CfgSampClkTiming %c '%s' %g %d %d %llu\n", task->kind, source ? source : "", rate_hz, edge, mode, (unsigned long long)samples);
    task->rate_hz = rate_hz;
    if (task->kind == 'o') written = 0;
    return OK;
}

int32_t DAQmxCfgDigEdgeStartTrig(void *handle, const char *source, int32_t edge) {
    TASK(handle);
    fprintf(calls, "CfgDigEdgeStartTrig %c %s %d\n", task->kind, source, edge);
    return OK;
}

/* Attributes: the kind of a value is the attribute's. */
typedef struct {
    const char *group;
    int32_t number;
    char type; /* d double, i int32, u uInt32, l uInt64, b bool32, s string, D array of doubles, I array of int32 */
    double number_value;
    const char *text;
} Attribute;

static const Attribute attributes[] = {
    {"SystemInfo", 0x1272, 'u', 24, 0}, {"SystemInfo", 0x1923, 'u', 8, 0}, {"SystemInfo", 0x2f22, 'u', 0, 0},
    {"SystemInfo", 0x193b, 's', 0, "Dev1"},
    {"Device", 0x0631, 's', 0, "PXIe-6356"}, {"Device", 0x0632, 'u', 4711, 0}, {"Device", 0x22ca, 'b', 1, 0},
    {"Device", 0x231e, 's', 0, "Dev1/ai0, Dev1/ai1"}, {"Device", 0x231f, 's', 0, "Dev1/ao0"},
    {"Device", 0x2990, 'D', 10, 0}, {"Device", 0x299b, 'D', 10, 0}, {"Device", 0x298d, 'd', 1.25e6, 0}, {"Device", 0x298e, 'd', 1, 0},
    {"Device", 0x2997, 'd', 3.33e6, 0}, {"Device", 0x29b6, 's', 0, ""}, {"Device", 0x29b7, 's', 0, ""},
    {"Device", 0x2994, 'i', 2, 0}, {"Device", 0x29cb, 'D', 0, 0},
    {"Task", 0x1276, 's', 0, "a task"}, {"Task", 0x2181, 'u', 2, 0}, {"Read", 0x217b, 'u', 2, 0}, {"Write", 0x217e, 'u', 1, 0},
    {"Chan", 0x0064, 'i', 10050, 0}, {"Chan", 0x17f4, 'i', 10200, 0}, {"Chan", 0x17f5, 'd', 0.002, 0}, {"Chan", 0x17f6, 'i', 10323, 0},
    {"Chan", 0x1815, 'd', 10, 0}, {"Chan", 0x2fed, 'd', 0.003, 0}, {"Chan", 0x3071, 'i', 10364, 0}, {"Chan", 0x3076, 'i', 10364, 0},
    {"Chan", 0x3075, 'd', 0, 0}, {"Chan", 0x2fbd, 'b', 0, 0},
    {"Timing", 0x1344, 'd', -1, 0}, {"Timing", 0x2f1b, 's', 0, "/Dev1/ai/SampleClock"}, {"Timing", 0x2f1c, 's', 0, "/Dev1/ai/SampleClockTimebase"},
    {"Trig", 0x2f1e, 's', 0, "/Dev1/ai/StartTrigger"},
    {"Buffer", 0x186c, 'u', 0, 0}, {"Buffer", 0x186d, 'u', 0, 0},
    {"Write", 0x1453, 'i', 10158, 0}, {"Write", 0x192b, 'l', -1, 0},
};

static const Attribute *attribute_of(const char *group, int32_t number) {
    for (size_t i = 0; i < sizeof attributes / sizeof *attributes; i++)
        if (attributes[i].number == number && !strcmp(attributes[i].group, group)) return &attributes[i];
    fprintf(calls, "unknown %s 0x%x\n", group, number);
    return NULL;
}

static int32_t get(const char *group, int32_t number, const Task *task, va_list rest) {
    const Attribute *found = attribute_of(group, number);
    if (!found) return failed(INVALID_ATTRIBUTE, "no such attribute");
    void *value = va_arg(rest, void *);
    double as_double = found->number_value;
    if (number == 0x1344) as_double = task->rate_hz;
    if (number == 0x192b) as_double = (double)written;
    switch (found->type) {
        case 'd': *(double *)value = as_double; break;
        case 'i': *(int32_t *)value = (int32_t)as_double; break;
        case 'u': case 'b': *(uint32_t *)value = (uint32_t)as_double; break;
        case 'l': *(uint64_t *)value = (uint64_t)as_double; break;
        case 's': {
            uint32_t size = va_arg(rest, uint32_t), needed = (uint32_t)strlen(found->text) + 1;
            if (size == 0) return (int32_t)needed;
            snprintf(value, size, "%s", found->text);
            break;
        }
        case 'D': {
            uint32_t size = va_arg(rest, uint32_t);
            if (size == 0) return 2;
            ((double *)value)[0] = -as_double;
            ((double *)value)[1] = as_double;
        }
    }
    return OK;
}

static int32_t set(const char *group, int32_t number, const char *of, va_list rest) {
    const Attribute *found = attribute_of(group, number);
    if (!found) return failed(INVALID_ATTRIBUTE, "no such attribute");
    fprintf(calls, "Set%sAttribute %s 0x%x ", group, of, number);
    switch (found->type) {
        case 'd': fprintf(calls, "%g\n", va_arg(rest, double)); break;
        case 'i': fprintf(calls, "%d\n", va_arg(rest, int32_t)); break;
        case 's': fprintf(calls, "%s\n", va_arg(rest, const char *)); break;
        default: fprintf(calls, "%u\n", va_arg(rest, uint32_t));
    }
    return OK;
}

#define WITH_REST(last, call) \
    va_list rest; \
    va_start(rest, last); \
    int32_t code = call; \
    va_end(rest); \
    return code

int32_t DAQmxGetSystemInfoAttribute(int32_t number, ...) { WITH_REST(number, get("SystemInfo", number, NULL, rest)); }
int32_t DAQmxGetDeviceAttribute(const char *device, int32_t number, ...) {
    if (strcmp(device, "Dev1")) return failed(NO_DEVICE, "no such device");
    WITH_REST(number, get("Device", number, NULL, rest));
}
int32_t DAQmxGetPhysicalChanAttribute(const char *name, int32_t number, ...) {
    (void)name;
    WITH_REST(number, get("PhysicalChan", number, NULL, rest));
}
int32_t DAQmxGetChanAttribute(void *handle, const char *name, int32_t number, ...) {
    TASK(handle);
    (void)name;
    WITH_REST(number, get("Chan", number, task, rest));
}
int32_t DAQmxSetChanAttribute(void *handle, const char *name, int32_t number, ...) {
    TASK(handle);
    (void)task;
    WITH_REST(number, set("Chan", number, name, rest));
}
#define OF_TASK(group) \
    int32_t DAQmxGet##group##Attribute(void *handle, int32_t number, ...) { \
        TASK(handle); \
        WITH_REST(number, get(#group, number, task, rest)); \
    } \
    int32_t DAQmxSet##group##Attribute(void *handle, int32_t number, ...) { \
        TASK(handle); \
        char kind[2] = {task->kind, 0}; \
        WITH_REST(number, set(#group, number, kind, rest)); \
    }
OF_TASK(Task)
OF_TASK(Timing)
OF_TASK(Trig)
OF_TASK(Buffer)
OF_TASK(Read)
OF_TASK(Write)

/* Samples: input k of channel c is output k times c + 1. */
int32_t DAQmxWriteAnalogF64(void *handle, int32_t n, uint32_t auto_start, double timeout_s, uint32_t layout, const double *volts, int32_t *done,
                            uint32_t *reserved) {
    TASK(handle);
    if (written < 1000) fprintf(calls, "WriteAnalogF64 %d %u %g %u %s\n", n, auto_start, timeout_s, layout, reserved ? "reserved" : "NULL");
    for (int32_t i = 0; i < n; i++) output_v[(written + (uint64_t)i) % BUFFER] = volts[i];
    written += (uint64_t)n;
    *done = n;
    (void)task;
    return OK;
}

int32_t DAQmxWriteAnalogScalarF64(void *handle, uint32_t auto_start, double timeout_s, double volts, uint32_t *reserved) {
    TASK(handle);
    (void)task;
    fprintf(calls, "WriteAnalogScalarF64 %u %g %g %s\n", auto_start, timeout_s, volts, reserved ? "reserved" : "NULL");
    return OK;
}

int32_t DAQmxReadAnalogF64(void *handle, int32_t n, double timeout_s, uint32_t layout, double *out, uint32_t size, int32_t *done, uint32_t *reserved) {
    TASK(handle);
    if (task->position < 1000)
        fprintf(calls, "ReadAnalogF64 %d %g %u %u %s\n", n, timeout_s, layout, size, reserved ? "reserved" : "NULL");
    *done = 0;
    if (task->position + (uint64_t)n > written) return failed(NOT_YET, "no samples");
    for (int c = 0; c < task->channels; c++)
        for (int32_t i = 0; i < n; i++) out[c * n + i] = (c + 1) * output_v[(task->position + (uint64_t)i) % BUFFER];
    task->position += (uint64_t)n;
    *done = n;
    return OK;
}

/* Errors. */
int32_t DAQmxGetExtendedErrorInfo(char *text, uint32_t size) {
    snprintf(text, size, "%s", last_error);
    return OK;
}
int32_t DAQmxGetErrorString(int32_t code, char *text, uint32_t size) {
    snprintf(text, size, "stub: error %d", code);
    return OK;
}
int32_t DAQmxSetRuntimeEnvironment(const char *environment, const char *version, const char *first, const char *second) {
    (void)environment, (void)version, (void)first, (void)second;
    return OK;
}
