"""The shared library and its structures: include/rtv.h in ctypes."""
import ctypes as C
import os

import numpy as np

ABI = 3395303342
#: The first VTK whose renderers Python can replace.
OLDEST_VTK = (9, 4)
NONE, U8, F32, F64, I32, I64 = range(6)
COLOR_PROPERTY, COLOR_POINTS, COLOR_CELLS, COLOR_MAPPED = range(4)
LIGHT_DIRECTIONAL, LIGHT_POINT, LIGHT_SPOT = range(3)
POINTS, WIREFRAME, SURFACE = range(3)
CHOICE_RAYS, CHOICE_OPENGL, CHOICE_ASK_AGAIN = range(3)
TEXTURE, TEXTURE_TRANSFORM, TEXTURE_CUBE_MAP, TEXTURE_MIPMAP, TEXTURE_FRONT_ONLY = 1, 2, 4, 8, 16
_KINDS = {np.dtype(np.uint8): U8, np.dtype(np.float32): F32, np.dtype(np.float64): F64, np.dtype(np.int32): I32, np.dtype(np.int64): I64}


class RtvError(Exception):
    """Raised if the library cannot be used; the text says why and what to do."""


class Array(C.Structure):
    _fields_ = [("data", C.c_void_p), ("tuples", C.c_uint64), ("components", C.c_uint32), ("kind", C.c_uint32)]

    @classmethod
    def of(cls, numbers):
        """Wraps a contiguous numpy array, which must outlive the call that uses it."""
        tuples = numbers.shape[0]
        return cls(numbers.ctypes.data, tuples, numbers.size // tuples if tuples else 1, _KINDS[numbers.dtype])


class Cells(C.Structure):
    _fields_ = [("offsets", Array), ("connectivity", Array)]


class Property(C.Structure):
    _fields_ = [(n, C.c_float * 3) for n in ("ambient_color", "diffuse_color", "specular_color")]
    _fields_ += [(n, C.c_float) for n in ("ambient", "diffuse", "specular", "specular_power", "opacity", "metallic", "roughness", "base_ior")]
    _fields_ += [(n, C.c_uint32) for n in ("flat", "lighting", "pbr", "cull_front", "cull_back")]
    _fields_ += [("edge_color", C.c_float * 3), ("edge_width", C.c_float)]


class Image(C.Structure):
    _fields_ = [("texels", Array), ("key", C.c_uint64), ("width", C.c_uint32)]
    _fields_ += [(n, C.c_uint8) for n in ("interpolate", "repeat", "srgb", "reserved")]


class Maps(C.Structure):
    _fields_ = [(n, Image) for n in ("material", "normal", "emissive")]
    _fields_ += [("normal_scale", C.c_float), ("occlusion_strength", C.c_float), ("emissive_factor", C.c_float * 3), ("reserved", C.c_uint32)]


class Surface(C.Structure):
    _fields_ = [
        ("name", C.c_char_p), ("shape_key", C.c_uint64), ("color_key", C.c_uint64), ("texture_key", C.c_uint64), ("points", Array),
        ("verts", Cells), ("lines", Cells), ("polys", Cells), ("strips", Cells), ("point_normals", Array), ("cell_normals", Array),
        ("texcoords", Array), ("clip_planes", Array), ("color_source", C.c_uint32), ("edges_only", C.c_uint32), ("colors", Array), ("map", Array),
        ("nan_color", C.c_uint8 * 4), ("texture_interpolate", C.c_uint8), ("texture_repeat", C.c_uint8), ("texture_srgb", C.c_uint8), ("reserved", C.c_uint8),
        ("texture", Array), ("texture_width", C.c_uint32), ("has_back", C.c_uint32), ("property", Property), ("back", Property),
        ("world_from_data", C.c_double * 16), ("glyph_matrices", Array), ("glyph_colors", Array), ("point_radius", C.c_double),
        ("line_radius", C.c_double), ("tangents", Array), ("maps", C.POINTER(Maps)),
    ]


class Volume(C.Structure):
    _fields_ = [
        ("name", C.c_char_p), ("scalar_key", C.c_uint64), ("scalars", Array), ("dims", C.c_uint32 * 3), ("nearest", C.c_uint32),
        ("spacing", C.c_double * 3), ("world_from_data", C.c_double * 16), ("range", C.c_double * 2), ("colors", Array), ("opacities", Array),
        ("unit_distance", C.c_double), ("sample_distance", C.c_double), ("viewer", C.c_double * 3), ("shade", C.c_uint32), ("ambient", C.c_float), ("diffuse", C.c_float), ("specular", C.c_float),
        ("specular_power", C.c_float), ("specular_mirrored", C.c_uint32), ("lights", Array), ("gradient_opacities", Array),
        ("steepest", C.c_double), ("blend", C.c_uint32), ("has_viewer", C.c_uint32), ("isovalues", Array),
        ("cells", C.c_uint32), ("cropping_regions", C.c_uint32), ("cropping_planes", C.c_double * 6), ("clip_planes", Array),
        ("cropping_in_texels", C.c_uint32), ("clipping_in_texels", C.c_uint32),
    ]


class Light(C.Structure):
    _fields_ = [
        ("position", C.c_double * 3), ("focal_point", C.c_double * 3), ("cone_angle_deg", C.c_double), ("exponent", C.c_double),
        ("color", C.c_float * 3), ("attenuation", C.c_float * 3), ("kind", C.c_uint32), ("headlight", C.c_uint32),
    ]


class View(C.Structure):
    _fields_ = [
        ("clip_from_world", C.c_double * 16), ("viewer", C.c_double * 3),
        ("background_bottom", C.c_float * 3), ("background_top", C.c_float * 3),
        ("focus_distance", C.c_double), ("width", C.c_uint32), ("height", C.c_uint32), ("interactive", C.c_uint32), ("shadows", C.c_uint32),
        ("window_samples", C.c_uint32), ("one_layer", C.c_uint32), ("has_viewer", C.c_uint32),
    ]


class Picture(C.Structure):
    _fields_ = [
        ("width", C.c_uint32), ("height", C.c_uint32), ("opaque", C.POINTER(C.c_uint8)), ("blended", C.POINTER(C.c_float)),
        ("depth", C.POINTER(C.c_float)), ("first_depth", C.POINTER(C.c_float)), ("straight", C.POINTER(C.c_uint16)),
    ]


class ActorFacts(C.Structure):
    _fields_ = [("actor_class", C.c_char_p), ("mapper_class", C.c_char_p)]
    _fields_ += [(n, C.c_uint32) for n in (
        "representation", "pbr", "edge_visibility", "lines_as_tubes", "vertex_visibility", "translucent", "num_clipping_planes", "has_back")]
    _fields_ += [(n, C.c_double) for n in ("back_opacity", "edge_opacity", "coat_strength", "anisotropy", "metallic")]
    _fields_ += [("edge_tint", C.c_double * 3)]
    _fields_ += [(n, C.c_uint32) for n in (
        "shader_code", "glyphs", "texture", "num_textures", "albedo", "material", "normal", "emissive", "no_data", "block_scalars",
        "polygon_offset", "image_lighting")]


class SceneFacts(C.Structure):
    _fields_ = [("pixels", C.c_uint64)]
    _fields_ += [(n, C.c_uint32) for n in (
        "props", "shadows", "interactive", "known", "software", "python", "volumes", "others", "translucent", "edges")]
    _fields_ += [("triangles", C.c_uint64)]


class SurfaceFacts(C.Structure):
    _fields_ = [(n, C.c_uint64) for n in ("num_verts", "num_lines")]
    _fields_ += [(n, C.c_uint32) for n in (
        "representation", "not_polygons", "triangulated", "edges", "texture", "maps", "has_back", "color_source", "invalid_arrays",
        "unreadable_cells", "cell_components", "reserved")]
    _fields_ += [("cell_type", C.c_char_p), ("cell_array_class", C.c_char_p)]


class GlyphFacts(C.Structure):
    _fields_ = [(n, C.c_uint32) for n in (
        "source_table_tree", "num_clipping_planes", "num_sources", "data_set", "composite", "block_attributes", "num_blocks_without_points",
        "has_source")]
    _fields_ += [(n, C.c_uint64) for n in ("num_source_polygons", "num_other_source_cells")]
    _fields_ += [(n, C.c_uint32) for n in ("has_colors", "color_components")]
    _fields_ += [(n, C.c_uint64) for n in ("num_colors", "num_points")]


class VolumeFacts(C.Structure):
    _fields_ = [("volume_class", C.c_char_p), ("mapper_class", C.c_char_p)]
    _fields_ += [(n, C.c_uint32) for n in (
        "cropping", "num_clipping_planes", "mask", "scattering", "vectors", "transfer_function_2d", "labels", "blend_mode", "gradient_opacity",
        "shade", "num_lights", "num_positional_lights", "num_ambient_lights", "num_listed_lights")]
    _fields_ += [("specular", C.c_double)]
    _fields_ += [(n, C.c_uint32) for n in ("has_data", "image", "num_blocks")]
    _fields_ += [("dims", C.c_uint32 * 3)]
    _fields_ += [(n, C.c_uint32) for n in ("blanked", "scalars", "cell_scalars", "num_components", "turned", "cropping_regions")]
    _fields_ += [(n, C.c_double * 2) for n in ("range", "average_range")]


class SceneVolume(C.Structure):
    _fields_ = [
        ("facts", C.POINTER(VolumeFacts)), ("view", C.POINTER(View)), ("scalars", Array), ("dims", C.c_uint32 * 3), ("adjusts", C.c_uint32),
        ("opacities", Array), ("unit_distance", C.c_double), ("sample_distance", C.c_double), ("world_from_unit", C.c_double * 16),
    ]


def _places():
    here = os.path.dirname(os.path.abspath(__file__))
    yield "RTVTK_LIBRARY", os.environ.get("RTVTK_LIBRARY")
    yield "the package", os.path.join(here, "libvtk_bridge.so")
    home = os.environ.get("RTV_HOME")
    yield "RTV_HOME", home and os.path.join(home, "libvtk_bridge.so")


def _load():
    tried = []
    for name, path in _places():
        if not path:
            continue
        tried.append(f"{path} ({name})")
        if os.path.isfile(path):
            try:
                return C.CDLL(path), path
            except OSError as error:
                raise RtvError(f"{path} cannot be loaded: {error}") from error
        if name == "RTVTK_LIBRARY":
            raise RtvError(f"RTVTK_LIBRARY is {path}, which is no file; set RTVTK_LIBRARY to the file libvtk_bridge.so, or leave it out")
    raise RtvError(f"the library libvtk_bridge.so was not found; tried {', '.join(tried)}; set RTVTK_LIBRARY to the file libvtk_bridge.so")


def _functions(library, path):
    def bind(name, result, *arguments):
        try:
            function = getattr(library, name)
        except AttributeError as error:
            raise RtvError(f"{path} has no function {name}: it is not, or another version of, vtk-bridge's library") from error
        function.restype, function.argtypes = result, arguments
        return function

    p, text = C.c_void_p, C.c_char_p
    found = bind("rtv_abi", C.c_uint32)()
    if found != ABI:
        raise RtvError(f"{path} has interface {found}, this package needs {ABI}: install the package that belongs to the library")
    return dict(
        new=bind("rtv_new", p), free=bind("rtv_free", None, p), option=bind("rtv_bridge_option", C.c_double, p, text),
        set_process_option=bind("rtv_set_option", C.c_int32, text, text),
        set_option=bind("rtv_set_bridge_option", C.c_int32, p, text, text),
        host=bind("rtv_host", None, C.c_uint32, C.c_uint32, C.c_uint32), begin=bind("rtv_begin", C.c_int32, p),
        surfaces=bind("rtv_surfaces", C.c_int32, p, C.POINTER(Surface), C.c_uint64),
        has_colors=bind("rtv_has_colors", C.c_int32, p, C.c_uint64, C.c_uint64),
        volume=bind("rtv_volume", text, p, C.POINTER(Volume)), has_volume=bind("rtv_has_volume", C.c_int32, p, C.c_uint64),
        choose=bind("rtv_choose", C.c_uint32, p, C.POINTER(SceneFacts)),
        choose_volume=bind("rtv_choose_volume", None, p, C.POINTER(SceneVolume)),
        check_actor=bind("rtv_check_actor", text, p, C.POINTER(ActorFacts)),
        check_surface=bind("rtv_check_surface", text, p, C.POINTER(SurfaceFacts)),
        check_glyphs=bind("rtv_check_glyphs", text, p, C.POINTER(GlyphFacts)),
        check_volume=bind("rtv_check_volume", text, p, C.POINTER(VolumeFacts)),
        light=bind("rtv_light", None, p, C.POINTER(Light)), pass_on=bind("rtv_pass", None, p, text, text), warn=bind("rtv_warn", None, p, text),
        render=bind("rtv_render", C.c_int32, p, C.POINTER(View), C.POINTER(Picture)), end=bind("rtv_end", None, p),
    )


def check_vtk(version):
    """Raises `RtvError` for a VTK whose classes cannot be replaced from Python: 9.3 takes a
    replacement and makes renderers of its own all the same."""
    if tuple(version[:2]) < OLDEST_VTK:
        named = ".".join(map(str, version))
        oldest = ".".join(map(str, OLDEST_VTK))
        cure = "pip install --upgrade vtk"
        raise RtvError(f"VTK {named} is older than {oldest}, which rtvtk needs; {cure}")


def set_host(major, minor, build):
    """Loads the library and tells it the VTK version.

    Raises `RtvError` if it cannot be loaded, or VTK is too old.
    """
    check_vtk((major, minor, build))
    Bridge.calls()["host"](major, minor, build)


class Bridge:
    """A renderer's side of the library."""

    _calls = None

    @classmethod
    def calls(cls):
        if Bridge._calls is None:
            Bridge._calls = _functions(*_load())
        return Bridge._calls

    def __init__(self):
        Bridge.calls()
        self._handle = Bridge._calls["new"]()

    def __del__(self):
        if Bridge._calls and getattr(self, "_handle", None):
            Bridge._calls["free"](self._handle)

    def __getattr__(self, name):
        if name.startswith("_"):
            raise AttributeError(name)
        function = Bridge._calls[name]
        if name in ("warn", "pass_on", "option", "set_option"):
            return lambda *texts: function(self._handle, *(None if t is None else t.encode() for t in texts))
        return lambda *arguments: function(self._handle, *arguments)
