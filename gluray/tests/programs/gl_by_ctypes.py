"""OpenGL, GLX and X through ctypes: the library is found as in scripts and games, by dlopen and dlsym. Importing this creates one window."""
import array, ctypes as c, os, struct, sys, threading
from ctypes import c_int, c_uint, c_ulong, c_void_p, c_float, c_double

X = c.CDLL("libX11.so.6")
GL = c.CDLL("libGL.so.1")
for f in ("XOpenDisplay", "XDefaultVisual"):
    getattr(X, f).restype = c_void_p
for f in ("XDefaultRootWindow", "XCreateWindow", "XCreateColormap"):
    getattr(X, f).restype = c_ulong
for f in ("glXChooseVisual", "glXCreateContext"):
    getattr(GL, f).restype = c_void_p
W = H = 128


class VisualInfo(c.Structure):
    _fields_ = [("visual", c_void_p), ("visualid", c_ulong), ("screen", c_int), ("depth", c_int), ("cls", c_int)]


class Attributes(c.Structure):
    _fields_ = [("before", c_ulong * 12), ("colormap", c_ulong), ("cursor", c_ulong)]


def F(name, *types):
    f = getattr(GL, name)
    f.argtypes = types
    return f


X.XInitThreads()
dpy = c_void_p(X.XOpenDisplay(None))
root = X.XDefaultRootWindow(dpy)
# Cases whose names begin with `samples` use four samples per pixel.
several = (100000, 1, 100001, 4) if len(sys.argv) > 1 and sys.argv[1].startswith("samples") else ()
vi = c_void_p(GL.glXChooseVisual(dpy, 0, (c_int * 20)(4, 5, 8, 8, 9, 8, 10, 8, 12, 24, 13, 8, *several, 0)))
info = c.cast(vi, c.POINTER(VisualInfo)).contents


def window():
    at = Attributes()
    at.colormap = X.XCreateColormap(dpy, c_ulong(root), c_void_p(info.visual), 0)
    w = X.XCreateWindow(dpy, c_ulong(root), 0, 0, W, H, 0, info.depth, 1, c_void_p(info.visual), c_ulong(1 << 13 | 1 << 3), c.byref(at))
    X.XMapWindow(dpy, c_ulong(w))
    X.XSync(dpy, 0)
    return w


def context(share=None):
    return c_void_p(GL.glXCreateContext(dpy, vi, share, 1))


def current(w, ctx):
    assert GL.glXMakeCurrent(dpy, c_ulong(w), ctx)


begin, end = F("glBegin", c_uint), F("glEnd")
vertex, vertex4, normal, color = F("glVertex3f", *[c_float] * 3), F("glVertex4f", *[c_float] * 4), F("glNormal3f", *[c_float] * 3), F("glColor4f", *[c_float] * 4)
enable, disable, clear = F("glEnable", c_uint), F("glDisable", c_uint), F("glClear", c_uint)
mode, ortho, frustum = F("glMatrixMode", c_uint), F("glOrtho", *[c_double] * 6), F("glFrustum", *[c_double] * 6)
translate, scale, rotate, identity = F("glTranslatef", *[c_float] * 3), F("glScalef", *[c_float] * 3), F("glRotatef", *[c_float] * 4), F("glLoadIdentity")
enable_array, disable_array = F("glEnableClientState", c_uint), F("glDisableClientState", c_uint)
TRIANGLES, STRIP, FAN, QUADS, QUAD_STRIP, POLYGON = 4, 5, 6, 7, 8, 9


def lit():
    enable(0x0B50)
    enable(0x4000)
    enable(0x0B57)
    F("glColorMaterial", c_uint, c_uint)(0x0408, 0x1602)
    F("glLightfv", c_uint, c_uint, c_void_p)(0x4000, 0x1203, (c_float * 4)(0.5, 0.7, 1, 0))
    F("glMaterialfv", c_uint, c_uint, c_void_p)(0x0408, 0x1202, (c_float * 4)(0.5, 0.5, 0.5, 1))
    F("glMaterialf", c_uint, c_uint, c_float)(0x0408, 0x1601, 20)


def start(perspective=False):
    F("glViewport", *[c_int] * 4)(0, 0, W, H)
    F("glClearColor", *[c_float] * 4)(0.1, 0.1, 0.2, 1)
    clear(0x4100)
    enable(0x0B71)
    mode(0x1701)
    identity()
    frustum(-1, 1, -1, 1, 1, 10) if perspective else ortho(-1.5, 1.5, -1.5, 1.5, -10, 10)
    mode(0x1700)
    identity()
    if perspective:
        translate(0, 0, -2)


def bump(n=12):
    """A curved sheet as quad strips, with normals and colours."""
    z = lambda x, y: 0.4 * (x * x - y * y) + 0.1 * x
    for i in range(n):
        begin(QUAD_STRIP)
        for j in range(n + 1):
            for k in (0, 1):
                x, y = 2 * (i + k) / n - 1, 2 * j / n - 1
                normal(-0.8 * x - 0.1, 0.8 * y, 1)
                color((x + 1) / 2, (y + 1) / 2, 0.5, 1)
                vertex(x, y, z(x, y))
        end()


def simple(**k):
    start(**k)
    lit()
    enable(0x0BA1)
    rotate(40, 1, 0.3, 0.2)


w0 = window()


def run(cases):
    """Draws the case named on the command line, and writes the framebuffer: width, height, RGBA bytes, depth as floats."""
    case = cases[sys.argv[1]]
    if case.__code__.co_argcount:
        current(w0, context())
        case(w0)
    else:
        current(w0, context())
        case()
    rgba, depth = (c.c_uint8 * (W * H * 4))(), (c_float * (W * H))()
    read = F("glReadPixels", c_int, c_int, c_int, c_int, c_uint, c_uint, c_void_p)
    read(0, 0, W, H, 0x1908, 0x1401, rgba)
    read(0, 0, W, H, 0x1902, 0x1406, depth)
    with open(sys.argv[2], "wb") as out:
        out.write(struct.pack("II", W, H))
        out.write(bytes(rgba))
        out.write(bytes(depth))
