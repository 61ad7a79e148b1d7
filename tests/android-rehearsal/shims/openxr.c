// libopenxr_loader.so: Linux's loader, made to accept what only Android's accepts: XR_KHR_loader_init_android,
// XR_KHR_android_create_instance and XR_KHR_android_thread_settings. The app's arguments are checked and logged.
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

typedef int32_t XrResult;
typedef void (*Function)(void);
typedef struct Header {
  int32_t type;
  struct Header *next;
} Header;
typedef struct {
  Header header;
  char name[128];
  uint32_t version;
} Property;
typedef struct {
  Header header;
  void *vm, *activity;
} ForAndroid;
typedef struct {
  Header header;
  uint64_t flags;
  struct {
    char application[128];
    uint32_t application_version;
    char engine[128];
    uint32_t engine_version;
    uint64_t api;
  } info;
  uint32_t layer_count;
  const char *const *layers;
  uint32_t extension_count;
  const char *const *extensions;
} CreateInfo;

typedef struct {
  Header header;
  int64_t display_time;
  int32_t blend_mode;
  uint32_t layer_count;
  const Header *const *layers;
} FrameEnd;

enum { LOADER_INIT_ANDROID = 1000089000, CREATE_ANDROID = 1000008000, PROJECTION_LAYER = 35 };
static const struct {
  const char *name;
  uint32_t version;
} OURS[] = {{"XR_KHR_android_create_instance", 3}, {"XR_KHR_android_thread_settings", 6}};

int __android_log_print(int, const char *, const char *, ...);
#define SAY(...) __android_log_print(4, "OpenXR", __VA_ARGS__)

static XrResult (*real_get)(void *, const char *, Function *);
static XrResult (*real_create)(const CreateInfo *, void **);
static XrResult (*real_extensions)(const char *, uint32_t, uint32_t *, Property *);
static XrResult (*real_layers)(uint32_t, uint32_t *, void *);
static XrResult (*real_end_frame)(void *, const void *);
static int initialised;

// Frames that were handed to the compositor: with pictures of people (a projection layer), and others (a notice, or nothing).
static int frames[2];

void rehearsal_frames(int32_t *out) {
  for (int i = 0; i < 2; i++) out[i] = __atomic_load_n(&frames[i], __ATOMIC_SEQ_CST);
}

__attribute__((constructor)) static void load(void) {
  const char *path = getenv("REHEARSAL_OPENXR");
  void *loader = dlopen(path ? path : "libopenxr_loader.so.1", RTLD_NOW | RTLD_LOCAL);
  if (!loader) {
    SAY("no loader: %s", dlerror());
    return;
  }
  real_get = dlsym(loader, "xrGetInstanceProcAddr");
  real_create = dlsym(loader, "xrCreateInstance");
  real_extensions = dlsym(loader, "xrEnumerateInstanceExtensionProperties");
  real_layers = dlsym(loader, "xrEnumerateApiLayerProperties");
}

// The two tables of JNI, by the places that its specification gives: no JDK's header is needed.
typedef const void *const *const *Machine;
typedef const void *const *const *Environment;
enum { ATTACH = 4, DETACH = 5, GET_ENV = 6 };
enum { FIND_CLASS = 6, DELETE_LOCAL_REF = 23, IS_INSTANCE_OF = 32, GET_OBJECT_REF_TYPE = 232 };
enum { JNI_OK = 0, JNI_VERSION_1_6 = 0x00010006, GLOBAL_REFERENCE = 2 };

// Whether this is a Java machine and a global reference to an android.app.Activity, asked as the loader would: from the calling thread.
static int is_good(const char *call, const void *vm_raw, void *activity) {
  if (!vm_raw || !activity) return SAY("%s: vm %p, activity %p", call, vm_raw, activity), 0;
  Machine vm = vm_raw;
  Environment env = NULL;
  int32_t (*get_env)(Machine, Environment *, int32_t) = (*vm)[GET_ENV];
  int was_attached = get_env(vm, &env, JNI_VERSION_1_6) == JNI_OK;
  if (!was_attached) ((int32_t(*)(Machine, Environment *, void *))(*vm)[ATTACH])(vm, &env, NULL);
  void *class = ((void *(*)(Environment, const char *))(*env)[FIND_CLASS])(env, "android/app/Activity");
  int good = ((uint8_t(*)(Environment, void *, void *))(*env)[IS_INSTANCE_OF])(env, activity, class) &&
             ((int32_t(*)(Environment, void *))(*env)[GET_OBJECT_REF_TYPE])(env, activity) == GLOBAL_REFERENCE;
  SAY("%s: %s", call, good ? "a global reference to an activity" : "WRONG activity");
  ((void (*)(Environment, void *))(*env)[DELETE_LOCAL_REF])(env, class);
  if (!was_attached) ((int32_t(*)(Machine))(*vm)[DETACH])(vm);
  return good;
}

