// Threads: attributes in bionic's own layout, which this file alone reads; glibc's are longer.
#include "android.h"
#include <errno.h>
#include <pthread.h>
#include <string.h>

struct android_attr {
  uint32_t flags;
  void *base;
  size_t stack, guard;
  int32_t policy, priority;
  char reserved[16];
};
_Static_assert(sizeof(struct android_attr) == 56, "as bionic's");
int android_pthread_attr_init(struct android_attr *attr) {
  *attr = (struct android_attr){.stack = 1024 * 1024, .guard = 4096};
  return 0;
}
ANDROID(pthread_attr_init);
int android_pthread_attr_destroy(struct android_attr *attr) { return memset(attr, 0x42, sizeof *attr), 0; }
ANDROID(pthread_attr_destroy);
int android_pthread_attr_setstacksize(struct android_attr *attr, size_t size) { return size < 16384 ? EINVAL : (attr->stack = size, 0); }
ANDROID(pthread_attr_setstacksize);
int android_pthread_attr_getstacksize(const struct android_attr *attr, size_t *size) { return *size = attr->stack, 0; }
ANDROID(pthread_attr_getstacksize);
int android_pthread_attr_getstack(const struct android_attr *attr, void **base, size_t *size) { return *base = attr->base, *size = attr->stack, 0; }
ANDROID(pthread_attr_getstack);
int android_pthread_attr_getguardsize(const struct android_attr *attr, size_t *size) { return *size = attr->guard, 0; }
ANDROID(pthread_attr_getguardsize);
int android_pthread_attr_setguardsize(struct android_attr *attr, size_t size) { return attr->guard = size, 0; }
ANDROID(pthread_attr_setguardsize);
int android_pthread_attr_setdetachstate(struct android_attr *attr, int state) { return attr->flags = (attr->flags & ~1u) | (state != 0), 0; }
ANDROID(pthread_attr_setdetachstate);
int android_pthread_getattr_np(pthread_t thread, struct android_attr *attr) {
  pthread_attr_t theirs;
  int error = pthread_getattr_np(thread, &theirs);
  if (error) return error;
  *attr = (struct android_attr){0};
  pthread_attr_getstack(&theirs, &attr->base, &attr->stack);
  pthread_attr_getguardsize(&theirs, &attr->guard);
  pthread_attr_destroy(&theirs);
  return 0;
}
ANDROID(pthread_getattr_np);
int android_pthread_create(pthread_t *thread, const struct android_attr *attr, void *(*start)(void *), void *argument) {
  pthread_attr_t theirs;
  pthread_attr_init(&theirs);
  // Bionic's own stack is a megabyte less the guard; glibc's keeps thread-local memory on it besides.
  size_t stack = (attr ? attr->stack : 1024 * 1024) + 65536;
  pthread_attr_setstacksize(&theirs, stack);
  if (attr && attr->flags & 1) pthread_attr_setdetachstate(&theirs, PTHREAD_CREATE_DETACHED);
  int error = pthread_create(thread, &theirs, start, argument);
  pthread_attr_destroy(&theirs);
  return error;
}
ANDROID(pthread_create);
// Bionic's is a long; glibc's an int.
int android_pthread_mutexattr_init(long *attr) { return *attr = 0, 0; }
ANDROID(pthread_mutexattr_init);
int android_pthread_condattr_init(long *attr) { return *attr = 0, pthread_condattr_init((pthread_condattr_t *)attr); }
ANDROID(pthread_condattr_init);
