"""Frames of gmsh, one for each line that comes: the library that the program `gmsh` is, called through its C interface."""
import ctypes, ctypes.util, glob, sys

names = [ctypes.util.find_library("gmsh")] + sorted(glob.glob("/usr/lib/*/libgmsh.so*")) + ["libgmsh.so"]
gmsh = None
for name in filter(None, names):
    try:
        gmsh = ctypes.CDLL(name)
        break
    except OSError:
        pass
if gmsh is None:
    sys.exit("libgmsh cannot be loaded")
error = ctypes.c_int(0)


def call(name, *arguments):
    getattr(gmsh, name)(*arguments, ctypes.byref(error))
    if error.value:
        sys.exit("%s: error %d" % (name, error.value))


def option(name, value):
    call("gmshOptionSetNumber", name.encode(), ctypes.c_double(value))


file, size = sys.argv[1], int(sys.argv[2])
arguments = (ctypes.c_char_p * 2)(b"gmsh", b"-nopopup")
# Newer versions take an additional argument; older ones ignore it.
call("gmshInitialize", ctypes.c_int(2), arguments, ctypes.c_int(0))
for name, value in {
    "General.Terminal": 0, "General.GraphicsWidth": size, "General.GraphicsHeight": size, "General.MenuWidth": 0,
    "General.Trackball": 0, "General.RotationX": -60, "General.RotationZ": 30, "Mesh.SurfaceFaces": 1, "Mesh.SurfaceEdges": 0,
}.items():
    option(name, value)
call("gmshMerge", file.encode())
call("gmshFltkInitialize")
call("gmshFltkWait", ctypes.c_double(0.3))
print("ready", flush=True)
angle = 30
for line in sys.stdin:
    angle += 5
    option("General.RotationZ", angle)
    call("gmshGraphicsDraw")
    print("frame", flush=True)
