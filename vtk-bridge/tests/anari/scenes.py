"""A scene per kind of object: each function makes the contents of a world on a device."""
import numpy as np

from anari_c import *

F = np.float32


def grid_mesh(n=12):
    """A wavy sheet: points, triangles, normals."""
    u = np.linspace(-1, 1, n, dtype=F)
    x, y = np.meshgrid(u, u)
    z = 0.25 * np.sin(3 * x) * np.cos(2 * y)
    points = np.stack([x, y, z], -1).reshape(-1, 3).astype(F)
    nx, ny = -0.75 * np.cos(3 * x) * np.cos(2 * y), 0.5 * np.sin(3 * x) * np.sin(2 * y)
    normals = np.stack([nx, ny, np.ones_like(nx)], -1).reshape(-1, 3)
    normals = (normals / np.linalg.norm(normals, axis=1, keepdims=True)).astype(F)
    i = np.arange(n * n).reshape(n, n)
    a, b, c, d = i[:-1, :-1].ravel(), i[:-1, 1:].ravel(), i[1:, 1:].ravel(), i[1:, :-1].ravel()
    quads = np.stack([a, b, c, d], -1).astype(np.uint32)
    return points, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]), quads, normals


def surface(d, geometry, material=None):
    material = material or d.new("Material", "matte", color=[0.9, 0.4, 0.2])
    return [d.new("Surface", geometry=geometry, material=material)]


def sheet(d, normals=True):
    points, triangles, _, n = grid_mesh()
    g = d.new("Geometry", "triangle", vertex__position=d.array(FLOAT32_VEC3, points), primitive__index=d.array(UINT32_VEC3, triangles))
    if normals:
        g.put(vertex__normal=d.array(FLOAT32_VEC3, n))
    return g


def triangle(d):
    return dict(surface=surface(d, sheet(d)))


def triangle_colors(d):
    points = grid_mesh()[0]
    colors = np.concatenate([points * 0.5 + 0.5, np.ones((len(points), 1), F)], 1).clip(0, 1)
    g = sheet(d, normals=False).put(vertex__color=d.array(FLOAT32_VEC4, colors))
    return dict(surface=surface(d, g, d.new("Material", "matte", color="color")))


def triangle_soup(d):
    """Without an index, with a colour per primitive."""
    points, triangles, _, _ = grid_mesh(6)
    soup = points[triangles.ravel()]
    colors = np.random.default_rng(1).random((len(triangles), 4)).astype(F)
    colors[:, 3] = 1
    g = d.new("Geometry", "triangle", vertex__position=d.array(FLOAT32_VEC3, soup), primitive__color=d.array(FLOAT32_VEC4, colors))
    return dict(surface=surface(d, g, d.new("Material", "matte", color="color")))


def quad(d):
    points, _, quads, _ = grid_mesh()
    g = d.new("Geometry", "quad", vertex__position=d.array(FLOAT32_VEC3, points), primitive__index=d.array(UINT32_VEC4, quads))
    return dict(surface=surface(d, g))


def dots(n=40, seed=3):
    r = np.random.default_rng(seed)
    return (r.random((n, 3)) * 2 - 1).astype(F), (0.05 + 0.1 * r.random(n)).astype(F), r.random((n, 4)).astype(F)


def sphere(d):
    points, radii, colors = dots()
    colors[:, 3] = 1
    g = d.new("Geometry", "sphere", vertex__position=d.array(FLOAT32_VEC3, points), vertex__radius=d.array(FLOAT32, radii),
              vertex__color=d.array(FLOAT32_VEC4, colors))
    return dict(surface=surface(d, g, d.new("Material", "matte", color="color")))


def sphere_common(d):
    g = d.new("Geometry", "sphere", vertex__position=d.array(FLOAT32_VEC3, dots(20)[0]), radius=0.15)
    return dict(surface=surface(d, g))


def cylinder(d):
    points, radii, _ = dots(30)
    g = d.new("Geometry", "cylinder", vertex__position=d.array(FLOAT32_VEC3, points), primitive__radius=d.array(FLOAT32, radii[:15] * 0.7), caps="both")
    return dict(surface=surface(d, g))


def cylinder_open(d):
    return dict(surface=surface(d, d.new("Geometry", "cylinder", vertex__position=d.array(FLOAT32_VEC3, F([[-0.5, -0.6, 0.6], [0.4, 0.5, -0.4]])),
                                         radius=0.4, caps="second")))


