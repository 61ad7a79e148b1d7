// Shared by the files of this folder. They make up libc.so by Android's name: what differs between bionic and glibc on a 64-bit
// machine, or is bionic's alone. What is the same in both is passed on to glibc by a jump (src/shims/forward.rs).
//
// A function NAME of bionic's is written here as android_NAME and exported as NAME of the version LIBC, which is what libraries made with
// an NDK ask for and nothing of glibc's world does: glibc's own libraries never meet these, although they are in one process.
#pragma once
#define _GNU_SOURCE
#include <stddef.h>
#include <stdint.h>

#define ANDROID(name) __asm__(".symver android_" #name "," #name "@LIBC")

// To the log, under the tag `bionic`.
void tell(const char *format, ...) __attribute__((format(printf, 1, 2), visibility("hidden")));

// Names that Android API level 29 has, sorted as strcmp does; written by src/shims/mod.rs.
extern const char *const api_29[] __attribute__((visibility("hidden")));
extern const unsigned api_29_count __attribute__((visibility("hidden")));
