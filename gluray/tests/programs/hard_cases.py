"""Small OpenGL programs, one per hard case. `hard_cases.py CASE OUT` draws the case in a window and writes OUT: width, height, RGB bytes, and depth as
floats, bottom row first."""
import math

from gl_by_ctypes import *
from mode_scenes import *
from texture_scenes import *
from view_scenes import *


def plain():
    simple()
    bump()


def perspective():
    simple(perspective=True)
    bump()


def depth_range_is_clamped():
    simple()
    F("glDepthRange", c_double, c_double)(-1e5, 1e5)
    bump()


def reversed_depth_range():
    simple()
    F("glDepthRange", c_double, c_double)(0.8, 0.2)
    bump()


def byte_normals():
    simple()
    p = (c_float * 12)(-1, -1, 0, 1, -1, 0.3, 1, 1, 0, -1, 1, -0.3)
    n = (c.c_int8 * 16)(0, 0, 127, 0, 60, 0, 100, 0, 0, 80, 90, 0, -70, 0, 100, 0)
    F("glVertexPointer", c_int, c_uint, c_int, c_void_p)(3, 0x1406, 0, p)
    F("glNormalPointer", c_uint, c_int, c_void_p)(0x1400, 4, n)
    F("glEnableClientState", c_uint)(0x8074)
    F("glEnableClientState", c_uint)(0x8075)
    F("glDrawArrays", c_uint, c_int, c_int)(QUADS, 0, 4)


