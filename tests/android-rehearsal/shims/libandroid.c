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

// Closing: a message to the main thread.
static void (*on_finish)(void *);
void rehearsal_on_finish(void (*hook)(void *)) { on_finish = hook; }
void ANativeActivity_finish(void *activity) {
  if (on_finish) on_finish(activity);
}
