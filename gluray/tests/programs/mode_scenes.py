"""Scenes that the modes beyond `match` change."""
from gl_by_ctypes import *


def box(at, size):
    """A box with normals, counter-clockwise from outside."""
    begin(QUADS)
    for axis in range(3):
        for sign in (-1, 1):
            n = [0, 0, 0]
            n[axis] = sign
            normal(*n)
            for u, v in ((-1, -1), (1, -1), (1, 1), (-1, 1))[::sign]:
                p = [0, 0, 0]
                p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3] = sign, u, v
                vertex(*[a + size * b for a, b in zip(at, p)])
    end()


def floor():
    begin(QUADS)
    normal(0, 1, 0)
    for x, z in ((-3, 1.5), (3, 1.5), (3, -4.5), (-3, -4.5)):
        vertex(x, -0.7, z)
    end()


def scene(parallel):
    start(perspective=not parallel)
    lit()
    rotate(20, 1, 0, 0)
    F("glLightfv", c_uint, c_uint, c_void_p)(0x4000, 0x1203, (c_float * 4)(-0.8, 1, 0.4, 0))
    F("glMaterialfv", c_uint, c_uint, c_void_p)(0x0408, 0x1202, (c_float * 4)(0, 0, 0, 1))
    color(0.5, 0.5, 0.5, 1)
    floor()
    color(0.9, 0.1, 0.1, 1)
    box((0, -0.25, -0.6), 0.45)


def box_on_floor():
    """A red box on a grey floor, seen from slightly above; light from the upper left."""
    scene(False)


def box_on_floor_parallel():
    scene(True)


def box_in_fog():
    """The same in blue fog."""
    enable(0x0B60)
    F("glFogi", c_uint, c_int)(0x0B65, 0x2601)
    F("glFogf", c_uint, c_float)(0x0B63, 0.5)
    F("glFogf", c_uint, c_float)(0x0B64, 5)
    F("glFogfv", c_uint, c_void_p)(0x0B66, (c_float * 4)(0.2, 0.4, 1, 1))
    scene(False)


def sheets_blended_in_the_wrong_order():
    """Two translucent sheets, the near one first: OpenGL's blending then loses the far one."""
    start()
    enable(0x0BE2)
    F("glBlendFunc", c_uint, c_uint)(0x0302, 0x0303)
    for z, rgba in ((0.5, (1, 0, 0, 0.5)), (-0.5, (0, 1, 0, 0.5))):
        color(*rgba)
        begin(QUADS)
        for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
            vertex(x, y, z)
        end()


def samples_of_silhouettes():
    """Unlit boards of many directions in a framebuffer with four samples per pixel: only silhouettes distinguish the modes from the driver."""
    start(perspective=True)
    for k in range(14):
        F("glPushMatrix")()
        rotate(25.7 * k, 0.1, 0.2, 1)
        translate(0.15 * (k % 3), 0.1, -0.12 * k)
        color((k % 3) / 2, (k % 5) / 4, (k % 2), 1)
        begin(TRIANGLES)
        for x, y in ((0.1, -0.08), (1.4, 0.02), (0.1, 0.15)):
            vertex(x, y, 0.02 * k)
        end()
        F("glPopMatrix")()


def glsl(vertex_text, fragment_text, names):
    program = F("glCreateProgram")()
    for kind, text in ((0x8B31, vertex_text), (0x8B30, fragment_text)):
        shader = F("glCreateShader", c_uint)(kind)
        F("glShaderSource", c_uint, c_int, c_void_p, c_void_p)(shader, 1, c.byref(c.c_char_p(text.encode())), None)
        F("glCompileShader", c_uint)(shader)
        F("glAttachShader", c_uint, c_uint)(program, shader)
    for i, name in enumerate(names):
        F("glBindAttribLocation", c_uint, c_uint, c.c_char_p)(program, i, name.encode())
    F("glLinkProgram", c_uint)(program)
    ok = c_int()
    F("glGetProgramiv", c_uint, c_uint, c_void_p)(program, 0x8B82, c.byref(ok))
    assert ok.value
    F("glUseProgram", c_uint)(program)
    return program


