/* The library of a Python FMU that the master loads. It calls that of PythonFMU, which lies beside it, and guards both sides:
   the master from what no slave can mend (errors that are fatal, a pointer to a freed state, silence without logging), and
   PythonFMU from what would end the process (null pointers, strings that are not UTF-8, a folder that it cannot read).
   On Windows it needs no C library, whose compilation would take a minute. */

#define _GNU_SOURCE /* dladdr */
#include <stdatomic.h>
#include <stdbool.h>

#include "fmi2Functions.h"

enum { LONGEST_PATH = 4096 };

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
WINDOWS(void *) CreateFileA(const char *, uint32_t, uint32_t, void *, uint32_t, uint32_t, void *);
WINDOWS(int) ReadFile(void *, void *, uint32_t, uint32_t *, void *);
WINDOWS(int) CloseHandle(void *);
WINDOWS(uint32_t) GetShortPathNameW(const wchar_t *, wchar_t *, uint32_t);
WINDOWS(int) MultiByteToWideChar(uint32_t, uint32_t, const char *, int, wchar_t *, int);
WINDOWS(int) WideCharToMultiByte(uint32_t, uint32_t, const wchar_t *, int, char *, int, const char *, int *);

enum { ADDRESS_OF_SAME_COUNT = 6, ZEROED = 8, UTF8 = 65001, SHARE = 1, EXISTING = 3 };
#define READ 0x80000000u
static void *library;

static void *allocate(size_t size) {
    return HeapAlloc(GetProcessHeap(), ZEROED, size);
}

static void release(void *block) {
    HeapFree(GetProcessHeap(), 0, block);
}

/* Load PythonFMU's library from the folder of this one. */
static void *load_next(void) {
    static const wchar_t name[] = L"pythonfmu-export.dll";
    wchar_t *path = allocate(LONGEST_PATH * sizeof *path);
    void *own;
    if (!path || !GetModuleHandleExW(ADDRESS_OF_SAME_COUNT, (const void *)&load_next, &own)) return NULL;
    uint32_t end = GetModuleFileNameW(own, path, LONGEST_PATH - sizeof name / sizeof *name);
    while (end && path[end - 1] != L'\\' && path[end - 1] != L'/') end--;
    for (size_t i = 0; i < sizeof name / sizeof *name; i++) path[end + i] = name[i];
    library = LoadLibraryW(path);
    release(path);
    return library;
}

static void *find(void *handle, const char *name) {
    return GetProcAddress(handle, name);
}

static void end_with_process(void *handle) {
    (void)handle;
}

/* Read the first bytes of a file; return their number, or -1. */
static int read_file(const char *path, char *text, int size) {
    void *file = CreateFileA(path, READ, SHARE, NULL, EXISTING, 0, NULL);
    uint32_t count = 0;
    if (file == (void *)-1) return -1;
    int good = ReadFile(file, text, (uint32_t)size, &count, NULL);
    CloseHandle(file);
    return good ? (int)count : -1;
}

/* PythonFMU reads paths of ASCII alone: put the short name of a folder, if the disk has one, in place of the path. */
static void shorten(char *path) {
    wchar_t *wide = allocate(LONGEST_PATH * sizeof *wide);
    if (!wide) return;
    if (MultiByteToWideChar(UTF8, 0, path, -1, wide, LONGEST_PATH) && GetShortPathNameW(wide, wide, LONGEST_PATH))
        WideCharToMultiByte(UTF8, 0, wide, -1, path, LONGEST_PATH, NULL, NULL);
    release(wide);
}

/* Let PythonFMU's library go with this one, whose files the master may delete; not where the process ends. */
int DllMain(void *module, uint32_t reason, void *process_ends) {
    (void)module;
    if (reason == 0 && !process_ends && library) FreeLibrary(library);
    return 1;
}

#else

#include <dlfcn.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static char folder[LONGEST_PATH]; /* of this library, with the slash; empty if it is not known */

/* Find the folder while the library is loaded: later a relative path may mean another one. */
__attribute__((constructor)) static void find_folder(void) {
    Dl_info own;
    if (dladdr((void *)&find_folder, &own) && realpath(own.dli_fname, folder)) *(strrchr(folder, '/') + 1) = 0;
}

static void *allocate(size_t size) {
    return calloc(1, size);
}

static void release(void *block) {
    free(block);
}

