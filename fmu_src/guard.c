/* The library of a Python FMU that the master loads. It calls that of PythonFMU, which lies beside it, and guards both sides:
   the master from what no slave can mend (errors that are fatal, a pointer to a freed state, silence without logging), and
   PythonFMU from what would end the process (null pointers, strings that are not UTF-8, a folder that it cannot read).
   On Windows it needs no C library, whose compilation would take a minute. */

#define _GNU_SOURCE /* dladdr */
#include <stdbool.h>

#include "fmi2Functions.h"

#ifdef _WIN32

#include <stdint.h>

#define WINDOWS(type) __declspec(dllimport) type
WINDOWS(int) GetModuleHandleExW(uint32_t, const void *, void **);
WINDOWS(uint32_t) GetModuleFileNameW(void *, wchar_t *, uint32_t);
WINDOWS(void *) LoadLibraryW(const wchar_t *);
WINDOWS(int) FreeLibrary(void *);
WINDOWS(void *) GetProcAddress(void *, const char *);
WINDOWS(void *) GetProcessHeap(void);
WINDOWS(void *) HeapAlloc(void *, uint32_t, size_t);
WINDOWS(int) HeapFree(void *, uint32_t, void *);
WINDOWS(uint32_t) GetFileAttributesA(const char *);
WINDOWS(uint32_t) GetShortPathNameW(const wchar_t *, wchar_t *, uint32_t);
WINDOWS(int) MultiByteToWideChar(uint32_t, uint32_t, const char *, int, wchar_t *, int);
WINDOWS(int) WideCharToMultiByte(uint32_t, uint32_t, const wchar_t *, int, char *, int, const char *, int *);

enum { ADDRESS_OF_SAME_COUNT = 6, ZEROED = 8, UTF8 = 65001, LONGEST = 4096 };
static void *library;

/* Load PythonFMU's library from the folder of this one. */
static void *load_next(void) {
    static wchar_t path[LONGEST];
    static const wchar_t name[] = L"pythonfmu-export.dll";
    void *own;
    if (!GetModuleHandleExW(ADDRESS_OF_SAME_COUNT, (const void *)&load_next, &own)) return NULL;
    uint32_t end = GetModuleFileNameW(own, path, LONGEST - sizeof name / sizeof *name);
    while (end && path[end - 1] != L'\\' && path[end - 1] != L'/') end--;
    for (size_t i = 0; i < sizeof name / sizeof *name; i++) path[end + i] = name[i];
    return library = LoadLibraryW(path);
}

static void *find(void *handle, const char *name) {
    return GetProcAddress(handle, name);
}

static void *allocate(size_t size) {
    return HeapAlloc(GetProcessHeap(), ZEROED, size);
}

static void release(void *block) {
    HeapFree(GetProcessHeap(), 0, block);
}

static bool exists(const char *path) {
    return GetFileAttributesA(path) != UINT32_MAX;
}

/* PythonFMU reads paths of ASCII alone: put the short name of a folder, if the disk has one, in place of the path. */
static void shorten(char *path, size_t size) {
    static wchar_t wide[LONGEST];
    if (MultiByteToWideChar(UTF8, 0, path, -1, wide, LONGEST) && GetShortPathNameW(wide, wide, LONGEST))
        WideCharToMultiByte(UTF8, 0, wide, -1, path, (int)size, NULL, NULL);
}

/* Let PythonFMU's library go with this one, whose files the master may delete; not where the process ends. */
int DllMain(void *module, uint32_t reason, void *process_ends) {
    (void)module;
    if (reason == 0 && !process_ends && library) FreeLibrary(library);
    return 1;
}

#else

#include <dlfcn.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* Load Python's library, the newest that the system finds, into a host that has none. */
static void load_python(void) {
    char name[] = "libpython3.00.so.1.0";
    for (int minor = 29; minor >= 10 && !dlsym(RTLD_DEFAULT, "Py_IsInitialized"); minor--) {
        name[11] = (char)('0' + minor / 10), name[12] = (char)('0' + minor % 10);
        dlopen(name, RTLD_NOW | RTLD_GLOBAL);
    }
}

static void *load_next(void) {
    static const char name[] = "libpythonfmu-export.so";
    Dl_info own;
    if (!dladdr((void *)&load_next, &own)) return NULL;
    const char *end = strrchr(own.dli_fname, '/');
    size_t folder = end ? (size_t)(end + 1 - own.dli_fname) : 0;
    char *path = malloc(folder + sizeof name);
    if (!path) return NULL;
    memcpy(path, own.dli_fname, folder);
    memcpy(path + folder, name, sizeof name);
    load_python();
    void *handle = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    free(path);
    return handle;
}

