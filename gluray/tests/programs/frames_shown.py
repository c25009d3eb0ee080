"""Draws a bar that moves one step per frame, and writes as JSON where the X server shows it after each frame, and where it is when the program reads its window."""
import json

from gl_by_ctypes import *

FRAMES, STEP = 8, 12
X.XGetImage.restype = c_void_p
X.XGetPixel.restype = c_ulong


def draw(frame):
    start()
    lit()
    color(1, 1, 1, 1)
    normal(0, 0, 1)
    x = -1.4 + 3.0 * frame * STEP / W
    begin(QUADS)
    for dx, y in ((0, -1), (0.2, -1), (0.2, 1), (0, 1)):
        vertex(x + dx, y, 0)
    end()


def place(bright):
    """The number of the frame whose bar this row of pixels shows."""
    lit = [i for i, v in enumerate(bright) if v]
    return round((min(lit) - 0.1 / 3 * W) / STEP) if lit else None


def shown():
    X.XSync(dpy, 0)
    image = c_void_p(X.XGetImage(dpy, c_ulong(w0), 0, 0, W, H, c_ulong(0xFFFFFFFF), 2))
    return place([X.XGetPixel(image, x, H // 2) & 0xFF > 128 for x in range(W)])


current(w0, context())
seen = []
for frame in range(FRAMES):
    draw(frame)
    GL.glXSwapBuffers(dpy, c_ulong(w0))
    seen.append(shown())
draw(FRAMES)
rgba = (c.c_uint8 * (W * 4))()
F("glReadPixels", c_int, c_int, c_int, c_int, c_uint, c_uint, c_void_p)(0, H // 2, W, 1, 0x1908, 0x1401, rgba)
with open(sys.argv[1], "w") as out:
    json.dump({"shown": seen, "read": place([v > 128 for v in rgba[0::4]])}, out)
