"""Non-finite numbers, scales from 1e-18 to 1e18, changes while a frame is drawn, and random values for every parameter of every object: the device
continues, reports the fault, and no pixel becomes NaN. Exit code 1 and a line per failure."""
import sys
import traceback

import scenes
from anari_c import *
from robust import expect_message
from spec import F, ball, close

BAD = [float("nan"), float("inf"), float("-inf"), -1.0, 0.0, 1e38, -1e38, 1e-38]
KINDS = {"Camera": CAMERA, "Frame": FRAME, "Geometry": GEOMETRY, "Instance": INSTANCE, "Light": LIGHT, "Material": MATERIAL, "Renderer": RENDERER, "Sampler": SAMPLER,
         "SpatialField": SPATIAL_FIELD, "Surface": SURFACE, "Volume": VOLUME}


class Entry(C.Structure):
    _fields_ = [("name", C.c_char_p), ("type", C.c_int)]


def parameters(d, kind, subtype):
    """Names and types of parameters, as the device reports them."""
    entries = C.cast(object_info(d.handle, kind, subtype.encode(), b"parameter", PARAMETER_LIST), C.POINTER(Entry))
    found, i = [], 0
    while entries and entries[i].name:
        found.append((entries[i].name.decode(), entries[i].type))
        i += 1
    return found


def image_is_finite(d, f, why):
    p = draw(d, f)
    assert p is None or np.isfinite(p).all(), why


def numbers_that_are_none_are_named_and_never_reach_a_pixel(d):
    for kind, subtype, name, floats in [
        ("Light", "directional", "irradiance", 1), ("Light", "directional", "direction", 3), ("Light", "point", "intensity", 1), ("Light", "point", "position", 3),
        ("Light", "point", "radius", 1), ("Light", "spot", "openingAngle", 1), ("Light", "spot", "falloffAngle", 1), ("Light", "ring", "radius", 1), ("Light", "ring", "innerRadius", 1),
        ("Light", "quad", "edge1", 3), ("Light", "quad", "radiance", 1), ("Light", "quad", "color", 3),
        ("Material", "matte", "color", 3), ("Material", "matte", "opacity", 1), ("Material", "physicallyBased", "metallic", 1), ("Material", "physicallyBased", "roughness", 1),
        ("Material", "physicallyBased", "emissive", 3), ("Material", "physicallyBased", "ior", 1), ("Material", "physicallyBased", "specular", 1),
        ("Material", "physicallyBased", "transmission", 1), ("Material", "physicallyBased", "attenuationDistance", 1),
        ("Renderer", "default", "ambientRadiance", 1), ("Renderer", "default", "volumeTolerance", 1), ("Renderer", "default", "background", 4),
        ("Camera", "perspective", "fovy", 1), ("Camera", "perspective", "apertureRadius", 1), ("Camera", "omnidirectional", "direction", 3), ("Camera", "orthographic", "height", 1),
        ("Camera", "orthographic", "imageRegion", 4),
    ]:
        for v in BAD:
            o = d.new(kind, subtype)
            o.set(name, FLOAT32_BOX2 if name == "imageRegion" else FLOAT32 + floats - 1, np.full(floats, v, F)).commit()
            settings = dict(ambient=0.5)
            if kind == "Light":
                settings["light"] = o
            if kind == "Material":
                settings["material"] = o
            f = ball(d, **settings).put(size=(15, 15))
            if kind == "Camera":
                f.put(camera=o)
            if kind == "Renderer":
                f.put(renderer=o)
            if name == "background" and not np.isfinite(v):
                draw(d, f)  # The program's own colour fills uncovered pixels.
            else:
                image_is_finite(d, f, f"{subtype} {name} {v}")
            o.release()
    expect_message(d, "`roughness` is NaN", "warning")
    expect_message(d, "light `directional`: its strength is NaN", "error")
    expect_message(d, "camera `perspective`: the frame is not drawn", "error")


