"""Surfaces and curves through evaluators, one small program each: `evaluators.py CASE OUT`, like hard_cases.py."""
from gl_by_ctypes import *

MAP1, MAP2 = 0x0D90, 0x0DB0
COLOR_4, NORMAL, TEX_1, TEX_2, TEX_3, TEX_4, VERTEX_3, VERTEX_4 = 0, 2, 3, 4, 5, 6, 7, 8
SIZES = (4, 1, 3, 1, 2, 3, 4, 3, 4)
AUTO_NORMAL = 0x0D80
POINT, LINE, FILL = 0x1B00, 0x1B01, 0x1B02
grid2, grid1 = F("glMapGrid2f", c_int, c_float, c_float, c_int, c_float, c_float), F("glMapGrid1f", c_int, c_float, c_float)
mesh2, mesh1 = F("glEvalMesh2", c_uint, *[c_int] * 4), F("glEvalMesh1", c_uint, c_int, c_int)
coord2, coord1 = F("glEvalCoord2f", c_float, c_float), F("glEvalCoord1f", c_float)
point2, point1 = F("glEvalPoint2", c_int, c_int), F("glEvalPoint1", c_int)
tex = F("glTexCoord2f", c_float, c_float)


def map2(what, rows, u=(0, 1), v=(0, 1)):
    """Sets and enables a surface, given by rows of control points."""
    n, m, size = len(rows), len(rows[0]), SIZES[what]
    values = (c_float * (n * m * size))(*(x for row in rows for p in row for x in p))
    f = F("glMap2f", c_uint, c_float, c_float, c_int, c_int, c_float, c_float, c_int, c_int, c_void_p)
    f(MAP2 + what, *u, size * m, n, *v, size, m, values)
    enable(MAP2 + what)


def map1(what, points, u=(0, 1)):
    values = (c_double * (len(points) * SIZES[what]))(*(x for p in points for x in p))
    F("glMap1d", c_uint, c_double, c_double, c_int, c_int, c_void_p)(MAP1 + what, *u, SIZES[what], len(points), values)
    enable(MAP1 + what)


def sheet(n=4, m=4, bend=1.0):
    """Control points of a sheet with hills, n by m of them."""
    at = lambda k, n: 2.2 * k / (n - 1) - 1.1
    height = lambda i, j: bend * ((i * 5 + j * 3) % 4 - 1.5) * 0.5
    return [[(at(i, n), at(j, m), height(i, j)) for j in range(m)] for i in range(n)]


def hues(n, m):
    return [[((i + 1) / n, (j + 1) / m, (i * j) % 3 / 2, 1) for j in range(m)] for i in range(n)]


def scene(**k):
    simple(**k)
    enable(AUTO_NORMAL)
    color(0.9, 0.6, 0.3, 1)
    grid2(20, 0, 1, 16, 0, 1)


def patch_with_automatic_normals():
    scene()
    map2(VERTEX_3, sheet())
    mesh2(FILL, 0, 20, 0, 16)


