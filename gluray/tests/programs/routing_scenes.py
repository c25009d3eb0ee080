"""Frames of few and of many triangles in turns: `routing_scenes.py CASE OUT`. OUT contains colour and depth of each frame.

Every frame has a display list (with a call of another), immediate mode, an array and lines, and state that is left over from the frame before."""
import math

from gl_by_ctypes import *

floats = lambda *v: (c_float * len(v))(*v)
pointer, normals = F("glVertexPointer", c_int, c_uint, c_int, c_void_p), F("glNormalPointer", c_uint, c_int, c_void_p)
arrays = F("glDrawArrays", c_uint, c_int, c_int)
new_list, end_list, call = F("glNewList", c_uint, c_uint), F("glEndList"), F("glCallList", c_uint)
material = F("glMaterialfv", c_uint, c_uint, c_void_p)
read = F("glReadPixels", c_int, c_int, c_int, c_int, c_uint, c_uint, c_void_p)


def sheet(n):
    """A wavy sheet of 2 n^2 triangles, with normals."""
    at = lambda i, j: (2 * i / n - 1, 2 * j / n - 1, 0.3 * math.sin(5 * i / n) * math.cos(4 * j / n))
    corners = ((0, 0), (1, 0), (1, 1), (0, 0), (1, 1), (0, 1))
    positions, directions = [], []
    for i in range(n):
        for j in range(n):
            for di, dj in corners:
                p = at(i + di, j + dj)
                positions += p
                directions += (-p[0], p[1], 2)
    return floats(*positions), floats(*directions), 6 * n * n


few, many = sheet(6), sheet(100)


def draw_sheet(s):
    enable_array(0x8074)
    enable_array(0x8075)
    pointer(3, 0x1406, 0, s[0])
    normals(0x1406, 0, s[1])
    arrays(TRIANGLES, 0, s[2])
    disable_array(0x8074)
    disable_array(0x8075)


def compile_lists():
    """List 2 is called by list 1, and replaced later."""
    new_list(2, 0x1300)
    color(0.2, 0.8, 0.3, 1)
    begin(QUADS)
    normal(0, 0, 1)
    for x, y in ((-1.4, -1.4), (-0.9, -1.4), (-0.9, -0.9), (-1.4, -0.9)):
        vertex(x, y, 0.4 * x)
    end()
    end_list()
    new_list(1, 0x1300)
    F("glShadeModel", c_uint)(0x1D00)
    begin(TRIANGLES)
    for k, (x, y) in enumerate(((0.9, 0.9), (1.4, 0.9), (1.4, 1.4))):
        color(k / 2, 0.3, 1 - k / 2, 1)
        normal(0.1 * k, 0.2, 1)
        vertex(x, y, 0.2)
    end()
    call(2)
    F("glShadeModel", c_uint)(0x1D01)
    translate(0.05, 0, 0)
    end_list()


def frame(n, heavy):
    F("glClearColor", *[c_float] * 4)(0.1, 0.1, 0.2, 1)
    clear(0x4100)
    mode(0x1700)
    identity()
    # The colour is the one that the frame before has left.
    draw_sheet(few)
    rotate(3 * n, 0.3, 1, 0.2)
    call(1)
    material(0x0408, 0x1202, floats(0.1 * (n % 5), 0.5, 0.5, 1))
    normal(0, 0, 1)
    begin(POLYGON)
    color(1, 0.2, 0.1, 1)
    for k in range(7):
        vertex(0.5 * math.cos(k), 0.5 * math.sin(k), 0.6)
    end()
    if heavy:
        color(0.9, 0.8, 0.3, 1)
        draw_sheet(many)
    begin(1)
    color(1, 1, 1, 1)
    for k in range(6):
        vertex(-1.2, -1 + 0.35 * k, 0.1)
        vertex(1.2, -0.9 + 0.35 * k, 0.1)
    end()
    color(0.3, 0.4, 0.5 + 0.1 * (n % 4), 1)
    if n == 14:
        new_list(2, 0x1300)
        begin(TRIANGLES)
        normal(0, 0.4, 1)
        for x, y in ((-1.4, -1.4), (-0.9, -1.4), (-0.9, -0.9)):
            vertex(x, y, 0.1)
        end()
        end_list()


def record(out):
    rgba, depth = (c.c_uint8 * (W * H * 4))(), (c_float * (W * H))()
    read(0, 0, W, H, 0x1908, 0x1401, rgba)
    read(0, 0, W, H, 0x1902, 0x1406, depth)
    out.write(struct.pack("II", W, H))
    out.write(bytes(rgba))
    out.write(bytes(depth))


CASES = {
    # Few triangles, many in frames 6 to 15, and few again.
    "turns": [6 <= n < 16 for n in range(24)],
    # Every other frame.
    "flicker": [n % 2 == 0 for n in range(12)],
    "few": [False] * 8,
}

current(w0, context())
simple()
compile_lists()
with open(sys.argv[2], "wb") as out:
    for n, heavy in enumerate(CASES[sys.argv[1]]):
        frame(n, heavy)
        record(out)
        # Geometry that was not drawn for some frames is forgotten; reading ends a frame as well.
        if sys.argv[1] != "flicker":
            GL.glXSwapBuffers(dpy, c_ulong(w0))
