"""Checks our device against ANARI's specification: each function is a test, with numbers from closed forms. Exit code 1 and a line per failure."""
import sys
import traceback

import scenes
from anari_c import *

F = np.float32


def close(a, b, tolerance=2e-3):
    assert np.allclose(a, b, atol=tolerance), f"{a} is not {b}"


def ball(d, material=None, light=None, radius=1.0, ambient=0.0, **more):
    """A ball seen from (0, 0, 10) through 101 x 101 pixels of 0.02, in linear floats."""
    g = d.new("Geometry", "sphere", vertex__position=d.array(FLOAT32_VEC3, F([[0, 0, 0]])), radius=radius)
    m = material or d.new("Material", "matte", color=[0.5, 0.25, 1.0])
    s = d.new("Surface", geometry=g, material=m, id=42)
    c = d.new("Camera", "orthographic", position=[0.0, 0.0, 10.0], direction=[0.0, 0.0, -1.0], up=[0.0, 1.0, 0.0], height=2.02, aspect=1.0)
    f = scenes.view(d, dict(surface=[s]), lights=[light] if light else [], size=(101, 101), camera=c, ambient=ambient, **more)
    return f.put(channel__color=FLOAT32_VEC4)


def directional_light_is_albedo_over_pi_times_irradiance_times_cosine(d):
    f = ball(d, light=d.new("Light", "directional", direction=[0.0, 0.0, -1.0], irradiance=float(np.pi)))
    p = draw(d, f)
    close(p[50, 50], [0.5, 0.25, 1.0, 1.0])
    close(p[50, 80, 0], 0.5 * np.sqrt(1 - 0.6**2), 5e-3)
    close(p[0, 0], [0.1, 0.1, 0.2, 1.0])


def point_light_falls_off_with_the_square_and_power_is_4_pi_intensity(d):
    for light in (d.new("Light", "point", position=[0.0, 0.0, 3.0], intensity=float(4 * np.pi)),
                  d.new("Light", "point", position=[0.0, 0.0, 3.0], power=float(16 * np.pi**2))):
        close(draw(d, ball(d, light=light))[50, 50, :3], [0.5, 0.25, 1.0])


def spot_light_is_full_inside_dark_outside_and_linear_in_the_cosine_between(d):
    angle = 2 * np.arctan(0.1)
    light = d.new("Light", "spot", position=[0.0, 0.0, 6.0], direction=[0.0, 0.0, -1.0], openingAngle=float(angle), falloffAngle=float(angle / 4),
                  intensity=float(25 * np.pi))
    p = draw(d, ball(d, light=light))[..., 0]
    close(p[50, 50], 0.5)
    assert p[50, 50 + 30] < 1e-6 and p[50, 50 + 10] > 0.4, p[50, 50:90:5]
    assert 0.05 < p[50, 50 + 20] < 0.45, "the rim is soft"


def ring_light_is_a_disk_with_the_cosine_to_its_normal(d):
    # The middle is straight ahead at distance 2; (0.6, 0, 0.8) is off the axis and tests the
    # cosines at both ends and the square of the distance.
    for light in (d.new("Light", "ring", position=[0.0, 0.0, 3.0], direction=[0.0, 0.0, -1.0], radius=0.01, intensity=float(4 * np.pi)),
                  d.new("Light", "ring", position=[0.0, 0.0, 3.0], direction=[0.0, 0.0, -1.0], radius=0.01, power=float(4 * np.pi**2))):
        p = draw(d, ball(d, light=light))
        close(p[50, 50, :3], [0.5, 0.25, 1.0])
        way = np.array([-0.6, 0.0, 2.2])
        length = np.linalg.norm(way)
        cosines = (way @ [0.6, 0.0, 0.8]) / length * (way[2] / length)
        close(p[50, 80, 0], 0.5 * 4 * cosines / length**2, 1e-2)


def ambient_light_makes_a_surface_its_colour(d):
    close(draw(d, ball(d, ambient=1.0))[50, 50], [0.5, 0.25, 1.0, 1.0])


def ambient_light_is_seen_in_metals(d):
    metal = d.new("Material", "physicallyBased", baseColor=[0.9, 0.6, 0.3], metallic=1.0, roughness=0.0)
    for renderer in ("default", "pathtracer"):
        close(draw(d, ball(d, material=metal, ambient=1.0, renderer=renderer))[50, 50, :3], [0.9, 0.6, 0.3], 1e-2)