static void *find(void *handle, const char *name) {
    return dlsym(handle, name);
}

static void *allocate(size_t size) {
    return calloc(1, size);
}

static void release(void *block) {
    free(block);
}

static bool exists(const char *path) {
    return access(path, R_OK) == 0;
}

static void shorten(char *path, size_t size) {
    (void)path, (void)size;
}

#endif

/* PythonFMU's functions */
#define EACH(DO)                                                                                                               \
    DO(SetDebugLogging)                                                                                                        \
    DO(Instantiate)                                                                                                            \
    DO(FreeInstance)                                                                                                           \
    DO(SetupExperiment)                                                                                                        \
    DO(EnterInitializationMode) DO(ExitInitializationMode) DO(Terminate) DO(Reset) DO(GetReal) DO(GetInteger) DO(GetBoolean)   \
        DO(GetString) DO(SetReal) DO(SetInteger) DO(SetBoolean) DO(SetString) DO(GetFMUstate) DO(SetFMUstate) DO(FreeFMUstate) \
            DO(SerializedFMUstateSize) DO(SerializeFMUstate) DO(DeSerializeFMUstate) DO(GetDirectionalDerivative)              \
                DO(SetRealInputDerivatives) DO(GetRealOutputDerivatives) DO(DoStep) DO(CancelStep) DO(GetStatus)               \
                    DO(GetRealStatus) DO(GetIntegerStatus) DO(GetBooleanStatus) DO(GetStringStatus)

#define DECLARE(name) fmi2##name##TYPE *name;
static struct {
    EACH(DECLARE)
} next;