def cone(d):
    points, radii, _ = dots(20)
    r = radii * 1.5
    r[1::2] = 0
    g = d.new("Geometry", "cone", vertex__position=d.array(FLOAT32_VEC3, points), vertex__radius=d.array(FLOAT32, r), caps="both")
    return dict(surface=surface(d, g))


def curve(d):
    t = np.linspace(0, 12, 120, dtype=F)
    points = np.stack([0.8 * np.cos(t), 0.8 * np.sin(t), t / 6 - 1], -1).astype(F)
    colors = np.stack([t / 12, 1 - t / 12, 0.5 + 0 * t, 1 + 0 * t], -1).astype(F)
    g = d.new("Geometry", "curve", vertex__position=d.array(FLOAT32_VEC3, points), radius=0.07, vertex__color=d.array(FLOAT32_VEC4, colors),
              primitive__index=d.array(UINT32, np.arange(119, dtype=np.uint32)))
    return dict(surface=surface(d, g, d.new("Material", "matte", color="color")))


def field(d, n=24):
    """Distance from a point off the middle, on -1..1."""
    u = np.linspace(-1, 1, n, dtype=F)
    z, y, x = np.meshgrid(u, u, u, indexing="ij")
    values = np.sqrt((x - 0.2) ** 2 + y**2 + z**2 * 1.5).astype(F)
    f = d.new("SpatialField", "structuredRegular", data=d.array(FLOAT32, values, 3), origin=[-1.0, -1.0, -1.0], spacing=[2 / (n - 1)] * 3)
    return f, values


def isosurface(d):
    f, _ = field(d)
    values = d.array(FLOAT32, F([0.35, 0.6]))
    colors = d.array(FLOAT32_VEC4, F([[1, 0.2, 0.1, 1], [0.2, 0.4, 1, 1]]))
    g = d.new("Geometry", "isosurface", field=f, isovalue=values, primitive__color=colors)
    return dict(surface=surface(d, g, d.new("Material", "matte", color="color")))


def volume(d):
    f, _ = field(d)
    ramp = F([[1, 0, 0, 1], [1, 1, 0, 1], [0, 0.4, 1, 1]])
    v = d.new("Volume", "transferFunction1D", value=f, valueRange=[0.2, 1.0], color=d.array(FLOAT32_VEC3, ramp[:, :3].copy()),
              opacity=d.array(FLOAT32, F([0.9, 0.3, 0.0])), unitDistance=0.5)
    return dict(volume=[v])


