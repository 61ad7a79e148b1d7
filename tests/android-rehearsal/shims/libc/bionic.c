// Bionic's own functions: errors, properties, the checked variants that its headers turn calls into, and numbers that it gives other
// meanings.
#include "android.h"
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <malloc.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/select.h>
#include <sys/syscall.h>
#include <unistd.h>

void tell(const char *format, ...) {
  static int (*print)(int, const char *, const char *, va_list);
  if (!print) {
    void *log = dlopen("liblog.so", RTLD_NOW);
    if (log) print = (int (*)(int, const char *, const char *, va_list))dlsym(log, "__android_log_vprint");
  }
  va_list arguments;
  va_start(arguments, format);
  if (print) print(4, "bionic", format, arguments);
  va_end(arguments);
}


int *android___errno(void) { return __errno_location(); }
ANDROID(__errno);

void android_android_set_abort_message(const char *text) { tell("abort message: %s", text ? text : "(null)"); }
ANDROID(android_set_abort_message);

// Below 27 ONNX Runtime leaves NNAPI alone, whose library is not here; it calls what it did not find.
static const char *property(const char *name) {
  static const char *const all[][2] = {{"ro.build.version.sdk", "26"}, {"ro.product.model", "Rehearsal"}, {"ro.arch", "x86_64"}};
  for (unsigned i = 0; i < sizeof all / sizeof *all; i++)
    if (!strcmp(name, all[i][0])) return all[i][1];
  return NULL;
}
int android___system_property_get(const char *name, char *value) {
  const char *found = property(name);
  tell("property %s: %s", name, found ? found : "unset");
  strcpy(value, found ? found : "");
  return (int)strlen(value);
}
ANDROID(__system_property_get);
const void *android___system_property_find(const char *name) { return property(name); }
ANDROID(__system_property_find);
void android___system_property_read_callback(const void *info, void (*callback)(void *, const char *, const char *, uint32_t), void *cookie) {
  callback(cookie, "?", info, 0);
}
ANDROID(__system_property_read_callback);

int android___open_2(const char *path, int flags) { return open(path, flags); }
ANDROID(__open_2);
size_t android___strlen_chk(const char *text, size_t size) { return (void)size, strlen(text); }
ANDROID(__strlen_chk);
char *android___strchr_chk(const char *text, int c, size_t size) { return (void)size, strchr(text, c); }
ANDROID(__strchr_chk);
char *android___strrchr_chk(const char *text, int c, size_t size) { return (void)size, strrchr(text, c); }
ANDROID(__strrchr_chk);
ssize_t android___write_chk(int fd, const void *data, size_t size, size_t bound) { return (void)bound, write(fd, data, size); }
ANDROID(__write_chk);
void *android___memchr_chk(const void *data, int c, size_t size, size_t bound) { return (void)bound, memchr(data, c, size); }
ANDROID(__memchr_chk);
void android___FD_SET_chk(int fd, fd_set *set, size_t size) { (void)size, FD_SET(fd, set); }
ANDROID(__FD_SET_chk);
int android___FD_ISSET_chk(int fd, const fd_set *set, size_t size) { return (void)size, FD_ISSET(fd, set); }
ANDROID(__FD_ISSET_chk);
void android___FD_CLR_chk(int fd, fd_set *set, size_t size) { (void)size, FD_CLR(fd, set); }
ANDROID(__FD_CLR_chk);
size_t android___ctype_get_mb_cur_max(void) { return MB_CUR_MAX; }
ANDROID(__ctype_get_mb_cur_max);
void android___assert2(const char *file, int line, const char *function, const char *what) {
  tell("%s:%d: %s: assertion \"%s\" failed", file, line, function, what);
  abort();
}
ANDROID(__assert2);
size_t android_malloc_usable_size(const void *p) {
  extern size_t malloc_usable_size(void *);
  return malloc_usable_size((void *)p);
}
ANDROID(malloc_usable_size);
// M_PURGE: free memory goes back to the system.
int android_mallopt(int option, int value) { return (void)value, option == -101 ? malloc_trim(0), 1 : 0; }
ANDROID(mallopt);
int android_gettid(void) { return (int)syscall(SYS_gettid); }
ANDROID(gettid);

// Three of bionic's FILE, 152 bytes each, which libraries for API levels below 23 refer to; the pointers are to glibc's own.
char android___sF[3 * 152];
ANDROID(__sF);
FILE *android_stdin, *android_stdout, *android_stderr;
ANDROID(stdin);
ANDROID(stdout);
ANDROID(stderr);
__attribute__((constructor)) static void files(void) { android_stdin = stdin, android_stdout = stdout, android_stderr = stderr; }

// Errors

// Bionic exports the POSIX one under this name.
int android_strerror_r(int number, char *text, size_t size) {
  extern int __xpg_strerror_r(int, char *, size_t);
  return __xpg_strerror_r(number, text, size);
}
ANDROID(strerror_r);

char *android___gnu_strerror_r(int number, char *text, size_t size) { return strerror_r(number, text, size); }
ANDROID(__gnu_strerror_r);

// sysconf has other numbers (bionic's bits/sysconf.h).

long android_sysconf(int name) {
  static const struct {
    int theirs, ours;
  } all[] = {{0x0000, _SC_ARG_MAX}, {0x0005, _SC_CHILD_MAX}, {0x0006, _SC_CLK_TCK}, {0x000b, _SC_OPEN_MAX}, {0x0027, _SC_PAGESIZE}, {0x0028, _SC_PAGE_SIZE}, {0x0037, _SC_IOV_MAX}, {0x0044, _SC_HOST_NAME_MAX}, {0x0047, _SC_GETGR_R_SIZE_MAX}, {0x0048, _SC_GETPW_R_SIZE_MAX}, {0x0049, _SC_LOGIN_NAME_MAX}, {0x004a, _SC_THREAD_DESTRUCTOR_ITERATIONS}, {0x004b, _SC_THREAD_KEYS_MAX}, {0x004c, _SC_THREAD_STACK_MIN}, {0x004d, _SC_THREAD_THREADS_MAX}, {0x0060, _SC_NPROCESSORS_CONF}, {0x0061, _SC_NPROCESSORS_ONLN}, {0x0062, _SC_PHYS_PAGES}, {0x0063, _SC_AVPHYS_PAGES}, {0x0064, _SC_MONOTONIC_CLOCK}};
  for (unsigned i = 0; i < sizeof all / sizeof *all; i++)
    if (all[i].theirs == name) return sysconf(all[i].ours);
  tell("sysconf(%#x): not known here", name);
  return errno = EINVAL, -1;
}
ANDROID(sysconf);
