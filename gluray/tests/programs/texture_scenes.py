"""Scenes of hard_cases.py about textures."""
from gl_by_ctypes import *

TEXTURE_2D, RGBA, BYTES = 0x0DE1, 0x1908, 0x1401
bind_texture = F("glBindTexture", c_uint, c_uint)
parameter = F("glTexParameteri", c_uint, c_uint, c_int)
parameter_f = F("glTexParameterf", c_uint, c_uint, c_float)
image = F("glTexImage2D", c_uint, c_int, c_int, c_int, c_int, c_int, c_uint, c_uint, c_void_p)
part = F("glTexSubImage2D", c_uint, c_int, c_int, c_int, c_int, c_int, c_uint, c_uint, c_void_p)
tex_coord = F("glTexCoord2f", c_float, c_float)
MIN, MAG, WRAP_S, WRAP_T = 0x2801, 0x2800, 0x2802, 0x2803
MIPMAPS = (0x2700, 0x2701, 0x2702, 0x2703)


def texels(w, h, seed):
    """A pattern of squares in colours that differ from level to level."""
    out = (c.c_uint8 * (4 * w * h))()
    for y in range(h):
        for x in range(w):
            on = (x * 8 // w + y * 8 // h) % 2
            for k in range(3):
                out[4 * (y * w + x) + k] = (seed * (83 + 40 * k) + 90 * on + 20 * k) % 256
            out[4 * (y * w + x) + 3] = 255
    return out


def pyramid(name, size=64, levels=7):
    bind_texture(TEXTURE_2D, name)
    for n in range(levels):
        side = max(1, size >> n)
        image(TEXTURE_2D, n, RGBA, side, side, 0, RGBA, BYTES, texels(side, side, n + 1))


def textured(perspective=True):
    """A lit scene that looks along the floor."""
    start(perspective=perspective)
    lit()
    color(1, 1, 1, 1)
    normal(0, 0.6, 0.8)
    enable(TEXTURE_2D)


def floor(x0, x1, repeats=4.0):
    begin(QUADS)
    for x, z, t in ((x0, 0.5, 0), (x1, 0.5, 0), (x1, -7.5, repeats), (x0, -7.5, repeats)):
        tex_coord(repeats * x / 2, t)
        vertex(x, -0.8, z)
    end()


def mipmaps():
    """Each of the four filters with mipmaps on a strip of floor."""
    textured()
    for i, f in enumerate(MIPMAPS):
        pyramid(i + 1)
        parameter(TEXTURE_2D, MIN, f)
        parameter(TEXTURE_2D, MAG, 0x2601 if i % 2 else 0x2600)
        floor(-4 + 2 * i, -2 + 2 * i)


def levels_and_limits_of_textures():
    """Base and maximum level, limits and bias of the level of detail, two filters without mipmaps, and an incomplete mipmap chain, which disables the texture."""
    textured()
    for i, settings in enumerate(
        (
            {0x813C: 1, 0x813D: 3, MIN: 0x2703},
            {0x813A: 1.5, 0x813B: 2.5, MIN: 0x2703},
            {0x8501: 1.25, MIN: 0x2701},
            {MIN: 0x2600, MAG: 0x2601},
            {MIN: 0x2703},
        )
    ):
        pyramid(i + 1)
        parameter(TEXTURE_2D, MAG, 0x2601)
        for what, value in settings.items():
            (parameter_f if isinstance(value, float) else parameter)(TEXTURE_2D, what, value)
        if i == 4:
            image(TEXTURE_2D, 3, RGBA, 5, 5, 0, RGBA, BYTES, texels(5, 5, 1))
        floor(-5 + 2 * i, -3 + 2 * i)


def generated_mipmaps():
    """GL_GENERATE_MIPMAP, and a part of the base level replaced after a draw."""
    textured()
    bind_texture(TEXTURE_2D, 1)
    parameter(TEXTURE_2D, 0x8191, 1)
    parameter(TEXTURE_2D, MIN, 0x2703)
    image(TEXTURE_2D, 0, RGBA, 64, 64, 0, RGBA, BYTES, texels(64, 64, 3))
    floor(-4, 0)
    part(TEXTURE_2D, 0, 16, 16, 32, 32, RGBA, BYTES, texels(32, 32, 9))
    floor(0, 4)


def square(x0, y0, x1, y1, z=0.0):
    begin(QUADS)
    for x, y, s, t in ((x0, y0, 0, 0), (x1, y0, 1, 0), (x1, y1, 1, 1), (x0, y1, 0, 1)):
        tex_coord(s, t)
        vertex(x, y, z)
    end()


def textures_replaced_between_draws():
    """A draw keeps the texels that it was issued with when they are replaced, replaced in part, copied from the window, uploaded from a buffer, or
    deleted; the program's own pixel storage (rows of eight bytes, a longer row, a scale) has no effect on them."""
    textured(perspective=False)
    normal(0, 0, 1)
    store = F("glPixelStorei", c_uint, c_int)
    store(0x0D05, 8)
    store(0x0D02, 100)
    F("glPixelTransferf", c_uint, c_float)(0x0D14, 1.0)
    bind_texture(TEXTURE_2D, 1)
    parameter(TEXTURE_2D, MIN, 0x2601)
    store(0x0CF5, 1)
    for i in range(12):
        # More calls than gluray tracks individually.
        image(TEXTURE_2D, 0, 0x1907, 17, 9, 0, RGBA, BYTES, texels(17, 9, i))
        for k in range(i):
            parameter(TEXTURE_2D, MAG, 0x2601)
        part(TEXTURE_2D, 0, 2, 2, 5, 3, RGBA, BYTES, texels(5, 3, i + 20))
        square(-1.4 + 0.23 * i, -1.4, -1.2 + 0.23 * i, -0.6)
    bind_texture(TEXTURE_2D, 2)
    parameter(TEXTURE_2D, MIN, 0x2601)
    F("glCopyTexImage2D", c_uint, c_int, c_uint, c_int, c_int, c_int, c_int, c_int)(TEXTURE_2D, 0, 0x1907, 0, 0, 64, 32, 0)
    square(-1.4, -0.5, 0, 0.5)
    buffer = F("glBindBuffer", c_uint, c_uint)
    buffer(0x88EC, 5)
    F("glBufferData", c_uint, c_ulong, c_void_p, c_uint)(0x88EC, 4 * 16 * 16, texels(16, 16, 4), 0x88E4)
    image(TEXTURE_2D, 0, RGBA, 16, 16, 0, RGBA, BYTES, None)
    square(0.1, -0.5, 1.4, 0.5)
    buffer(0x88EC, 0)
    buffer(0x88EB, 5)
    bind_texture(TEXTURE_2D, 3)
    parameter(TEXTURE_2D, MIN, 0x2601)
    image(TEXTURE_2D, 0, RGBA, 4, 4, 0, RGBA, BYTES, texels(4, 4, 7))
    square(-1.4, 0.6, 0, 1.4)
    F("glDeleteTextures", c_int, c_void_p)(1, (c_uint * 1)(3))
    buffer(0x88EB, 0)
    store(0x0D05, 4)
    store(0x0D02, 0)
    bind_texture(TEXTURE_2D, 1)
    square(0.1, 0.6, 1.4, 1.4)


def a_thousand_textures():
    """Each texture is drawn with once. The process must not keep them."""
    import resource

    textured(perspective=False)
    normal(0, 0, 1)
    peak = lambda: resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    data = texels(16, 16, 5)
    big = (c.c_uint8 * (4 * 512 * 512))(*(bytes(data) * 1024))
    before = 0
    for i in range(300):
        name = i % 3 + 1
        bind_texture(TEXTURE_2D, name)
        parameter(TEXTURE_2D, MIN, 0x2601)
        image(TEXTURE_2D, 0, RGBA, 512, 512, 0, RGBA, BYTES, big)
        square(-1.4, -1.4, 1.4, 1.4)
        F("glDeleteTextures", c_int, c_void_p)(1, (c_uint * 1)(name))
        F("glFinish")()
        if i == 40:
            before = peak()
    assert peak() < before + 30_000, f"{peak() - before} KiB more after 300 textures"


def environments_of_textures():
    """Each texture environment with each set of components, where the specification defines the result: colours, constant colours and lit surfaces."""
    textured(perspective=False)
    normal(0, 0.3, 0.9)
    F("glLightModeli", c_uint, c_int)(0x81F8, 0x81F9)
    values = (c.c_uint8 * 64)(*(v for i in range(16) for v in (17 * i, 255 - 11 * i, (60 * i) % 256, 80 + 11 * i)))
    color_of = F("glTexEnvfv", c_uint, c_uint, c_void_p)
    color_of(0x2300, 0x2201, (c_float * 4)(0.9, 0.2, 0.6, 0.7))
    kinds = (0x1907, RGBA, 0x1906, 0x1909, 0x190A, 0x8049)
    for k, inner in enumerate(kinds):
        bind_texture(TEXTURE_2D, k + 1)
        parameter(TEXTURE_2D, MIN, 0x2601)
        parameter(TEXTURE_2D, MAG, 0x2601)
        image(TEXTURE_2D, 0, inner, 4, 4, 0, RGBA, BYTES, values)
        # GL_DECAL is defined for colours only.
        for n, env in enumerate((0x2100, 0x1E01, 0x2101, 0x0BE2, 0x0104)):
            if env == 0x2101 and k > 1:
                continue
            F("glTexEnvi", c_uint, c_uint, c_int)(0x2300, 0x2200, env)
            color(0.2 + 0.15 * n, 0.7 - 0.1 * k, 0.4, 1)
            square(-1.4 + 0.47 * k, -1.4 + 0.56 * n, -1 + 0.47 * k, -0.9 + 0.56 * n, 0.1 * n)