def depth_normal_albedo_and_ids_describe_the_surface(d):
    f = ball(d, ambient=0.5, channels=[("depth", FLOAT32), ("normal", FLOAT32_VEC3), ("albedo", FLOAT32_VEC3), ("primitiveId", UINT32), ("objectId", UINT32),
                                       ("instanceId", UINT32)])
    draw(d, f)
    depth, normal, albedo = (pixels(d, f, f"channel.{n}") for n in ("depth", "normal", "albedo"))
    close(depth[50, 50], 9.0, 1e-5)
    assert np.isinf(depth[0, 0])
    close(normal[50, 80], [0.6, 0.0, 0.8], 1e-4)
    close(albedo[50, 50], [0.5, 0.25, 1.0])
    for channel, inside in (("primitiveId", 0), ("objectId", 42), ("instanceId", 2**32 - 1)):
        ids = pixels(d, f, f"channel.{channel}")
        assert ids[50, 50] == inside and ids[0, 0] == 2**32 - 1, channel


def packed_channel_types_hold_the_same_values(d):
    f = ball(d, ambient=1.0, channels=[("normal", FIXED16_VEC3), ("albedo", UFIXED8_RGB_SRGB)])
    draw(d, f.put(channel__color=UFIXED8_RGBA_SRGB))
    assert list(pixels(d, f)[50, 50]) == [188, 137, 255, 255]
    assert list(pixels(d, f, "channel.albedo")[50, 50]) == [188, 137, 255]
    assert list(pixels(d, f, "channel.normal")[50, 50]) == [0, 0, 32767]


def rows_begin_at_the_bottom(d):
    f = ball(d, ambient=1.0)
    c = d.new("Camera", "orthographic", position=[0.0, 0.9, 10.0], direction=[0.0, 0.0, -1.0], up=[0.0, 1.0, 0.0], height=2.02, aspect=1.0)
    p = draw(d, f.put(camera=c))
    assert p[10, 50, 0] > 0.4 and p[90, 50, 0] < 0.2, "a camera above the ball sees it below"


def image_region_is_a_part_of_the_image(d):
    f = ball(d, light=scenes.directional(d))
    whole = draw(d, f.put(size=(202, 202)))
    c = d.new("Camera", "orthographic", position=[0.0, 0.0, 10.0], direction=[0.0, 0.0, -1.0], up=[0.0, 1.0, 0.0], height=2.02, aspect=1.0, imageRegion=[0.5, 0.0, 1.0, 0.5])
    close(draw(d, f.put(size=(101, 101), camera=c)), whole[:101, 101:], 1e-4)


def background_images_fill_what_is_free(d):
    image = d.array(FLOAT32_VEC4, F([[[1, 0, 0, 1], [0, 1, 0, 1]], [[0, 0, 1, 1], [1, 1, 1, 1]]]), 2)
    f = ball(d, ambient=1.0)
    r = d.new("Renderer", "default", background=image, ambientRadiance=1.0)
    p = draw(d, f.put(renderer=r))
    close(p[0, 0], [1, 0, 0, 1])
    close(p[-1, 0], [0, 0, 1, 1])
    close(p[50, 50], [0.5, 0.25, 1, 1])


def instances_have_transforms_ids_and_colours(d):
    g = d.new("Geometry", "sphere", vertex__position=d.array(FLOAT32_VEC3, F([[0, 0, 0]])), radius=0.3)
    s = d.new("Surface", geometry=g, material=d.new("Material", "matte", color="color"))
    group = d.new("Group", surface=[s])
    m = np.stack([np.eye(4, dtype=F), np.eye(4, dtype=F)])
    m[0, 3, 0], m[1, 3, 0] = -0.6, 0.6
    many = d.new("Instance", "transform", group=group, transform=d.array(FLOAT32_MAT4, m.reshape(2, 16)), id=d.array(UINT32, np.uint32([5, 6])), color=[1.0, 0.5, 0.0, 1.0])
    f = ball(d, ambient=1.0, channels=[("instanceId", UINT32)])
    w = d.new("World", instance=[many])
    p = draw(d, f.put(world=w))
    close(p[50, 20], [1.0, 0.5, 0.0, 1.0])
    ids = pixels(d, f, "channel.instanceId")
    assert (ids[50, 20], ids[50, 80]) == (5, 6)
    close(w.property("bounds", FLOAT32_BOX3, 6), [-0.9, -0.3, -0.3, 0.9, 0.3, 0.3], 1e-5)
    close(group.property("bounds", FLOAT32_BOX3, 6), [-0.3] * 3 + [0.3] * 3, 1e-5)


def a_volume_of_one_value_has_the_opacity_of_its_thickness(d):
    field = d.new("SpatialField", "structuredRegular", data=d.array(FLOAT32, np.full((3, 3, 3), 0.5, F), 3), origin=[-1.0, -1.0, -1.0])
    v = d.new("Volume", "transferFunction1D", value=field, color=[1.0, 0.0, 0.0], opacity=0.5, unitDistance=1.0)
    f = ball(d)
    p = draw(d, f.put(world=d.new("World", volume=[v])))
    # Two units of a medium that transmits half of the light per unit.
    close(p[50, 50], [0.75 + 0.25 * 0.1, 0.25 * 0.1, 0.25 * 0.2, 1.0])


