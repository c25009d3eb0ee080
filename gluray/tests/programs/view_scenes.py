"""Views, normals, quads and lists as programs have them that nobody looked at before."""
from gl_by_ctypes import *
from mode_scenes import scene

ENABLED = {"smooth_lines": 0x0B20, "smooth_points": 0x0B10, "stippled_lines": 0x0B24, "offset": 0x8037, "offset_lines": 0x2A02}
color_material = F("glColorMaterial", c_uint, c_uint)
SIDES, SPECULAR, AMBIENT_AND_DIFFUSE = 0x0408, 0x1202, 0x1602


def dome(n=16, length=1):
    """Half a sphere without colours of its own, with normals of a length."""
    from math import cos, pi, sin

    for i in range(n):
        begin(STRIP)
        for j in range(2 * n + 1):
            for k in (0, 1):
                t, p = pi * (i + k) / n / 2, pi * j / n
                x, y, z = sin(t) * cos(p), sin(t) * sin(p), cos(t)
                normal(length * x, length * y, length * z)
                vertex(x, y, z)
        end()


def colours_of_two_materials():
    """OpenDX's order: one colour for highlights, another for the rest. In a list, Mesa keeps the first material."""
    color_material(SIDES, SPECULAR)
    color(0.5, 0.5, 0.5, 1)
    color_material(SIDES, AMBIENT_AND_DIFFUSE)
    color(1, 0.42, 0, 1)
    dome()


def lit_white():
    start()
    lit()
    F("glMaterialfv", c_uint, c_uint, c_void_p)(SIDES, SPECULAR, (c_float * 4)(1, 1, 1, 1))


def listed(draw, execute):
    F("glNewList", c_uint, c_uint)(7, 0x1301 if execute else 0x1300)
    draw()
    F("glEndList")()
    if not execute:
        F("glCallList", c_uint)(7)


def colour_material_twice():
    lit_white()
    colours_of_two_materials()


def colour_material_twice_in_a_list():
    lit_white()
    listed(colours_of_two_materials, False)


def colour_material_twice_in_a_list_that_is_executed():
    lit_white()
    listed(colours_of_two_materials, True)


def material_before_colour_material_in_a_list():
    """The same with a material and a normal between changes of state."""

    def draw():
        color_material(SIDES, SPECULAR)
        normal(0, 0, 1)
        F("glMaterialf", c_uint, c_uint, c_float)(SIDES, 0x1601, 3)
        color(0.2, 0.9, 0.2, 1)
        color_material(SIDES, AMBIENT_AND_DIFFUSE)
        F("glMaterialfv", c_uint, c_uint, c_void_p)(SIDES, 0x1600, (c_float * 4)(0, 0, 0.5, 1))
        dome()

    lit_white()
    listed(draw, False)


def deep(near, far):
    start()
    lit()
    mode(0x1701)
    identity()
    ortho(-1.5, 1.5, -1.5, 1.5, near, far)
    mode(0x1700)
    rotate(40, 1, 0.3, 0.2)
    color(0.9, 0.6, 0.2, 1)
    dome(40)


def near_plane_far_in_front():
    """Depths from -100,000 to 100,000 for a scene of size one: rays may not start at the near plane."""
    deep(-1e5, 1e5)


def near_plane_somewhat_in_front():
    deep(-90, 110)


def far_plane_far_behind():
    deep(-2, 1e6)


def viewed_from_behind():
    """`box_on_floor_parallel` by a program that turns the z axis over twice, in the projection and in the model-view."""
    import mode_scenes

    before = mode_scenes.start

    def begin_scene(perspective=False):
        before(perspective=perspective)
        mode(0x1701)
        scale(1, 1, -1)
        mode(0x1700)
        scale(1, 1, -1)

    mode_scenes.start = begin_scene
    scene(True)


def quads(*caps, two_sided=False, arrays=False):
    """Quads that bend, with colours that show the diagonal."""
    start()
    rotate(30, 1, 0.4, 0.1)
    for cap in caps:
        enable(ENABLED[cap])
    F("glPolygonOffset", c_float, c_float)(1, 1)
    if two_sided:
        lit()
        F("glLightModeli", c_uint, c_int)(0x0B52, 1)
    points, colours = [], []
    for i in range(4):
        for j in range(4):
            for a, b in ((0, 0), (1, 0), (1, 1), (0, 1)):
                x, y = (i + a) / 2 - 1, (j + b) / 2 - 1
                points += (x, y, 0.2 * ((i + j + a + b) % 2))
                colours += (1, 0.2, 0.2, 1) if (a + b) % 2 else (0.2, 1, 0.3, 1)
    normal(0, 0, 1)
    if arrays:
        p, c4 = (c_float * len(points))(*points), (c_float * len(colours))(*colours)
        F("glVertexPointer", c_int, c_uint, c_int, c_void_p)(3, 0x1406, 0, p)
        F("glColorPointer", c_int, c_uint, c_int, c_void_p)(4, 0x1406, 0, c4)
        enable_array(0x8074)
        enable_array(0x8076)
        F("glDrawArrays", c_uint, c_int, c_int)(QUADS, 0, len(points) // 3)
        return
    begin(QUADS)
    for k in range(len(points) // 3):
        color(*colours[4 * k : 4 * k + 4])
        vertex(*points[3 * k : 3 * k + 3])
    end()


def quads_with_smooth_lines():
    quads("smooth_lines")


def quads_with_smooth_lines_and_offset():
    quads("smooth_lines", "offset")


def quads_by_arrays_with_smooth_points_and_offset():
    quads("smooth_points", "offset", arrays=True)


def quads_with_stippled_and_offset_lines():
    F("glLineStipple", c_int, c_uint)(1, 0x0F0F)
    quads("stippled_lines", "offset_lines")


def quads_with_unbroken_stippled_lines_and_offset():
    quads("stippled_lines", "offset")


def quads_of_two_sides_with_smooth_lines():
    quads("smooth_lines", two_sided=True)


def quads_of_two_sides():
    quads(two_sided=True)


def normals(length, shrink=1, rescale=False):
    start()
    lit()
    if rescale:
        enable(0x803A)
    # Flat facets would be the same in all modes; a fine dome is, but for its highlights.
    F("glMaterialfv", c_uint, c_uint, c_void_p)(SIDES, SPECULAR, (c_float * 4)(0, 0, 0, 1))
    F("glLightfv", c_uint, c_uint, c_void_p)(0x4000, 0x1203, (c_float * 4)(0.3, 0.4, 1, 0))
    scale(1 / shrink, 1 / shrink, 1 / shrink)
    color(0.4, 0.5, 0.3, 1)
    dome(48, length)


def normals_of_length_two():
    normals(2)


def normals_of_half_length():
    normals(0.5)


def normals_under_a_scale():
    normals(0.6, 1.4)


def equal_depths_after_the_driver():
    """The driver draws a stippled dome, then the same dome is coloured where depth is equal, as in OpenCSG's last pass."""
    start()
    rotate(40, 1, 0.3, 0.2)
    enable(0x0B42)
    color(0.2, 0.2, 0.8, 1)
    dome()
    disable(0x0B42)
    F("glDepthFunc", c_uint)(0x0202)
    color(0.9, 0.7, 0.1, 1)
    dome()
