"""Programs that misuse the interface, and inputs at the limits: the device must continue and report the fault. Exit code 1 and a line per failure."""
import gc
import sys
import threading
import traceback

import scenes
from anari_c import *

F = np.float32


def expect_message(d, text, severity=None):
    found = [m for m in d.messages if text in m[1] and severity in (None, m[0])]
    assert found, f"no message contains {text!r}: {d.messages}"


def wrong_types_are_named_and_ignored(d):
    g = d.new("Geometry", "sphere", vertex__position=d.array(FLOAT32_VEC3, F([[0, 0, 0]])))
    g.set("radius", INT32, np.int32(3)).commit()
    expect_message(d, "`radius` is a INT32; it must be FLOAT32", "error")
    g.set("vertex.position", ARRAY1D, d.array(UINT32, np.uint32([1, 2, 3]))).commit()
    expect_message(d, "array of UINT32; its elements must be FLOAT32_VEC3", "error")
    d.new("Material", "matte", alphaMode="sometimes")
    expect_message(d, '`alphaMode` is "sometimes"', "error")
    f = d.new("Frame", channel__color=FLOAT32_VEC3)
    expect_message(d, "`channel.color` is FLOAT32_VEC3; it must be one of", "error")
    g.set("material", MATERIAL, f)
    expect_message(d, "is given as MATERIAL, but it is a FRAME", "error")


def unknown_names_are_told_once(d):
    for _ in range(3):
        d.new("Renderer", "default").set("pixelsamples", INT32, np.int32(3))
    m = d.new("Material", "matte")
    for _ in range(5):
        m.set("shininess", FLOAT32, F(3))
    expect_message(d, "did you mean `pixelSamples`?", "warning")
    assert sum("shininess" in t for _, t in d.messages) == 1, d.messages


def unknown_subtypes_draw_nothing_and_are_named(d):
    g = d.new("Geometry", "teapot").set("lid", FLOAT32, F(1)).commit()
    expect_message(d, "there is no geometry `teapot`", "error")
    s = d.new("Surface", geometry=g, material=d.new("Material", "matte"))
    p = draw(d, scenes.view(d, dict(surface=[s] + scenes.triangle(d)["surface"])))
    assert p.std() > 5, "the rest is drawn"
    expect_message(d, "this device has no geometry `teapot`")
    assert draw(d, scenes.view(d, {}, camera=d.new("Camera", "fisheye"))) is None


def frames_without_world_or_commit_are_refused(d):
    f = d.new("Frame")
    assert draw(d, f) is None
    expect_message(d, '["world", "camera", "renderer", "size"] not set', "error")
    f = scenes.view(d, scenes.triangle(d))
    f.put(size=(0, 7))
    assert draw(d, f) is None
    expect_message(d, "`size` is [0, 7]", "error")
    assert f.property("duration", FLOAT32) is None and d.property("nothing", FLOAT32) is None


def objects_can_be_released_in_any_order(d):
    made = []
    original = Device.new

    def noting(self, *a, **k):
        made.append(original(self, *a, **k))
        return made[-1]

    Device.new = noting
    try:
        f = scenes.view(d, scenes.sphere(d))
    finally:
        Device.new = original
    before = draw(d, f)
    for o in np.random.default_rng(1).permutation([o for o in made if o is not f]):
        o.release()
    assert (draw(d, f) == before).all(), "the frame keeps what it needs"
    f.release()
    for o in made:
        o.release()
    expect_message(d, "is no object of this device; it was released", "error")
    assert map_frame(d.handle, f.handle, b"channel.color", U32(), U32(), U32()) is None


def memory_may_be_freed_when_its_array_is_released(d):
    f, shared = None, np.random.default_rng(0).random((5000, 3)).astype(F) * 2 - 1
    a = d.array(FLOAT32_VEC3, shared)
    keep, d.keep = d.keep, []
    radius = 0.02
    s = d.new("Surface", geometry=d.new("Geometry", "sphere", vertex__position=a, radius=radius), material=d.new("Material", "matte"))
    f = scenes.view(d, dict(surface=[s]))
    a.release()
    keep[0][:] = np.nan  # as if freed
    del keep, shared
    gc.collect()
    p = draw(d, f)
    assert p.std() > 5 and not [t for s, t in d.messages if "NaN" in t], d.messages


def deleters_are_called_once_when_nobody_needs_the_array(d):
    calls = []
    deleter = DELETER(lambda user, memory: calls.append(memory))
    d.keep.append(deleter)
    points = F([[0, 0, 0]])
    handle = new_array1d(d.handle, points.ctypes.data, C.cast(deleter, P), None, FLOAT32_VEC3, 1)
    g = d.new("Geometry", "sphere", vertex__position=Object(d, handle, ARRAY1D))
    release(d.handle, handle)
    assert calls == [], "the geometry has it"
    g.release()
    assert calls == [points.ctypes.data], calls


