"""Behaviour observed in programs of all kinds, as small programs: `traps.py CASE OUT`, like hard_cases.py."""
from math import cos, sin

from gl_by_ctypes import *


def lists():
    return F("glNewList", c_uint, c_uint), F("glEndList"), F("glCallList", c_uint), F("glGenLists", c_int)


def disc(r, n=24):
    begin(FAN)
    vertex(0, 0, 0)
    for k in range(n + 1):
        a = 6.2831853 * k / n
        vertex(r * cos(a), r * sin(a), 0.1)
    end()


def generated_lists_with_state_between_primitives():
    """Each list has several primitives with state between them, and names come from glGenLists after the first were compiled (xscreensaver's gears)."""
    simple()
    new, done, call, generate = lists()
    names = []
    for k in range(3):
        names.append(generate(1))
        new(names[-1], 0x1300)
        F("glPushMatrix")()
        scale(0.3, 0.3, 0.3)
        for turn, shade in ((0, 0.9), (20, 0.6), (40, 0.3)):
            F("glFrontFace", c_uint)(0x0901)
            color(shade, k / 3, 1 - k / 3, 1)
            rotate(turn, 0.3, 0.5, 0.1)
            bump(3)
        F("glPopMatrix")()
        done()
    assert len(set(names)) == 3
    for k, name in enumerate(names):
        F("glPushMatrix")()
        translate(k - 1, 0.8 * (k % 2), 0.1 * k)
        call(name)
        F("glPopMatrix")()


def corners(n=1, step=0.0):
    """Quads whose diagonal is visible: two corners are bright, the others dark."""
    for i in range(n):
        for k, (x, y) in enumerate(((-1, -1), (0.2, -1), (0.2, 0.6), (-1, 0.6))):
            color(k % 2, 1 - k % 2, i / n, 1)
            vertex(x + i * step, y + i * step, i * 0.01)


def quads_of_immediate_mode():
    start()
    begin(QUADS)
    corners(3, 0.3)
    end()


def quads_of_which_one_is_clipped():
    start()
    begin(QUADS)
    corners(3, 0.6)
    end()


def quads_of_a_display_list():
    start()
    new, done, call, generate = lists()
    name = generate(1)
    new(name, 0x1300)
    begin(QUADS)
    corners(3, 0.3)
    end()
    done()
    begin(QUADS)
    corners()
    end()
    call(name)


def quads_of_a_list_that_is_passed():
    start()
    disable(0x0B71)
    new, done, call, generate = lists()
    new(1, 0x1300)
    begin(QUADS)
    corners(3, 0.3)
    end()
    done()
    call(1)


def quads_by_index():
    start()
    p, q = (c_float * 24)(), (c_float * 32)()
    for i in range(2):
        for k, (x, y) in enumerate(((-1, -1), (0, -1), (0, 0.5), (-1, 0.5))):
            p[3 * (4 * i + k)], p[3 * (4 * i + k) + 1] = x + i, y + 0.3 * i
            q[4 * (4 * i + k)], q[4 * (4 * i + k) + 3] = k % 2, 1
    F("glVertexPointer", c_int, c_uint, c_int, c_void_p)(3, 0x1406, 0, p)
    F("glColorPointer", c_int, c_uint, c_int, c_void_p)(4, 0x1406, 0, q)
    enable_array(0x8074)
    enable_array(0x8076)
    F("glDrawElements", c_uint, c_int, c_uint, c_void_p)(QUADS, 4, 0x1405, (c_uint * 4)(0, 1, 2, 3))
    F("glDrawArrays", c_uint, c_int, c_int)(QUADS, 4, 4)


def arrays_of_a_list_leave_the_current_normal_alone():
    simple()
    new, done, call, generate = lists()
    p = (c_float * 9)(-1.2, -1.2, 0, -0.8, -1.2, 0, -1, -0.8, 0)
    n = (c_float * 9)(*(-0.9, 0, 0.3) * 3)
    F("glVertexPointer", c_int, c_uint, c_int, c_void_p)(3, 0x1406, 0, p)
    F("glNormalPointer", c_uint, c_int, c_void_p)(0x1406, 0, n)
    enable_array(0x8074)
    enable_array(0x8075)
    new(1, 0x1300)
    F("glDrawArrays", c_uint, c_int, c_int)(TRIANGLES, 0, 3)
    done()
    call(1)
    begin(TRIANGLES)
    vertex(-0.5, -0.5, 0)
    vertex(1, -0.5, 0)
    vertex(0, 1, 0)
    end()


