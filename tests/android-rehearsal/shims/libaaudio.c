// libaaudio.so: a microphone that hears a file, and a loudspeaker whose sound goes into one, both at the pace of the clock. They are raw 32-bit
// floats of 48 kHz: REHEARSAL_MICROPHONE, one channel, is heard over and over, REHEARSAL_LOUDSPEAKER, left and right, is appended to. Without them there is
// silence. While the file that REHEARSAL_SOUND_AWAY names is there, both devices are away, as headphones that were unplugged.
#define _GNU_SOURCE
#include <errno.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

enum { OK = 0, DISCONNECTED = -899, ILLEGAL_ARGUMENT = -898, INVALID_STATE = -895, UNAVAILABLE = -889, NO_MEMORY = -887 };
enum { OUTPUT = 0, INPUT = 1, PCM_FLOAT = 2, BURST = 240, CAPACITY = 4800, RATE = 48000 };
// Between the device and the air, frames: 20 ms.
enum { LATENCY = 960 };

typedef struct {
  int32_t direction, format, rate, channels, usage, preset, mode, sharing;
} AAudioStreamBuilder;
typedef struct {
  AAudioStreamBuilder is;
  FILE *file;
  int64_t start_ns, frames, skipped;
  int32_t buffer, started;
} AAudioStream;

static int64_t now_ns(void) {
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return now.tv_sec * 1000000000LL + now.tv_nsec;
}

static int is_away(void) {
  const char *path = getenv("REHEARSAL_SOUND_AWAY");
  return path && access(path, F_OK) == 0;
}

// Frames that the device has captured or played by its clock.
static int64_t done(const AAudioStream *stream) { return (now_ns() - stream->start_ns) * RATE / 1000000000LL; }

static void wait_ns(int64_t ns) {
  struct timespec time = {ns / 1000000000LL, ns % 1000000000LL};
  while (nanosleep(&time, &time) && errno == EINTR) {
  }
}

int32_t AAudio_createStreamBuilder(AAudioStreamBuilder **builder) {
  *builder = calloc(1, sizeof **builder);
  return *builder ? OK : NO_MEMORY;
}

int32_t AAudioStreamBuilder_delete(AAudioStreamBuilder *builder) {
  free(builder);
  return OK;
}

#define SETTER(name, field) \
  void AAudioStreamBuilder_set##name(AAudioStreamBuilder *builder, int32_t value) { builder->field = value; }
SETTER(Direction, direction)
SETTER(Format, format)
SETTER(SampleRate, rate)
SETTER(ChannelCount, channels)
SETTER(PerformanceMode, mode)
SETTER(SharingMode, sharing)
SETTER(Usage, usage)
SETTER(InputPreset, preset)

#define GETTER(name, field) \
  int32_t AAudioStream_get##name(AAudioStream *stream) { return stream->is.field; }
GETTER(Direction, direction)
GETTER(Format, format)
GETTER(SampleRate, rate)
GETTER(ChannelCount, channels)

int32_t AAudioStream_getFramesPerBurst(AAudioStream *stream) {
  (void)stream;
  return BURST;
}

int32_t AAudioStream_setBufferSizeInFrames(AAudioStream *stream, int32_t frames) {
  if (frames < BURST) frames = BURST;
  stream->buffer = frames > CAPACITY ? CAPACITY : frames;
  return stream->buffer;
}

int32_t AAudioStreamBuilder_openStream(AAudioStreamBuilder *builder, AAudioStream **stream) {
  // What these devices are; Android's service would convert.
  if (builder->format != PCM_FLOAT || builder->rate != RATE || builder->channels != (builder->direction == INPUT ? 1 : 2)) return ILLEGAL_ARGUMENT;
  if (is_away()) return UNAVAILABLE;
  *stream = calloc(1, sizeof **stream);
  if (!*stream) return NO_MEMORY;
  (*stream)->is = *builder;
  (*stream)->buffer = CAPACITY;
  int is_input = builder->direction == INPUT;
  const char *path = getenv(is_input ? "REHEARSAL_MICROPHONE" : "REHEARSAL_LOUDSPEAKER");
  if (path) (*stream)->file = fopen(path, is_input ? "rbe" : "abe");
  return OK;
}

int32_t AAudioStream_close(AAudioStream *stream) {
  if (stream->file) fclose(stream->file);
  free(stream);
  return OK;
}

int32_t AAudioStream_requestStart(AAudioStream *stream) {
  stream->start_ns = now_ns();
  stream->started = 1;
  return OK;
}

int32_t AAudioStream_read(AAudioStream *stream, void *buffer, int32_t frames, int64_t timeout_ns) {
  if (!stream->started || stream->is.direction != INPUT) return INVALID_STATE;
  int64_t until = now_ns() + timeout_ns;
  for (;;) {
    if (is_away()) return DISCONNECTED;
    int64_t waiting = done(stream) - stream->frames - stream->skipped;
    if (waiting > RATE) {
      // An overrun: nobody has read for a second.
      stream->skipped += waiting - frames;
      waiting = frames;
    }
    if (waiting >= frames || now_ns() >= until) {
      if (waiting < frames) frames = (int32_t)(waiting < 0 ? 0 : waiting);
      break;
    }
    wait_ns(1000000);
  }
  float *out = buffer;
  int32_t got = 0;
  while (stream->file && got < frames) {
    size_t count = fread(out + got, sizeof *out, frames - got, stream->file);
    got += (int32_t)count;
    if (count == 0) {
      if (ftell(stream->file) == 0) break;
      rewind(stream->file);
    }
  }
  memset(out + got, 0, (frames - got) * sizeof *out);
  stream->frames += frames;
  return frames;
}

int32_t AAudioStream_write(AAudioStream *stream, const void *buffer, int32_t frames, int64_t timeout_ns) {
  if (!stream->started || stream->is.direction != OUTPUT) return INVALID_STATE;
  int64_t until = now_ns() + timeout_ns;
  int64_t room;
  for (;;) {
    if (is_away()) return DISCONNECTED;
    int64_t ahead = stream->frames - done(stream);
    if (ahead < 0) {
      // An underrun: the device has waited.
      stream->start_ns -= ahead * 1000000000LL / RATE;
      ahead = 0;
    }
    room = stream->buffer - ahead;
    if (room > 0 || now_ns() >= until) break;
    wait_ns(1000000);
  }
  if (room <= 0) return 0;
  if (frames > room) frames = (int32_t)room;
  if (stream->file) {
    fwrite(buffer, sizeof(float), (size_t)frames * stream->is.channels, stream->file);
    fflush(stream->file);
  }
  stream->frames += frames;
  return frames;
}

int32_t AAudioStream_getTimestamp(AAudioStream *stream, int clock, int64_t *position, int64_t *time_ns) {
  int64_t at = done(stream) - LATENCY;
  if (clock != CLOCK_MONOTONIC || !stream->started || at < 0) return INVALID_STATE;
  int is_input = stream->is.direction == INPUT;
  // What is captured now reaches the buffer later, what is written is heard later.
  *position = is_input ? at + LATENCY - stream->skipped : at;
  *time_ns = stream->start_ns + (is_input ? at : at + LATENCY) * 1000000000LL / RATE;
  return OK;
}