def fans(first=0):
    """Two fans and a strip of arrays; the numbers of their first vertices, and of their vertices."""
    corners = []
    for cx, cy in ((-0.6, -0.5), (0.6, 0.5)):
        corners += [(cx, cy, 0.2)] + [(cx + 0.5 * math.cos(0.9 * k), cy + 0.5 * math.sin(0.9 * k), -0.1 * k) for k in range(7)]
    corners += [(0.4 * (k // 2) - 1, 0.25 * (k % 2) + 0.6, 0.1 * k) for k in range(6)]
    return [(9.0, 9.0, 9.0)] * first + corners, (first, first + 8, first + 16), (8, 8, 6)


def arrays_of(corners):
    """Arrays of positions, colours and normals in the program's memory."""
    numbers = [v for x, y, z in corners for v in (x, y, z)]
    colors = [v for x, y, z in corners for v in (abs(x) % 1, abs(y) % 1, abs(z) % 1)]
    kept = [(c_float * len(numbers))(*numbers), (c_float * len(colors))(*colors)]
    F("glVertexPointer", c_int, c_uint, c_int, c_void_p)(3, 0x1406, 0, kept[0])
    F("glColorPointer", c_int, c_uint, c_int, c_void_p)(3, 0x1406, 0, kept[1])
    enable_array(0x8074)
    enable_array(0x8076)
    return kept


def ints(*values):
    return (c_int * len(values))(*values)


def several_ranges():
    """Several ranges of arrays in one call: fans that share no triangle, and quads that are split as one by one."""
    simple()
    corners, firsts, counts = fans(2)
    kept = arrays_of(corners)
    draw = F("glMultiDrawArrays", c_uint, c_void_p, c_void_p, c_int)
    draw(FAN, ints(*firsts[:2]), ints(*counts[:2]), 2)
    draw(STRIP, ints(firsts[2], 0), ints(counts[2], 0), 2)
    kept += arrays_of([(x + dx, y - 0.9, 0.3 * x * y) for dx in (-0.7, 0.2) for x, y in ((0, 0), (0.5, 0), (0.5, 0.4), (0, 0.6))])
    draw(QUADS, ints(4, 0), ints(4, 4), 2)
    draw(QUADS, ints(0), ints(4), 0)


def several_clipped_quads():
    """Quads of several ranges, one of which the near plane cuts: the driver splits those of that range alone the other way."""
    start(perspective=True)
    # The eye is 2 in front of the origin, the near plane 1.
    corners = ((-1.5, -1.2, 0), (-0.1, -1.2, 0), (-0.1, 1, 0), (-1.5, 0.6, 0)), ((0.1, -1.2, 0), (1.5, -1.2, 0), (1.2, 1, 1.3), (0.1, 0.6, 1.2))
    kept = arrays_of([corner for quad in corners for corner in quad])
    F("glMultiDrawArrays", c_uint, c_void_p, c_void_p, c_int)(QUADS, ints(0, 4), ints(4, 4), 2)


def several_lists_of_indices():
    """Several lists of indices in one call, in the program's memory and in a buffer, with a base for each and without."""
    simple()
    corners, firsts, counts = fans()
    kept = arrays_of(corners)
    lists_of = [(c.c_uint16 * n)(*range(n)) for n in counts]
    places = (c_void_p * 3)(*[c.addressof(a) for a in lists_of])
    F("glMultiDrawElementsBaseVertex", c_uint, c_void_p, c_uint, c_void_p, c_int, c_void_p)(FAN, ints(*counts[:2]), 0x1403, places, 2, ints(*firsts[:2]))
    name = c_uint()
    F("glGenBuffers", c_int, c_void_p)(1, c.byref(name))
    F("glBindBuffer", c_uint, c_uint)(0x8893, name)
    indices = (c.c_uint8 * 10)(255, 16, 17, 18, 19, 20, 21, 17, 16, 18)
    F("glBufferData", c_uint, c.c_ssize_t, c_void_p, c_uint)(0x8893, 10, indices, 0x88E4)
    F("glMultiDrawElements", c_uint, c_void_p, c_uint, c_void_p, c_int)(STRIP, ints(3, 6), 0x1401, (c_void_p * 2)(7, 1), 2)
    F("glBindBuffer", c_uint, c_uint)(0x8893, 0)
    kept.append(lists_of)


def in_a_list(draw):
    new, done, call = lists()
    start()
    new(7, 0x1300)
    draw()
    done()
    simple()
    call(7)


def several_ranges_in_a_list():
    in_a_list(several_ranges)


def several_lists_of_indices_in_a_list():
    in_a_list(several_lists_of_indices)


def several_draws_that_are_refused():
    """Calls with errors draw nothing and report them; instances without a program are the driver's."""
    simple()
    corners, firsts, counts = fans()
    kept = arrays_of(corners)
    draw = F("glMultiDrawArrays", c_uint, c_void_p, c_void_p, c_int)
    said = F("glGetError")
    draw(FAN, ints(*firsts[:2]), ints(*counts[:2]), -1)
    assert said() == 0x0501
    draw(FAN, ints(*firsts[:2]), ints(-8, 8), 2)
    assert said() == 0x0501
    elements = F("glMultiDrawElements", c_uint, c_void_p, c_uint, c_void_p, c_int)
    elements(FAN, ints(4), 0x1406, (c_void_p * 1)(c.addressof(ints(0, 1, 2, 3))), 1)
    assert said() == 0x0500
    draw(FAN, ints(*firsts[:2]), ints(*counts[:2]), 2)
    instanced = F("glDrawArraysInstanced", c_uint, c_int, c_int, c_int)
    instanced(STRIP, firsts[2], counts[2], 3)
    kept.append(0)


def mirrored_model_view():
    simple()
    scale(-1, 1, 1)
    # Front faces are clockwise: the faces that the mirror reversed are visible, the others are
    # culled.
    enable(0x0B44)
    F("glFrontFace", c_uint)(0x0900)
    F("glLightModeli", c_uint, c_int)(0x0B52, 1)
    bump()


def singular_model_view():
    simple()
    bump()
    translate(0, 0, 1)
    scale(0.5, 0.5, 0)
    disable(0x0B50)
    bump()


def negative_w():
    start(perspective=True)
    begin(TRIANGLES)
    color(1, 0, 0, 1)
    vertex4(-1, -1, 0, 1)
    color(0, 1, 0, 1)
    vertex4(1, -1, 0, 1)
    color(0, 0, 1, 1)
    vertex4(0, -2, -1, -1)
    end()
    begin(TRIANGLES)
    color(1, 1, 0, 1)
    vertex(-0.5, 0, 0)
    vertex(0.5, 0, 0)
    vertex(0, 1, 5)
    end()


def vertices_behind_the_eye():
    start(perspective=True)
    # Triangles, because the driver chooses the diagonal of a quad, and Mesa chooses another one
    # when it has to clip.
    corners = ((-1, -0.5, -6, 0), (1, -0.5, -6, 1), (1, -0.5, 6, 0.5), (-1, -0.5, 6, 0.2))
    begin(TRIANGLES)
    for x, y, z, r in (corners[i] for i in (0, 1, 2, 0, 2, 3)):
        color(r, 1 - r, 0.5, 1)
        vertex(x, y, z)
    end()


def concave_polygon():
    start()
    begin(POLYGON)
    for i, (x, y) in enumerate(((-1, -1), (1, -1), (0, -0.3), (1, 1), (-1, 1))):
        color(i / 4, 1 - i / 4, 0.3, 1)
        vertex(x, y, 0.1 * i)
    end()


def degenerate_strips():
    start()
    begin(STRIP)
    for i, (x, y) in enumerate(((-1, -1), (-1, 1), (-1, 1), (0, -1), (0, -1), (0, 1), (0, 1), (1, -1), (1, 1))):
        color(i / 8, 0.5, 1 - i / 8, 1)
        vertex(x, y, 0)
    end()
    begin(STRIP)
    vertex(0, 0, 0.5)
    end()
    begin(TRIANGLES)
    end()


def nan_vertices():
    start()
    begin(TRIANGLES)
    for x, y in ((-1, -1), (0, -1), (-0.5, 0)):
        vertex(x, y, 0)
    for x, y in ((0.1, 0.1), (float("nan"), 0), (0.5, 0.9)):
        vertex(x, y, 0)
    color(1, 0, 0, 1)
    for x, y in ((0, -1), (1, -1), (0.5, 0)):
        vertex(x, y, 0)
    end()


def lists():
    return F("glNewList", c_uint, c_uint), F("glEndList"), F("glCallList", c_uint)


def nested_lists():
    simple()
    new, done, call = lists()
    new(1, 0x1300)
    bump(4)
    done()
    new(2, 0x1300)
    F("glPushMatrix")()
    scale(0.4, 0.4, 0.4)
    call(1)
    translate(2, 2, 0)
    call(1)
    F("glPopMatrix")()
    done()
    new(3, 0x1301)
    call(2)
    rotate(90, 0, 0, 1)
    call(2)
    done()


def list_changed_while_in_use():
    simple()
    new, done, call = lists()
    for x in (-0.6, 0.6):
        new(5, 0x1300)
        begin(TRIANGLES)
        color(0.5 + x / 2, 0.5, 0, 1)
        normal(0, 0, 1)
        for dx, dy in ((-0.4, -0.4), (0.4, -0.4), (0, 0.5)):
            vertex(x + dx, dy, 0)
        end()
        done()
        call(5)
    new(6, 0x1300)
    call(5)
    done()
    F("glDeleteLists", c_uint, c_int)(5, 1)
    call(6)


def flat_shading():
    simple()
    F("glShadeModel", c_uint)(0x1D00)
    bump(6)
    for i, m in enumerate((TRIANGLES, STRIP, FAN, QUADS, POLYGON)):
        begin(m)
        for k, (x, y) in enumerate(((0, 0), (0.3, 0), (0.3, 0.3), (0, 0.3))):
            color(k / 3, 1 - k / 3, 0.2 * i, 1)
            vertex(x - 1.2 + 0.4 * i, y - 1.4, 2)
        end()


def polygon_offset_under_lines():
    simple()
    enable(0x8037)
    F("glPolygonOffset", c_float, c_float)(1, 1)
    bump()
    disable(0x8037)
    disable(0x0B50)
    F("glPolygonMode", c_uint, c_uint)(0x0408, 0x1B01)
    color(1, 1, 1, 1)
    bump()


def surfaces_parallel_to_the_screen():
    """Their depths are those of their corners, rounded as the driver rounds them."""
    start(perspective=True)
    disable(0x0B50)
    for i in range(16):
        x, y, z = 0.55 * (i % 4) - 1.05, 0.55 * (i // 4) - 1.05, -0.137 * i
        begin(QUADS)
        color(0.2 + 0.05 * i, 0.6, 1 - 0.05 * i, 1)
        for dx, dy in ((0, 0), (0.5, 0), (0.5, 0.5), (0, 0.5)):
            vertex((x + dx) * (2 - z) / 2, (y + dy) * (2 - z) / 2, z)
        end()


def clip_planes():
    simple()
    for i, p in enumerate(((1, 0.2, 0, 0.3), (0, -1, 0.5, 0.5))):
        F("glClipPlane", c_uint, c_void_p)(0x3000 + i, (c_double * 4)(*p))
        enable(0x3000 + i)
    bump()


def fog():
    simple(perspective=True)
    enable(0x0B60)
    F("glFogi", c_uint, c_int)(0x0B65, 0x0800)
    F("glFogf", c_uint, c_float)(0x0B62, 0.4)
    F("glFogfv", c_uint, c_void_p)(0x0B66, (c_float * 4)(0.8, 0.8, 0.2, 1))
    bump()


def color_map_texture():
    simple()
    texels = (c.c_uint8 * 64)(*[(i * 37 + 11 * (i % 4)) % 256 for i in range(64)])
    F("glBindTexture", c_uint, c_uint)(0x0DE0, 1)
    F("glTexParameteri", c_uint, c_uint, c_int)(0x0DE0, 0x2801, 0x2601)
    F("glTexParameteri", c_uint, c_uint, c_int)(0x0DE0, 0x2802, 0x812F)
    F("glTexImage1D", c_uint, c_int, c_int, c_int, c_int, c_uint, c_uint, c_void_p)(0x0DE0, 0, 0x1908, 16, 0, 0x1908, 0x1401, texels)
    F("glTexGeni", c_uint, c_uint, c_int)(0x2000, 0x2500, 0x2401)
    F("glTexGenfv", c_uint, c_uint, c_void_p)(0x2000, 0x2501, (c_float * 4)(0.4, 0.1, 0.3, 0.5))
    enable(0x0C60)
    enable(0x0DE0)
    bump()


def samples_of_surfaces():
    """Two intersecting surfaces, a hole in a far one, the driver's lines before and after."""
    simple(perspective=True)
    begin(1)
    vertex(-1, -1, 0.3)
    vertex(1, 1, 0.3)
    end()
    bump()
    rotate(70, 0.2, 1, 0.1)
    bump(3)
    disable(0x0B50)
    begin(1)
    color(1, 1, 1, 1)
    vertex(-1, 1, 0.1)
    vertex(1, -1, -0.1)
    end()


def resolved_samples():
    """A framebuffer object with four samples per pixel, and its resolved image."""
    name = (c_uint * 2)(7, 8)
    F("glGenFramebuffers", c_int, c_void_p)(1, name)
    target = name[0]
    bind = F("glBindFramebuffer", c_uint, c_uint)
    bind(0x8D40, target)
    for format, place in ((0x8058, 0x8CE0), (0x81A6, 0x8D00)):
        F("glGenRenderbuffers", c_int, c_void_p)(1, name)
        F("glBindRenderbuffer", c_uint, c_uint)(0x8D41, name[0])
        F("glRenderbufferStorageMultisample", c_uint, c_int, c_uint, c_int, c_int)(0x8D41, 4, format, W, H)
        F("glFramebufferRenderbuffer", c_uint, c_uint, c_uint, c_uint)(0x8D40, place, 0x8D41, name[0])
    samples_of_surfaces()
    disable(0x0B71)
    begin(TRIANGLES)
    for x, y in ((-1.9, -1.9), (-0.3, -1.8), (-0.9, -0.9)):
        vertex(x, y, 0)
    end()
    bind(0x8CA9, 0)
    F("glBlitFramebuffer", *[c_int] * 8, c_uint, c_uint)(0, 0, W, H, 0, 0, W, H, 0x4000, 0x2600)
    bind(0x8D40, 0)


def samples_in_order():
    """Without a depth test the last one is visible, sample by sample."""
    start()
    disable(0x0B71)
    for i in range(5):
        begin(TRIANGLES)
        color(i / 4, 1 - i / 4, 0.5, 1)
        for x, y in ((-1, -1), (1, -0.8), (0.1, 0.9)):
            vertex(x * (1 - 0.13 * i), y + 0.11 * i, 0)
        end()


def samples_switched_off():
    """A framebuffer with four samples, drawn to as if it had one; and a sample mask, which is left to the driver."""
    simple()
    disable(0x809D)
    bump(5)
    enable(0x809D)
    translate(0.3, 0.4, 0.5)
    bump(4)
    enable(0x809E)
    translate(-0.6, -0.9, 0.1)
    bump(4)


def material_per_vertex():
    simple()
    disable(0x0B57)
    m = F("glMaterialfv", c_uint, c_uint, c_void_p)
    begin(QUADS)
    for i, (x, y) in enumerate(((-1, -1), (1, -1), (1, 1), (-1, 1))):
        m(0x0404, 0x1602, (c_float * 4)(i / 3, 1 - i / 3, 0.5, 1))
        normal(0.1 * i, 0, 1)
        vertex(x, y, 0)
    end()


def blended_over_traced():
    simple()
    bump()
    disable(0x0B50)
    enable(0x0BE2)
    F("glBlendFunc", c_uint, c_uint)(0x0302, 0x0303)
    color(1, 1, 0, 0.4)
    F("glRectf", *[c_float] * 4)(-0.8, -0.3, 0.9, 0.4)


def layers_in_one_plane():
    """Overlapping squares in one plane and one batch, without a depth test: the last one is visible."""
    start()
    disable(0x0B71)
    numbers = iter(range(1, 10**6))
    part = lambda: next(numbers) * 7919 % 1009 / 1009
    begin(QUADS)
    for _ in range(60):
        x, y, s = 2.2 * part() - 1.4, 2.2 * part() - 1.4, 0.1 + 0.5 * part()
        color(part(), part(), part(), 1)
        for dx, dy in ((0, 0), (s, 0), (s, s), (0, s)):
            vertex(x + dx, y + dy, 0)
    end()


def two_contexts(w, n=2):
    shared = context()
    current(w, shared)
    new, done, _ = lists()
    new(9, 0x1300)
    bump(3)
    done()
    made = [shared]
    for i in range(n):
        ctx = context(shared)
        made.append(ctx)
        current(w, ctx)
        if i == 0:
            start()
        enable(0x0B71)
        F("glLoadIdentity")()
        mode(0x1701)
        identity()
        ortho(-1.5, 1.5, -1.5, 1.5, -10, 10)
        mode(0x1700)
        identity()
        translate(-1 + 2 * (i % 4) / 3, -1 + 2 * (i // 4) / 4, 0)
        scale(0.25, 0.25, 0.25)
        F("glCallList", c_uint)(9)
    return made


def seventeen_contexts(w):
    two_contexts(w, 16)


def context_destroyed_in_flight(w):
    made = two_contexts(w, 2)
    GL.glXDestroyContext(dpy, made[0])
    GL.glXDestroyContext(dpy, made[-1])
    color(1, 0, 0, 1)
    F("glRectf", *[c_float] * 4)(0, 0, 1, 1)


def threads(w):
    """Two threads, each with its own context and window; the image of the first one is checked."""
    other = window()

    def work():
        current(other, context())
        for _ in range(20):
            plain()
        GL.glFinish()
        GL.glXMakeCurrent(dpy, c_ulong(0), None)

    t = threading.Thread(target=work)
    t.start()
    for _ in range(20):
        plain()
    t.join()


def a_program_that_forks():
    plain()
    F("glReadPixels", c_int, c_int, c_int, c_int, c_uint, c_uint, c_void_p)(0, 0, 1, 1, 0x1908, 0x1401, (c.c_uint8 * 4)())
    pid = os.fork()
    if pid == 0:
        begin(TRIANGLES)
        end()
        os._exit(7)
    assert os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == 7
    rotate(10, 0, 0, 1)
    bump()


def arrays_beyond_their_buffer():
    start()
    b = c_uint()
    F("glGenBuffers", c_int, c_void_p)(1, c.byref(b))
    F("glBindBuffer", c_uint, c_uint)(0x8892, b)
    p = (c_float * 9)(-1, -1, 0, 1, -1, 0, 0, 1, 0)
    F("glBufferData", c_uint, c_ulong, c_void_p, c_uint)(0x8892, 36, p, 0x88E4)
    F("glVertexPointer", c_int, c_uint, c_int, c_void_p)(3, 0x1406, 0, None)
    F("glEnableClientState", c_uint)(0x8074)
    F("glDrawArrays", c_uint, c_int, c_int)(TRIANGLES, 0, 3)
    F("glDrawArrays", c_uint, c_int, c_int)(TRIANGLES, 0, 3000)


def errors():
    """The specification's rules for errors, drawn as colours."""
    get = GL.glGetError
    start()
    seen = []
    get()
    begin(TRIANGLES)
    enable(0x0B71)
    end()
    seen.append(get())
    begin(TRIANGLES)
    begin(TRIANGLES)
    end()
    seen.append(get())
    end()
    seen.append(get())
    begin(77)
    seen.append(get())
    F("glMaterialf", c_uint, c_uint, c_float)(0x0404, 0x1601, 300)
    seen.append(get())
    F("glDrawArrays", c_uint, c_int, c_int)(TRIANGLES, 0, -3)
    seen.append(get())
    F("glNewList", c_uint, c_uint)(0, 0x1300)
    seen.append(get())
    seen.append(get())
    assert seen == [0x502, 0x502, 0x502, 0x500, 0x501, 0x501, 0x501, 0], [hex(s) for s in seen]
    plain()


def select_and_feedback():
    """Picking and feedback give the driver's results."""
    simple()
    buffer = (c_uint * 64)()
    F("glSelectBuffer", c_int, c_void_p)(64, buffer)
    F("glRenderMode", c_uint)(0x1C02)
    F("glInitNames")()
    F("glPushName", c_uint)(5)
    bump(2)
    hits = F("glRenderMode", c_uint)(0x1C00)
    assert (hits, buffer[0], buffer[3]) == (1, 1, 5), (hits, list(buffer)[:4])
    values = (c_float * 4096)()
    F("glFeedbackBuffer", c_int, c_uint, c_void_p)(4096, 0x0600, values)
    F("glRenderMode", c_uint)(0x1C01)
    bump(2)
    assert F("glRenderMode", c_uint)(0x1C00) > 0 and values[0] == 0x0703
    bump()


def resident():
    """Resident memory of the process in KiB."""
    with open("/proc/self/status") as f:
        return next(int(line.split()[1]) for line in f if line.startswith("VmRSS"))


def soak():
    """New geometry in each frame, in every way that programs use, for SOAK_SECS seconds: the memory must not grow. From time to time a shape stays
    unchanged for some frames, so that it is rebuilt in the background."""
    import json, time
    secs = float(os.environ.get("SOAK_SECS", "12"))
    pointer = F("glVertexPointer", c_int, c_uint, c_int, c_void_p)
    draw = F("glDrawArrays", c_uint, c_int, c_int)
    generate, delete, bind = F("glGenBuffers", c_int, c_void_p), F("glDeleteBuffers", c_int, c_void_p), F("glBindBuffer", c_uint, c_uint)
    fill = F("glBufferData", c_uint, c_ulong, c_void_p, c_uint)
    n = 63000
    base = array.array("f", [(k * 7919 % 2003) / 1001.5 - 1 for k in range(3 * n)])
    started, frames, samples, shape = time.time(), 0, [], None
    while time.time() - started < secs or frames < 100:
        simple()
        rotate(frames, 0, 0, 1)
        if shape is None or frames % 24 < 16:
            first = frames * 31 % 2003
            shape = base[first:] + base[:first]
        address, way = shape.buffer_info()[0], frames // 4 % 4
        if way == 0:
            enable_array(0x8074)
            pointer(3, 0x1406, 0, address)
            draw(TRIANGLES, 0, n)
            disable_array(0x8074)
        elif way == 1:
            name = (c_uint * 1)()
            generate(1, name)
            bind(0x8892, name[0])
            fill(0x8892, 12 * n, address, 0x88E4)
            enable_array(0x8074)
            pointer(3, 0x1406, 0, None)
            draw(TRIANGLES, 0, n)
            disable_array(0x8074)
            bind(0x8892, 0)
            delete(1, name)
        else:
            if way == 2:
                F("glNewList", c_uint, c_uint)(1, 0x1301)
            begin(TRIANGLES)
            for k in range(0, 9000, 3):
                vertex(shape[k], shape[k + 1], shape[k + 2])
            end()
            if way == 2:
                F("glEndList")()
                F("glDeleteLists", c_uint, c_int)(1, 1)
        GL.glXSwapBuffers(dpy, c_ulong(w0))
        frames += 1
        samples.append(resident())
    if "SOAK_LOG" in os.environ:
        step = max(1, len(samples) // 200)
        with open(os.environ["SOAK_LOG"], "w") as f:
            json.dump({"secs": time.time() - started, "frames": frames, "resident_kib": samples[::step]}, f)
    # The memory of the first third suffices for the rest; some fragmentation is not a leak.
    third = len(samples) // 3
    early, late = max(samples[:third]), max(samples[third:])
    assert third > 30 and late < early + 30_000, f"{late - early} KiB more after {frames} frames"
    plain()


def a_program_that_ends_without_handlers():
    plain()


run(globals())
if sys.argv[1].startswith("a_program_that_ends"):
    os._exit(3)