def images_do_not_depend_on_the_unit_of_length(d):
    def scene(s):
        points, triangles, _, normals = scenes.grid_mesh()
        g = d.new("Geometry", "triangle", vertex__position=d.array(FLOAT32_VEC3, (points * s).astype(F)), primitive__index=d.array(UINT32_VEC3, triangles),
                  vertex__normal=d.array(FLOAT32_VEC3, normals), vertex__attribute0=d.array(FLOAT32_VEC2, points[:, :2].copy()))
        bend = d.new("Sampler", "image2D", image=d.array(UFIXED8_VEC4, np.uint8([[[160, 128, 240, 255]]]), 2))
        m = d.new("Material", "physicallyBased", baseColor=[0.8, 0.5, 0.3], metallic=0.3, roughness=0.6, normal=bend)
        balls = d.new("Geometry", "sphere", vertex__position=d.array(FLOAT32_VEC3, (F([[0, 0, 0.7], [0.6, 0.2, 0.5]]) * s).astype(F)), radius=float(0.2 * s))
        rod = d.new("Geometry", "cylinder", vertex__position=d.array(FLOAT32_VEC3, (F([[-0.8, -0.8, 0.5], [0.8, -0.5, 0.9]]) * s).astype(F)), radius=float(0.1 * s), caps="both")
        surfaces = scenes.surface(d, g, m) + scenes.surface(d, balls) + scenes.surface(d, rod)
        length = lambda *v: [float(F(c * s)) for c in v]
        lights = [d.new("Light", "quad", position=length(-1, 0.5, 2.5), edge1=length(0, 1, 0), edge2=length(1, 0, 0), radiance=3.0), d.new("Light", "directional", direction=[-0.3, -0.5, -1.0])]
        c = d.new("Camera", "perspective", position=length(0.4, 0.9, 2.9), direction=[-0.4, -0.9, -2.9], up=[0.0, 1.0, 0.0], fovy=0.8, aspect=4 / 3)
        return draw(d, scenes.view(d, dict(surface=surfaces), lights=lights, size=(96, 72), camera=c, pixelSamples=4)).astype(int)

    plain = scene(1.0)
    assert plain.std() > 20
    for s in (1e-18, 1e-9, 1e9, 1e18):
        other = scene(s)
        differ = (np.abs(other - plain).max(-1) > 2).mean()
        assert differ < 0.004, f"scale {s}: {differ:.2%} of the pixels differ"


def changes_while_a_frame_is_drawn_are_for_the_next_one(d):
    m = d.new("Material", "matte", color=[0.5, 0.25, 1.0])
    f = ball(d, material=m, ambient=1.0, renderer="pathtracer", pixelSamples=64)
    points = [o for o in d.keep if getattr(o, "shape", None) == (1, 3)][-1]
    render_frame(d.handle, f.handle)
    m.put(color=[1.0, 0.0, 0.0])
    points[:] = np.nan  # shared memory, which a program must not touch without mapping; the frame has its own copy
    close(draw_again(d, f), [0.5, 0.25, 1.0])
    points[:] = 0
    for _ in range(30):
        render_frame(d.handle, f.handle)
        m.put(color=list(np.random.default_rng(1).random(3)))
        unset_parameter(d.handle, m.handle, b"color")
        m.commit()
    close(draw_again(d, f), [0.8] * 3)


def draw_again(d, f):
    frame_ready(d.handle, f.handle, 1)
    return pixels(d, f)[50, 50, :3]


def frames_of_no_size_are_refused_and_the_next_one_is_drawn(d):
    f = ball(d, ambient=1.0)
    for size in ((0, 0), (0, 5), (5, 0), (2**20, 2**20)):
        assert draw(d, f.put(size=size)) is None, size
    expect_message(d, "`size` is [0, 0]; it must be 1 to 65536 each way", "error")
    f.set("size", FLOAT32_VEC2, F([5, 5])).commit()
    assert draw(d, f) is None
    expect_message(d, "`size` is a FLOAT32_VEC2; it must be UINT32_VEC2", "error")
    assert draw(d, f.put(size=(1, 1))).shape == (1, 1, 4)