def instances(d):
    points, triangles, _, n = grid_mesh(6)
    g = sheet(d)
    group = d.new("Group", surface=surface(d, g))
    out = []
    for k in range(4):
        a = k * 0.9
        m = np.eye(4, dtype=F)
        m[:2, :2] = 0.45 * F([[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]])
        m[3, :3] = [(k % 2) - 0.5, (k // 2) - 0.5, 0.1 * k]
        out.append(d.new("Instance", "transform", group=group, transform=m, id=k + 7))
    return dict(instance=out)


def texture(n=8):
    c = (np.indices((n, n)).sum(0) % 2).astype(np.uint8) * 255
    t = np.stack([c, np.full_like(c, 80), 255 - c, np.full_like(c, 255)], -1)
    t[0, :, :3] = [0, 255, 0]
    return t


def image2d(d):
    points = grid_mesh()[0]
    uv = (points[:, :2] * 0.75 + 0.5).astype(F)
    g = sheet(d, normals=False).put(vertex__attribute0=d.array(FLOAT32_VEC2, uv))
    s = d.new("Sampler", "image2D", image=d.array(UFIXED8_VEC4, texture(), 2), inAttribute="attribute0", filter="nearest", wrapMode1="repeat", wrapMode2="repeat")
    return dict(surface=surface(d, g, d.new("Material", "matte", color=s)))


def image1d(d):
    points = grid_mesh()[0]
    g = sheet(d, normals=False).put(vertex__attribute0=d.array(FLOAT32, (points[:, 0] * 0.5 + 0.5).astype(F).copy()))
    s = d.new("Sampler", "image1D", image=d.array(FLOAT32_VEC4, F([[1, 0, 0, 1], [0, 1, 0, 1], [0, 0, 1, 1]])), inAttribute="attribute0")
    return dict(surface=surface(d, g, d.new("Material", "matte", color=s)))


def image3d(d):
    r = np.random.default_rng(5).random((4, 4, 4, 4)).astype(F)
    r[..., 3] = 1
    points = grid_mesh()[0]
    g = sheet(d, normals=False).put(vertex__attribute0=d.array(FLOAT32_VEC3, (points * 0.5 + 0.5).astype(F)))
    s = d.new("Sampler", "image3D", image=d.array(FLOAT32_VEC4, r, 3), inAttribute="attribute0")
    return dict(surface=surface(d, g, d.new("Material", "matte", color=s)))


def sampler_transform(d):
    m = np.zeros((4, 4), F)
    m[0, 1] = m[1, 2] = m[2, 0] = 1  # columns: x to g, y to b, z to r
    points = grid_mesh()[0]
    g = sheet(d, normals=False).put(vertex__attribute1=d.array(FLOAT32_VEC3, (points * 0.5 + 0.5).astype(F)))
    s = d.new("Sampler", "transform", inAttribute="attribute1", outTransform=m)
    return dict(surface=surface(d, g, d.new("Material", "matte", color=s)))


def sampler_primitive(d):
    n = len(grid_mesh()[1])
    colors = np.random.default_rng(2).integers(0, 255, (n + 3, 4), np.uint8)
    s = d.new("Sampler", "primitive", array=d.array(UFIXED8_VEC4, colors)).set("inOffset", UINT64, np.uint64(3)).commit()
    return dict(surface=surface(d, sheet(d, normals=False), d.new("Material", "matte", color=s)))


def transparent(d):
    g = sheet(d, normals=False)
    m = d.new("Material", "matte", color=[0.2, 0.8, 0.3], opacity=0.4, alphaMode="blend")
    back = d.new("Geometry", "sphere", vertex__position=d.array(FLOAT32_VEC3, F([[0, 0, -0.6]])), radius=0.5)
    return dict(surface=surface(d, g, m) + surface(d, back))


def mask(d):
    points = grid_mesh()[0]
    g = sheet(d, normals=False).put(vertex__attribute0=d.array(FLOAT32, (0.5 + 0.5 * np.sin(9 * points[:, 0])).astype(F)))
    m = d.new("Material", "matte", color=[0.9, 0.7, 0.1], opacity="attribute0", alphaMode="mask", alphaCutoff=0.4)
    return dict(surface=surface(d, g, m))


def physically_based(d):
    out = []
    for k in range(3):
        g = d.new("Geometry", "sphere", vertex__position=d.array(FLOAT32_VEC3, F([[k * 0.7 - 0.7, 0, 0]])), radius=0.32)
        m = d.new("Material", "physicallyBased", baseColor=[0.9, 0.6, 0.3], metallic=[0.0, 0.5, 1.0][k], roughness=[0.8, 0.5, 0.3][k], specular=1.0)
        out += surface(d, g, m)
    return dict(surface=out)


SCENES = [triangle, triangle_colors, triangle_soup, quad, sphere, sphere_common, cylinder, cylinder_open, cone, curve, isosurface, volume, instances,
          image2d, image1d, image3d, sampler_transform, sampler_primitive, transparent, mask, physically_based]


def directional(d, irradiance=2.5):
    return d.new("Light", "directional", direction=[-0.3, -0.5, -1.0], irradiance=irradiance)


def view(d, contents, lights=None, size=(256, 192), ambient=0.25, camera=None, renderer="default", channels=(), **extra):
    """A frame of the contents."""
    lights = [directional(d)] if lights is None else lights
    if lights:
        contents = dict(contents, light=lights)
    world = d.new("World", **contents)
    camera = camera or d.new("Camera", "perspective", position=[0.4, 0.9, 2.9], direction=[-0.4, -0.9, -2.9], up=[0.0, 1.0, 0.0], fovy=0.8, aspect=size[0] / size[1])
    r = d.new("Renderer", renderer, background=[0.1, 0.1, 0.2, 1.0], ambientRadiance=ambient, **extra)
    f = d.new("Frame", world=world, camera=camera, renderer=r, size=size, channel__color=UFIXED8_VEC4, **{f"channel__{n}": t for n, t in channels})
    return f
