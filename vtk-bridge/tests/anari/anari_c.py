"""ANARI's C functions through ctypes, from the loader in the wheel pynari; numpy arrays as input and output.

Used by the test programs next to it, with any device: `Device("rtv")`, `Device("barney")`.
"""
import ctypes as C
import importlib.util
import os

import numpy as np

TYPES = dict(
    DATA_TYPE=100, STRING=101, VOID_POINTER=102, BOOL=103, STRING_LIST=150, DATA_TYPE_LIST=151, PARAMETER_LIST=152, STATUS_CALLBACK=202,
    FRAME_COMPLETION_CALLBACK=203, DEVICE=501, OBJECT=502, ARRAY1D=504, ARRAY2D=505, ARRAY3D=506, CAMERA=507, FRAME=508, GEOMETRY=509,
    GROUP=510, INSTANCE=511, LIGHT=512, MATERIAL=513, RENDERER=514, SURFACE=515, SAMPLER=516, SPATIAL_FIELD=517, VOLUME=518, WORLD=519,
    UINT8=1004, INT32=1016, UINT32=1020, UINT32_VEC2=1021, UINT32_VEC3=1022, UINT32_VEC4=1023, UINT64=1028, UFIXED8=1036, UFIXED8_VEC3=1038,
    UFIXED8_VEC4=1039, FIXED16_VEC3=1042, UFIXED16=1044, FLOAT32=1068, FLOAT32_VEC2=1069, FLOAT32_VEC3=1070, FLOAT32_VEC4=1071, FLOAT64=1072,
    UFIXED8_RGB_SRGB=2002, UFIXED8_RGBA_SRGB=2003, FLOAT32_BOX1=2008, FLOAT32_BOX2=2009, FLOAT32_BOX3=2010, FLOAT32_MAT4=2014, UINT64_REGION1=2104,
)
globals().update(TYPES)
NAMES = {v: k for k, v in TYPES.items()}
# numpy type and components of the types in which frames are mapped
PIXELS = {UFIXED8_VEC4: (np.uint8, 4), UFIXED8_RGBA_SRGB: (np.uint8, 4), UFIXED8_VEC3: (np.uint8, 3), UFIXED8_RGB_SRGB: (np.uint8, 3),
          FLOAT32: (np.float32, 1), FLOAT32_VEC3: (np.float32, 3), FLOAT32_VEC4: (np.float32, 4), UINT32: (np.uint32, 1), FIXED16_VEC3: (np.int16, 3)}
SEVERITIES = {1: "fatal", 2: "error", 3: "warning", 4: "performance", 5: "info", 6: "debug"}

_folder = os.path.dirname(importlib.util.find_spec("pynari").origin)
LOADER = C.CDLL(os.path.join(_folder, "libanari.so.0"), mode=C.RTLD_GLOBAL)
P, U64, U32, S = C.c_void_p, C.c_uint64, C.c_uint32, C.c_char_p
STATUS = C.CFUNCTYPE(None, P, P, P, C.c_int, C.c_int, C.c_int, S)
DELETER = C.CFUNCTYPE(None, P, P)
COMPLETED = C.CFUNCTYPE(None, P, P, P)


def _function(name, result, *arguments):
    f = getattr(LOADER, name)
    f.restype, f.argtypes = result, arguments
    return f


