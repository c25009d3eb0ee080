/* A GLVND vendor that logs each query and forwards it to Mesa's. With FAKE_VENDOR_HAS_NO_DISPLAY it has no EGL display. */
#include <dlfcn.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

typedef int (*Main)(uint32_t, const void *, void *, void **);
typedef void *(*GetDisplay)(uint32_t, void *, const void *);

static GetDisplay mesas;

static void note(const char *what) {
  FILE *file = fopen(getenv("FAKE_VENDOR_NOTES"), "a");
  fprintf(file, "%s\n", what);
  fclose(file);
}

static int forward(const char *library, const char *name, uint32_t version, const void *exports, void *vendor, void **imports) {
  Main real = (Main)dlsym(dlopen(library, RTLD_LAZY), name);
  return real(version, exports, vendor, imports);
}

int __glx_Main(uint32_t version, const void *exports, void *vendor, void **imports) {
  note("glx");
  return forward("libGLX_mesa.so.0", "__glx_Main", version, exports, vendor, imports);
}

static void *display(uint32_t platform, void *native, const void *attributes) {
  int none = getenv("FAKE_VENDOR_HAS_NO_DISPLAY") != NULL;
  note(none ? "egl: no display" : "egl: a display");
  return none ? NULL : mesas(platform, native, attributes);
}

int __egl_Main(uint32_t version, const void *exports, void *vendor, void **imports) {
  note("egl");
  int done = forward("libEGL_mesa.so.0", "__egl_Main", version, exports, vendor, imports);
  mesas = (GetDisplay)imports[0];
  imports[0] = (void *)display;
  return done;
}