def patches_of_every_order():
    """Equal, unequal and minimal orders; parts of grids; domains and grids other than 0 to 1, grids that run backwards."""
    scene(perspective=True)
    scale(0.55, 0.55, 0.55)
    for k, (n, m) in enumerate(((2, 2), (2, 5), (5, 2), (3, 3), (3, 6), (6, 3), (4, 7), (8, 8), (7, 4))):
        F("glPushMatrix")()
        translate(2.2 * (k % 3 - 1), 2.2 * (k // 3 - 1), 0)
        scale(0.9, 0.9, 0.9)
        color(k / 8, 1 - k / 8, 0.5, 1)
        map2(VERTEX_3, sheet(n, m, 0.8), (-1, 3), (2, 2.5))
        grid2(10, *((3, -1) if k % 2 else (-1, 3)), 9, 2, 2.5)
        mesh2(FILL, *((0, 10, 0, 9) if k % 4 else (1, 8, 3, 9)))
        F("glPopMatrix")()


def a_map_of_normals():
    """Normals of another order than the surface, and not of unit length."""
    scene()
    disable(AUTO_NORMAL)
    map2(VERTEX_3, sheet())
    map2(NORMAL, [[(-1, -0.5, 1), (-0.5, 1, 2)], [(0.5, 0, 1), (1, 0.2, 0.5)], [(0.1, 0.1, 1), (0, -1, 1)]])
    mesh2(FILL, 0, 20, 0, 16)


def colours_by_map_without_light():
    start()
    rotate(40, 1, 0.3, 0.2)
    grid2(9, 0, 1, 11, 0, 1)
    color(1, 1, 1, 1)
    map2(VERTEX_3, sheet())
    map2(COLOR_4, hues(3, 4))
    mesh2(FILL, 0, 9, 0, 11)
    # The current values are unchanged.
    begin(TRIANGLES)
    for x, y in ((-1.4, -1.4), (-0.9, -1.4), (-1.1, -0.9)):
        vertex(x, y, 1)
    end()


def colours_by_map_as_material():
    scene()
    map2(VERTEX_3, sheet())
    map2(COLOR_4, hues(2, 5))
    mesh2(FILL, 0, 20, 0, 16)
    disable(MAP2 + COLOR_4)
    # Evaluation must not change the current values, but Mesa 22.3 does. Where that would be
    # visible, these programs set them again.
    color(0.9, 0.6, 0.3, 1)
    translate(0.3, -0.3, 0.9)
    scale(0.3, 0.3, 0.3)
    mesh2(FILL, 0, 20, 0, 16)


def image():
    enable(0x0DE1)
    F("glBindTexture", c_uint, c_uint)(0x0DE1, 1)
    texels = (c.c_uint8 * 1024)(*(v for i in range(256) for v in (i, (i * 37) % 256, 255 - i, 255)))
    upload = F("glTexImage2D", c_uint, c_int, c_int, c_int, c_int, c_int, c_uint, c_uint, c_void_p)
    upload(0x0DE1, 0, 0x1908, 16, 16, 0, 0x1908, 0x1401, texels)
    for what in (0x2800, 0x2801):
        F("glTexParameteri", c_uint, c_uint, c_int)(0x0DE1, what, 0x2601)


def texture_coordinates_by_maps():
    """One to four components; the map with the most takes precedence."""
    scene()
    image()
    tex(0.5, 0.5)
    scale(0.5, 0.5, 0.5)
    for k, n in enumerate((1, 2, 3, 4)):
        F("glPushMatrix")()
        translate(2.4 * (k % 2) - 1.2, 2.4 * (k // 2) - 1.2, 0)
        map2(VERTEX_3, sheet())
        full = [[(0, 0, 0, 1), (0.3, 1, 0, 1.5)], [(1, 0.2, 0, 1.2), (1, 1, 0, 2)]]
        map2(TEX_1 + n - 1, [[p[:n] for p in row] for row in full])
        mesh2(FILL, 0, 20, 0, 16)
        F("glPopMatrix")()


def vertices_by_evaluators_among_others():
    """Triangles and fans of points of surfaces and curves, mixed with ordinary vertices, which use the current values."""
    scene()
    map2(VERTEX_3, sheet())
    map2(COLOR_4, hues(2, 2))
    begin(TRIANGLES)
    for i in range(0, 18, 2):
        for j in range(0, 14, 2):
            normal(0.3, 0.1, 1)
            color(1, 0, 0, 1)
            vertex(i / 9 - 1, j / 8 - 1, 0.8)
            point2(i + 2, j)
            coord2(i / 20, j / 16 + 0.15)
    end()
    disable(0x0B50)
    map1(VERTEX_3, [(-1.3, -1.3, 1), (-0.5, -0.2, 0.5), (0.3, -2.4, 1.2), (1.3, -1.2, 1)], (0, 2))
    map1(COLOR_4, [(1, 1, 0, 1), (0, 1, 1, 1)], (0, 2))
    grid1(10, 0, 2)
    color(0.2, 0.2, 1, 1)
    begin(FAN)
    vertex(0, -0.3, 1.1)
    F("glEvalCoord1dv", c_void_p)((c_double * 1)(0))
    for i in range(1, 8):
        point1(i)
    F("glEvalCoord1d", c_double)(1.6)
    F("glEvalCoord1fv", c_void_p)((c_float * 1)(1.8))
    coord1(2)
    end()
    begin(TRIANGLES)
    for u, v in ((0.1, 0.9), (0.4, 0.8), (0.2, 0.5)):
        F("glEvalCoord2dv", c_void_p)((c_double * 2)(u, v))
        F("glEvalCoord2fv", c_void_p)((c_float * 2)(u + 0.1, v))
        F("glEvalCoord2d", c_double, c_double)(u, v + 0.1)
    end()


def lists():
    return F("glNewList", c_uint, c_uint), F("glEndList"), F("glCallList", c_uint)


def in_display_lists():
    """Meshes and vertices in lists: with maps set outside, set in the list, and set by another list when it is called."""
    scene()
    new, done, call = lists()
    scale(0.5, 0.5, 0.5)
    new(1, 0x1300)
    mesh2(FILL, 0, 20, 0, 16)
    done()
    new(2, 0x1300)
    for k in range(2):
        F("glPushMatrix")()
        translate(-1.2 + 2.4 * k, 1.2, 0)
        map2(VERTEX_3, sheet(3 + k, 4))
        map2(COLOR_4, hues(2, 2 + k))
        call(1)
        F("glPopMatrix")()
    done()
    new(3, 0x1300)
    color(0, 0.2, 0.2, 1)
    begin(QUAD_STRIP)
    for i in range(21):
        color(i / 20, 0.2, 0.2, 1)
        point2(i, 2)
        coord2(i / 20, 0.9)
    end()
    done()
    map2(VERTEX_3, sheet(4, 3))
    translate(0, -1.2, 0)
    call(1)
    translate(0, 1.2, 0)
    call(2)
    disable(MAP2 + COLOR_4)
    color(0.9, 0.6, 0.3, 1)
    translate(1.2, -1.4, 0.5)
    call(3)
    new(4, 0x1301)
    translate(-2.4, 0, 0)
    map2(VERTEX_3, sheet(5, 5))
    grid2(6, 0, 1, 5, 0, 1)
    mesh2(FILL, 0, 6, 0, 5)
    done()


def rational_surfaces():
    """An exact quarter of a ball with automatic normals, and a sheet with weights and a colour map, in perspective."""
    scene(perspective=True)
    h = 0.5**0.5
    arc = ((1, 0, 1), (h, h, h), (0, 1, 1))
    map2(VERTEX_4, [[(x * a, x * b, y * c, w * c) for x, y, w in arc] for a, b, c in arc])
    mesh2(FILL, 0, 20, 0, 16)
    disable(AUTO_NORMAL)
    normal(0.2, 0.3, 1)
    translate(-0.6, -0.5, 0.2)
    scale(0.5, 0.5, 0.5)
    weighted = lambda p, w: (p[0] * w, p[1] * w, p[2] * w, w)
    map2(VERTEX_4, [[weighted(p, 0.5 + 0.4 * ((i + j) % 3)) for j, p in enumerate(row)] for i, row in enumerate(sheet())])
    map2(COLOR_4, hues(4, 2))
    mesh2(FILL, 0, 20, 0, 16)


def weights_that_are_not_positive():
    """From the middle on, rows of the mesh have points that the driver has to clip."""
    scene(perspective=True)
    disable(AUTO_NORMAL)
    normal(0, 0.2, 1)
    weights = (1, 0.8, 0.3, -0.6)
    map2(VERTEX_4, [[(x, y, z, weights[j]) for j, (x, y, z) in enumerate(row)] for row in sheet(4, 4, 0.3)])
    grid2(8, 0, 1, 8, 0, 1)
    mesh2(FILL, 0, 8, 0, 8)


def lines_and_points_over_patches():
    """The driver's lines lie on the surface, with and without an offset."""
    scene()
    map2(VERTEX_3, sheet())
    grid2(10, 0, 1, 8, 0, 1)
    enable(0x8037)
    F("glPolygonOffset", c_float, c_float)(1, 1)
    mesh2(FILL, 0, 10, 0, 8)
    disable(0x8037)
    disable(0x0B50)
    F("glDepthFunc", c_uint)(0x0203)
    color(1, 1, 1, 1)
    mesh2(LINE, 0, 10, 0, 8)
    color(0, 0, 0, 1)
    F("glPointSize", c_float)(3)
    mesh2(POINT, 0, 10, 0, 8)
    map1(VERTEX_3, [(-1.2, -1.2, 1), (0, 2, 1), (1.2, -1.2, 1)])
    grid1(20, 0, 1)
    color(1, 1, 0, 1)
    mesh1(LINE, 0, 20)
    new, done, call = lists()
    new(1, 0x1300)
    mesh1(POINT, 0, 20)
    translate(0.1, 0.1, 0.5)
    mesh2(LINE, 0, 10, 0, 8)
    done()
    call(1)


def flat_patches():
    start()
    rotate(40, 1, 0.3, 0.2)
    F("glShadeModel", c_uint)(0x1D00)
    grid2(5, 0, 1, 6, 0, 1)
    map2(VERTEX_3, sheet())
    map2(COLOR_4, hues(4, 4))
    mesh2(FILL, 0, 5, 0, 6)


def transparent_colours_by_map():
    """Blended where the map's alpha is below 1: the driver draws from there on."""
    scene()
    enable(0x0BE2)
    F("glBlendFunc", c_uint, c_uint)(0x0302, 0x0303)
    map2(VERTEX_3, sheet())
    grid2(6, 0, 1, 6, 0, 1)
    mesh2(FILL, 0, 6, 0, 6)
    translate(0.2, 0.2, 0.7)
    map2(COLOR_4, [[(1, 0, 0, 0.3), (0, 1, 0, 0.5)], [(0, 0, 1, 0.6), (1, 1, 0, 0.4)]])
    mesh2(FILL, 0, 6, 0, 6)


def without_a_depth_test():
    """Drawn by the driver, or traced in drawing order when everything is to be traced."""
    start()
    disable(0x0B71)
    rotate(40, 1, 0.3, 0.2)
    map2(VERTEX_3, sheet(4, 4, 2))
    map2(COLOR_4, hues(4, 4))
    grid2(20, 0, 1, 16, 0, 1)
    mesh2(FILL, 0, 20, 0, 16)
    begin(TRIANGLES)
    for u, v in ((0.1, 0.1), (0.9, 0.2), (0.3, 0.9)):
        coord2(u, v)
    end()


def automatic_normals_over_a_domain_that_runs_backwards():
    """Drivers disagree on the side: passed to the driver."""
    scene()
    map2(VERTEX_3, sheet(), (1, 0))
    mesh2(FILL, 0, 20, 0, 16)
    begin(TRIANGLES)
    for u, v in ((0.1, 0.1), (0.9, 0.2), (0.3, 0.9)):
        coord2(u, v)
    end()


def maps_of_attribute_stacks():
    """Maps enabled and disabled by PushAttrib and PopAttrib, and a map replaced between two meshes in one state."""
    scene()
    map2(VERTEX_3, sheet())
    map2(COLOR_4, hues(2, 2))
    F("glPushAttrib", c_uint)(0x00010000)
    disable(MAP2 + COLOR_4)
    grid2(4, 0, 1, 4, 0, 1)
    scale(0.5, 0.5, 0.5)
    translate(-1.2, -1.2, 0)
    mesh2(FILL, 0, 4, 0, 4)
    F("glPopAttrib")()
    translate(2.4, 0, 0)
    mesh2(FILL, 0, 20, 0, 16)
    map2(VERTEX_3, [[(x, y + 2.4, -z) for x, y, z in row] for row in sheet(3, 5)])
    mesh2(FILL, 0, 20, 0, 16)
    map2(VERTEX_3, [[(x - 2.4, y + 2.4, z / 2) for x, y, z in row] for row in sheet(5, 3)])
    mesh2(FILL, 0, 20, 0, 16)


def errors_of_evaluators():
    """Errors equal the driver's, and erroneous calls draw nothing."""
    get = GL.glGetError
    scene()
    map2(VERTEX_3, sheet())
    get()
    seen = []

    def was():
        seen.append(get())

    mesh2(0x1234, 0, 20, 0, 16)
    was()
    mesh1(FILL, 0, 20)
    was()
    grid2(0, 0, 1, 3, 0, 1)
    was()
    F("glMap2f", c_uint, c_float, c_float, c_int, c_int, c_float, c_float, c_int, c_int, c_void_p)(MAP2 + VERTEX_3, 0, 0, 3, 2, 0, 1, 3, 2, (c_float * 12)())
    was()
    begin(TRIANGLES)
    grid1(3, 0, 1)
    end()
    was()
    begin(TRIANGLES)
    vertex(-1, -1, 1)
    map1(VERTEX_3, [(0, 0, 0)])
    end()
    was()
    was()
    assert seen == [0x500, 0x500, 0x501, 0x501, 0x502, 0x502, 0], [hex(s) for s in seen]
    mesh2(FILL, 5, 4, 0, 16)
    mesh2(FILL, 0, 20, 16, 0)
    disable(MAP2 + VERTEX_3)
    mesh2(FILL, 0, 20, 0, 16)
    begin(TRIANGLES)
    for k in range(3):
        coord2(k / 3, k * k / 9)
        normal(0.1, 0.2, 0.9)
        vertex(-1.3 + 0.4 * k, -1.3 + 0.4 * (k % 2), 1)
    end()
    enable(MAP2 + VERTEX_3)
    mesh2(FILL, 0, 20, 0, 16)
    was()
    assert seen[-1] == 0


def glu(name, *types, result=None):
    """A function of GLU, which is opened here like a plugin and resolves OpenGL when it is first called."""
    f = getattr(c.CDLL("libGLU.so.1"), name)
    f.argtypes, f.restype = types, result
    return f


def nurbs(trims=()):
    n = c_void_p(glu("gluNewNurbsRenderer", result=c_void_p)())
    glu("gluNurbsProperty", c_void_p, c_uint, c_float)(n, 100203, 25.0)
    knots = (c_float * 8)(0, 0, 0, 0, 1, 1, 1, 1)
    at = lambda k: 1.3 * (k - 1.5) / 2.2
    hill = lambda u, v: 0.8 if u in (1, 2) and v in (1, 2) else -0.7
    points = (c_float * 48)(*(x for u in range(4) for v in range(4) for x in (at(u), at(v), hill(u, v))))
    glu("gluBeginSurface", c_void_p)(n)
    surface = glu("gluNurbsSurface", c_void_p, c_int, c_void_p, c_int, c_void_p, c_int, c_int, c_void_p, c_int, c_int, c_uint)
    surface(n, 8, knots, 8, knots, 12, 3, points, 4, 4, MAP2 + VERTEX_3)
    for trim in trims:
        glu("gluBeginTrim", c_void_p)(n)
        corners = (c_float * (2 * len(trim)))(*(x for p in trim for x in p))
        glu("gluPwlCurve", c_void_p, c_int, c_void_p, c_int, c_uint)(n, len(trim), corners, 2, 100210)
        glu("gluEndTrim", c_void_p)(n)
    glu("gluEndSurface", c_void_p)(n)


def nurbs_of_glu():
    """A surface, and one with a hole."""
    scene(perspective=True)
    scale(0.7, 0.7, 0.7)
    translate(-0.8, 0, 0)
    nurbs()
    translate(1.6, 0, 0.2)
    color(0.3, 0.6, 0.9, 1)
    outside = ((0, 0), (1, 0), (1, 1), (0, 1), (0, 0))
    nurbs((outside, ((0.25, 0.25), (0.25, 0.7), (0.6, 0.75), (0.7, 0.25), (0.25, 0.25))))


def a_library_that_is_opened_late():
    """GLU's sphere: calls of a library that finds OpenGL only after the driver was loaded."""
    scene()
    ball = glu("gluSphere", c_void_p, c_double, c_int, c_int)
    ball(c_void_p(glu("gluNewQuadric", result=c_void_p)()), 0.9, 20, 20)
    color(0.2, 0.4, 0.9, 1)
    translate(0.9, 0.4, 0.3)
    ball(c_void_p(glu("gluNewQuadric", result=c_void_p)()), 0.5, 20, 20)


run(globals())