def strips_that_restart_within_a_list():
    start()
    new, done, call, generate = lists()
    p, q = (c_float * 24)(), (c_float * 32)()
    for k in range(8):
        p[3 * k : 3 * k + 2] = -1.2 + 0.6 * (k % 4), -1 + 0.7 * (k // 4 + k % 2)
        q[4 * k : 4 * k + 4] = k % 3 / 2, 0.5, k // 4, 1
    F("glVertexPointer", c_int, c_uint, c_int, c_void_p)(3, 0x1406, 0, p)
    F("glColorPointer", c_int, c_uint, c_int, c_void_p)(4, 0x1406, 0, q)
    enable_array(0x8074)
    enable_array(0x8076)
    enable(0x8F9D)
    F("glPrimitiveRestartIndex", c_uint)(99)
    new(1, 0x1300)
    F("glDrawElements", c_uint, c_int, c_uint, c_void_p)(STRIP, 9, 0x1403, (c.c_uint16 * 9)(0, 1, 2, 3, 99, 4, 5, 6, 7))
    done()
    disable(0x8F9D)
    call(1)


def picture(name, shade):
    F("glBindTexture", c_uint, c_uint)(0x0DE1, name)
    texels = (c.c_uint8 * 64)(*(v for i in range(16) for v in (shade, 17 * i, 255 - shade, 255)))
    F("glTexImage2D", c_uint, c_int, c_int, c_int, c_int, c_int, c_uint, c_uint, c_void_p)(0x0DE1, 0, 0x1908, 4, 4, 0, 0x1908, 0x1401, texels)
    for what in (0x2800, 0x2801):
        F("glTexParameteri", c_uint, c_uint, c_int)(0x0DE1, what, 0x2600)


def textured(x, y=-0.5):
    begin(QUADS)
    for u, v in ((0, 0), (1, 0), (1, 1), (0, 1)):
        F("glTexCoord2f", c_float, c_float)(u, v)
        normal(0, 0, 1)
        vertex(x + u, y + v, 0)
    end()


def a_second_texture_is_bound_right_after_a_draw_with_the_first():
    simple()
    picture(1, 255)
    picture(2, 0)
    enable(0x0DE1)
    color(1, 1, 1, 1)
    F("glBindTexture", c_uint, c_uint)(0x0DE1, 1)
    textured(-1.2)
    for turn in (5, 0, 0):
        rotate(turn, 1, 0, 0)
    F("glBindTexture", c_uint, c_uint)(0x0DE1, 2)
    textured(0.1)
    # A texture may be replaced after a draw has used it.
    picture(2, 128)
    textured(-0.5, -1.5)


def things_around_the_viewer():
    """Most of the geometry is behind the viewer or outside the view."""
    start(perspective=True)
    lit()
    for k in range(12):
        F("glPushMatrix")()
        rotate(30 * k, 0, 1, 0)
        translate(0, 0, -4)
        bump(4)
        F("glPopMatrix")()


def masks_that_tell_front_from_back():
    simple()
    enable(0x0B90)
    separate = F("glStencilOpSeparate", *[c_uint] * 4)
    separate(0x0404, 0x1E00, 0x1E00, 0x1E02)
    separate(0x0405, 0x1E00, 0x1E00, 0x1E03)
    F("glStencilFunc", c_uint, c_int, c_uint)(0x0207, 0, 255)
    bump()
    F("glStencilFunc", c_uint, c_int, c_uint)(0x0202, 0, 255)
    separate(0x0408, 0x1E00, 0x1E00, 0x1E00)
    F("glLoadIdentity")()
    color(1, 1, 0, 1)
    begin(QUADS)
    corners()
    end()


def textures_of_few_components():
    """Luminance, intensity and red of several sizes: components that are not stored do not enter the texture environment."""
    simple()
    enable(0x0DE1)
    F("glTexEnvi", c_uint, c_uint, c_int)(0x2300, 0x2200, 0x1E01)
    upload = F("glTexImage2D", c_uint, c_int, c_int, c_int, c_int, c_int, c_uint, c_uint, c_void_p)
    texels = (c.c_uint8 * 64)(*(v for i in range(16) for v in (250 - 8 * i, 17 * i, 90, 60 + 10 * i)))
    for k, inner in enumerate((0x9015, 0x9016, 0x9017, 0x8229, 0x822B, 0x881E, 0x881F, 0x8C47, 0x8C3A)):
        F("glBindTexture", c_uint, c_uint)(0x0DE1, k + 1)
        upload(0x0DE1, 0, inner, 4, 4, 0, 0x1908, 0x1401, texels)
        for what in (0x2800, 0x2801):
            F("glTexParameteri", c_uint, c_uint, c_int)(0x0DE1, what, 0x2600)
        color(0.2, 0.5, 0.9, 1)
        F("glPushMatrix")()
        scale(0.7, 0.7, 0.7)
        textured(k % 3 * 1.2 - 1.8, k // 3 * 1.2 - 1.8)
        F("glPopMatrix")()


def fog_by_distance():
    """`GL_NV_fog_distance`: passed to the driver with this reason."""
    simple(perspective=True)
    enable(0x0B60)
    F("glFogi", c_uint, c_int)(0x855A, 0x855B)
    F("glFogi", c_uint, c_int)(0x0B65, 0x2601)
    F("glFogf", c_uint, c_float)(0x0B63, 1)
    F("glFogf", c_uint, c_float)(0x0B64, 3)
    bump()


def an_alpha_test_for_equality():
    """Eight bits may miss the alpha reference: passed to the driver with this reason."""
    start()
    enable(0x0BC0)
    F("glAlphaFunc", c_uint, c_float)(0x0202, 0.4)
    for k, a in enumerate((0.4, 0.6)):
        begin(TRIANGLES)
        for x, y in ((-1, -1), (1, -1), (0, 1)):
            color(1, k, 0, a)
            vertex(x + 0.4 * k, y, 0.1 * k)
        end()


def mipmaps_in_views_of_odd_heights():
    """Mipmap footprints are computed from two by two pixels of the window, regardless of the view: each level has its own colour."""
    start()
    F("glTexEnvi", c_uint, c_uint, c_int)(0x2300, 0x2200, 0x1E01)
    enable(0x0DE1)
    upload = F("glTexImage2D", c_uint, c_int, c_int, c_int, c_int, c_int, c_uint, c_uint, c_void_p)
    F("glBindTexture", c_uint, c_uint)(0x0DE1, 1)
    for level in range(8):
        n = 128 >> level
        shade = bytes((255 * (level & 1), 255 * (level >> 1 & 1), 255 * (level >> 2), 255))
        upload(0x0DE1, level, 0x1908, n, n, 0, 0x1908, 0x1401, c.c_char_p(shade * (n * n)))
    F("glTexParameteri", c_uint, c_uint, c_int)(0x0DE1, 0x2801, 0x2700)
    lit()
    F("glTexParameteri", c_uint, c_uint, c_int)(0x0DE1, 0x2800, 0x2600)
    for y, h in ((0, 31), (31, 30), (61, 67)):
        F("glViewport", *[c_int] * 4)(0, y, W, h)
        mode(0x1701)
        identity()
        frustum(-1, 1, -1, 1, 1, 40)
        mode(0x1700)
        identity()
        translate(0, 0, -2)
        begin(QUADS)
        for u, x in ((0, -1.9), (2, 1.9)):
            for v in (0, 9) if u == 0 else (9, 0):
                F("glTexCoord2f", c_float, c_float)(u, v)
                vertex(x, -0.9 + 0.19 * v, -2.3 * v)
        end()


def colour_material_with_the_same_colour_again():
    """As OpenSceneGraph begins its frames: a material while colour material is off, then the previous colour."""
    for turn in range(3):
        start()
        lit()
        F("glLightModelfv", c_uint, c_void_p)(0x0B53, (c_float * 4)(0.9, 0.9, 0.9, 1))
        color(0.4, 0.4, 0.4, 1)
        p = (c_float * 12)(-1, -1, 0, 1, -1, 0.2, 1, 1, 0, -1, 1, 0.3)
        normal(0, 0.3, 0.9)
        F("glVertexPointer", c_int, c_uint, c_int, c_void_p)(3, 0x1406, 0, p)
        enable_array(0x8074)
        F("glDrawArrays", c_uint, c_int, c_int)(QUADS, 0, 4)
        if turn < 2:
            F("glFinish")()
            F("glReadPixels", c_int, c_int, c_int, c_int, c_uint, c_uint, c_void_p)(0, 0, 1, 1, 0x1908, 0x1401, (c.c_uint8 * 4)())
        disable(0x0B57)
        color(0.4, 0.4, 0.4, 1)
        F("glMaterialfv", c_uint, c_uint, c_void_p)(0x0408, 0x1200, (c_float * 4)(0.05, 0.1, 0.2, 1))


def colour_material_after_a_material_that_nobody_has_drawn_with():
    """As OpenSceneGraph passes from frame to frame: Mesa delays the last material, and writes it over what colour material sets in the next frame."""
    start()
    p = (c_float * 12)(-1, -1, 0, 1, -1, 0.2, 1, 1, 0, -1, 1, 0.3)
    new, done, call, _ = lists()
    new(1, 0x1300)
    normal(0, 0.3, 0.9)
    F("glVertexPointer", c_int, c_uint, c_int, c_void_p)(3, 0x1406, 0, p)
    enable_array(0x8074)
    F("glDrawArrays", c_uint, c_int, c_int)(QUADS, 0, 4)
    done()
    material = F("glMaterialfv", c_uint, c_uint, c_void_p)
    model = F("glLightModelfv", c_uint, c_void_p)
    for turn in range(3):
        clear(0x4100)
        F("glLightfv", c_uint, c_uint, c_void_p)(0x4000, 0x1203, (c_float * 4)(0, 0, 1, 0))
        enable(0x0B50)
        enable(0x4000)
        F("glColorMaterial", c_uint, c_uint)(0x0408, 0x1602)
        enable(0x0B57)
        color(0.5, 0.5, 0.5, 1)
        material(0x0408, 0x1600, (c_float * 4)(0.1, 0, 0, 1))
        model(0x0B53, (c_float * 4)(0.4, 0.4, 0.4, 1))
        call(1)
        disable(0x0B57)
        color(0.5, 0.5, 0.5, 1)
        material(0x0408, 0x1200, (c_float * 4)(0.05, 0.1, 0.9, 1))
        model(0x0B53, (c_float * 4)(0.2, 0.2, 0.2, 1))
        if turn < 2:
            F("glReadPixels", c_int, c_int, c_int, c_int, c_uint, c_uint, c_void_p)(0, 0, 1, 1, 0x1908, 0x1401, (c.c_uint8 * 4)())


def pixels_that_are_scaled_while_surfaces_wait():
    """Pixmap fonts (FTGL) set the scales of red, green and blue to 0; then a bitmap makes gluray show what was traced."""
    start()
    lit()
    bump()
    color(0, 0, 0, 1)
    F("glRasterPos3f", c_float, c_float, c_float)(-1, 1.2, 0)
    F("glPushAttrib", c_uint)(0x6028)
    for scale_of in (0x0D14, 0x0D18, 0x0D1A):
        F("glPixelTransferf", c_uint, c_float)(scale_of, 0)
    F("glPixelTransferi", c_uint, c_int)(0x0D10, 0)
    F("glDrawPixels", c_int, c_int, c_uint, c_uint, c_void_p)(8, 4, 0x190A, 0x1401, bytes([255, 200] * 32))
    F("glPopAttrib")()


def names_of_lists_are_small():
    """Programs count their lists (Survex's aven has space for a thousand); with state between primitives, gluray needs lists of its own."""
    start()
    new, done, call, generate = lists()
    deleted = F("glDeleteLists", c_uint, c_int)
    names = []
    for k in range(4):
        names.append(generate(1 + k))
        new(names[-1], 0x1300)
        for turn in range(3):
            F("glFrontFace", c_uint)(0x0901)
            # Allocated while another is compiled.
            color(names[-1] / 20, (generate(2) % 7) / 7, turn / 3, 1)
            begin(TRIANGLES)
            for x, y in ((-0.3, -0.3), (0.3, -0.3), (0, 0.4)):
                vertex(x + 0.2 * turn, y + 0.1 * turn, 0.1 * turn)
            end()
        done()
    assert max(names) < 40, names
    deleted(names[1], 1)
    names[1] = generate(1)
    for k, name in enumerate(names):
        F("glPushMatrix")()
        translate(0.9 * (k % 2) - 0.6, 0.9 * (k // 2) - 0.6, 0.02 * name)
        call(name)
        F("glPopMatrix")()


def elements_of_arrays_in_a_list():
    """`glArrayElement` between Begin and End of a list (R's rgl): the arrays are read when the list is compiled."""
    simple()
    n = 24
    points, normals, colors = [], [], []
    for k in range(n + 1):
        a = 6.2831853 * k / n
        for r in (0.5, 1.1):
            points += [r * cos(a), r * sin(a), 0.3 * r]
            normals += [0.3 * cos(a), 0.3 * sin(a), 0.9]
            colors += [k / n, r - 0.4, 1 - k / n, 1]
    p, q, r = ((c_float * len(v))(*v) for v in (points, normals, colors))
    pointer = F("glVertexPointer", c_int, c_uint, c_int, c_void_p)
    pointer(3, 0x1406, 0, p)
    F("glNormalPointer", c_uint, c_int, c_void_p)(0x1406, 0, q)
    F("glColorPointer", c_int, c_uint, c_int, c_void_p)(4, 0x1406, 0, r)
    for array in (0x8074, 0x8075, 0x8076):
        enable_array(array)
    new, done, call, _ = lists()
    element = F("glArrayElement", c_int)
    new(5, 0x1300)
    begin(5)
    for i in range(2 * n + 2):
        element(i)
    end()
    done()
    for i in range(len(p)):
        p[i] = 0
    call(5)
    translate(0, 0, 0.5)
    scale(0.4, 0.4, 0.4)
    # The same in immediate mode.
    for i in range(len(points)):
        p[i] = points[i]
    begin(5)
    for i in range(2 * n + 2):
        element(i)
    end()


def a_framebuffer_object_and_then_the_window():
    """Rows of the window are flipped for the driver, those of a framebuffer object are not; between them only colours are cleared."""
    start()
    disable(0x0B71)
    for name in ("glGenFramebuffers", "glGenTextures"):
        F(name, c_int, c_void_p)(1, (c_uint * 1)())
    bind = F("glBindFramebuffer", c_uint, c_uint)
    for turn in range(2):
        bind(0x8D40, 1)
        F("glBindTexture", c_uint, c_uint)(0x0DE1, 1)
        F("glTexImage2D", c_uint, c_int, c_int, c_int, c_int, c_int, c_uint, c_uint, c_void_p)(0x0DE1, 0, 0x1908, W, H, 0, 0x1908, 0x1401, None)
        F("glTexParameteri", c_uint, c_uint, c_int)(0x0DE1, 0x2801, 0x2600)
        F("glFramebufferTexture2D", *[c_uint] * 4, c_int)(0x8D40, 0x8CE0, 0x0DE1, 1, 0)
        assert F("glCheckFramebufferStatus", c_uint)(0x8D40) == 0x8CD5
        clear(0x4000)
        color(1, turn, 0.2, 1)
        begin(POLYGON)
        for x, y in ((-1.2, -1.2), (0.1, -1.2), (-0.9, 0.1)):
            vertex(x + turn, y, 0)
        end()
        bind(0x8D40, 0)
        if turn == 0:
            clear(0x4000)
        # The same rectangle of pixels.
        color(0.3, turn, 1, 1)
        begin(POLYGON)
        for x, y in ((-1.2, -1.2), (0.1, -1.2), (-0.9, 0.1)):
            vertex(x + turn, y, 0)
        end()
    enable(0x0DE1)
    F("glTexEnvi", c_uint, c_uint, c_int)(0x2300, 0x2200, 0x1E01)
    textured(-0.2, 0.4)


run(globals())