/* Give PythonFMU the symbols of Python: of that which the host has loaded, else of the newest that the system finds. */
static void load_python(void) {
    char name[] = "libpython3.00.so.1.0";
    for (int way = 0; way < 2; way++)
        for (int minor = 29; minor >= 10 && !dlsym(RTLD_DEFAULT, "Py_IsInitialized"); minor--) {
            name[11] = (char)('0' + minor / 10), name[12] = (char)('0' + minor % 10);
            dlopen(name, RTLD_NOW | RTLD_GLOBAL | (way ? 0 : RTLD_NOLOAD));
        }
}

static void *load_next(void) {
    static const char name[] = "libpythonfmu-export.so";
    char *path = allocate(strlen(folder) + sizeof name);
    if (!path) return NULL;
    load_python();
    void *handle = dlopen(strcat(strcpy(path, folder), name), RTLD_NOW | RTLD_LOCAL);
    release(path);
    return handle;
}

static void *find(void *handle, const char *name) {
    return dlsym(handle, name);
}

/* Let PythonFMU's library end Python before its own destructors run: these would use a pointer that they have destroyed. */
static void end_with_process(void *handle) {
    extern int __cxa_atexit(void (*)(void *), void *, void *);
    void (*end)(void *) = (void (*)(void *))find(handle, "finalizePythonInterpreter");
    if (end) __cxa_atexit(end, NULL, NULL);
}

static int read_file(const char *path, char *text, int size) {
    int file = open(path, O_RDONLY | O_CLOEXEC);
    if (file < 0) return -1;
    ssize_t count = read(file, text, (size_t)size);
    close(file);
    return (int)count;
}

static void shorten(char *path) {
    (void)path;
}

#endif

/* PythonFMU's functions */
/* clang-format off */
#define EACH(DO) \
    DO(Instantiate) DO(FreeInstance) DO(SetupExperiment) DO(EnterInitializationMode) DO(ExitInitializationMode) \
    DO(Terminate) DO(Reset) DO(GetReal) DO(GetInteger) DO(GetBoolean) DO(GetString) DO(SetReal) DO(SetInteger) \
    DO(SetBoolean) DO(SetString) DO(GetFMUstate) DO(SetFMUstate) DO(FreeFMUstate) DO(SerializedFMUstateSize) \
    DO(SerializeFMUstate) DO(DeSerializeFMUstate) DO(GetDirectionalDerivative) DO(SetRealInputDerivatives) \
    DO(GetRealOutputDerivatives) DO(DoStep) DO(CancelStep) DO(GetStatus) DO(GetRealStatus) DO(GetIntegerStatus) \
    DO(GetBooleanStatus) DO(GetStringStatus)
/* clang-format on */

#define DECLARE(name) fmi2##name##TYPE *name;
static struct {
    EACH(DECLARE)
} next;

