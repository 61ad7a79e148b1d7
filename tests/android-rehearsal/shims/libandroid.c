// libandroid.so: loopers over poll(2), input queues over an eventfd, windows without contents, and a configuration that never
// changes. Functions named rehearsal_... are for the host (src/bin/host/shims.rs).
#define _GNU_SOURCE
#include <errno.h>
#include <poll.h>
#include <pthread.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <time.h>
#include <unistd.h>

typedef int (*Callback)(int, int, void *);
typedef struct {
  int fd, ident, events;
  Callback callback;
  void *data;
} Request;
typedef struct {
  pthread_mutex_t lock;
  int wake, references, count;
  Request requests[16];
} ALooper;

// A thread's looper, which ends with its thread.
static pthread_key_t key;

void ALooper_acquire(ALooper *looper) { __atomic_add_fetch(&looper->references, 1, __ATOMIC_SEQ_CST); }

void ALooper_release(ALooper *looper) {
  if (__atomic_sub_fetch(&looper->references, 1, __ATOMIC_SEQ_CST)) return;
  close(looper->wake);
  free(looper);
}

__attribute__((constructor)) static void make_key(void) { pthread_key_create(&key, (void (*)(void *))ALooper_release); }

ALooper *ALooper_forThread(void) { return pthread_getspecific(key); }

ALooper *ALooper_prepare(int options) {
  (void)options;
  ALooper *looper = ALooper_forThread();
  if (!looper) {
    looper = calloc(1, sizeof *looper);
    pthread_mutex_init(&looper->lock, NULL);
    looper->wake = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    looper->references = 1;
    pthread_setspecific(key, looper);
  }
  return looper;
}

void ALooper_wake(ALooper *looper) {
  uint64_t one = 1;
  if (write(looper->wake, &one, sizeof one) < 0) perror("ALooper_wake");
}

int ALooper_removeFd(ALooper *looper, int fd) {
  int found = 0;
  pthread_mutex_lock(&looper->lock);
  for (int i = 0; i < looper->count; i++)
    if (looper->requests[i].fd == fd) {
      looper->requests[i] = looper->requests[--looper->count];
      found = 1;
      break;
    }
  pthread_mutex_unlock(&looper->lock);
  ALooper_wake(looper);
  return found;
}

int ALooper_addFd(ALooper *looper, int fd, int ident, int events, Callback callback, void *data) {
  if (!callback && ident < 0) return -1;
  int result = -1;
  pthread_mutex_lock(&looper->lock);
  int at = 0;
  while (at < looper->count && looper->requests[at].fd != fd) at++;
  if (at < 16) {
    looper->requests[at] = (Request){fd, callback ? -2 : ident, events, callback, data};
    if (at == looper->count) looper->count++;
    result = 1;
  }
  pthread_mutex_unlock(&looper->lock);
  ALooper_wake(looper);
  return result;
}

// A change of the set of descriptors wakes the poll, as on Android; that does not count as a wake.
int ALooper_pollOnce(int timeout, int *out_fd, int *out_events, void **out_data) {
  ALooper *looper = ALooper_forThread();
  if (!looper) return -4;
  struct pollfd fds[17];
  Request requests[16];
  pthread_mutex_lock(&looper->lock);
  int count = looper->count;
  memcpy(requests, looper->requests, sizeof requests);
  pthread_mutex_unlock(&looper->lock);
  for (int i = 0; i < count; i++) fds[i] = (struct pollfd){requests[i].fd, (requests[i].events & 1 ? POLLIN : 0) | (requests[i].events & 2 ? POLLOUT : 0), 0};
  fds[count] = (struct pollfd){looper->wake, POLLIN, 0};
  int ready = poll(fds, count + 1, timeout);
  if (ready < 0) return errno == EINTR ? -1 : -4;
  if (ready == 0) return -3;
  if (fds[count].revents) {
    uint64_t drained;
    if (read(looper->wake, &drained, sizeof drained) < 0) perror("ALooper_pollOnce");
  }
  int called = 0;
  for (int i = 0; i < count; i++) {
    short got = fds[i].revents;
    if (!got) continue;
    int events = (got & POLLIN ? 1 : 0) | (got & POLLOUT ? 2 : 0) | (got & POLLERR ? 4 : 0) | (got & POLLHUP ? 8 : 0) | (got & POLLNVAL ? 16 : 0);
    if (requests[i].callback) {
      if (!requests[i].callback(requests[i].fd, events, requests[i].data)) ALooper_removeFd(looper, requests[i].fd);
      called = 1;
      continue;
    }
    if (out_fd) *out_fd = requests[i].fd;
    if (out_events) *out_events = events;
    if (out_data) *out_data = requests[i].data;
    return requests[i].ident;
  }
  return called ? -2 : -1;
}