def isosurfaces_number_their_isovalues(d):
    field, _ = scenes.field(d, 32)
    g = d.new("Geometry", "isosurface", field=field, isovalue=d.array(FLOAT32, F([0.9, 0.3])))
    s = d.new("Surface", geometry=g, material=d.new("Material", "matte", opacity=0.5, alphaMode="blend"))
    f = ball(d, ambient=1.0, channels=[("primitiveId", UINT32), ("depth", FLOAT32)])
    draw(d, f.put(world=d.new("World", surface=[s])))
    ids, depth = pixels(d, f, "channel.primitiveId"), pixels(d, f, "channel.depth")
    assert set(np.unique(ids)) <= {0, 2**32 - 1} and ids[50, 60] == 0
    close(depth[50, 60], 10 - 0.9 / np.sqrt(1.5), 5e-3)


def sheet_colours(d, material, **attributes):
    """A square over the whole image under light that shows its colours; x and y of a pixel in 0..1."""
    corners = F([[-1.01, -1.01, 0], [1.01, -1.01, 0], [1.01, 1.01, 0], [-1.01, 1.01, 0]])
    g = d.new("Geometry", "quad", vertex__position=d.array(FLOAT32_VEC3, corners), **attributes)
    f = ball(d, ambient=1.0)
    p = draw(d, f.put(world=d.new("World", surface=[d.new("Surface", geometry=g, material=material)])))
    x = (np.arange(101) + 0.5) / 101
    return p, *np.meshgrid(x, x)


def samplers_give_what_numpy_computes(d):
    uv = d.array(FLOAT32_VEC3, F([[0, 0, 0.5], [1, 0, 0.5], [1, 1, 0.5], [0, 1, 0.5]]))
    sampled = lambda kind, **p: sheet_colours(d, d.new("Material", "matte", color=d.new("Sampler", kind, **p)), vertex__attribute0=uv)
    row = F([[1, 0, 0, 1], [0, 1, 0, 1], [0, 0, 1, 1]])
    p, x, _ = sampled("image1D", image=d.array(FLOAT32_VEC4, row))
    for c in range(3):
        close(p[..., c], np.interp(x, [1 / 6, 1 / 2, 5 / 6], row[:, c]))
    checks = np.random.default_rng(4).random((5, 7, 4)).astype(F)
    p, x, y = sampled("image2D", image=d.array(FLOAT32_VEC4, checks, 2), filter="nearest", wrapMode1="repeat", wrapMode2="mirrorRepeat",
                      inTransform=np.diag([2, 3, 1, 1]).astype(F), inOffset=[0.25, 0.0, 0.0, 0.0])
    i, j = np.floor((2 * x + 0.25) * 7).astype(int) % 7, np.floor(3 * y * 5).astype(int) % 10
    same = np.isclose(p[..., :3], checks[np.where(j < 5, j, 9 - j), i][..., :3], atol=2e-3).all(-1)
    assert same.mean() > 0.999, "all but pixels on edges of texels"
    block = np.zeros((2, 2, 2, 4), F)
    block[..., 0], block[..., 1], block[..., 2], block[..., 3] = *np.meshgrid([0, 1], [0, 1], [0, 1], indexing="ij"), 1
    p, x, y = sampled("image3D", image=d.array(FLOAT32_VEC4, block, 3))
    ramp = lambda v: np.clip(2 * v - 0.5, 0, 1)
    close(p[..., :3], np.stack([0 * x + 0.5, ramp(y), ramp(x)], -1))
    swap = np.zeros((4, 4), F)
    swap[0, 1] = swap[1, 0] = swap[3, 3] = 1
    p, x, y = sampled("transform", outTransform=swap, outOffset=[0.0, 0.0, 0.25, 0.0])
    close(p[..., :3], np.stack([y, x, 0 * x + 0.25], -1))
    p, _, _ = sampled("primitive", array=d.array(FLOAT32_VEC4, F([[9, 9, 9, 1], [0.1, 0.2, 0.3, 1]])))
    close(p[50, 50, :3], [9, 9, 9])


def opacity_blends_and_masks(d):
    ramp = d.array(FLOAT32, F([0, 1, 1, 0]))
    make = lambda **p: d.new("Material", "matte", color=[1.0, 0.0, 0.0], opacity="attribute0", **p)
    for mode, alpha in (("opaque", lambda x: 0 * x + 1), ("blend", lambda x: x), ("mask", lambda x: (x >= 0.3).astype(float))):
        p, x, _ = sheet_colours(d, make(alphaMode=mode, alphaCutoff=0.3), vertex__attribute0=ramp)
        close(p[..., 0], alpha(x) + (1 - alpha(x)) * 0.1)


