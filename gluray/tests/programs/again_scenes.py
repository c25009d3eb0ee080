"""Frames that repeat, and frames in which one thing has changed: `again_scenes.py GROUP OUT`.

Each case of a group draws its frame twice, makes its change, and draws it once more. OUT contains colour and depth of the second and the third
frame, case by case."""
from texture_scenes import *

from mode_scenes import glsl

floats = lambda *v: (c_float * len(v))(*v)
light = F("glLightfv", c_uint, c_uint, c_void_p)
material = F("glMaterialfv", c_uint, c_uint, c_void_p)
bind_buffer = F("glBindBuffer", c_uint, c_uint)
data = F("glBufferData", c_uint, c.c_ssize_t, c_void_p, c_uint)
part_of_data = F("glBufferSubData", c_uint, c.c_ssize_t, c.c_ssize_t, c_void_p)
viewport = F("glViewport", *[c_int] * 4)
ARRAY = 0x8892


def sheet(bend):
    """A small sheet of triangles, positions and normals one after the other."""
    at = lambda i, j: (-1.3 + 0.25 * i, -1.3 + 0.25 * j, bend * (i - 2) * (j - 2) / 9)
    corners = [(i + di, j + dj) for i in range(4) for j in range(4) for di, dj in ((0, 0), (1, 0), (1, 1), (0, 0), (1, 1), (0, 1))]
    positions = [v for p in corners for v in at(*p)]
    normals = [v for i, j in corners for v in (-0.4 * (j - 2) * bend, -0.4 * (i - 2) * bend, 1)]
    return positions, normals


class Scene:
    """One object of each kind: a buffer object, a client array, a display list, immediate mode, a texture, a custom shader."""

    def __init__(self):
        self.positions, self.normals = sheet(1.0)
        self.vertices = len(self.positions) // 3
        self.buffer, self.list, self.texture = 3, 5, 7
        bind_buffer(ARRAY, self.buffer)
        both = floats(*self.positions, *self.normals)
        data(ARRAY, c.sizeof(both), both, 0x88E8)
        bind_buffer(ARRAY, 0)
        self.array = floats(*[v + (0.0, 1.4, 0.0)[k % 3] for k, v in enumerate(self.positions)])
        self.array_normals = floats(*self.normals)
        self.compile_list(0.5)
        bind_texture(TEXTURE_2D, self.texture)
        image(TEXTURE_2D, 0, RGBA, 8, 8, 0, RGBA, BYTES, texels(8, 8, 3))
        parameter(TEXTURE_2D, MIN, 0x2600)
        parameter(TEXTURE_2D, MAG, 0x2600)
        self.program = glsl(
            "#version 120\nvoid main() { gl_Position = ftransform(); }\n",
            "#version 120\nuniform vec4 shade;\nvoid main() { gl_FragColor = shade; }\n",
            (),
        )
        F("glUseProgram", c_uint)(0)
        self.shade = (0.9, 0.2, 0.1, 1)
        self.height, self.normal, self.color = 0.3, (0, 0.3, 1), (0.6, 0.8, 0.3, 1)
        self.back = (0.1, 0.1, 0.2, 1)
        self.view, self.cut, self.tilt = (0, 0, W, H), (0, 0, W, H), 25
        self.between = lambda: None
        self.count = self.vertices
        self.shade_of_sheet = (0.1, 0.2, 0.9, 0.5)
        light(0x4000, 0x1203, floats(0.5, 0.7, 1, 0))

    def compile_list(self, size):
        F("glNewList", c_uint, c_uint)(self.list, 0x1300)
        begin(TRIANGLES)
        normal(0.2, 0.1, 1)
        # Clockwise, unlike all others.
        for x, y in ((0.4, -1.2), (0.4, -1.2 + size), (0.4 + size, -1.2)):
            vertex(x, y, 0.2)
        end()
        F("glEndList")()

    def draw_with_program(self):
        """A draw by the driver in the middle of the frame."""
        F("glUseProgram", c_uint)(self.program)
        F("glUniform4f", c_int, *[c_float] * 4)(F("glGetUniformLocation", c_uint, c.c_char_p)(self.program, b"shade"), *self.shade)
        begin(TRIANGLES)
        for x, y in ((1.1, 1.3), (0.7, 1.3), (0.9, 0.9)):
            vertex(x, y, 0)
        end()
        F("glUseProgram", c_uint)(0)

    def frame(self):
        F("glClearColor", *[c_float] * 4)(*self.back)
        F("glScissor", *[c_int] * 4)(0, 0, W, H)
        clear(0x4100)
        F("glScissor", *[c_int] * 4)(*self.cut)
        viewport(*self.view)
        mode(0x1701)
        identity()
        ortho(-1.5, 1.5, -1.5, 1.5, -10, 10)
        mode(0x1700)
        identity()
        rotate(self.tilt, 1, 0.4, 0)
        color(*self.color)
        for bound, positions, normals in (
            (self.buffer, 0, 4 * 3 * self.vertices),
            (0, self.array, self.array_normals),
        ):
            bind_buffer(ARRAY, bound)
            F("glVertexPointer", c_int, c_uint, c_int, c_void_p)(3, 0x1406, 0, positions)
            F("glNormalPointer", c_uint, c_int, c_void_p)(0x1406, 0, normals)
            enable_array(0x8074)
            enable_array(0x8075)
            F("glDrawArrays", c_uint, c_int, c_int)(TRIANGLES, 0, self.count)
            disable_array(0x8075)
            disable_array(0x8074)
        bind_buffer(ARRAY, 0)
        F("glCallList", c_uint)(self.list)
        self.between()
        if sys.argv[1] == "AGAIN":
            self.draw_with_program()
        normal(*self.normal)
        color(0.9, 0.5, 0.4, 1)
        begin(TRIANGLES)
        for x, y in ((-0.1, -1.3), (1.3, -0.4), (-0.1, self.height)):
            vertex(x, y, -0.1)
        end()
        enable(TEXTURE_2D)
        bind_texture(TEXTURE_2D, self.texture)
        color(1, 1, 1, 1)
        normal(0, 0, 1)
        square(0.2, 0.4, 1.3, 1.3, -0.3)
        disable(TEXTURE_2D)


