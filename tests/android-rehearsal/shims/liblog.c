// liblog.so: logcat, as lines of the file that REHEARSAL_LOGCAT names. A message that Android would cut is cut, and says so.
#define _GNU_SOURCE
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

static int out = -1;

__attribute__((constructor)) static void open_log(void) {
  const char *path = getenv("REHEARSAL_LOGCAT");
  if (path) out = open(path, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
}

int __android_log_buf_write(int buffer, int priority, const char *tag, const char *text) {
  (void)buffer;
  struct timespec now;
  clock_gettime(CLOCK_REALTIME, &now);
  struct tm local;
  localtime_r(&now.tv_sec, &local);
  static const char letters[] = "??VDIWEFS";
  char head[128];
  int length = snprintf(head, sizeof head, "%02d:%02d:%02d.%03ld %5ld %5ld %c %-8s: ", local.tm_hour, local.tm_min, local.tm_sec,
                        now.tv_nsec / 1000000, (long)getpid(), (long)syscall(SYS_gettid),
                        letters[priority >= 0 && priority < 9 ? priority : 0], tag ? tag : "(null)");
  // The full length, which may be more than fitted.
  if (length >= (int)sizeof head) length = sizeof head - 1;
  size_t size = strlen(text);
  while (size && text[size - 1] == '\n') size--;
  size_t most = 4068 - 3 - (tag ? strlen(tag) : 0);
  char *line = malloc(length + size + 32);
  memcpy(line, head, length);
  size_t kept = size > most ? most : size;
  memcpy(line + length, text, kept);
  size_t total = length + kept;
  if (kept < size) total += sprintf(line + total, " [CUT: %zu of %zu bytes]", kept, size);
  line[total++] = '\n';
  ssize_t written = write(out, line, total);
  free(line);
  return (int)written;
}

int __android_log_write(int priority, const char *tag, const char *text) { return __android_log_buf_write(0, priority, tag, text); }

int __android_log_vprint(int priority, const char *tag, const char *format, va_list arguments) {
  char *text = NULL;
  if (vasprintf(&text, format, arguments) < 0) return -1;
  int result = __android_log_write(priority, tag, text);
  free(text);
  return result;
}

int __android_log_print(int priority, const char *tag, const char *format, ...) {
  va_list arguments;
  va_start(arguments, format);
  int result = __android_log_vprint(priority, tag, format, arguments);
  va_end(arguments);
  return result;
}

void __android_log_assert(const char *condition, const char *tag, const char *format, ...) {
  if (format) {
    va_list arguments;
    va_start(arguments, format);
    __android_log_vprint(7, tag, format, arguments);
    va_end(arguments);
  } else {
    __android_log_print(7, tag, "assertion failed: %s", condition ? condition : "?");
  }
  abort();
}