static XrResult initialize(const ForAndroid *info) {
  if (!info || info->header.type != LOADER_INIT_ANDROID) return SAY("xrInitializeLoaderKHR: another structure"), -1;
  if (!is_good("xrInitializeLoaderKHR", info->vm, info->activity)) return -1;
  initialised = 1;
  return 0;
}

static XrResult set_thread(void *session, int kind, uint32_t id) {
  char path[64];
  snprintf(path, sizeof path, "/proc/self/task/%u", id);
  int there = access(path, F_OK) == 0;
  (void)session;
  SAY("xrSetAndroidApplicationThreadKHR: kind %d, thread %u: %s", kind, id, there ? "one of ours" : "NO SUCH THREAD");
  return there ? 0 : -1000003000;
}

XrResult xrEnumerateApiLayerProperties(uint32_t capacity, uint32_t *count, void *layers) { return real_layers ? real_layers(capacity, count, layers) : -51; }

XrResult xrEnumerateInstanceExtensionProperties(const char *layer, uint32_t capacity, uint32_t *count, Property *all) {
  if (!initialised) return SAY("xrEnumerateInstanceExtensionProperties before xrInitializeLoaderKHR"), -6;
  uint32_t theirs = 0;
  if (layer) return real_extensions(layer, capacity, count, all);
  XrResult result = real_extensions(NULL, 0, &theirs, NULL);
  if (result) return result;
  const uint32_t ours = sizeof OURS / sizeof *OURS;
  *count = theirs + ours;
  if (!capacity) return 0;
  if (capacity < theirs + ours) return -11;
  result = real_extensions(NULL, theirs, &theirs, all);
  for (uint32_t i = 0; i < ours; i++) {
    strcpy(all[theirs + i].name, OURS[i].name);
    all[theirs + i].version = OURS[i].version;
  }
  return result;
}

XrResult xrCreateInstance(const CreateInfo *info, void **instance) {
  if (!initialised) return SAY("xrCreateInstance before xrInitializeLoaderKHR"), -6;
  CreateInfo copy = *info;
  const char *kept[64];
  int named = 0;
  copy.extension_count = 0;
  for (uint32_t i = 0; i < info->extension_count; i++) {
    int ours = 0;
    for (uint32_t j = 0; j < sizeof OURS / sizeof *OURS; j++) ours |= !strcmp(info->extensions[i], OURS[j].name);
    named |= !strcmp(info->extensions[i], OURS[0].name);
    SAY("xrCreateInstance enables %s", info->extensions[i]);
    if (!ours && copy.extension_count < 64) kept[copy.extension_count++] = info->extensions[i];
  }
  copy.extensions = kept;
  const ForAndroid *android = NULL;
  Header *next = info->header.next;
  if (next && next->type == CREATE_ANDROID) {
    android = (const ForAndroid *)next;
    copy.header.next = next->next;
  }
  if (!named) return SAY("xrCreateInstance without XR_KHR_android_create_instance"), -9;
  if (!android || !is_good("xrCreateInstance", android->vm, android->activity)) return -2;
  XrResult result = real_create(&copy, instance);
  SAY("xrCreateInstance for API %u.%u: %d", (unsigned)(copy.info.api >> 48), (unsigned)(copy.info.api >> 32 & 0xffff), result);
  return result;
}

static XrResult end_frame(void *session, const FrameEnd *end) {
  int people = 0;
  for (uint32_t i = 0; i < end->layer_count; i++) people |= end->layers[i]->type == PROJECTION_LAYER;
  __atomic_add_fetch(&frames[!people], 1, __ATOMIC_SEQ_CST);
  return real_end_frame(session, end);
}

XrResult xrGetInstanceProcAddr(void *instance, const char *name, Function *function) {
  static const struct {
    const char *name;
    void *function;
  } ours[] = {{"xrInitializeLoaderKHR", initialize},
              {"xrCreateInstance", xrCreateInstance},
              {"xrEnumerateInstanceExtensionProperties", xrEnumerateInstanceExtensionProperties},
              {"xrSetAndroidApplicationThreadKHR", set_thread},
              {"xrGetInstanceProcAddr", xrGetInstanceProcAddr}};
  for (unsigned i = 0; i < sizeof ours / sizeof *ours; i++)
    if (!strcmp(name, ours[i].name)) {
      *function = (Function)ours[i].function;
      return 0;
    }
  if (!real_get) return -51;
  XrResult result = real_get(instance, name, function);
  if (!result && !strcmp(name, "xrEndFrame")) {
    real_end_frame = (XrResult(*)(void *, const void *))*function;
    *function = (Function)end_frame;
  }
  return result;
}
