// Signals: a set is 8 bytes, and sigaction's flags come first.
#include "android.h"
#include <errno.h>
#include <pthread.h>
#include <signal.h>
#include <string.h>

typedef uint64_t android_sigset;
struct android_sigaction {
  int flags;
  union {
    void (*simple)(int);
    void (*full)(int, siginfo_t *, void *);
  };
  android_sigset mask;
  void (*restorer)(void);
};
_Static_assert(sizeof(struct android_sigaction) == 32, "as bionic's");
static void wide(android_sigset from, sigset_t *to) {
  sigemptyset(to);
  memcpy(to, &from, sizeof from);
}
static android_sigset narrow(const sigset_t *from) {
  android_sigset to;
  memcpy(&to, from, sizeof to);
  return to;
}
int android_sigaction(int number, const struct android_sigaction *new, struct android_sigaction *old) {
  struct sigaction theirs = {0}, before = {0};
  if (new) {
    if (new->flags & SA_SIGINFO)
      theirs.sa_sigaction = new->full;
    else
      theirs.sa_handler = new->simple;
    theirs.sa_flags = new->flags;
    wide(new->mask, &theirs.sa_mask);
  }
  int result = sigaction(number, new ? &theirs : NULL, &before);
  if (!result && old) {
    memset(old, 0, sizeof *old);
    old->flags = before.sa_flags & ~0x04000000;
    if (before.sa_flags & SA_SIGINFO)
      old->full = before.sa_sigaction;
    else
      old->simple = before.sa_handler;
    old->mask = narrow(&before.sa_mask);
  }
  return result;
}
ANDROID(sigaction);
int android_sigemptyset(android_sigset *set) { return *set = 0, 0; }
ANDROID(sigemptyset);
int android_sigfillset(android_sigset *set) { return *set = ~0ull, 0; }
ANDROID(sigfillset);
int android_sigaddset(android_sigset *set, int number) { return *set |= 1ull << (number - 1), 0; }
ANDROID(sigaddset);
int android_sigdelset(android_sigset *set, int number) { return *set &= ~(1ull << (number - 1)), 0; }
ANDROID(sigdelset);
int android_sigismember(const android_sigset *set, int number) { return *set >> (number - 1) & 1; }
ANDROID(sigismember);
int android_pthread_sigmask(int how, const android_sigset *new, android_sigset *old) {
  sigset_t theirs, before;
  if (new) wide(*new, &theirs);
  int result = pthread_sigmask(how, new ? &theirs : NULL, &before);
  if (!result && old) *old = narrow(&before);
  return result;
}
ANDROID(pthread_sigmask);
int android_sigprocmask(int how, const android_sigset *new, android_sigset *old) {
  int error = android_pthread_sigmask(how, new, old);
  return error ? (errno = error, -1) : 0;
}
ANDROID(sigprocmask);
