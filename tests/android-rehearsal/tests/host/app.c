// A small app that is compiled with the NDK's headers alone (android/native_activity.h, jni.h): it checks the host's
// own definitions. It logs every callback.
#include <stddef.h>
#include <stdint.h>

int __android_log_print(int priority, const char *tag, const char *format, ...);
void ANativeActivity_finish(void *activity);
#define SAY(...) __android_log_print(4, "app", __VA_ARGS__)

typedef struct ANativeActivity ANativeActivity;
typedef struct {
  void (*onStart)(ANativeActivity *);
  void (*onResume)(ANativeActivity *);
  void *(*onSaveInstanceState)(ANativeActivity *, size_t *);
  void (*onPause)(ANativeActivity *);
  void (*onStop)(ANativeActivity *);
  void (*onDestroy)(ANativeActivity *);
  void (*onWindowFocusChanged)(ANativeActivity *, int);
  void (*onNativeWindowCreated)(ANativeActivity *, void *);
  void (*onNativeWindowResized)(ANativeActivity *, void *);
  void (*onNativeWindowRedrawNeeded)(ANativeActivity *, void *);
  void (*onNativeWindowDestroyed)(ANativeActivity *, void *);
  void (*onInputQueueCreated)(ANativeActivity *, void *);
  void (*onInputQueueDestroyed)(ANativeActivity *, void *);
  void (*onContentRectChanged)(ANativeActivity *, const int32_t *);
  void (*onConfigurationChanged)(ANativeActivity *);
  void (*onLowMemory)(ANativeActivity *);
} ANativeActivityCallbacks;
struct ANativeActivity {
  ANativeActivityCallbacks *callbacks;
  void *vm;
  const void *const *const *env;
  void *clazz;
  const char *internalDataPath, *externalDataPath;
  int32_t sdkVersion;
  void *instance, *assetManager;
  const char *obbPath;
};

#define TELLS(name) \
  static void name(ANativeActivity *activity) { (void)activity, SAY(#name); }
TELLS(onStart) TELLS(onResume) TELLS(onPause) TELLS(onStop) TELLS(onDestroy) TELLS(onConfigurationChanged) TELLS(onLowMemory)
#define TELLS_WITH(name) \
  static void name(ANativeActivity *activity, void *pointer) { (void)activity, SAY(#name " %s", pointer ? "something" : "nothing"); }
TELLS_WITH(onNativeWindowCreated) TELLS_WITH(onNativeWindowResized) TELLS_WITH(onNativeWindowRedrawNeeded)
TELLS_WITH(onNativeWindowDestroyed) TELLS_WITH(onInputQueueCreated) TELLS_WITH(onInputQueueDestroyed)
static void onWindowFocusChanged(ANativeActivity *activity, int has) { (void)activity, SAY("onWindowFocusChanged %d", has); }
static void onContentRectChanged(ANativeActivity *activity, const int32_t *rect) { (void)activity, SAY("onContentRectChanged %d %d", rect[2], rect[3]); }
static void *onSaveInstanceState(ANativeActivity *activity, size_t *size) {
  (void)activity, *size = 0;
  SAY("onSaveInstanceState");
  return NULL;
}

// By the places of JNI's specification.
static void look_at_intent(ANativeActivity *activity) {
  const void *const *const *env = activity->env;
  const void *const *table = *env;
  typedef const void *const *const *Env;
  void *(*class_of)(Env, void *) = table[31];
  void *(*method)(Env, void *, const char *, const char *) = table[33];
  void *(*call)(Env, void *, void *, const void *) = table[36];
  const char *(*chars)(Env, void *, uint8_t *) = table[169];
  void (*release)(Env, void *, const char *) = table[170];
  SAY("JNI %x", ((int32_t(*)(Env))table[4])(env));
  void *intent = call(env, activity->clazz, method(env, class_of(env, activity->clazz), "getIntent", "()Landroid/content/Intent;"), NULL);
  void *link = call(env, intent, method(env, class_of(env, intent), "getDataString", "()Ljava/lang/String;"), NULL);
  const char *text = chars(env, link, NULL);
  SAY("link %s", text);
  release(env, link, text);
  // A name that Android has, with another signature: an exception, which has to be cleared.
  void *none = method(env, class_of(env, intent), "getDataString", "()I");
  SAY("no such method: %s, exception %d", none ? "found" : "not found", ((uint8_t(*)(Env))table[228])(env));
  ((void (*)(Env))table[17])(env);
}

void ANativeActivity_onCreate(ANativeActivity *activity, void *state, size_t size) {
  *activity->callbacks = (ANativeActivityCallbacks){onStart, onResume, onSaveInstanceState, onPause, onStop, onDestroy, onWindowFocusChanged, onNativeWindowCreated, onNativeWindowResized, onNativeWindowRedrawNeeded, onNativeWindowDestroyed, onInputQueueCreated, onInputQueueDestroyed, onContentRectChanged, onConfigurationChanged, onLowMemory};
  SAY("onCreate: API level %d, state %s of %zu, %s, %s, %s", activity->sdkVersion, state ? "something" : "nothing", size, activity->internalDataPath, activity->externalDataPath, activity->obbPath);
  look_at_intent(activity);
  ANativeActivity_finish(activity);
}