load_library = _function("anariLoadLibrary", P, S, STATUS, P)
unload_library = _function("anariUnloadLibrary", None, P)
new_device = _function("anariNewDevice", P, P, S)
device_subtypes = _function("anariGetDeviceSubtypes", C.POINTER(S), P)
device_extensions = _function("anariGetDeviceExtensions", C.POINTER(S), P, S)
new_array1d = _function("anariNewArray1D", P, P, P, P, P, U32, U64)
new_array2d = _function("anariNewArray2D", P, P, P, P, P, U32, U64, U64)
new_array3d = _function("anariNewArray3D", P, P, P, P, P, U32, U64, U64, U64)
set_parameter = _function("anariSetParameter", None, P, P, S, U32, P)
unset_parameter = _function("anariUnsetParameter", None, P, P, S)
unset_all = _function("anariUnsetAllParameters", None, P, P)
map_parameter1d = _function("anariMapParameterArray1D", P, P, P, S, U32, U64, C.POINTER(U64))
unmap_parameter = _function("anariUnmapParameterArray", None, P, P, S)
commit = _function("anariCommitParameters", None, P, P)
release = _function("anariRelease", None, P, P)
retain = _function("anariRetain", None, P, P)
map_array = _function("anariMapArray", P, P, P)
unmap_array = _function("anariUnmapArray", None, P, P)
get_property = _function("anariGetProperty", C.c_int, P, P, S, U32, P, U64, U32)
object_subtypes = _function("anariGetObjectSubtypes", C.POINTER(S), P, U32)
object_info = _function("anariGetObjectInfo", P, P, U32, S, S, U32)
parameter_info = _function("anariGetParameterInfo", P, P, U32, S, S, U32, S, U32)
render_frame = _function("anariRenderFrame", None, P, P)
frame_ready = _function("anariFrameReady", C.c_int, P, P, U32)
discard_frame = _function("anariDiscardFrame", None, P, P)
map_frame = _function("anariMapFrame", P, P, P, S, C.POINTER(U32), C.POINTER(U32), C.POINTER(U32))
unmap_frame = _function("anariUnmapFrame", None, P, P, S)
_PLAIN = {k: _function(f"anariNew{k}", P, P) for k in ("Surface", "Group", "World", "Frame")}
_TYPED = {k: _function(f"anariNew{k}", P, P, S)
          for k in ("Geometry", "Material", "Sampler", "SpatialField", "Volume", "Light", "Instance", "Camera", "Renderer")}
_KIND = dict(Surface=SURFACE, Group=GROUP, World=WORLD, Frame=FRAME, Geometry=GEOMETRY, Material=MATERIAL, Sampler=SAMPLER, SpatialField=SPATIAL_FIELD,
             Volume=VOLUME, Light=LIGHT, Instance=INSTANCE, Camera=CAMERA, Renderer=RENDERER)


def strings(pointer):
    """Decodes a null-terminated C list of strings."""
    out, i = [], 0
    while pointer and pointer[i]:
        out.append(pointer[i].decode())
        i += 1
    return out


class Object:
    def __init__(self, device, handle, kind):
        self.device, self.handle, self.kind = device, handle, kind

    def set(self, name, kind, value):
        """Sets a parameter of an explicit type."""
        d, n = self.device.handle, name.encode()
        if kind == STRING:
            set_parameter(d, self.handle, n, kind, C.cast(C.c_char_p(value.encode()), P))
        elif kind == VOID_POINTER:
            set_parameter(d, self.handle, n, kind, value)
        elif isinstance(value, Object):
            h = C.c_void_p(value.handle)
            set_parameter(d, self.handle, n, kind, C.cast(C.byref(h), P))
        elif isinstance(value, C._CFuncPtr):
            set_parameter(d, self.handle, n, kind, C.cast(C.byref(value), P))
        else:
            a = np.ascontiguousarray(value)
            set_parameter(d, self.handle, n, kind, a.ctypes.data)
        return self

    def put(self, **values):
        """Sets parameters, with types inferred from the values, and commits. `__` in names stands for a dot."""
        for name, v in values.items():
            name = name.replace("__", ".")
            if isinstance(v, Object):
                self.set(name, v.kind, v)
            elif isinstance(v, bool):
                self.set(name, BOOL, np.int32(v))
            elif isinstance(v, int):
                self.set(name, DATA_TYPE if name.startswith("channel.") else (UINT32 if name == "id" else INT32), np.uint32(v))
            elif isinstance(v, float):
                self.set(name, FLOAT32, np.float32(v))
            elif isinstance(v, str):
                self.set(name, STRING, v)
            elif name == "size":
                self.set(name, UINT32_VEC2, np.uint32(v))
            elif name == "imageRegion":
                self.set(name, FLOAT32_BOX2, np.float32(v))
            elif name == "valueRange":
                self.set(name, FLOAT32_BOX1, np.float32(v))
            elif isinstance(v, list) and v and isinstance(v[0], Object):
                a = self.device.objects(v)
                self.set(name, ARRAY1D, a)
                a.release()
            else:
                v = np.asarray(v, np.float32)
                self.set(name, FLOAT32_MAT4 if v.size == 16 else {2: FLOAT32_VEC2, 3: FLOAT32_VEC3, 4: FLOAT32_VEC4}[v.size], v)
        return self.commit()

    def commit(self):
        commit(self.device.handle, self.handle)
        return self

    def release(self):
        release(self.device.handle, self.handle)

    def property(self, name, kind, values=1, wait=True):
        """A property as a numpy array, or None."""
        numpy_type = {FLOAT32: np.float32, FLOAT32_BOX3: np.float32, INT32: np.int32, UINT64: np.uint64}[kind]
        out = np.zeros(values, numpy_type)
        found = get_property(self.device.handle, self.handle, name.encode(), kind, out.ctypes.data, out.nbytes, int(wait))
        return out if found else None


