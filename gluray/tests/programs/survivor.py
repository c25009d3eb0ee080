"""Exits at once and leaves a child, which creates an EGL context when the file `go` appears, and writes the result to the file named on the command line."""
import ctypes as c, os, sys, time

if os.fork():
    os._exit(0)
os.setsid()
# The parent waits for these to be closed.
nothing = os.open(os.devnull, os.O_RDWR)
for fd in range(3):
    os.dup2(nothing, fd)
end = time.time() + 300
while not os.path.exists("go") and time.time() < end:
    time.sleep(0.02)


def context():
    egl = c.CDLL("libEGL.so.1")
    for f in ("eglGetPlatformDisplay", "eglCreateContext", "eglQueryString"):
        getattr(egl, f).restype = c.c_void_p
    display = c.c_void_p(egl.eglGetPlatformDisplay(0x31DD, None, None))
    if not egl.eglInitialize(display, None, None):
        return "no vendor: EGL error 0x%x" % egl.eglGetError()
    egl.eglBindAPI(0x30A2)
    ctx = c.c_void_p(egl.eglCreateContext(display, None, None, None))
    if not ctx or not egl.eglMakeCurrent(display, None, None, ctx):
        return "no context: EGL error 0x%x" % egl.eglGetError()
    ours = any("libgluray" in line for line in open("/proc/self/maps"))
    return "a context" + (" of ours" if ours else "")


try:
    found = context()
except BaseException as e:
    found = repr(e)
with open("found.new", "w") as out:
    out.write(found)
os.rename("found.new", sys.argv[1])
