// Opening libraries, and looking for functions by name.
#include "android.h"
#include <dlfcn.h>
#include <string.h>

static void *listed;
static const char *name_here(const char *name) {
  if (!name) return NULL;
  if (!strcmp(name, "libvulkan.so")) return "libvulkan.so.1";
  return name;
}
void *android_dlopen(const char *name, int flags) {
  void *handle = dlopen(name_here(name), flags | RTLD_DEEPBIND);
  if (handle)
    tell("dlopen %s", name ? name : "(the program)");
  else {
    char *why = dlerror();
    tell("dlopen %s: %s", name ? name : "(the program)", why ? why : "?");
    dlopen(name_here(name), flags | RTLD_DEEPBIND);  // so that dlerror has it again
  }
  return handle;
}
ANDROID(dlopen);
// A weak name of the C library: an API 29 has it, and with this file's meaning if it has one.
void *android_dlsym(void *handle, const char *name) {
  if (handle != RTLD_DEFAULT) return dlsym(handle, name);
  unsigned low = 0, high = api_29_count;
  while (low < high) {
    unsigned middle = (low + high) / 2;
    if (strcmp(api_29[middle], name) < 0)
      low = middle + 1;
    else
      high = middle;
  }
  if (low == api_29_count || strcmp(api_29[low], name)) {
    tell("dlsym %s: not in API level 29", name);
    return NULL;
  }
  if (!listed) {
    Dl_info info;
    dladdr(&listed, &info);
    listed = dlopen(info.dli_fname, RTLD_NOW | RTLD_NOLOAD);
  }
  void *ours = listed ? dlvsym(listed, name, "LIBC") : NULL;
  void *found = ours ? ours : dlsym(RTLD_DEFAULT, name);
  tell("dlsym %s: %s", name, ours ? "this shim's" : found ? "glibc's" : "MISSING");
  return found;
}
ANDROID(dlsym);