static bool find_all(void *handle) {
    if (!handle) return false;
#define FIND(name)                                                                                                             \
    next.name = (fmi2##name##TYPE *)find(handle, "fmi2" #name);                                                                \
    if (!next.name) return false;
    EACH(FIND)
    end_with_process(handle);
    return true;
}

/* Load PythonFMU's library once, whichever thread comes first. */
static bool load(void) {
    static atomic_flag busy = ATOMIC_FLAG_INIT;
    static bool loaded;
    while (atomic_flag_test_and_set(&busy)) continue;
    loaded = loaded || find_all(load_next());
    bool found = loaded;
    atomic_flag_clear(&busy);
    return found;
}

/* Life and log */

typedef struct {
    fmi2Component slave;
    fmi2CallbackFunctions master, own;
    bool logging, said; /* said: the slave has logged what is wrong, in the present call */
    bool refused;       /* the last step */
    double time;        /* of the last good step, at first the start; not a number: not known */
    char *name, resources[LONGEST_PATH];
} Guard;

static bool same(const char *a, const char *b) {
    while (*a && *a == *b) a++, b++;
    return *a == *b;
}

static char *copy(const char *text) {
    size_t n = 0;
    while (text[n]) n++;
    char *found = allocate(n + 1);
    for (size_t i = 0; found && i < n; i++) found[i] = text[i];
    return found;
}

/* Hand a message on: errors always, others if logging is on; as text, which is no format. PythonFMU's own message on an
   exception is left out where the slave has said in a sentence what is wrong. */
static void log_message(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                        fmi2String message, ...) {
    static const char *const categories[] = {NULL, "logStatusWarning", "logStatusDiscard", "logStatusError"};
    Guard *c = environment;
    (void)name;
    if (!c->master.logger || (status == fmi2OK && !c->logging) || (status == fmi2Fatal && c->said)) return;
    if (status == fmi2Fatal) status = fmi2Error;
    c->said |= status == fmi2Error;
    if (!category && status <= fmi2Error) category = categories[status];
    c->master.logger(c->master.componentEnvironment, c->name, status, category, "%s", message);
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

static bool starts(const char *text, const char *lower) {
    for (; *lower; text++, lower++)
        if ((*text >= 'A' && *text <= 'Z' ? *text - 'A' + 'a' : *text) != *lower) return false;
    return true;
}

/* Write the path that a URI means (RFC 8089) to `path`; anything else than a URI of a file is taken for a path. */
static bool read_uri(const char *uri, char *path) {
    bool is_uri = starts(uri, "file:");
    const char *from = is_uri ? uri + 5 : uri;
    size_t n = 0;
    if (is_uri && starts(from, "//localhost/"))
        from += 11;
    else if (is_uri && starts(from, "///"))
        from += 2;
#ifdef _WIN32
    if (is_uri && from[0] == '/' && from[1] && from[2] == ':') from++; /* /C:/path */
#endif
    for (; *from; from++) {
        bool coded = is_uri && *from == '%' && hex(from[1]) >= 0 && hex(from[2]) >= 0;
        path[n] = coded ? (char)(16 * hex(from[1]) + hex(from[2])) : *from;
        if (coded) from += 2;
        if (!path[n] || ++n == LONGEST_PATH) return false;
    }
    path[n] = 0;
    return is_utf8(path);
}

/* Return what is wrong with the folder, as PythonFMU will read its name: it takes "%20" for a space. */
static const char *check_resources(const char *resources, const char *guid) {
    static const char file[] = "/guid.txt";
    char *path = allocate(LONGEST_PATH + sizeof file), found[256];
    size_t n = 0;
    if (!path) return "there is no memory";
    for (const char *s = resources; *s; s++) {
        bool space = s[0] == '%' && s[1] == '2' && s[2] == '0';
        path[n++] = space ? ' ' : *s;
        if (space) s += 2;
    }
    for (size_t i = 0; i < sizeof file; i++) path[n + i] = file[i];
    int count = read_file(path, found, sizeof found - 1);
    release(path);
    if (count < 0) return "the resources of the FMU cannot be read where the master says they are";
    found[count] = 0;
    return same(found, guid) ? NULL : "the GUID is not that of this FMU";
}

const char *fmi2GetTypesPlatform(void) {
    return fmi2TypesPlatform;
}

const char *fmi2GetVersion(void) {
    return fmi2Version;
}

static const char *check_start(Guard *c, fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources) {
    if (!name || !is_utf8(name)) return "an instance must have a name, in UTF-8";
    if (type != fmi2CoSimulation) return "the Python FMU is for co-simulation alone";
    if (!guid) return "the GUID is missing";
    if (!resources || !read_uri(resources, c->resources))
        return "the location of the resources is missing, too long, or not in UTF-8";
    shorten(c->resources);
    const char *wrong = check_resources(c->resources, guid);
    if (wrong) return wrong;
    return load() ? NULL
                  : "PythonFMU's library beside this one cannot be loaded: it needs Python's library, and on Linux glibc "
                    "2.32 or newer";
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging) {
    Guard *c = functions ? allocate(sizeof *c) : NULL;
    if (!c) return NULL;
    c->master = c->own = *functions;
    c->own.logger = log_message;
    c->own.componentEnvironment = c;
    c->logging = logging;
    c->name = copy(name ? name : "");
    const char *wrong = c->name ? check_start(c, name, type, guid, resources) : "there is no memory";
    if (wrong)
        refuse(c, wrong);
    else
        c->slave = next.Instantiate(name, type, guid, c->resources, &c->own, visible, fmi2True);
    if (c->slave) return c;
    release(c->name);
    release(c);
    return NULL;
}

void fmi2FreeInstance(fmi2Component component) {
    Guard *c = component;
    if (!c) return;
    next.FreeInstance(c->slave);
    release(c->name);
    release(c);
}

fmi2Status fmi2SetDebugLogging(fmi2Component component, fmi2Boolean on, size_t n, const fmi2String categories[]) {
    static const char *const known[] = {"logAll", "logStatusWarning", "logStatusDiscard", "logStatusError", "logStatusFatal"};
    Guard *c = component;
    if (!c || (n && !categories)) return refuse(c, "fmi2SetDebugLogging: a null pointer");
    for (size_t i = 0; i < n; i++) {
        bool found = false;
        for (size_t k = 0; categories[i] && k < sizeof known / sizeof *known; k++) found |= same(categories[i], known[k]);
        if (!found) return refuse(c, "fmi2SetDebugLogging: a category that the FMU does not have");
    }
    c->logging = on;
    return fmi2OK;
}

/* Calls handed on as they are, if no pointer is null */
#define CALL(name, parameters, good, ...)                                                                                      \
    fmi2Status fmi2##name parameters {                                                                                         \
        Guard *c = component;                                                                                                  \
        return c && (good) ? mild(next.name(begin(c), ##__VA_ARGS__)) : refuse(c, "fmi2" #name ": a null pointer");            \
    }

fmi2Status fmi2SetupExperiment(fmi2Component component, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean has_stop, fmi2Real stop) {
    Guard *c = component;
    if (!c) return refuse(c, "fmi2SetupExperiment: a null pointer");
    c->time = start;
    return mild(next.SetupExperiment(begin(c), has_tolerance, tolerance, start, has_stop, stop));
}

CALL(EnterInitializationMode, (fmi2Component component), true)
CALL(ExitInitializationMode, (fmi2Component component), true)
CALL(Terminate, (fmi2Component component), true)

/* What PythonFMU would keep of the last step, beyond a reset or a state that is set. */
static void forget_step(Guard *c) {
    c->refused = false;
    c->time = __builtin_nan("");
}

fmi2Status fmi2Reset(fmi2Component component) {
    Guard *c = component;
    if (!c) return refuse(c, "fmi2Reset: a null pointer");
    forget_step(c);
    return mild(next.Reset(begin(c)));
}

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

fmi2Status fmi2SetFMUstate(fmi2Component component, fmi2FMUstate state) {
    Guard *c = component;
    if (!c || !state) return refuse(c, "fmi2SetFMUstate: a null pointer");
    fmi2Status status = mild(next.SetFMUstate(begin(c), state));
    if (status <= fmi2Warning) forget_step(c);
    return status;
}

CALL(SerializedFMUstateSize, (fmi2Component component, fmi2FMUstate state, size_t *size), (state && size), state, size)

fmi2Status fmi2SerializeFMUstate(fmi2Component component, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
    Guard *c = component;
    size_t right = 0;
    if (!c || !state || !bytes) return refuse(c, "fmi2SerializeFMUstate: a null pointer");
    if (next.SerializedFMUstateSize(begin(c), state, &right) > fmi2Warning || right != size)
        return refuse(c, "fmi2SerializeFMUstate: the size is not that of the state");
    return mild(next.SerializeFMUstate(begin(c), state, bytes, size));
}

CALL(DeSerializeFMUstate, (fmi2Component component, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state), (bytes && state),
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

fmi2Status fmi2DoStep(fmi2Component component, fmi2Real time, fmi2Real step, fmi2Boolean no_return) {
    Guard *c = component;
    if (!c) return refuse(c, "fmi2DoStep: a null pointer");
    fmi2Status status = mild(next.DoStep(begin(c), time, step, no_return));
    c->refused = status > fmi2Warning;
    if (!c->refused || c->time != c->time) c->time = c->refused ? time : time + step;
    return status;
}

CALL(CancelStep, (fmi2Component component), true)
CALL(GetIntegerStatus, (fmi2Component component, const fmi2StatusKind kind, fmi2Integer *value), value, kind, value)
CALL(GetStringStatus, (fmi2Component component, const fmi2StatusKind kind, fmi2String *value), value, kind, value)

#define STATUS(name, type, wanted, known, found)                                                                               \
    fmi2Status fmi2##name(fmi2Component component, const fmi2StatusKind kind, type *value) {                                   \
        Guard *c = component;                                                                                                  \
        if (!c || !value) return refuse(c, "fmi2" #name ": a null pointer");                                                   \
        if (kind != (wanted)) return mild(next.name(begin(c), kind, value));                                                   \
        if (!(known)) return fmi2Discard;                                                                                      \
        *value = found;                                                                                                        \
        return fmi2OK;                                                                                                         \
    }
STATUS(GetStatus, fmi2Status, fmi2DoStepStatus, true, c->refused ? fmi2Discard : fmi2OK)
STATUS(GetRealStatus, fmi2Real, fmi2LastSuccessfulTime, c->time == c->time, c->time)
STATUS(GetBooleanStatus, fmi2Boolean, fmi2Terminated, true, c->refused)