def mapped_parameter_arrays_are_the_devices_own(d):
    g = d.new("Geometry", "sphere", radius=0.5)
    stride = U64()
    memory = map_parameter1d(d.handle, g.handle, b"vertex.position", FLOAT32_VEC3, 2, stride)
    assert memory and stride.value == 12 and memory % 16 == 0
    C.memmove(memory, F([[0, 0, 0], [0.5, 0, 0]]).ctypes.data, 24)
    unmap_parameter(d.handle, g.handle, b"vertex.position")
    g.commit()
    s = d.new("Surface", geometry=g, material=d.new("Material", "matte"))
    assert draw(d, scenes.view(d, dict(surface=[s]))).std() > 5
    unmap_parameter(d.handle, g.handle, b"vertex.radius")
    expect_message(d, "`vertex.radius` is not set to an array", "error")


def nan_and_empty_geometry_is_left_out_and_counted(d):
    points = scenes.grid_mesh()[0].copy()
    points[::5] = np.nan
    triangles = scenes.grid_mesh()[1].copy()
    triangles[3] = [0, 1, 4_000_000_000]
    g = d.new("Geometry", "triangle", vertex__position=d.array(FLOAT32_VEC3, points), primitive__index=d.array(UINT32_VEC3, triangles))
    assert draw(d, scenes.view(d, dict(surface=scenes.surface(d, g)))).std() > 2
    expect_message(d, "29 of 144 vertices are NaN or infinite", "warning")
    expect_message(d, "1 of 242 primitives name vertices past the last one", "warning")
    assert new_array1d(d.handle, None, None, None, FLOAT32_VEC3, 0) is None
    expect_message(d, "an array must have at least one", "error")
    assert new_array3d(d.handle, None, None, None, FLOAT32, 2**40, 2**40, 2**40) is None
    expect_message(d, "are more than fit into memory", "error")
    empty = d.new("Geometry", "curve")
    assert draw(d, scenes.view(d, dict(surface=scenes.surface(d, empty)), lights=[])) is not None
    expect_message(d, "`vertex.position` is not set", "error")


def bad_cameras_and_matrices_are_named(d):
    f = scenes.view(d, scenes.triangle(d), camera=d.new("Camera", "perspective", direction=[0.0, 1.0, 0.0], up=[0.0, 1.0, 0.0]))
    assert draw(d, f) is None
    expect_message(d, "camera `perspective`: the frame is not drawn", "error")
    group = d.new("Group", **scenes.triangle(d))
    i = d.new("Instance", "transform", group=group, transform=np.zeros((4, 4), F))
    assert draw(d, scenes.view(d, dict(instance=[i]))) is not None
    expect_message(d, "1 of 1 matrices are singular", "warning")


def two_devices_do_not_mix(d):
    other = Device("rtv")
    foreign = other.new("Material", "matte")
    d.new("Surface").set("material", MATERIAL, foreign)
    expect_message(d, "belongs to another device", "error")
    a, b = draw(d, scenes.view(d, scenes.cone(d))), draw(other, scenes.view(other, scenes.cone(other)))
    assert (a == b).all()
    other.close()
    assert (draw(d, scenes.view(d, scenes.cone(d))) == a).all(), "goes on without the other"


def many_threads_may_draw_at_once(d):
    frames = [scenes.view(d, s(d)) for s in (scenes.sphere, scenes.curve, scenes.volume, scenes.image2d)]
    expected = [draw(d, f) for f in frames]
    wrong = []

    def work(i):
        for _ in range(4):
            if not (draw(d, frames[i]) == expected[i]).all():
                wrong.append(i)

    threads = [threading.Thread(target=work, args=(i,)) for i in range(len(frames))]
    [t.start() for t in threads]
    [t.join() for t in threads]
    assert not wrong, wrong


def frames_run_beside_the_program_and_can_be_discarded(d):
    f = scenes.view(d, scenes.sphere(d), size=(512, 512), renderer="pathtracer", pixelSamples=4000)
    render_frame(d.handle, f.handle)
    assert frame_ready(d.handle, f.handle, 0) == 0, "4000 samples take a while"
    discard_frame(d.handle, f.handle)
    assert frame_ready(d.handle, f.handle, 1) == 1
    assert pixels(d, f).shape == (512, 512, 4)


def completion_callbacks_come_once_a_frame(d):
    seen = []
    callback = COMPLETED(lambda user, device, frame: seen.append((user, frame)))
    d.keep.append(callback)
    f = scenes.view(d, scenes.triangle(d))
    f.set("frameCompletionCallback", FRAME_COMPLETION_CALLBACK, callback).set("frameCompletionCallbackUserData", VOID_POINTER, 77).commit()
    draw(d, f)
    draw(d, f)
    f.release()  # waits for running callbacks
    assert seen == [(77, f.handle)] * 2, seen


def the_device_can_be_released_with_everything_in_use(d):
    other = Device("rtv")
    f = scenes.view(other, scenes.sphere(other), size=(512, 512), renderer="pathtracer", pixelSamples=4000)
    render_frame(other.handle, f.handle)
    other.close()
    assert any("objects that were not" in t for _, t in other.messages), other.messages


if __name__ == "__main__":
    failed = 0
    for name, test in list(globals().items()):
        if callable(test) and getattr(test, "__module__", "") == "__main__" and name != "expect_message":
            d = Device("rtv")
            try:
                test(d)
            except Exception:
                failed += 1
                print(f"{name}:\n{traceback.format_exc()}", flush=True)
    print("robust", flush=True)
    sys.exit(failed > 0)