static bool load(void) {
    void *handle = load_next();
    if (!handle) return false;
#define LOAD(name)                                                                                                             \
    next.name = (fmi2##name##TYPE *)find(handle, "fmi2" #name);                                                                \
    if (!next.name) return false;
    EACH(LOAD)
    return true;
}

/* Life and log */

enum { LONGEST_PATH = 4096, LONGEST_NAME = 256 };

typedef struct {
    fmi2Component slave;
    const fmi2CallbackFunctions *master;
    fmi2CallbackFunctions own;
    bool logging, said; /* whether the slave has logged what is wrong, in the present call */
    char name[LONGEST_NAME], resources[LONGEST_PATH];
} Guard;

/* Hand a message on: errors always, others if logging is on; as text, which is no format. PythonFMU's own message on an exception
   is left out where the slave has said in a sentence what is wrong. */
static void log_message(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                        fmi2String message, ...) {
    static const char *const categories[] = {NULL, "logStatusWarning", "logStatusDiscard", "logStatusError"};
    Guard *c = environment;
    (void)name;
    if (!c->master->logger || (status == fmi2OK && !c->logging) || (status == fmi2Fatal && c->said)) return;
    if (status == fmi2Fatal) status = fmi2Error;
    c->said |= status == fmi2Error;
    c->master->logger(c->master->componentEnvironment, c->name, status,
                      category || status > fmi2Error ? category : categories[status], "%s", message);
}

/* Begin a call of PythonFMU: its component. */
static fmi2Component begin(Guard *c) {
    c->said = false;
    return c->slave;
}

static fmi2Status refuse(Guard *c, const char *sentence) {
    if (c) log_message(c, c->name, fmi2Error, NULL, sentence);
    return fmi2Error;
}

/* An exception of the slave is fatal to PythonFMU; the slave lives on, so that it is an error. */
static fmi2Status mild(fmi2Status status) {
    return status == fmi2Fatal ? fmi2Error : status;
}

static bool is_utf8(const char *text) {
    for (const unsigned char *s = (const unsigned char *)text; *s;) {
        int more = *s < 0x80 ? 0 : *s >= 0xC2 && *s < 0xE0 ? 1 : *s >= 0xE0 && *s < 0xF0 ? 2 : *s >= 0xF0 && *s < 0xF5 ? 3 : -1;
        /* shortest forms alone, no halves of surrogates, nothing beyond 0x10FFFF */
        unsigned char low = *s == 0xE0 ? 0xA0 : *s == 0xF0 ? 0x90 : 0x80, high = *s == 0xED ? 0x9F : *s == 0xF4 ? 0x8F : 0xBF;
        if (more < 0) return false;
        for (s++; more > 0; more--, s++, low = 0x80, high = 0xBF)
            if (*s < low || *s > high) return false;
    }
    return true;
}

static int hex(char digit) {
    return digit >= '0' && digit <= '9'   ? digit - '0'
           : digit >= 'A' && digit <= 'F' ? digit - 'A' + 10
           : digit >= 'a' && digit <= 'f' ? digit - 'a' + 10
                                          : -1;
}

/* Write the path that a URI means (RFC 8089) to `path`; anything else than a URI of a file is taken for a path. */
static bool read_uri(const char *uri, char *path, size_t size) {
    static const char scheme[] = "file:", host[] = "//localhost/";
    size_t i = 0, n = 0;
    while (scheme[i] && uri[i] == scheme[i]) i++;
    bool is_uri = !scheme[i];
    const char *from = is_uri ? uri + i : uri;
    if (is_uri) {
        for (i = 0; host[i] && from[i] == host[i];) i++;
        if (!host[i])
            from += i - 1; /* file://localhost/path */
        else if (from[0] == '/' && from[1] == '/' && from[2] == '/')
            from += 2; /* file:///path */
#ifdef _WIN32
        if (from[0] == '/' && from[1] && from[2] == ':') from++; /* /C:/path */
#endif
    }
    for (; *from; from++) {
        if (n + 1 >= size) return false;
        bool coded = is_uri && *from == '%' && hex(from[1]) >= 0 && hex(from[2]) >= 0;
        path[n++] = coded ? (char)(16 * hex(from[1]) + hex(from[2])) : *from;
        if (coded) from += 2;
    }
    path[n] = 0;
    return is_utf8(path);
}

/* Whether PythonFMU will find the slave in the folder; it takes "%20" for a space. */
static bool holds_slave(const char *resources) {
    static const char file[] = "/slavemodule.txt";
    static char path[LONGEST_PATH + sizeof file];
    size_t n = 0;
    for (const char *s = resources; *s; s++) {
        bool space = s[0] == '%' && s[1] == '2' && s[2] == '0';
        path[n++] = space ? ' ' : *s;
        if (space) s += 2;
    }
    for (size_t i = 0; i < sizeof file; i++) path[n + i] = file[i];
    return exists(path);
}

const char *fmi2GetTypesPlatform(void) {
    return fmi2TypesPlatform;
}

const char *fmi2GetVersion(void) {
    return fmi2Version;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging) {
    Guard *c = functions ? allocate(sizeof *c) : NULL;
    if (!c) return NULL;
    c->master = functions;
    c->own = *functions;
    c->own.logger = log_message;
    c->own.componentEnvironment = c;
    c->logging = logging;
    for (size_t i = 0; name && name[i] && i + 1 < LONGEST_NAME; i++) c->name[i] = name[i];
    const char *wrong = NULL;
    if (!name || !is_utf8(name))
        wrong = "an instance must have a name, in UTF-8";
    else if (type != fmi2CoSimulation)
        wrong = "the Python FMU is for co-simulation alone";
    else if (!guid)
        wrong = "the GUID is missing";
    else if (!resources || !read_uri(resources, c->resources, LONGEST_PATH))
        wrong = "the location of the resources is missing, too long, or not in UTF-8";
    else if (!load())
        wrong =
            "PythonFMU's library beside this one cannot be loaded: it needs Python's library, and on Linux glibc 2.32 or newer";
    if (!wrong) {
        shorten(c->resources, LONGEST_PATH);
        if (!holds_slave(c->resources)) wrong = "the resources of the FMU cannot be read where the master says they are";
    }
    if (wrong)
        refuse(c, wrong);
    else
        c->slave = next.Instantiate(name, type, guid, c->resources, &c->own, visible, fmi2True);
    if (c->slave) return c;
    release(c);
    return NULL;
}

void fmi2FreeInstance(fmi2Component component) {
    Guard *c = component;
    if (!c) return;
    next.FreeInstance(c->slave);
    release(c);
}

fmi2Status fmi2SetDebugLogging(fmi2Component component, fmi2Boolean on, size_t n, const fmi2String categories[]) {
    Guard *c = component;
    if (!c || (n && !categories)) return refuse(c, "fmi2SetDebugLogging: a null pointer");
    for (size_t i = 0; i < n; i++)
        if (!categories[i]) return refuse(c, "fmi2SetDebugLogging: a null pointer");
    c->logging = on;
    return mild(next.SetDebugLogging(begin(c), fmi2True, on ? n : 0, categories));
}

/* Calls handed on as they are, if no pointer is null */
#define CALL(name, parameters, good, ...)                                                                                      \
    fmi2Status fmi2##name parameters {                                                                                         \
        Guard *c = component;                                                                                                  \
        return c && (good) ? mild(next.name(begin(c), ##__VA_ARGS__)) : refuse(c, "fmi2" #name ": a null pointer");            \
    }

CALL(SetupExperiment,
     (fmi2Component component, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start, fmi2Boolean has_stop,
      fmi2Real stop),
     true, has_tolerance, tolerance, start, has_stop, stop)
CALL(EnterInitializationMode, (fmi2Component component), true)
CALL(ExitInitializationMode, (fmi2Component component), true)
CALL(Terminate, (fmi2Component component), true)
CALL(Reset, (fmi2Component component), true)

#define VALUES(name, type)                                                                                                     \
    CALL(name, (fmi2Component component, const fmi2ValueReference at[], size_t n, type values[]), !n || (at && values), at, n, \
         values)
VALUES(GetReal, fmi2Real)
VALUES(GetInteger, fmi2Integer)
VALUES(GetBoolean, fmi2Boolean)
VALUES(GetString, fmi2String)
VALUES(SetReal, const fmi2Real)
VALUES(SetInteger, const fmi2Integer)
VALUES(SetBoolean, const fmi2Boolean)

fmi2Status fmi2SetString(fmi2Component component, const fmi2ValueReference at[], size_t n, const fmi2String values[]) {
    Guard *c = component;
    if (!c || (n && !(at && values))) return refuse(c, "fmi2SetString: a null pointer");
    for (size_t i = 0; i < n; i++)
        if (!values[i] || !is_utf8(values[i])) return refuse(c, "fmi2SetString: a string that is null or not in UTF-8");
    return mild(next.SetString(begin(c), at, n, values));
}

/* Takes the place of the state that the pointer has, which is freed. */
fmi2Status fmi2GetFMUstate(fmi2Component component, fmi2FMUstate *state) {
    Guard *c = component;
    if (!c || !state) return refuse(c, "fmi2GetFMUstate: a null pointer");
    fmi2FMUstate found = NULL;
    fmi2Status status = mild(next.GetFMUstate(begin(c), &found));
    if (status > fmi2Warning) return status;
    fmi2FreeFMUstate(c, state);
    *state = found;
    return status;
}

CALL(SetFMUstate, (fmi2Component component, fmi2FMUstate state), state, state)
CALL(SerializedFMUstateSize, (fmi2Component component, fmi2FMUstate state, size_t *size), state &&size, state, size)
CALL(SerializeFMUstate, (fmi2Component component, fmi2FMUstate state, fmi2Byte bytes[], size_t size), state &&bytes, state,
     bytes, size)
CALL(DeSerializeFMUstate, (fmi2Component component, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state), bytes &&state,
     bytes, size, state)

fmi2Status fmi2FreeFMUstate(fmi2Component component, fmi2FMUstate *state) {
    Guard *c = component;
    if (!c) return fmi2Error;
    if (!state || !*state) return fmi2OK;
    fmi2Status status = mild(next.FreeFMUstate(begin(c), state));
    *state = NULL;
    return status;
}

CALL(GetDirectionalDerivative,
     (fmi2Component component, const fmi2ValueReference of[], size_t n, const fmi2ValueReference at[], size_t m,
      const fmi2Real seed[], fmi2Real product[]),
     true, of, n, at, m, seed, product)
CALL(SetRealInputDerivatives,
     (fmi2Component component, const fmi2ValueReference at[], size_t n, const fmi2Integer order[], const fmi2Real values[]),
     true, at, n, order, values)
CALL(GetRealOutputDerivatives,
     (fmi2Component component, const fmi2ValueReference at[], size_t n, const fmi2Integer order[], fmi2Real values[]), true, at,
     n, order, values)
CALL(DoStep, (fmi2Component component, fmi2Real time, fmi2Real step, fmi2Boolean no_return), true, time, step, no_return)
CALL(CancelStep, (fmi2Component component), true)
CALL(GetStatus, (fmi2Component component, const fmi2StatusKind kind, fmi2Status *value), value, kind, value)
CALL(GetRealStatus, (fmi2Component component, const fmi2StatusKind kind, fmi2Real *value), value, kind, value)
CALL(GetIntegerStatus, (fmi2Component component, const fmi2StatusKind kind, fmi2Integer *value), value, kind, value)
CALL(GetBooleanStatus, (fmi2Component component, const fmi2StatusKind kind, fmi2Boolean *value), value, kind, value)
CALL(GetStringStatus, (fmi2Component component, const fmi2StatusKind kind, fmi2String *value), value, kind, value)