int ALooper_pollAll(int timeout, int *fd, int *events, void **data) {
  for (;;) {
    int result = ALooper_pollOnce(timeout, fd, events, data);
    if (result != -2) return result;
  }
}

// Input: events that the host puts in, which are only counted.
typedef struct {
  int32_t taken, finished, handled;
} Figures;
typedef struct {
  pthread_mutex_t lock;
  int fd;
  Figures figures;
  ALooper *looper;
} AInputQueue;
typedef struct {
  int type;
} AInputEvent;

AInputQueue *rehearsal_new_queue(void) {
  AInputQueue *queue = calloc(1, sizeof *queue);
  pthread_mutex_init(&queue->lock, NULL);
  queue->fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK | EFD_SEMAPHORE);
  return queue;
}

// After onInputQueueDestroyed: the framework's own end of it.
void rehearsal_free_queue(AInputQueue *queue) {
  close(queue->fd);
  pthread_mutex_destroy(&queue->lock);
  free(queue);
}

void rehearsal_put_input(AInputQueue *queue, int events) {
  uint64_t many = events;
  if (write(queue->fd, &many, sizeof many) < 0) perror("rehearsal_put_input");
}

void rehearsal_input_figures(AInputQueue *queue, Figures *out) {
  pthread_mutex_lock(&queue->lock);
  *out = queue->figures;
  pthread_mutex_unlock(&queue->lock);
}

void AInputQueue_attachLooper(AInputQueue *queue, ALooper *looper, int ident, Callback callback, void *data) {
  queue->looper = looper;
  ALooper_addFd(looper, queue->fd, ident, 1, callback, data);
}
void AInputQueue_detachLooper(AInputQueue *queue) {
  if (queue->looper) ALooper_removeFd(queue->looper, queue->fd);
  queue->looper = NULL;
}
int32_t AInputQueue_hasEvents(AInputQueue *queue) {
  struct pollfd fd = {queue->fd, POLLIN, 0};
  return poll(&fd, 1, 0) > 0;
}
int32_t AInputQueue_getEvent(AInputQueue *queue, AInputEvent **event) {
  uint64_t one;
  if (read(queue->fd, &one, sizeof one) < 0) return -EAGAIN;
  pthread_mutex_lock(&queue->lock);
  int taken = ++queue->figures.taken;
  pthread_mutex_unlock(&queue->lock);
  *event = malloc(sizeof **event);
  // AINPUT_EVENT_TYPE_KEY and AINPUT_EVENT_TYPE_MOTION in turns.
  (*event)->type = taken % 2 ? 1 : 2;
  return 0;
}
int32_t AInputQueue_preDispatchEvent(AInputQueue *queue, AInputEvent *event) {
  (void)queue, (void)event;
  return 0;
}
void AInputQueue_finishEvent(AInputQueue *queue, AInputEvent *event, int handled) {
  pthread_mutex_lock(&queue->lock);
  queue->figures.finished++;
  queue->figures.handled += handled != 0;
  pthread_mutex_unlock(&queue->lock);
  free(event);
}
int32_t AInputEvent_getType(const AInputEvent *event) { return event->type; }

// Windows: nothing is drawn into them. Only references are counted, over all windows, beside the framework's own.
typedef struct {
  int nothing;
} ANativeWindow;
static int window_references;

ANativeWindow *rehearsal_new_window(void) { return calloc(1, sizeof(ANativeWindow)); }

// After onNativeWindowDestroyed.
void rehearsal_free_window(ANativeWindow *window) { free(window); }

int rehearsal_window_references(void) { return __atomic_load_n(&window_references, __ATOMIC_SEQ_CST); }

void ANativeWindow_acquire(ANativeWindow *window) { (void)window, __atomic_add_fetch(&window_references, 1, __ATOMIC_SEQ_CST); }

void ANativeWindow_release(ANativeWindow *window) { (void)window, __atomic_sub_fetch(&window_references, 1, __ATOMIC_SEQ_CST); }

// The configuration: a Quest's, more or less.
typedef struct {
  int nothing;
} AConfiguration;
AConfiguration *AConfiguration_new(void) { return calloc(1, sizeof(AConfiguration)); }
void AConfiguration_delete(AConfiguration *configuration) { free(configuration); }
void AConfiguration_fromAssetManager(AConfiguration *out, void *manager) {
  if (manager != (void *)0xa55e7) fprintf(stderr, "AConfiguration_fromAssetManager: not the manager that the activity has\n");
  out->nothing = 1;
}
void AConfiguration_copy(AConfiguration *to, AConfiguration *from) { *to = *from; }
void AConfiguration_getLanguage(AConfiguration *configuration, char *out) { (void)configuration, memcpy(out, "en", 2); }
void AConfiguration_getCountry(AConfiguration *configuration, char *out) { (void)configuration, memcpy(out, "US", 2); }
int32_t AConfiguration_getSdkVersion(AConfiguration *configuration) { return (void)configuration, 32; }
int32_t AConfiguration_getDensity(AConfiguration *configuration) { return (void)configuration, 320; }