def what_moves_is_refused_by_name(d):
    group = d.new("Group", **scenes.sphere(d))
    for subtype in ("motionTransform", "motionScaleRotationTranslation"):
        i = d.new("Instance", subtype, group=group)
        expect_message(d, f"there is no instance `{subtype}`; this device has [\"transform\"]", "error")
        image_is_finite(d, scenes.view(d, dict(instance=[i])), subtype)
    for kind, subtype in (("SpatialField", "unstructured"), ("SpatialField", "nanovdb"), ("Camera", "stereo"), ("Volume", "scivis"), ("Sampler", "compressedImage2D")):
        d.new(kind, subtype)
        expect_message(d, f"`{subtype}`; this device has", "error")
    for kind, subtype, name in (("Geometry", "triangle", "motion.vertex.position"), ("Camera", "perspective", "shutter"), ("Camera", "perspective", "stereoMode"),
                                ("Material", "physicallyBased", "clearcoat"), ("Material", "physicallyBased", "specularColor"), ("Material", "physicallyBased", "sheenColor"),
                                ("Material", "physicallyBased", "iridescence"), ("Material", "physicallyBased", "thickness"), ("Light", "quad", "intensityDistribution"),
                                ("Light", "ring", "c0"), ("Light", "point", "visible"), ("Renderer", "default", "denoise")):
        d.new(kind, subtype).set(name, FLOAT32, F(1)).commit()
        expect_message(d, f"`{subtype}`: there is no parameter `{name}` on this device: it changes nothing", "warning")
    m = d.new("Material", "physicallyBased").set("transmission", SAMPLER, d.new("Sampler", "primitive"))
    m.commit()
    expect_message(d, "`transmission` is a SAMPLER; it must be FLOAT32: it is ignored", "error")


def arrays_of_wrong_elements_and_lengths_are_named(d):
    g = d.new("Geometry", "quad", vertex__position=d.array(FLOAT32_VEC3, F([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])), vertex__normal=d.array(FLOAT32_VEC3, F([[0, 0, 1]])))
    g.set("vertex.tangent", ARRAY1D, d.array(FLOAT32_VEC2, F([[1, 0]] * 4))).commit()
    expect_message(d, "`vertex.tangent` is an array of FLOAT32_VEC2; its elements must be FLOAT32_VEC4", "error")
    g.set("vertex.tangent", ARRAY1D, d.array(FLOAT32_VEC3, F([[np.nan, 0, 0]]))).commit()
    bend = d.new("Sampler", "image2D", image=d.array(FLOAT32_VEC3, F([[[np.nan, 1, 0]]]), 2))
    m = d.new("Material", "physicallyBased", normal=bend, metallic="attribute3", roughness="attribute2")
    image_is_finite(d, ball(d, ambient=1.0).put(world=d.new("World", surface=scenes.surface(d, g, m), light=[scenes.directional(d)])), "short arrays")
    expect_message(d, "`vertex.normal` has 1 elements, 4 are needed", "warning")
    bad = d.new("Material", "physicallyBased", emissive="colour")
    image_is_finite(d, ball(d, material=bad), "an attribute that is none")
    expect_message(d, "`emissive` is \"colour\", which is no attribute", "error")


def random_value(d, r, kind):
    """A value for a parameter, sometimes of another type: (type, numpy value or object)."""
    number = lambda n: F([r.choice([r.normal(), r.random(), *BAD]) for _ in range(n)])
    if r.random() < 0.1:
        kind = int(r.choice([FLOAT32, INT32, FLOAT32_VEC3, FLOAT32_VEC4, STRING, BOOL, UINT64]))
    if kind == STRING:
        return STRING, str(r.choice(["color", "attribute0", "attribute1", "worldNormal", "objectPosition", "both", "front", "linear", "nearest", "repeat", "clampToBorder", "mask", "blend", "", "ä" * 9]))
    if FLOAT32 <= kind <= FLOAT32_VEC4:
        return kind, number(kind - FLOAT32 + 1)
    if kind in (FLOAT32_BOX1, FLOAT32_BOX2, FLOAT32_MAT4):
        return kind, number({FLOAT32_BOX1: 2, FLOAT32_BOX2: 4, FLOAT32_MAT4: 16}[kind])
    if kind in (INT32, UINT32, BOOL, DATA_TYPE):
        return kind, np.uint32(r.choice([0, 1, 2, 3, 7, 2**31, 2**32 - 1]))
    if kind in (UINT64, UINT32_VEC2):
        return kind, np.uint32([r.choice([0, 1, 9, 2**32 - 1]), r.choice([0, 1, 9])])
    if ARRAY1D <= kind <= ARRAY3D:
        dims = kind - ARRAY1D + 1
        element = int(r.choice([FLOAT32, FLOAT32_VEC2, FLOAT32_VEC3, FLOAT32_VEC4, UINT32, UINT32_VEC2, UINT32_VEC3, UINT32_VEC4, UFIXED8_VEC4, FLOAT32_MAT4]))
        shape = [int(r.integers(1, 9)) for _ in range(dims)]
        n = {FLOAT32: 1, FLOAT32_VEC2: 2, FLOAT32_VEC3: 3, FLOAT32_VEC4: 4, UINT32: 1, UINT32_VEC2: 2, UINT32_VEC3: 3, UINT32_VEC4: 4, UFIXED8_VEC4: 4, FLOAT32_MAT4: 16}[element]
        if element in (UINT32, UINT32_VEC2, UINT32_VEC3, UINT32_VEC4):
            values = r.integers(0, 12, shape + [n]).astype(np.uint32)
        elif element == UFIXED8_VEC4:
            values = r.integers(0, 256, shape + [n]).astype(np.uint8)
        else:
            values = number(int(np.prod(shape)) * n).reshape(shape + [n])
        return kind, d.array(element, values, dims)
    return None