def texels_in_part(s):
    part(TEXTURE_2D, 0, 2, 2, 4, 4, RGBA, BYTES, texels(4, 4, 9))


def texels_from_the_window(s):
    F("glCopyTexSubImage2D", c_uint, *[c_int] * 7)(TEXTURE_2D, 0, 0, 0, 20, 20, 6, 6)


def texture_filter(s):
    parameter(TEXTURE_2D, MAG, 0x2601)


def texture_bound(s):
    s.texture = 8
    bind_texture(TEXTURE_2D, 8)
    image(TEXTURE_2D, 0, RGBA, 4, 4, 0, RGBA, BYTES, texels(4, 4, 5))
    parameter(TEXTURE_2D, MIN, 0x2600)
    parameter(TEXTURE_2D, MAG, 0x2600)


def texture_environment(s):
    F("glTexEnvi", c_uint, c_uint, c_int)(0x2300, 0x2200, 0x1E01)


def texture_matrix(s):
    mode(0x1702)
    scale(2, 1, 1)
    mode(0x1700)


def light_moved(s):
    light(0x4000, 0x1203, floats(-1, 0.2, 0.6, 0))


def light_of_another_colour(s):
    light(0x4000, 0x1201, floats(0.2, 0.9, 0.5, 1))


def a_second_light(s):
    light(0x4001, 0x1201, floats(0, 0.2, 0.6, 1))
    light(0x4001, 0x1203, floats(-1, 0, 1, 0))
    enable(0x4001)


def highlights(s):
    material(0x0408, 0x1602, floats(0, 0, 0, 1))
    material(0x0408, 0x1202, floats(1, 1, 0, 1))


def light_of_the_model(s):
    F("glLightModelfv", c_uint, c_void_p)(0x0B53, floats(0.6, 0.2, 0.2, 1))


def lighting_off(s):
    disable(0x0B50)


def a_uniform(s):
    s.shade = (0.1, 0.2, 0.9, 1)


def smaller_view(s):
    s.view = (10, 5, 90, 70)


def scissors(s):
    s.cut = (20, 20, 60, 90)


def clear_colour(s):
    s.back = (0.5, 0.3, 0.1, 1)


def turned(s):
    s.tilt = 26


def depths_halved(s):
    F("glDepthRange", c_double, c_double)(0, 0.5)


def clipped(s):
    F("glClipPlane", c_uint, c_void_p)(0x3000, (c_double * 4)(1, 0.2, 0, 0.3))
    enable(0x3000)


def culled(s):
    enable(0x0B44)
    F("glCullFace", c_uint)(0x0405)
    F("glFrontFace", c_uint)(0x0900)


def flat(s):
    F("glShadeModel", c_uint)(0x1D00)