def hdri_light_shows_its_middle_in_its_direction(d):
    sky = np.zeros((8, 16, 3), F)
    sky[:, 7:9] = [2, 1, 0]  # the middle
    sky[:, 11:13] = [0, 0, 3]  # a quarter to the right of it
    light = d.new("Light", "hdri", up=[0.0, 1.0, 0.0], direction=[0.0, 0.0, -1.0], radiance=d.array(FLOAT32_VEC3, sky, 2))
    c = d.new("Camera", "perspective", position=[0.0, 0.0, 0.0], direction=[0.0, 0.0, -1.0], up=[0.0, 1.0, 0.0], fovy=0.2, aspect=1.0)
    f = ball(d)
    close(draw(d, f.put(world=d.new("World", light=[light]), camera=c))[50, 50, :3], [2, 1, 0], 1e-2)
    c.put(direction=[1.0, 0.0, 0.0])
    close(draw(d, f)[50, 50, :3], [0, 0, 3], 0.1)


def parameters_take_effect_when_they_are_committed(d):
    m = d.new("Material", "matte", color=[0.5, 0.25, 1.0])
    f = ball(d, material=m, ambient=1.0)
    m.set("color", FLOAT32_VEC3, F([1, 0, 0]))
    close(draw(d, f)[50, 50, :3], [0.5, 0.25, 1.0])
    m.commit()
    close(draw(d, f)[50, 50, :3], [1, 0, 0])
    unset_parameter(d.handle, m.handle, b"color")
    m.commit()
    close(draw(d, f)[50, 50, :3], [0.8] * 3)


def changed_arrays_change_the_image_when_unmapped(d):
    points = d.array(FLOAT32_VEC3, F([[0, 0, 0]]))
    g = d.new("Geometry", "sphere", vertex__position=points, radius=0.5)
    s = d.new("Surface", geometry=g, material=d.new("Material", "matte"))
    f = ball(d, ambient=1.0)
    f.put(world=d.new("World", surface=[s]))
    assert draw(d, f)[50, 50, 0] > 0.7
    memory = C.cast(map_array(d.handle, points.handle), C.POINTER(C.c_float))
    memory[0] = 0.9
    unmap_array(d.handle, points.handle)
    p = draw(d, f)
    assert p[50, 50, 0] < 0.2 and p[50, 90, 0] > 0.7


def accumulated_frames_get_smoother(d):
    f = ball(d, light=scenes.directional(d), renderer="pathtracer", pixelSamples=2, ambient=0.5).put(accumulation=True)
    frames = [draw(d, f).copy() for _ in range(8)]
    assert f.property("numSamples", INT32)[0] == 16
    first, last = (np.abs(p - frames[-1]).mean() for p in (frames[0], frames[5]))
    assert last < 0.5 * first, (first, last)


def introspection_lists_what_there_is(d):
    assert "sphere" in strings(object_subtypes(d.handle, GEOMETRY)) and strings(object_subtypes(d.handle, SURFACE)) == []
    extensions = strings(device_extensions(d.library, b"default"))
    assert "ANARI_KHR_GEOMETRY_CURVE" in extensions and "ANARI_KHR_CAMERA_STEREO" not in extensions

    class Entry(C.Structure):
        _fields_ = [("name", C.c_char_p), ("type", C.c_int)]

    entries = C.cast(object_info(d.handle, GEOMETRY, b"sphere", b"parameter", PARAMETER_LIST), C.POINTER(Entry))
    names, i = set(), 0
    while entries[i].name:
        names.add(entries[i].name.decode())
        i += 1
    assert {"vertex.position", "radius", "primitive.index"} <= names, names
    info = lambda what, kind: parameter_info(d.handle, GEOMETRY, b"sphere", b"radius", FLOAT32, what, kind)
    assert C.cast(info(b"default", FLOAT32), C.POINTER(C.c_float))[0] == 1.0
    assert info(b"default", FLOAT32_VEC3) is None, "of another type"
    assert b"radius" in C.cast(info(b"description", STRING), C.c_char_p).value
    assert object_info(d.handle, GEOMETRY, b"teapot", b"parameter", PARAMETER_LIST) is None
    assert d.property("version", INT32)[0] >= 100 and d.property("geometryMaxIndex", UINT64)[0] > 1e9


if __name__ == "__main__":
    failed = 0
    for name, test in list(globals().items()):
        if callable(test) and getattr(test, "__module__", "") == "__main__" and name not in ("close", "ball", "sheet_colours"):
            d = Device("rtv")
            try:
                test(d)
                assert not d.errors(), d.errors()
            except Exception:
                failed += 1
                print(f"{name}:\n{traceback.format_exc()}{d.messages[-4:]}", flush=True)
    sys.exit(failed > 0)
