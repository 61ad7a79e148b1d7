// Names of hosts: addrinfo's last pointers are the other way round, and the errors are BSD's.
#include "android.h"
#include <netdb.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>

struct android_addrinfo {
  int flags, family, type, protocol;
  socklen_t length;
  char *name;
  struct sockaddr *address;
  struct android_addrinfo *next;
};
static const struct {
  int ours, theirs, flag;
} EAI[] = {{EAI_AGAIN, 2, 0}, {EAI_BADFLAGS, 3, 0}, {EAI_FAIL, 4, 0}, {EAI_FAMILY, 5, 0}, {EAI_MEMORY, 6, 0}, {EAI_NODATA, 7, 0}, {EAI_NONAME, 8, 0}, {EAI_SERVICE, 9, 0}, {EAI_SOCKTYPE, 10, 0}, {EAI_SYSTEM, 11, 0}, {EAI_OVERFLOW, 14, 0}};
static int eai(int error) {
  if (!error) return 0;
  for (unsigned i = 0; i < sizeof EAI / sizeof *EAI; i++)
    if (EAI[i].ours == error) return EAI[i].theirs;
  return 4;
}
void android_freeaddrinfo(struct android_addrinfo *info) {
  while (info) {
    struct android_addrinfo *next = info->next;
    free(info->name);
    free(info);
    info = next;
  }
}
ANDROID(freeaddrinfo);
int android_getaddrinfo(const char *host, const char *service, const struct android_addrinfo *hints, struct android_addrinfo **out) {
  struct addrinfo theirs = {0}, *found = NULL;
  if (hints) {
    // AI_PASSIVE, CANONNAME and NUMERICHOST are the same; others are not.
    int flags = hints->flags & 7;
    if (hints->flags & 0x8) flags |= AI_NUMERICSERV;
    if (hints->flags & 0x400) flags |= AI_ADDRCONFIG;
    if (hints->flags & 0x800) flags |= AI_V4MAPPED;
    theirs = (struct addrinfo){.ai_flags = flags, .ai_family = hints->family, .ai_socktype = hints->type, .ai_protocol = hints->protocol};
  }
  int error = getaddrinfo(host, service, hints ? &theirs : NULL, &found);
  if (error) return eai(error);
  struct android_addrinfo **end = out;
  *out = NULL;
  for (struct addrinfo *one = found; one; one = one->ai_next) {
    struct android_addrinfo *copy = calloc(1, sizeof *copy + one->ai_addrlen);
    *copy = (struct android_addrinfo){one->ai_flags & 7, one->ai_family, one->ai_socktype, one->ai_protocol, one->ai_addrlen, one->ai_canonname ? strdup(one->ai_canonname) : NULL, (struct sockaddr *)(copy + 1), NULL};
    memcpy(copy + 1, one->ai_addr, one->ai_addrlen);
    *end = copy;
    end = &copy->next;
  }
  freeaddrinfo(found);
  return 0;
}
ANDROID(getaddrinfo);
const char *android_gai_strerror(int error) {
  for (unsigned i = 0; i < sizeof EAI / sizeof *EAI; i++)
    if (EAI[i].theirs == error) return gai_strerror(EAI[i].ours);
  return "unknown";
}
ANDROID(gai_strerror);
int android_getnameinfo(const struct sockaddr *address, socklen_t length, char *host, size_t host_size, char *service, size_t service_size, int flags) {
  // NI_NOFQDN 1, NUMERICHOST 2, NAMEREQD 4, NUMERICSERV 8, DGRAM 16.
  int theirs = (flags & 1 ? NI_NOFQDN : 0) | (flags & 2 ? NI_NUMERICHOST : 0) | (flags & 4 ? NI_NAMEREQD : 0) | (flags & 8 ? NI_NUMERICSERV : 0) | (flags & 16 ? NI_DGRAM : 0);
  return eai(getnameinfo(address, length, host, host_size, service, service_size, theirs));
}
ANDROID(getnameinfo);
