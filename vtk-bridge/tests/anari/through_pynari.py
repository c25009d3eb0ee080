"""A program as users of pynari write it, with only pynari: `through_pynari.py [DEVICE]`. Checks the colours of known pixels on our device; exit code 1 when one is wrong."""
import sys

import numpy as np
import pynari as anari

F = np.float32
device = anari.newDevice(sys.argv[1] if len(sys.argv) > 1 else "rtv")


def matte(*color):
    m = device.newMaterial("matte")
    m.setParameter("color", anari.float3, color)
    m.commitParameters()
    return m


def surface(kind, material, **arrays):
    g = device.newGeometry(kind)
    for name, (element, values) in arrays.items():
        if np.ndim(values) == 0:
            g.setParameter(name, element, values)
        else:
            g.setParameter(name.replace("_", "."), anari.ARRAY, device.newArray(element, np.ascontiguousarray(values)))
    g.commitParameters()
    s = device.newSurface()
    s.setParameter("geometry", anari.GEOMETRY, g)
    s.setParameter("material", anari.MATERIAL, material)
    s.commitParameters()
    return s


# Next to each other along x: a square of two triangles, a ball and a cylinder.
square = F([[-3, -1, 0], [-1, -1, 0], [-1, 1, 0], [-3, 1, 0]])
surfaces = [
    surface("triangle", matte(1.0, 0.0, 0.0), vertex_position=(anari.FLOAT32_VEC3, square), primitive_index=(anari.UINT32_VEC3, np.uint32([[0, 1, 2], [0, 2, 3]]))),
    surface("sphere", matte(0.0, 0.5, 0.0), vertex_position=(anari.FLOAT32_VEC3, F([[0, 0, 0]])), radius=(anari.FLOAT32, 0.9)),
    surface("cylinder", matte(0.0, 0.0, 0.25), vertex_position=(anari.FLOAT32_VEC3, F([[2, -1, 0], [2, 1, 0]])), radius=(anari.FLOAT32, 0.7)),
]
world = device.newWorld()
world.setParameterArray("surface", anari.SURFACE, surfaces)
light = device.newLight("directional")
light.setParameter("direction", anari.float3, (0.0, 0.0, -1.0))
light.setParameter("irradiance", anari.FLOAT32, float(np.pi))
light.commitParameters()
world.setParameterArray("light", anari.LIGHT, [light])
world.commitParameters()

camera = device.newCamera("orthographic")
for name, kind, value in (("position", anari.float3, (0.0, 0.0, 9.0)), ("direction", anari.float3, (0.0, 0.0, -1.0)), ("up", anari.float3, (0.0, 1.0, 0.0)),
                          ("height", anari.FLOAT32, 3.0), ("aspect", anari.FLOAT32, 2.0)):
    camera.setParameter(name, kind, value)
camera.commitParameters()
renderer = device.newRenderer("default")
renderer.setParameter("background", anari.float4, (0.25, 0.25, 0.25, 1.0))
renderer.setParameter("ambientRadiance", anari.FLOAT32, 0.0)
renderer.commitParameters()

frame = device.newFrame()
frame.setParameter("size", anari.uint2, (120, 60))
frame.setParameter("channel.color", anari.DATA_TYPE, anari.UFIXED8_VEC4)
for name, kind, value in (("renderer", anari.OBJECT, renderer), ("camera", anari.OBJECT, camera), ("world", anari.OBJECT, world)):
    frame.setParameter(name, kind, value)
frame.commitParameters()
frame.render()
picture = frame.get("channel.color")
# pynari returns (width, height, 4) or (height, width, 4), depending on its version.
picture = picture if picture.shape[0] == 60 else picture.reshape(60, 120, 4)
expected = {(20, 30): (255, 0, 0), (60, 30): (0, 128, 0), (100, 30): (0, 0, 64), (60, 1): (64, 64, 64)}
wrong = {at: picture[at[1], at[0], :3].tolist() for at, color in expected.items() if np.abs(picture[at[1], at[0], :3].astype(int) - color).max() > 1}
print(wrong or "as expected")
sys.exit(bool(wrong))