class Device(Object):
    def __init__(self, name):
        self.messages = []

        def told(_user, _device, source, kind, severity, code, text):
            self.messages.append((SEVERITIES.get(severity, severity), text.decode()))

        self._callback = STATUS(told)
        self.library = load_library(name.encode(), self._callback, None)
        assert self.library, f"{name} cannot be loaded: {self.messages}"
        handle = new_device(self.library, b"default")
        assert handle, f"{name} makes no device: {self.messages}"
        super().__init__(self, handle, DEVICE)
        self.keep = []
        self.commit()

    def new(self, kind, subtype=None, **parameters):
        handle = _PLAIN[kind](self.handle) if kind in _PLAIN else _TYPED[kind](self.handle, (subtype or "default").encode())
        return Object(self, handle, _KIND[kind]).put(**parameters)

    def array(self, kind, values, dims=1):
        """An array over numpy's memory, which is kept alive with the device. Dimensions: x first, as in ANARI."""
        a = np.ascontiguousarray(values)
        self.keep.append(a)
        shape = a.shape[:dims][::-1] if dims > 1 else (a.shape[0],)
        new = {1: new_array1d, 2: new_array2d, 3: new_array3d}[dims]
        return Object(self, new(self.handle, a.ctypes.data, None, None, kind, *shape), ARRAY1D + dims - 1)

    def objects(self, objects):
        return self.array({o.kind for o in objects}.pop(), np.array([o.handle for o in objects], np.uint64))

    def errors(self):
        return [t for s, t in self.messages if s in ("fatal", "error")]

    def close(self):
        release(self.handle, self.handle)


def draw(device, frame, channel="channel.color"):
    """Renders and returns a channel's pixels, first row at the bottom."""
    render_frame(device.handle, frame.handle)
    frame_ready(device.handle, frame.handle, 1)
    return pixels(device, frame, channel)


def pixels(device, frame, channel="channel.color"):
    w, h, t = U32(), U32(), U32()
    p = map_frame(device.handle, frame.handle, channel.encode(), w, h, t)
    if not p:
        return None
    kind, n = PIXELS[t.value]
    count = w.value * h.value * n
    raw = np.ctypeslib.as_array(C.cast(p, C.POINTER(np.ctypeslib.as_ctypes_type(kind))), (count,)).copy()
    unmap_frame(device.handle, frame.handle, channel.encode())
    return raw.reshape(h.value, w.value, n) if n > 1 else raw.reshape(h.value, w.value)


def psnr(a, b):
    """PSNR of two 8-bit images, in decibels."""
    error = np.mean((a.astype(float) - b.astype(float)) ** 2)
    return 99.0 if error == 0 else 10 * np.log10(255.0**2 / error)
