/* Preloaded into animated programs: time advances only from frame to frame, so that equal runs draw equal images. The frame with number FRAME is
   written to OUT as a PPM, and the program ends. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/time.h>
#include <sys/types.h>
#include <time.h>
#include <unistd.h>

static long frame;
static double waited;

static double now(void) { return 1.7e9 + frame / 30.0 + waited; }

int gettimeofday(struct timeval *t, void *zone) {
    (void)zone;
    waited += 1e-5;
    t->tv_sec = (time_t)now();
    t->tv_usec = (suseconds_t)((now() - (double)t->tv_sec) * 1e6);
    return 0;
}

time_t time(time_t *out) {
    time_t t = (time_t)now();
    if (out) *out = t;
    return t;
}

pid_t getpid(void) { return 4242; }

int usleep(useconds_t micro) {
    waited += micro * 1e-6;
    return 0;
}

static void look(void) {
    frame++;
    if (!getenv("OUT") || !getenv("FRAME") || atol(getenv("FRAME")) != frame) return;
    void (*get)(unsigned, int *) = dlsym(RTLD_DEFAULT, "glGetIntegerv");
    void (*store)(unsigned, int) = dlsym(RTLD_DEFAULT, "glPixelStorei");
    void (*read)(int, int, int, int, unsigned, unsigned, void *) = dlsym(RTLD_DEFAULT, "glReadPixels");
    int v[4];
    get(0x0BA2, v);
    store(0x0D05, 1);
    unsigned char *rgb = calloc((size_t)v[2] * (size_t)v[3], 3);
    read(v[0], v[1], v[2], v[3], 0x1907, 0x1401, rgb);
    FILE *out = fopen(getenv("OUT"), "wb");
    fprintf(out, "P6\n%d %d\n255\n", v[2], v[3]);
    for (int y = v[3]; y-- > 0;) fwrite(rgb + 3 * (size_t)v[2] * (size_t)y, 3, (size_t)v[2], out);
    fclose(out);
    exit(0);
}

unsigned eglSwapBuffers(void *display, void *surface) {
    look();
    unsigned (*real)(void *, void *) = dlsym(RTLD_NEXT, "eglSwapBuffers");
    return real(display, surface);
}