def any_value_of_any_parameter_is_survived(d):
    seen, refused = 0, 0
    for seed in range(24):
        r = np.random.default_rng(seed)
        subtypes = lambda kind: strings(object_subtypes(d.handle, KINDS[kind])) or [""]
        made = {kind: d.new(kind, str(r.choice(subtypes(kind)))) for kind in ("Geometry", "Material", "Sampler", "Light", "SpatialField", "Volume", "Camera", "Renderer")}
        made["Surface"] = d.new("Surface", geometry=made["Geometry"], material=made["Material"])
        made["Geometry"].put(vertex__position=d.array(FLOAT32_VEC3, r.normal(size=(9, 3)).astype(F)))
        made["Sampler"].put(image=d.array(FLOAT32_VEC4, r.random((4, 4, 4)).astype(F), 2))
        made["SpatialField"].put(data=d.array(FLOAT32, r.random((4, 4, 4)).astype(F), 3))
        made["Volume"].put(value=made["SpatialField"])
        made["Instance"] = d.new("Instance", "transform", group=d.new("Group", surface=[made["Surface"]], volume=[made["Volume"]], light=[made["Light"]]))
        world = d.new("World", instance=[made["Instance"]], surface=[made["Surface"]], light=[scenes.directional(d)])
        f = d.new("Frame", world=world, camera=made["Camera"], renderer=made["Renderer"], size=(9, 7), channel__color=FLOAT32_VEC4, channel__normal=FLOAT32_VEC3, channel__depth=FLOAT32)
        for _ in range(24):
            kind = str(r.choice([k for k in made]))
            o = made[kind]
            # Parameters of all subtypes: this subtype does not know those of the others.
            names = [p for s in subtypes(kind) for p in parameters(d, KINDS[kind], s)]
            name, of = names[int(r.integers(len(names)))]
            if of in (SAMPLER, DATA_TYPE) or of not in NAMES:
                o.set(name, SAMPLER, made["Sampler"])
            elif (value := random_value(d, r, of)) is not None and name not in ("size", "pixelSamples", "maxDepth", "lightSamples", "ambientSamples"):
                o.set(name, *value)
            o.commit()
            seen += 1
            p = draw(d, f)
            refused += p is None
            if p is not None:
                # Uncovered pixels show the program's own background, whatever its values.
                hit = np.isfinite(pixels(d, f, "channel.depth")) & (p[..., 3] == 1)
                assert np.isfinite(p[hit]).all() or kind == "Renderer", f"seed {seed}: {kind} {name}: {p[hit]}"
                assert np.isfinite(pixels(d, f, "channel.normal")).all(), f"seed {seed}: {kind} {name}"
    assert seen == 24 * 24 and refused < seen / 2, (seen, refused)


if __name__ == "__main__":
    failed = 0
    for name, test in list(globals().items()):
        helpers = ("parameters", "image_is_finite", "draw_again", "random_value")
        if callable(test) and getattr(test, "__module__", "") == "__main__" and name not in helpers and name != "Entry":
            d = Device("rtv")
            try:
                test(d)
            except Exception:
                failed += 1
                print(f"{name}:\n{traceback.format_exc()}{d.messages[-4:]}", flush=True)
    sys.exit(failed > 0)