#define GET(name, value) \
  int32_t AConfiguration_get##name(AConfiguration *configuration) { return (void)configuration, value; }
GET(Keyboard, 1) GET(KeysHidden, 1) GET(Mcc, 0) GET(Mnc, 0) GET(NavHidden, 2) GET(Navigation, 1) GET(Orientation, 2)
GET(ScreenLong, 1) GET(ScreenSize, 3) GET(Touchscreen, 1) GET(UiModeNight, 1) GET(UiModeType, 7)

#undef GET

// Heat and performance hints, of API levels 30 to 33, which the app looks up when it runs. What it does with them is counted.
typedef struct {
  int32_t thermal_managers, listeners, headrooms, hasty_headrooms, sessions, open_sessions, threads, strangers, reports, wrong;
} PowerFigures;
static PowerFigures power;
#define COUNT(what, by) __atomic_add_fetch(&power.what, by, __ATOMIC_SEQ_CST)

void rehearsal_power(PowerFigures *out) { *out = power; }

static int thermal_manager, hint_manager;

static int is_wrong(const void *object, const void *wanted) {
  if (object != wanted) COUNT(wrong, 1);
  return object != wanted;
}

void *AThermal_acquireManager(void) {
  COUNT(thermal_managers, 1);
  return &thermal_manager;
}
void AThermal_releaseManager(void *manager) {
  if (!is_wrong(manager, &thermal_manager)) COUNT(thermal_managers, -1);
}
// ATHERMAL_STATUS_LIGHT.
int AThermal_getCurrentThermalStatus(void *manager) { return is_wrong(manager, &thermal_manager) ? -1 : 1; }

typedef void (*StatusCallback)(void *, int);
int AThermal_registerThermalStatusListener(void *manager, StatusCallback callback, void *data) {
  if (is_wrong(manager, &thermal_manager) || !callback) return EINVAL;
  COUNT(listeners, 1);
  // As Android does: the present status, at once.
  callback(data, 1);
  return 0;
}
int AThermal_unregisterThermalStatusListener(void *manager, StatusCallback callback, void *data) {
  (void)callback, (void)data;
  if (is_wrong(manager, &thermal_manager)) return EINVAL;
  COUNT(listeners, -1);
  return 0;
}

// Not a number to who asks more than about once a second.
float AThermal_getThermalHeadroom(void *manager, int seconds) {
  static int64_t last_ms;
  if (is_wrong(manager, &thermal_manager) || seconds < 0 || seconds > 60) return __builtin_nanf("");
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  int64_t ms = now.tv_sec * 1000LL + now.tv_nsec / 1000000;
  int64_t before = __atomic_exchange_n(&last_ms, ms, __ATOMIC_SEQ_CST);
  if (before && ms - before < 900) {
    COUNT(hasty_headrooms, 1);
    return __builtin_nanf("");
  }
  COUNT(headrooms, 1);
  return 0.625f;
}

void *APerformanceHint_getManager(void) { return &hint_manager; }

typedef struct {
  int64_t target;
} APerformanceHintSession;

APerformanceHintSession *APerformanceHint_createSession(void *manager, const int32_t *threads, size_t count, int64_t target) {
  if (is_wrong(manager, &hint_manager) || !count || target <= 0) return NULL;
  for (size_t i = 0; i < count; i++) {
    char path[64];
    snprintf(path, sizeof path, "/proc/self/task/%d", threads[i]);
    if (access(path, F_OK)) COUNT(strangers, 1);
  }
  COUNT(threads, count);
  COUNT(sessions, 1);
  COUNT(open_sessions, 1);
  APerformanceHintSession *session = calloc(1, sizeof *session);
  session->target = target;
  return session;
}
int APerformanceHint_updateTargetWorkDuration(APerformanceHintSession *session, int64_t target) {
  if (target <= 0) return EINVAL;
  session->target = target;
  return 0;
}
int APerformanceHint_reportActualWorkDuration(APerformanceHintSession *session, int64_t actual) {
  (void)session;
  if (actual <= 0) return EINVAL;
  COUNT(reports, 1);
  return 0;
}
void APerformanceHint_closeSession(APerformanceHintSession *session) {
  COUNT(open_sessions, -1);
  free(session);
}

// Closing: a message to the main thread.
static void (*on_finish)(void *);
void rehearsal_on_finish(void (*hook)(void *)) { on_finish = hook; }
void ANativeActivity_finish(void *activity) {
  if (on_finish) on_finish(activity);
}