def buffer(values):
    name = c_uint()
    F("glGenBuffers", c_int, c_void_p)(1, c.byref(name))
    F("glBindBuffer", c_uint, c_uint)(0x8892, name.value)
    F("glBufferData", c_uint, c.c_ssize_t, c_void_p, c_uint)(0x8892, 4 * len(values), (c_float * len(values))(*values), 0x88E4)
    return name.value


def corner_by_shader(vertex_text):
    """Three walls of a corner with a custom program, and a pillar in it."""
    start(perspective=True)
    points, normals = [], []

    def quad(p, u, v, n, cells=6):
        at = lambda i, j: [p[k] + u[k] * i / cells + v[k] * j / cells for k in range(3)]
        for i in range(cells):
            for j in range(cells):
                for a, b in ((i, j), (i + 1, j), (i + 1, j + 1), (i, j), (i + 1, j + 1), (i, j + 1)):
                    points.extend(at(a, b))
                    normals.extend(n)

    quad((-1, -1, -0.6), (2, 0, 0), (0, 2, 0), (0, 0, 1))
    quad((-1, -1, -0.6), (0, 0, 1.5), (2, 0, 0), (0, 1, 0))
    quad((-1, -1, -0.6), (0, 2, 0), (0, 0, 1.5), (1, 0, 0))
    quad((0.1, -1, 0), (0.3, 0, 0), (0, 1.2, 0), (0, 0, 1))
    fragment = "#version 120\nvarying vec3 n;\nvoid main() { gl_FragColor = vec4(0.5 + 0.4 * normalize(n), 1.0); }\n"
    program = glsl(vertex_text, fragment, ("place", "up"))
    model_view, projection = (c_float * 16)(), (c_float * 16)()
    F("glGetFloatv", c_uint, c_void_p)(0x0BA6, model_view)
    F("glGetFloatv", c_uint, c_void_p)(0x0BA7, projection)
    for name, m in (("view", model_view), ("lens", projection)):
        at = F("glGetUniformLocation", c_uint, c.c_char_p)(program, name.encode())
        F("glUniformMatrix4fv", c_int, c_int, c_int, c_void_p)(at, 1, 0, m)
    for i, values in enumerate((points, normals)):
        buffer(values)
        F("glVertexAttribPointer", c_uint, c_int, c_uint, c_int, c_int, c_void_p)(i, 3, 0x1406, 0, 0, None)
        F("glEnableVertexAttribArray", c_uint)(i)
    F("glDrawArrays", c_uint, c_int, c_int)(TRIANGLES, 0, len(points) // 3)
    F("glUseProgram", c_uint)(0)
    F("glBindBuffer", c_uint, c_uint)(0x8892, 0)


HEAD = "#version 120\nuniform mat4 view, lens;\nattribute vec3 place, up;\nvarying vec3 n;\n"


def shader_of_ones_own():
    corner_by_shader(HEAD + "void main() { n = up; gl_Position = lens * (view * vec4(place, 1.0)); }\n")


def shader_that_bends():
    corner_by_shader(HEAD + "void main() { n = up; vec3 p = place; p.y += 0.1 * sin(5.0 * p.x); gl_Position = lens * (view * vec4(p, 1.0)); }\n")


def lists_over_several_frames():
    """A list that is compiled once and drawn in three frames, with a colour that is set once."""
    simple()
    lists = F("glGenLists", c_int)(1)
    F("glNewList", c_uint, c_uint)(lists, 0x1300)
    bump()
    F("glEndList")()
    for _ in range(3):
        clear(0x4100)
        F("glCallList", c_uint)(lists)
        begin(TRIANGLES)
        for x, y in ((-1.4, -1.4), (-0.8, -1.4), (-1.4, -0.8)):
            vertex(x, y, 0)
        end()
        GL.glXSwapBuffers(dpy, c_ulong(w0))
    clear(0x4100)
    F("glCallList", c_uint)(lists)
