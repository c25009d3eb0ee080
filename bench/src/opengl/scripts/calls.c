/* Measures nanoseconds per call of OpenGL functions that programs call by the million, outside of Begin and End: the overhead of a layer before the driver.
   OpenGL and X are opened at run time, so no headers are needed. Prints `name nanoseconds`, the minimum of several rounds. */
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

typedef void *P;
typedef unsigned long U;
static P x11, gl;
static P of(P library, const char *name) {
    P f = dlsym(library, name);
    if (!f) {
        fprintf(stderr, "%s is not there\n", name);
        exit(1);
    }
    return f;
}
static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return t.tv_sec * 1e9 + t.tv_nsec;
}

enum { CALLS = 2000000, ROUNDS = 7 };
#define TIME(name, call)                                                                                               \
    do {                                                                                                               \
        double best = 1e30;                                                                                            \
        for (int round = 0; round < ROUNDS; round++) {                                                                 \
            double start = now();                                                                                      \
            for (int i = 0; i < CALLS; i++) {                                                                          \
                call;                                                                                                  \
            }                                                                                                          \
            double each = (now() - start) / CALLS;                                                                     \
            if (each < best)                                                                                           \
                best = each;                                                                                           \
        }                                                                                                              \
        printf("%s %.3f\n", name, best);                                                                               \
        fflush(stdout);                                                                                                \
    } while (0)

int main(void) {
    x11 = dlopen("libX11.so.6", RTLD_NOW);
    gl = dlopen("libGL.so.1", RTLD_NOW);
    if (!x11 || !gl) {
        fprintf(stderr, "%s\n", dlerror());
        return 1;
    }
    P display = ((P(*)(const char *))of(x11, "XOpenDisplay"))(NULL);
    if (!display) {
        fprintf(stderr, "no display\n");
        return 1;
    }
    int wanted[] = {4, 5, 8, 8, 9, 8, 10, 8, 12, 24, 0};
    struct {
        P visual;
        U id;
        int screen, depth;
    } *info = ((P(*)(P, int, int *))of(gl, "glXChooseVisual"))(display, 0, wanted);
    U root = ((U(*)(P))of(x11, "XDefaultRootWindow"))(display);
    U map = ((U(*)(P, U, P, int))of(x11, "XCreateColormap"))(display, root, info->visual, 0);
    U attributes[14] = {0};
    attributes[12] = map;
    U window = ((U(*)(P, U, int, int, unsigned, unsigned, unsigned, int, unsigned, P, U, U *))of(x11, "XCreateWindow"))(
        display, root, 0, 0, 64, 64, 0, info->depth, 1, info->visual, 1 << 13 | 1 << 3, attributes);
    ((int (*)(P, U))of(x11, "XMapWindow"))(display, window);
    P context = ((P(*)(P, P, P, int))of(gl, "glXCreateContext"))(display, info, NULL, 1);
    if (!((int (*)(P, U, P))of(gl, "glXMakeCurrent"))(display, window, context)) {
        fprintf(stderr, "no context\n");
        return 1;
    }
    void (*color)(float, float, float) = of(gl, "glColor3f");
    void (*normal)(float, float, float) = of(gl, "glNormal3f");
    void (*attribute)(unsigned, float, float, float, float) = of(gl, "glVertexAttrib4f");
    void (*fog)(float, float, float) = of(gl, "glSecondaryColor3f");
    void (*enable)(unsigned) = of(gl, "glEnable");
    void (*pointer)(unsigned, int) = of(gl, "glPixelStorei");
    void (*name)(unsigned) = of(gl, "glLoadName");
    unsigned char (*enabled)(unsigned) = of(gl, "glIsEnabled");
    TIME("glColor3f", color(i * 1e-7f, 0.5f, 0.25f));
    TIME("glNormal3f", normal(i * 1e-7f, 0.5f, 0.25f));
    TIME("glSecondaryColor3f", fog(i * 1e-7f, 0.5f, 0.25f));
    TIME("glVertexAttrib4f", attribute(5, i * 1e-7f, 0.5f, 0.25f, 1.0f));
    TIME("glEnable", enable(0x0bd0));
    TIME("glPixelStorei", pointer(0x0cf5, i & 4 ? 4 : 8));
    TIME("glLoadName", name(0));
    TIME("glIsEnabled", enabled(0x0b71));
    return 0;
}