def foggy(s):
    enable(0x0B60)
    F("glFogi", c_uint, c_int)(0x0B65, 0x2601)
    F("glFogf", c_uint, c_float)(0x0B63, -1)
    F("glFogf", c_uint, c_float)(0x0B64, 2)


def buffer_in_part(s):
    bind_buffer(ARRAY, s.buffer)
    bent = floats(*sheet(-2.0)[0][:60])
    part_of_data(ARRAY, 0, c.sizeof(bent), bent)
    bind_buffer(ARRAY, 0)


def normals_of_the_buffer(s):
    bind_buffer(ARRAY, s.buffer)
    other = floats(*[v for _ in range(20) for v in (0.9, 0.1, 0.3)])
    part_of_data(ARRAY, 4 * 3 * s.vertices, c.sizeof(other), other)
    bind_buffer(ARRAY, 0)


def buffer_mapped(s):
    bind_buffer(ARRAY, s.buffer)
    GL.glMapBuffer.restype = c_void_p
    c.memmove(F("glMapBuffer", c_uint, c_uint)(ARRAY, 0x88B9), floats(*[0.0] * 54), 4 * 54)
    F("glUnmapBuffer", c_uint)(ARRAY)
    bind_buffer(ARRAY, 0)


def array_rewritten(s):
    for k in range(2, 60, 3):
        s.array[k] += 0.4
        s.array[k - 2] -= 0.1


def normals_of_the_array(s):
    for k in range(0, 60, 3):
        s.array_normals[k] = -1


def fewer_vertices(s):
    s.count -= 12


def list_compiled_anew(s):
    s.compile_list(0.9)


def a_vertex(s):
    s.height += 0.3


def a_normal(s):
    s.normal = (0.9, -0.2, 0.4)


def a_colour(s):
    s.color = (0.2, 0.3, 0.9, 1)


def lines(depth, shade):
    disable(0x0B50)
    color(*shade, 1)
    begin(1)
    for k in range(8):
        vertex(-1.4, -1.3 + 0.35 * k, depth)
        vertex(1.4, -1.2 + 0.35 * k, depth)
    end()
    enable(0x0B50)


def lines_of_the_drivers(s):
    s.between = lambda: lines(0.3, (1, 1, 0))


def blended_by_the_driver(s):
    """Draws between two parts of the frame: in the same colour in the first two frames, in another in the third."""
    s.shade_of_sheet = (0.9, 0.8, 0.1, 0.5)


def blended(s):
    enable(0x0BE2)
    F("glBlendFunc", c_uint, c_uint)(0x0302, 0x0303)
    disable(0x0B50)
    color(*s.shade_of_sheet)
    square(-1.2, -1.1, 0.6, 0.6, 0.5)
    enable(0x0B50)
    disable(0x0BE2)


def nothing(s):
    pass


# Changes after which the image differs.
CHANGES = [
    texels_in_part, texels_from_the_window, texture_filter, texture_bound, texture_environment, texture_matrix, light_moved, light_of_another_colour,
    a_second_light, highlights, light_of_the_model, lighting_off, smaller_view, scissors, turned, depths_halved, clipped, culled, flat,
    foggy, buffer_in_part, normals_of_the_buffer, buffer_mapped, array_rewritten, normals_of_the_array, fewer_vertices, list_compiled_anew, a_vertex,
    a_normal, a_colour,
]  # fmt: skip
# Cases in which the traced part is unchanged, with or without a change around it.
AGAIN = [nothing, clear_colour, a_uniform, lines_of_the_drivers, blended_by_the_driver]


def picture():
    rgba, depth = (c.c_uint8 * (W * H * 4))(), (c_float * (W * H))()
    read = F("glReadPixels", c_int, c_int, c_int, c_int, c_uint, c_uint, c_void_p)
    read(0, 0, W, H, 0x1908, 0x1401, rgba)
    read(0, 0, W, H, 0x1902, 0x1406, depth)
    return struct.pack("II", W, H) + bytes(rgba) + bytes(depth)


with open(sys.argv[2], "wb") as out:
    for change in globals()[sys.argv[1]]:
        # A context for each case, so that no change outlives it.
        current(w0, context())
        enable(0x0B71)
        enable(0x0C11)
        lit()
        scene = Scene()
        if change is blended_by_the_driver:
            scene.between = lambda s=scene: blended(s)
        scene.frame()
        GL.glXSwapBuffers(dpy, c_ulong(w0))
        scene.frame()
        out.write(picture())
        change(scene)
        scene.frame()
        out.write(picture())
        current(0, None)
