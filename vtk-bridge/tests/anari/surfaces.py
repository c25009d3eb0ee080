"""Samplers and attributes on physically based materials, borders, nearest fields, area lights and panoramas, with numbers from closed forms on our device. Exit code 1 and a line per failure."""
import sys
import traceback

import scenes
from anari_c import *
from spec import F, ball, close, sheet_colours

PI = float(np.pi)
UNIT = F([[0, 0], [1, 0], [1, 1], [0, 1]])


def plain(d, **more):
    """A physically based material that is ideally diffuse and white unless the arguments override that."""
    return d.new("Material", "physicallyBased", **{**dict(baseColor=[1.0, 1.0, 1.0], metallic=0.0, roughness=1.0), **more})


def one_texel(d, *value):
    return d.new("Sampler", "image2D", image=d.array(FLOAT32_VEC4, F([[value + (1,) * (4 - len(value))]]), 2))


def emissive_occlusion_and_opacity_follow_attributes_and_samplers(d):
    ramp = d.array(FLOAT32, F([0, 1, 1, 0]))
    colors = d.array(FLOAT32_VEC3, F([[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]))
    p, x, y = sheet_colours(d, plain(d, baseColor=[0.0, 0.0, 0.0], emissive="attribute1"), vertex__attribute1=colors)
    close(p[..., :3], np.stack([x, y, 0 * x + 1], -1))
    row = d.array(FLOAT32, F([0.25, 0.75]))
    of_ramp = lambda v: np.interp(v, [0.25, 0.75], [0.25, 0.75])
    occluded = plain(d, occlusion=d.new("Sampler", "image1D", image=row))
    p, x, _ = sheet_colours(d, occluded, vertex__attribute0=ramp)
    close(p[..., 0], of_ramp(x))
    for mode, alpha in (("blend", of_ramp), ("mask", lambda v: (of_ramp(v) >= 0.4).astype(float)), ("opaque", lambda v: 0 * v + 1)):
        m = plain(d, opacity=d.new("Sampler", "image1D", image=row), alphaMode=mode, alphaCutoff=0.4)
        p, x, _ = sheet_colours(d, m, vertex__attribute0=ramp)
        close(p[..., 0], alpha(x) + (1 - alpha(x)) * 0.1)
    # The mask also uses the texture's own alpha.
    texels = F([[[1, 0, 0, 0.2], [0, 1, 0, 0.9]]])
    m = plain(d, baseColor=d.new("Sampler", "image2D", image=d.array(FLOAT32_VEC4, texels, 2), filter="nearest"), alphaMode="mask")
    p, x, _ = sheet_colours(d, m, vertex__attribute0=d.array(FLOAT32_VEC2, UNIT))
    close(p[50, 20, :3], [0.1, 0.1, 0.2])
    close(p[50, 80, :3], [0, 1, 0])


def occlusion_leaves_lamps_alone(d):
    m = plain(d, occlusion=one_texel(d, 0.25))
    p = draw(d, ball(d, material=m, ambient=0.4, light=d.new("Light", "directional", irradiance=0.5 * PI)))
    close(p[50, 50, 0], 0.5 + 0.4 * 0.25)


def metallic_roughness_and_specular_are_the_material_with_those_numbers(d):
    light = scenes.directional(d)
    numbers = dict(metallic=0.6, roughness=0.45, specular=0.7)
    base = dict(baseColor=[0.9, 0.5, 0.2])
    for renderer in ("default", "pathtracer"):
        look = lambda **p: draw(d, ball(d, material=plain(d, **base, **p), light=light, ambient=0.3, renderer=renderer, pixelSamples=4)).copy()
        expected = look(**numbers)
        close(look(**{name: one_texel(d, v) for name, v in numbers.items()}), expected, 1e-5)
        assert np.abs(look() - expected).mean() > 1e-2, "they do something"
    g = d.new("Geometry", "sphere", vertex__position=d.array(FLOAT32_VEC3, F([[0, 0, 0]])), radius=1.0, attribute0=[0.6, 0, 0, 1], attribute1=[0.45, 0, 0, 1], attribute2=[0.7, 0, 0, 1])
    m = plain(d, **base, metallic="attribute0", roughness="attribute1", specular="attribute2")
    f = ball(d, light=light, ambient=0.3, renderer="pathtracer", pixelSamples=4)
    world = d.new("World", surface=[d.new("Surface", geometry=g, material=m)], light=[light])
    close(draw(d, f.put(world=world)), expected, 1e-5)


def one_image_serves_several_channels_through_transforms(d):
    """Channels as glTF packs them: occlusion in red, roughness in green, metalness in blue."""
    packed = d.array(UFIXED8_VEC3, np.uint8([[[255, 102, 204]]]), 2)

    def channel(c):
        m = np.zeros((4, 4), F)
        m[c, 0] = m[3, 3] = 1
        return d.new("Sampler", "image2D", image=packed, outTransform=m)

    look = lambda **p: draw(d, ball(d, material=plain(d, baseColor=[0.9, 0.5, 0.2], **p), light=scenes.directional(d), ambient=0.3)).copy()
    close(look(metallic=channel(2), roughness=channel(1), occlusion=channel(0)), look(metallic=0.8, roughness=0.4), 1e-4)


def lit_sheet(d, material, direction, **attributes):
    corners = F([[-1.01, -1.01, 0], [1.01, -1.01, 0], [1.01, 1.01, 0], [-1.01, 1.01, 0]])
    g = d.new("Geometry", "quad", vertex__position=d.array(FLOAT32_VEC3, corners), **attributes)
    light = d.new("Light", "directional", direction=direction, irradiance=PI)
    f = ball(d, channels=[("normal", FLOAT32_VEC3)])
    p = draw(d, f.put(world=d.new("World", surface=[d.new("Surface", geometry=g, material=material)], light=[light])))
    return p[50, 50, 0], pixels(d, f, "channel.normal")[50, 50]


def normal_maps_bend_along_tangents_or_along_their_own_coordinates(d):
    bend = F([0.48, 0.36, 0.8])
    m = plain(d, normal=one_texel(d, *(0.5 * bend + 0.5)))
    to_light = F([0.5, -0.3, 0.9]) / np.linalg.norm([0.5, -0.3, 0.9])
    uv = d.array(FLOAT32_VEC2, UNIT)
    tangent = lambda *t: d.array(FLOAT32_VEC4 if len(t) == 4 else FLOAT32_VEC3, F([t] * 4))
    for normal, arrays in (
        (bend, dict(vertex__attribute0=uv)),
        ([-0.36, 0.48, 0.8], dict(vertex__attribute0=d.array(FLOAT32_VEC2, UNIT[:, ::-1] * F([1, -1])))),  # u along y, v against x
        ([-0.36, 0.48, 0.8], dict(vertex__attribute0=uv, vertex__tangent=tangent(0, 1, 0))),
        ([0.36, 0.48, 0.8], dict(vertex__attribute0=uv, vertex__tangent=tangent(0, 1, 0, -1))),
        ([-0.48, -0.36, 0.8], dict(vertex__attribute0=uv, vertex__tangent=tangent(0, 1, 0), faceVarying__tangent=tangent(-1, 0, 0, 1))),
    ):
        light, layer = lit_sheet(d, m, [-float(c) for c in to_light], **arrays)
        close(layer, normal, 1e-4)
        close(light, np.dot(normal, to_light), 1e-3)
    # Constant texture coordinates define no tangent frame, so the normal is unchanged.
    close(lit_sheet(d, m, [0.0, 0.0, -1.0])[1], [0, 0, 1], 1e-5)
    draw(d, ball(d, material=m, ambient=0.5))
    assert any("`normal` is left out on geometry `sphere`" in t for _, t in d.messages), d.messages


def images_end_at_their_border(d):
    texels = d.array(FLOAT32_VEC4, F([[[1, 0, 0, 1], [0, 1, 0, 1]], [[0, 0, 1, 1], [1, 1, 0, 1]]]), 2)
    uv = d.array(FLOAT32_VEC2, F(UNIT * 2 - 0.5))
    s = d.new("Sampler", "image2D", image=texels, filter="nearest", wrapMode1="clampToBorder", wrapMode2="clampToEdge", borderColor=[0.25, 0.5, 0.75, 1.0])
    p, _, _ = sheet_colours(d, d.new("Material", "matte", color=s), vertex__attribute0=uv)
    close(p[35, 10, :3], [0.25, 0.5, 0.75])
    close(p[35, 35, :3], [1, 0, 0])
    close(p[10, 60, :3], [0, 1, 0])
    # Halfway from the last texel to the border, they are mixed.
    s.put(filter="linear", wrapMode2="clampToBorder")
    row = s.put(inTransform=np.diag([0, 0, 1, 1]).astype(F), inOffset=[1.0, 0.25, 0.0, 0.0])
    p, _, _ = sheet_colours(d, d.new("Material", "matte", color=row), vertex__attribute0=uv)
    close(p[50, 50, :3], [0.125, 0.75, 0.375])


def nearest_fields_step_halfway(d):
    data = np.zeros((2, 2, 2), F)
    data[:, :, 1] = 1  # x grows fastest
    def picture(kind):
        field = d.new("SpatialField", "structuredRegular", data=d.array(FLOAT32, data, 3), origin=[-1.0, -1.0, -1.0], spacing=[2.0, 2.0, 2.0], filter=kind)
        opaque = d.array(FLOAT32, F([0, 1]))
        v = d.new("Volume", "transferFunction1D", value=field, color=[0.0, 1.0, 0.0], opacity=opaque, unitDistance=0.1)
        return draw(d, ball(d).put(world=d.new("World", volume=[v])))[50, :, 1].copy()

    close(picture("nearest")[[5, 45, 55, 95]], [0.1, 0.1, 1, 1])
    assert 0.2 < picture("linear")[4] < 0.95, "a ramp"


def volume_colours_may_be_bytes(d):
    field = d.new("SpatialField", "structuredRegular", data=d.array(FLOAT32, np.full((2, 2, 2), 0.5, F), 3), origin=[-1.0, -1.0, -1.0], spacing=[2.0, 2.0, 2.0])
    v = d.new("Volume", "transferFunction1D", value=field, color=d.array(UFIXED8_VEC4, np.uint8([[0, 255, 51, 255]] * 2)), opacity=1.0)
    close(draw(d, ball(d).put(world=d.new("World", volume=[v])))[50, 50, :3], [0, 1, 0.2])


def quad_lights_shine_by_radiance_power_or_intensity_to_the_side_asked_for(d):
    small = dict(position=[-0.01, -0.01, 3.0], edge1=[0.02, 0.0, 0.0], edge2=[0.0, 0.02, 0.0])
    at = lambda **p: draw(d, ball(d, light=d.new("Light", "quad", **{**small, **p})))[50, 50, 0]
    # Straight ahead at distance 2, a quarter of 4 pi gives white.
    for strength in (dict(intensity=4 * PI), dict(power=4 * PI * PI), dict(radiance=4 * PI / 0.0004)):
        close(at(side="back", **strength), 0.5)
        assert at(side="front", **strength) == 0 and at(**strength) == 0, "edge1 x edge2 points away"
        # Both sides share the power.
        close(at(side="both", **strength), 0.25 if "power" in strength else 0.5)
    close(at(edge1=small["edge2"], edge2=small["edge1"], intensity=4 * PI), 0.5)
    # A large light, compared with Lambert's formula for a square seen from its axis at half its
    # edge's distance.
    f = ball(d, light=d.new("Light", "quad", position=[-1.0, -1.0, 2.0], edge1=[0.0, 2.0, 0.0], edge2=[2.0, 0.0, 0.0], radiance=1.0), pixelSamples=64, lightSamples=64)
    corners = np.array([[-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]]) / np.sqrt(3)
    form = sum(np.arccos(a @ b) * np.cross(a, b)[2] / np.linalg.norm(np.cross(a, b)) for a, b in zip(corners, np.roll(corners, -1, 0))) / (2 * np.pi)
    close(draw(d, f)[50, 50, 0], 0.5 * abs(form), 4e-3)


def ring_lights_have_a_hole_and_a_cone(d):
    ring = dict(position=[0.0, 0.0, 2.5], direction=[0.0, 0.0, -1.0], radius=1.2)
    disk = lambda r: r * r / (r * r + 1.5**2)
    for hole in (0.0, 0.8):
        light = d.new("Light", "ring", innerRadius=hole, radiance=PI, falloffAngle=0.0, **ring)
        p = draw(d, ball(d, light=light, pixelSamples=64, lightSamples=64))
        close(p[50, 50, 0], 0.5 * PI * (disk(1.2) - disk(hole)), 1e-2)
    narrow = d.new("Light", "ring", position=[0.0, 0.0, 3.0], radius=0.001, openingAngle=0.2, falloffAngle=0.0, intensity=4 * PI)
    p = draw(d, ball(d, light=narrow))[50, :, 0]
    close(p[50], 0.5)
    assert p[50 + 8] > 0.4 and p[50 + 14] == 0, p[50:70]


def panoramas_have_their_direction_in_the_middle(d):
    places = F([[0, 0, -4], [4, 0, 0], [-4, 0, 0], [0, 4, 0], [0, 0, 4]])
    colors = F([[1, 0, 0, 1], [0, 1, 0, 1], [0, 0, 1, 1], [1, 1, 0, 1], [0, 1, 1, 1]])
    g = d.new("Geometry", "sphere", vertex__position=d.array(FLOAT32_VEC3, places), vertex__color=d.array(FLOAT32_VEC4, colors), radius=1.0)
    s = d.new("Surface", geometry=g, material=d.new("Material", "matte", color="color"))
    c = d.new("Camera", "omnidirectional", direction=[0.0, 0.0, -1.0], up=[0.0, 1.0, 0.0])
    f = scenes.view(d, dict(surface=[s]), lights=[], size=(128, 64), camera=c, ambient=1.0, channels=[("depth", FLOAT32)]).put(channel__color=FLOAT32_VEC4)
    p = draw(d, f).copy()
    for k, (x, y) in enumerate([(64, 32), (96, 32), (32, 32), (64, 63), (0, 32)]):
        close(p[y, x, :3], colors[k, :3])
        close(pixels(d, f, "channel.depth")[y, x], 3.0, 0.02)
    right = draw(d, f.put(size=(64, 64), camera=c.put(imageRegion=[0.5, 0.0, 1.0, 1.0])))
    close(right, p[:, 64:], 1e-5)
    # Samples, lights and shadows also work there.
    f = scenes.view(d, dict(surface=[s]), size=(64, 32), camera=c, renderer="pathtracer", pixelSamples=4)
    assert draw(d, f).std() > 5


if __name__ == "__main__":
    failed = 0
    for name, test in list(globals().items()):
        if callable(test) and getattr(test, "__module__", "") == "__main__" and name not in ("plain", "one_texel", "lit_sheet"):
            d = Device("rtv")
            try:
                test(d)
                assert not d.errors(), d.errors()
            except Exception:
                failed += 1
                print(f"{name}:\n{traceback.format_exc()}{d.messages[-4:]}", flush=True)
    sys.exit(failed > 0)
