"""The interface of composite for Python: what rtsv_composite.h is for C, by ctypes.

Names have no prefix here: rtsv_composite_comm_free of C is comm_free. Calls raise Error
instead of returning a status, and structures know their size. The library is the file that
RTSV_COMPOSITE_LIBRARY names, else the one in ../lib beside this folder (an installation),
else the one that the dynamic linker finds.

Made from the Rust sources by tests/interface: do not edit.
"""

import ctypes
import os


def _library_path():
    name = "librtsv_composite.so.0"
    here = os.path.dirname(os.path.realpath(__file__))
    installed = os.path.join(here, "..", "lib", name)
    named = os.environ.get("RTSV_COMPOSITE_LIBRARY")
    return named or (installed if os.path.exists(installed) else name)


_library = ctypes.CDLL(_library_path())
Release = ctypes.CFUNCTYPE(None, ctypes.c_void_p)


class Error(RuntimeError):
    """A call that failed: its text, and its status."""

    def __init__(self, status):
        super().__init__(last_error().decode())
        self.status = status


def _check(status, _function, _arguments):
    if status != OK:
        raise Error(status)


class _Structure(ctypes.Structure):
    def __init__(self, **members):
        super().__init__(**members)
        if hasattr(self, "struct_bytes"):
            self.struct_bytes = ctypes.sizeof(self)


# Version of this interface: major, minor and patch in a byte each. The library's own is that of
# rtsv_composite_library_version.
VERSION = 0x00000100
# The number in the library's name, librtsv_composite.so.0: a change that breaks programs raises
# it.
ABI = 0
# The call did what it says.
OK = 0
# A pointer that must not be null is null, or not aligned.
POINTER = 1
# A handle that was never made, has been freed, or is of another kind.
HANDLE = 2
# A handle that another thread has made: only that one may use it.
THREAD = 3
# A handle that another call of this thread is at work with.
BUSY = 4
# struct_bytes is not the size of the structure: set it, or compile with this version's header.
STRUCT = 5
# A value or an array cannot be used; the text names it.
VALUE = 6
# MPI is not running, or the communicator cannot be used.
MPI = 7
# What the ranks give does not fit together, or cannot be rendered. Every rank gets this status
# with the same text, and the group can be used further.
DISAGREE = 8
# The group of ranks has ended: this rank or another has failed. Free the handles, and make a new
# group.
ENDED = 9
# An error of this library, which ends the group.
PANIC = 10
# RGBA in 8 bits a channel, with depth.
DEPTH_U8 = 1
# RGBA in 16 bits a channel, with depth.
DEPTH_U16 = 2
# RGBA in half precision, with depth.
DEPTH_F16 = 3
# RGBA in single precision, with depth.
DEPTH_F32 = 4
# Premultiplied RGBA in 8 bits a channel, blended in the order of the ranks.
ALPHA_U8 = 5
# Premultiplied RGBA in 16 bits a channel.
ALPHA_U16 = 6
# Premultiplied RGBA in half precision.
ALPHA_F16 = 7
# Premultiplied RGBA in single precision.
ALPHA_F32 = 8
# Each rank owns a tile of the image and gets it from all others.
DIRECT_SEND = 0
# Half of the ranks send their images to the other half, round after round.
TREE = 1
# Partners exchange halves.
BINARY_SWAP = 2
# As binary swap, in groups of up to radix ranks.
RADIX_K = 3
# What a model of the network, measured before the first frame, finds cheapest.
AUTOMATIC = 4


class Options(_Structure):
    # How to composite; the same on all ranks but for timeout_secs. rtsv_composite_options_init
    # fills it.
    _fields_ = [
        # Size of this structure.
        ("struct_bytes", ctypes.c_uint64),
        # RTSV_COMPOSITE_DIRECT_SEND (the default) or another strategy: changes the time, not the
        # image.
        ("strategy", ctypes.c_uint32),
        # Group size of RTSV_COMPOSITE_RADIX_K, a power of two (8).
        ("radix", ctypes.c_uint32),
        # The rank that gets the image (0); -1 leaves a piece of it on each rank.
        ("destination", ctypes.c_int32),
        # 0 or 1 (the default): the image has its depths too.
        ("depth", ctypes.c_uint32),
        # 0 (the default) or 1: checksums cover the pixels of messages too.
        ("verify", ctypes.c_uint32),
        # 0 or 1 (the default): ranks of one machine merge in memory that they share.
        ("in_memory", ctypes.c_uint32),
        # 0 or 1 (the default): ranks wait for each other at the end, so that success on one means
        # success on all.
        ("final_barrier", ctypes.c_uint32),
        # Not used; 0.
        ("reserved", ctypes.c_uint32),
        # Most pixels of a message, about; 0 (the default) chooses.
        ("slice_px", ctypes.c_uint64),
        # Longest wait for a rank that gives no sign of life, seconds (60).
        ("timeout_secs", ctypes.c_double),
    ]



class Plane(_Structure):
    # Pixels of one kind in memory of the program. Pixel (x, y) begins at data + y * row_bytes + x
    # * pixel_bytes.
    _fields_ = [
        # The first pixel of row 0.
        ("data", ctypes.c_void_p),
        # From one pixel to the next; 0 for pixels without gaps.
        ("pixel_bytes", ctypes.c_int64),
        # From one row to the next, also negative; 0 for rows without gaps.
        ("row_bytes", ctypes.c_int64),
    ]



class Frame(_Structure):
    # What one rank has drawn. The order of rows is free, and the same on all ranks. The planes
    # are read before the call returns, and not copied where pixels have no gaps and are aligned,
    # rows ascend by whole pixels, and both planes have rows of one length. What lies between rows
    # must be readable.
    _fields_ = [
        # Size of this structure.
        ("struct_bytes", ctypes.c_uint64),
        # Pixels per row.
        ("width", ctypes.c_uint32),
        # Rows.
        ("height", ctypes.c_uint32),
        # Four channels per pixel, as the compositor's format says.
        ("color", Plane),
        # One float per pixel, 0 (near) to 1 (nothing drawn; so are NaN and more than 1); not read
        # for premultiplied formats.
        ("depth", Plane),
        # 0 or 1: bounds says where something was drawn; pixels outside count as not drawn.
        ("has_bounds", ctypes.c_uint32),
        # 0 or 1: depth_range is known, which checks the order of premultiplied frames.
        ("has_depth_range", ctypes.c_uint32),
        # First column, first row, column behind the last one, row behind the last one.
        ("bounds", ctypes.c_uint32 * 4),
        # Nearest and farthest depth of what was drawn, in a unit that all ranks share.
        ("depth_range", ctypes.c_float * 2),
    ]



class Tile(_Structure):
    # A tile of a display wall.
    _fields_ = [
        # First column in the frame.
        ("x", ctypes.c_uint32),
        # First row in the frame.
        ("y", ctypes.c_uint32),
        # Columns.
        ("width", ctypes.c_uint32),
        # Rows.
        ("height", ctypes.c_uint32),
        # The rank that shows it.
        ("rank", ctypes.c_uint32),
        # Not used; 0.
        ("reserved", ctypes.c_uint32),
    ]



class Image(_Structure):
    # A composited image, or this rank's part of one; without gaps. Its memory belongs to the
    # compositor until its next call.
    _fields_ = [
        # Size of this structure; set it before the call.
        ("struct_bytes", ctypes.c_uint64),
        # Pixels per row; 0 on ranks that get nothing.
        ("width", ctypes.c_uint32),
        # Rows.
        ("height", ctypes.c_uint32),
        # First column in the frame.
        ("x", ctypes.c_uint32),
        # First row in the frame.
        ("y", ctypes.c_uint32),
        # Four channels per pixel, all 0 where nothing was drawn; null on ranks that get nothing.
        ("color", ctypes.c_void_p),
        # One per pixel, 1 where nothing was drawn; null without depth.
        ("depth", ctypes.POINTER(ctypes.c_float)),
    ]

# uint8_t
U8 = 1
# int8_t
I8 = 2
# uint16_t
U16 = 3
# int16_t
I16 = 4
# uint32_t
U32 = 5
# int32_t
I32 = 6
# uint64_t
U64 = 7
# int64_t
I64 = 8
# float
F32 = 9
# double
F64 = 10


class Array(_Structure):
    # Tuples of numbers in memory of the program; all zero for none.
    _fields_ = [
        # The first number of the first tuple; null only without tuples.
        ("data", ctypes.c_void_p),
        # Number of tuples.
        ("count", ctypes.c_uint64),
        # Numbers of a tuple, one behind the other.
        ("components", ctypes.c_uint32),
        # What they are: RTSV_COMPOSITE_U8 to RTSV_COMPOSITE_F64.
        ("kind", ctypes.c_uint32),
        # From one tuple to the next, also negative or less than a tuple; 0 for tuples without
        # gaps.
        ("stride_bytes", ctypes.c_int64),
        # Called once with owner when the library needs the array no more, also after an error, or
        # null. Not called if the structure that holds this array is null or has another size.
        ("release", Release),
        # For release.
        ("owner", ctypes.c_void_p),
    ]

# Ideal diffuse.
MATTE = 0
# The colour without lighting.
UNLIT = 1
# OpenGL's model, with specular and shininess.
PHONG = 2
# A metal with roughness: a mirror at 0.
METAL = 3
# Clear glass with ior.
GLASS = 4
# glTF's model, with metallic and roughness.
PBR = 5


class Material(_Structure):
    # A material. rtsv_composite_material_init fills it: matte, white, opaque.
    _fields_ = [
        # Size of this structure.
        ("struct_bytes", ctypes.c_uint64),
        # RTSV_COMPOSITE_MATTE or another model.
        ("model", ctypes.c_uint32),
        # Linear RGB; multiplied by the colours of the object.
        ("color", ctypes.c_float * 3),
        # Emitted radiance, linear RGB.
        ("emission", ctypes.c_float * 3),
        # 1 opaque to 0 invisible.
        ("opacity", ctypes.c_float),
        # Strength of the highlight.
        ("specular", ctypes.c_float),
        # Exponent of the highlight.
        ("shininess", ctypes.c_float),
        # 0 smooth to 1.
        ("roughness", ctypes.c_float),
        # 0 or 1, or between.
        ("metallic", ctypes.c_float),
        # Refractive index.
        ("ior", ctypes.c_float),
        # 0 or 1: the normals of the triangles, not of their corners.
        ("flat", ctypes.c_uint32),
    ]

# The same from all directions.
AMBIENT = 0
# Parallel light from direction.
DIRECTIONAL = 1
# Light from position in all directions.
POINT = 2
# Light from position along direction, within cutoff_rad.
SPOT = 3
# Parallel light along the view, without shadows.
HEADLIGHT = 4


class Light(_Structure):
    # A light. rtsv_composite_light_init fills it: ambient, white.
    _fields_ = [
        # Size of this structure.
        ("struct_bytes", ctypes.c_uint64),
        # RTSV_COMPOSITE_AMBIENT or another kind.
        ("kind", ctypes.c_uint32),
        # 0 or 1: surfaces block it. Not for ambient light and headlights, which nothing blocks.
        ("shadows", ctypes.c_uint32),
        # Position in the world.
        ("position", ctypes.c_double * 3),
        # Directional: towards the light. Spot: away from it.
        ("direction", ctypes.c_double * 3),
        # Radius in world units, or of directional light half the angle it fills, radians; 0 for
        # sharp shadows.
        ("size", ctypes.c_double),
        # Half angle of a spot, radians.
        ("cutoff_rad", ctypes.c_double),
        # Linear RGB.
        ("color", ctypes.c_float * 3),
        # Not used; 0.
        ("reserved", ctypes.c_uint32),
    ]



class Surroundings(_Structure):
    # What surrounds the objects. rtsv_composite_surroundings_init fills it: nothing.
    _fields_ = [
        # Size of this structure.
        ("struct_bytes", ctypes.c_uint64),
        # Largest distance of an occluder of ambient light, world units, infinite for any.
        ("occlusion_distance", ctypes.c_double),
        # Rays of ambient occlusion for each point; 0 for no ambient occlusion.
        ("occlusion_rays", ctypes.c_uint32),
        # 0 or 1: a background of bottom to top, opaque. Else alpha is 0 where nothing is.
        ("has_background", ctypes.c_uint32),
        # Linear RGB of the bottom row.
        ("bottom", ctypes.c_float * 3),
        # Linear RGB of the top row.
        ("top", ctypes.c_float * 3),
    ]



class Mesh(_Structure):
    # This rank's triangles of an object. What ranks give under one name is one object.
    _fields_ = [
        # Size of this structure.
        ("struct_bytes", ctypes.c_uint64),
        # The object's name, UTF-8.
        ("name", ctypes.c_char_p),
        # The material's number in the scene.
        ("material", ctypes.c_uint32),
        # 0 or 1: colors has one colour per triangle, not per vertex.
        ("colors_per_face", ctypes.c_uint32),
        # Positions are kept as float relative to this point; the same on all ranks. Choose it
        # near the object where coordinates are large.
        ("origin", ctypes.c_double * 3),
        # Three floats or doubles per vertex.
        ("positions", Array),
        # Three integers per triangle, counter-clockwise seen from outside. Triangles with an
        # index beyond the positions are left out, and counted (rtsv_composite_renderer_warnings).
        ("triangles", Array),
        # Three floats or doubles per vertex, or none.
        ("normals", Array),
        # Linear RGBA, four floats or doubles, or none.
        ("colors", Array),
        # Transforms to the world, twelve doubles each (three rows of four), or none for one
        # without a transform. The same on all ranks that have a piece of the object.
        ("places", Array),
    ]



class Spheres(_Structure):
    # This rank's spheres of an object.
    _fields_ = [
        # Size of this structure.
        ("struct_bytes", ctypes.c_uint64),
        # The object's name, UTF-8.
        ("name", ctypes.c_char_p),
        # The material's number in the scene.
        ("material", ctypes.c_uint32),
        # Radius of all spheres, where radii has none.
        ("radius", ctypes.c_float),
        # As that of a mesh.
        ("origin", ctypes.c_double * 3),
        # Three floats or doubles per sphere.
        ("centers", Array),
        # One float or double per sphere, or none.
        ("radii", Array),
        # Linear RGBA, four floats or doubles per sphere, or none.
        ("colors", Array),
        # As those of a mesh.
        ("places", Array),
    ]



class Volume(_Structure):
    # A volume, of which ranks have bricks. All ranks give the same description, in the same
    # order.
    _fields_ = [
        # Size of this structure.
        ("struct_bytes", ctypes.c_uint64),
        # Its name, UTF-8.
        ("name", ctypes.c_char_p),
        # Points per axis of the whole grid.
        ("dims", ctypes.c_uint32 * 3),
        # 0: linear interpolation; 1: the value of the nearest point.
        ("nearest", ctypes.c_uint32),
        # World position of the first point.
        ("origin", ctypes.c_double * 3),
        # Distance of neighbouring points, world units.
        ("spacing", ctypes.c_double * 3),
        # Three floats or doubles (linear RGB) per entry, evenly spaced over range.
        ("colors", Array),
        # Values of the first and the last colour.
        ("range", ctypes.c_float * 2),
        # Two floats or doubles per entry, ascending: a value, and the opacity of a slab of
        # unit_distance there.
        ("opacities", Array),
        # See opacities; world units.
        ("unit_distance", ctypes.c_double),
    ]



class Brick(_Structure):
    # This rank's values on a box of points of a volume. Bricks of neighbours share the points
    # between them.
    _fields_ = [
        # Size of this structure.
        ("struct_bytes", ctypes.c_uint64),
        # The volume's number in the scene.
        ("volume", ctypes.c_uint32),
        # Not used; 0.
        ("reserved", ctypes.c_uint32),
        # First point in the whole grid.
        ("first", ctypes.c_uint32 * 3),
        # Points per axis of the brick.
        ("dims", ctypes.c_uint32 * 3),
        # One number per point; stride_bytes leads along x.
        ("values", Array),
        # From one row of points to the next, along y; 0 for rows without gaps.
        ("row_bytes", ctypes.c_int64),
        # From one slice of points to the next, along z; 0 for slices without gaps.
        ("slice_bytes", ctypes.c_int64),
    ]

# Rays go to the ranks whose bounds they enter: exact for every effect.
FORWARD = 0
# Each rank also holds what lies within the distance of ambient occlusion around its part.
GHOST_ZONES = 1
# Only the rank that was hit is asked: wrong near borders, for comparison.
LOCAL_ONLY = 2


class RenderOptions(_Structure):
    # How ranks render together; the same on all ranks but for timeout_secs and threads.
    # rtsv_composite_render_options_init fills it.
    _fields_ = [
        # Size of this structure.
        ("struct_bytes", ctypes.c_uint64),
        # The rank that gets the picture (0).
        ("root", ctypes.c_uint32),
        # RTSV_COMPOSITE_FORWARD (the default) or another way for light to cross borders.
        ("secondary_rays", ctypes.c_uint32),
        # 0 (the default) or 1: use all processors that the process may, not one thread for a
        # rank.
        ("threads", ctypes.c_uint32),
        # Not used; 0.
        ("reserved", ctypes.c_uint32),
        # Longest wait for a rank that gives no sign of life, seconds (60).
        ("timeout_secs", ctypes.c_double),
    ]

# A perspective view.
PERSPECTIVE = 0
# A parallel projection.
PARALLEL = 1
# The view of clip_from_world.
MATRIX = 2


class View(_Structure):
    # What to render; the same on all ranks. rtsv_composite_view_init fills it: a perspective view
    # from (0, 0, 1) to the origin, 640 x 480 pixels, one sample.
    _fields_ = [
        # Size of this structure.
        ("struct_bytes", ctypes.c_uint64),
        # Pixels per row.
        ("width", ctypes.c_uint32),
        # Rows.
        ("height", ctypes.c_uint32),
        # RTSV_COMPOSITE_PERSPECTIVE or another projection.
        ("projection", ctypes.c_uint32),
        # Samples per pixel.
        ("samples", ctypes.c_uint32),
        # Shadow rays per sample to each light that has a size (4).
        ("light_rays", ctypes.c_uint32),
        # Most reflections and refractions one behind the other; -1 (the default) for 8, or for no
        # limit in path tracing.
        ("max_bounces", ctypes.c_int32),
        # 0 or 1: light over many bounces.
        ("path_tracing", ctypes.c_uint32),
        # 0 or 1: the picture has depths too.
        ("depth", ctypes.c_uint32),
        # Another seed gives other noise.
        ("seed", ctypes.c_uint64),
        # Position of the eye in the world.
        ("eye", ctypes.c_double * 3),
        # A point in the middle of the picture.
        ("target", ctypes.c_double * 3),
        # What is up.
        ("up", ctypes.c_double * 3),
        # Full vertical angle of a perspective, radians.
        ("fov_y_rad", ctypes.c_double),
        # Height of the picture of a parallel projection, world units.
        ("parallel_height", ctypes.c_double),
        # Distance of the near plane.
        ("near", ctypes.c_double),
        # Distance of the far plane.
        ("far", ctypes.c_double),
        # Projection times view of OpenGL, row by row.
        ("clip_from_world", ctypes.c_double * 16),
    ]



class Picture(_Structure):
    # A rendered picture. Rows start at the top. Its memory belongs to the renderer until its next
    # call.
    _fields_ = [
        # Size of this structure; set it before the call.
        ("struct_bytes", ctypes.c_uint64),
        # Pixels per row; 0 on all ranks but the root.
        ("width", ctypes.c_uint32),
        # Rows.
        ("height", ctypes.c_uint32),
        # Linear RGBA, premultiplied, four per pixel; null on all ranks but the root.
        ("color", ctypes.POINTER(ctypes.c_float)),
        # OpenGL's window depth, one per pixel; null if it was not asked for.
        ("depth", ctypes.POINTER(ctypes.c_float)),
    ]



class Gas(_Structure):
    # A gas on a lattice of points, without its densities. All ranks give the same.
    _fields_ = [
        # Size of this structure.
        ("struct_bytes", ctypes.c_uint64),
        # Points per axis of the whole lattice.
        ("dims", ctypes.c_uint32 * 3),
        # Not used; 0.
        ("reserved", ctypes.c_uint32),
        # Position of the first point, metres.
        ("origin_m", ctypes.c_double * 3),
        # Distance of neighbouring points, metres.
        ("spacing_m", ctypes.c_double * 3),
        # K of the law of Gladstone and Dale, n = 1 + K rho, m^3/kg: 2.26e-4 for air.
        ("gladstone_dale", ctypes.c_double),
        # Density of the gas outside, kg/m^3.
        ("reference_density", ctypes.c_double),
    ]

# A schlieren picture: a slit, and a knife's edge in the cut-off plane.
KNIFE = 0
# A shadowgraph: no cut-off, and a film that is focused on a plane.
SHADOWGRAPH = 1
# Gradients by central differences: needs one more layer of points around a brick's cells.
TRILINEAR_GRADIENT = 0
# The gradient of linear interpolation, which jumps from cell to cell: needs no more layers.
TRILINEAR = 1


class Shot(_Structure):
    # How a gas is photographed; the same on all ranks but for timeout_secs and threads.
    # rtsv_composite_shot_init fills it: schlieren along z, 512 x 512 pixels that show the whole
    # gas.
    _fields_ = [
        # Size of this structure.
        ("struct_bytes", ctypes.c_uint64),
        # Pixels per row.
        ("width", ctypes.c_uint32),
        # Rows.
        ("height", ctypes.c_uint32),
        # RTSV_COMPOSITE_KNIFE or RTSV_COMPOSITE_SHADOWGRAPH.
        ("technique", ctypes.c_uint32),
        # RTSV_COMPOSITE_TRILINEAR_GRADIENT (the default) or RTSV_COMPOSITE_TRILINEAR.
        ("interpolant", ctypes.c_uint32),
        # The rank that gets the picture (0).
        ("root", ctypes.c_uint32),
        # 0 (the default) or 1: use all processors that the process may, not one thread for a
        # rank.
        ("threads", ctypes.c_uint32),
        # Direction of the light, towards the film.
        ("direction", ctypes.c_double * 3),
        # What is up in the picture.
        ("up", ctypes.c_double * 3),
        # Side of a pixel in the gas, metres; 0 (the default) for pixels that show the whole gas.
        ("pixel_m", ctypes.c_double),
        # Longest step of a ray, in distances of points (1).
        ("step_voxels", ctypes.c_double),
        # Knife: deflections in this direction brighten the picture, degrees counter-clockwise
        # from its right (0).
        ("angle_deg", ctypes.c_double),
        # Knife: width of the slit, across the edge (0.001).
        ("slit_width_m", ctypes.c_double),
        # Knife: focal length of both lenses (1.5).
        ("focal_length_m", ctypes.c_double),
        # Knife: fraction of the slit's image that is left open, the brightness without gas (0.5).
        ("open_fraction", ctypes.c_double),
        # Shadowgraph: distance of the plane in focus from the centre of the gas, along the light.
        ("focus_m", ctypes.c_double),
        # Longest wait for a rank that gives no sign of life, seconds (60).
        ("timeout_secs", ctypes.c_double),
    ]



class Photograph(_Structure):
    # A photograph. Rows start at the top.
    _fields_ = [
        # Size of this structure; set it before the call.
        ("struct_bytes", ctypes.c_uint64),
        # Memory of the program for a float per pixel, which the call fills on the root: 1 for all
        # light of the slit. Set it before the call; not used on other ranks.
        ("grey", ctypes.POINTER(ctypes.c_float)),
        # Floats that fit there; set it before the call.
        ("grey_count", ctypes.c_uint64),
        # Rays that this rank sent to others.
        ("rays_sent", ctypes.c_uint64),
        # Rays that ended at a density that is no finite number; on the root.
        ("masked", ctypes.c_uint64),
        # Rays that were turned back; on the root.
        ("turned", ctypes.c_uint64),
        # Bytes that this rank sent.
        ("bytes_sent", ctypes.c_uint64),
        # Rounds of rays that went from brick to brick.
        ("rounds", ctypes.c_uint32),
        # Copies of the densities that this rank made: none.
        ("copies", ctypes.c_uint32),
    ]


# Why the last call of this thread that failed did so; empty before. English, one line, UTF-8. It
# belongs to the library until the next failure of this thread.
last_error = _library.rtsv_composite_last_error
last_error.argtypes = [
    
]
last_error.restype = ctypes.c_char_p

# RTSV_COMPOSITE_VERSION of the library that runs.
library_version = _library.rtsv_composite_library_version
library_version.argtypes = [
    
]
library_version.restype = ctypes.c_uint32

# Collective: a group of the ranks of an MPI communicator, which is duplicated. comm points to the
# MPI_Comm and comm_bytes is its size: rtsv_composite_comm_from_mpi(&comm, sizeof comm, &group).
# MPI is running, with a thread level that allows calls from this thread.
comm_from_mpi = _library.rtsv_composite_comm_from_mpi
comm_from_mpi.argtypes = [
    ctypes.c_void_p, ctypes.c_uint64, ctypes.POINTER(ctypes.c_void_p)
]
comm_from_mpi.errcheck = _check
comm_from_mpi.restype = ctypes.c_uint32

# Collective: as rtsv_composite_comm_from_mpi, for a communicator of Fortran: an INTEGER, or
# comm%MPI_VAL of a type(MPI_Comm).
comm_from_fortran = _library.rtsv_composite_comm_from_fortran
comm_from_fortran.argtypes = [
    ctypes.c_int32, ctypes.POINTER(ctypes.c_void_p)
]
comm_from_fortran.errcheck = _check
comm_from_fortran.restype = ctypes.c_uint32

# A group of this rank alone, without MPI: for programs that run on one process too.
comm_self = _library.rtsv_composite_comm_self
comm_self.argtypes = [
    ctypes.POINTER(ctypes.c_void_p)
]
comm_self.errcheck = _check
comm_self.restype = ctypes.c_uint32

# This rank in the group, and the number of ranks; either may be null.
comm_rank = _library.rtsv_composite_comm_rank
comm_rank.argtypes = [
    ctypes.c_void_p, ctypes.POINTER(ctypes.c_uint32), ctypes.POINTER(ctypes.c_uint32)
]
comm_rank.errcheck = _check
comm_rank.restype = ctypes.c_uint32

# Ends the group: all ranks that wait, or will, get RTSV_COMPOSITE_ENDED with this reason. For a
# rank that cannot go on outside of a call.
comm_abort = _library.rtsv_composite_comm_abort
comm_abort.argtypes = [
    ctypes.c_void_p, ctypes.c_char_p
]
comm_abort.errcheck = _check
comm_abort.restype = ctypes.c_uint32

# Collective: frees a group, before MPI_Finalize; null is allowed. What was made with it must not
# be used any more, but must still be freed.
comm_free = _library.rtsv_composite_comm_free
comm_free.argtypes = [
    ctypes.c_void_p
]
comm_free.errcheck = _check
comm_free.restype = ctypes.c_uint32

# Fills options with their defaults; struct_bytes is sizeof of the structure.
options_init = _library.rtsv_composite_options_init
options_init.argtypes = [
    ctypes.POINTER(Options), ctypes.c_uint64
]
options_init.errcheck = _check
options_init.restype = ctypes.c_uint32

# A compositor for images of one pixel format (RTSV_COMPOSITE_DEPTH_U8, ...). It keeps its buffers
# from one image to the next. Null options are the defaults.
compositor_new = _library.rtsv_composite_compositor_new
compositor_new.argtypes = [
    ctypes.c_void_p, ctypes.c_uint32, ctypes.POINTER(Options), ctypes.POINTER(ctypes.c_void_p)
]
compositor_new.errcheck = _check
compositor_new.restype = ctypes.c_uint32

# Sets the order of the ranks for the next images: count ranks, each once, the one in front first;
# null for rank 0 in front. The same on all ranks.
compositor_order = _library.rtsv_composite_compositor_order
compositor_order.argtypes = [
    ctypes.c_void_p, ctypes.POINTER(ctypes.c_uint32), ctypes.c_uint32
]
compositor_order.errcheck = _check
compositor_order.restype = ctypes.c_uint32

# Collective: composites the frames of all ranks into image.
composite = _library.rtsv_composite_composite
composite.argtypes = [
    ctypes.c_void_p, ctypes.POINTER(Frame), ctypes.POINTER(Image)
]
composite.errcheck = _check
composite.restype = ctypes.c_uint32

# Collective: composites the frames of all ranks into the tiles of a display wall, which may
# overlap. All ranks give the same count tiles. images[k] is tile k on the rank that shows it, and
# without pixels on the others. The destination of the options is not used.
composite_wall = _library.rtsv_composite_composite_wall
composite_wall.argtypes = [
    ctypes.c_void_p, ctypes.POINTER(Frame), ctypes.POINTER(Tile), ctypes.c_uint32,
    ctypes.POINTER(Image)
]
composite_wall.errcheck = _check
composite_wall.restype = ctypes.c_uint32

# Which planes the last call had to copy, and why: a line for each, empty for none. The text
# belongs to the compositor until its next call.
compositor_copies = _library.rtsv_composite_compositor_copies
compositor_copies.argtypes = [
    ctypes.c_void_p, ctypes.POINTER(ctypes.c_char_p)
]
compositor_copies.errcheck = _check
compositor_copies.restype = ctypes.c_uint32

# Frees a compositor and its images; null is allowed.
compositor_free = _library.rtsv_composite_compositor_free
compositor_free.argtypes = [
    ctypes.c_void_p
]
compositor_free.errcheck = _check
compositor_free.restype = ctypes.c_uint32

# A scene of nothing.
scene_new = _library.rtsv_composite_scene_new
scene_new.argtypes = [
    ctypes.POINTER(ctypes.c_void_p)
]
scene_new.errcheck = _check
scene_new.restype = ctypes.c_uint32

# Fills a material: matte, white, opaque. struct_bytes is sizeof of the structure.
material_init = _library.rtsv_composite_material_init
material_init.argtypes = [
    ctypes.POINTER(Material), ctypes.c_uint64
]
material_init.errcheck = _check
material_init.restype = ctypes.c_uint32

# Adds a material; number gets its number, which counts from 0. All ranks add the same ones.
scene_material = _library.rtsv_composite_scene_material
scene_material.argtypes = [
    ctypes.c_void_p, ctypes.POINTER(Material), ctypes.POINTER(ctypes.c_uint32)
]
scene_material.errcheck = _check
scene_material.restype = ctypes.c_uint32

# Fills a light: ambient, white. struct_bytes is sizeof of the structure.
light_init = _library.rtsv_composite_light_init
light_init.argtypes = [
    ctypes.POINTER(Light), ctypes.c_uint64
]
light_init.errcheck = _check
light_init.restype = ctypes.c_uint32

# Adds a light. All ranks add the same ones.
scene_light = _library.rtsv_composite_scene_light
scene_light.argtypes = [
    ctypes.c_void_p, ctypes.POINTER(Light)
]
scene_light.errcheck = _check
scene_light.restype = ctypes.c_uint32

# Fills surroundings: transparent, no ambient occlusion. struct_bytes is sizeof of the structure.
surroundings_init = _library.rtsv_composite_surroundings_init
surroundings_init.argtypes = [
    ctypes.POINTER(Surroundings), ctypes.c_uint64
]
surroundings_init.errcheck = _check
surroundings_init.restype = ctypes.c_uint32

# Sets what surrounds the objects. All ranks give the same.
scene_surroundings = _library.rtsv_composite_scene_surroundings
scene_surroundings.argtypes = [
    ctypes.c_void_p, ctypes.POINTER(Surroundings)
]
scene_surroundings.errcheck = _check
scene_surroundings.restype = ctypes.c_uint32

# Adds this rank's triangles of an object. A rank leaves out the objects of which it has nothing.
scene_mesh = _library.rtsv_composite_scene_mesh
scene_mesh.argtypes = [
    ctypes.c_void_p, ctypes.POINTER(Mesh)
]
scene_mesh.errcheck = _check
scene_mesh.restype = ctypes.c_uint32

# Adds this rank's spheres of an object.
scene_spheres = _library.rtsv_composite_scene_spheres
scene_spheres.argtypes = [
    ctypes.c_void_p, ctypes.POINTER(Spheres)
]
scene_spheres.errcheck = _check
scene_spheres.restype = ctypes.c_uint32

# Which arrays were copied, and why: a line for each. The text belongs to the scene until its next
# call.
scene_copies = _library.rtsv_composite_scene_copies
scene_copies.argtypes = [
    ctypes.c_void_p, ctypes.POINTER(ctypes.c_char_p)
]
scene_copies.errcheck = _check
scene_copies.restype = ctypes.c_uint32

# Frees a scene; renderers that were made of it go on. Null is allowed.
scene_free = _library.rtsv_composite_scene_free
scene_free.argtypes = [
    ctypes.c_void_p
]
scene_free.errcheck = _check
scene_free.restype = ctypes.c_uint32

# Adds a volume without values; number gets its number, which counts from 0. All ranks add the
# same ones in the same order.
scene_volume = _library.rtsv_composite_scene_volume
scene_volume.argtypes = [
    ctypes.c_void_p, ctypes.POINTER(Volume), ctypes.POINTER(ctypes.c_uint32)
]
scene_volume.errcheck = _check
scene_volume.restype = ctypes.c_uint32

# Adds this rank's values on a box of points of a volume, any number of times.
scene_brick = _library.rtsv_composite_scene_brick
scene_brick.argtypes = [
    ctypes.c_void_p, ctypes.POINTER(Brick)
]
scene_brick.errcheck = _check
scene_brick.restype = ctypes.c_uint32

# Fills options with their defaults; struct_bytes is sizeof of the structure.
render_options_init = _library.rtsv_composite_render_options_init
render_options_init.argtypes = [
    ctypes.POINTER(RenderOptions), ctypes.c_uint64
]
render_options_init.errcheck = _check
render_options_init.restype = ctypes.c_uint32

# Collective: makes the ranks of a group render the sum of their scenes. A scene may be changed or
# freed afterwards. Null options are the defaults.
renderer_new = _library.rtsv_composite_renderer_new
renderer_new.argtypes = [
    ctypes.c_void_p, ctypes.c_void_p, ctypes.POINTER(RenderOptions),
    ctypes.POINTER(ctypes.c_void_p)
]
renderer_new.errcheck = _check
renderer_new.restype = ctypes.c_uint32

# Collective: replaces what the ranks have, for the next time step; ranks whose part is the same
# give the scene of before. After RTSV_COMPOSITE_DISAGREE the earlier scene remains.
renderer_replace = _library.rtsv_composite_renderer_replace
renderer_replace.argtypes = [
    ctypes.c_void_p, ctypes.c_void_p
]
renderer_replace.errcheck = _check
renderer_replace.restype = ctypes.c_uint32

# Fills a view; struct_bytes is sizeof of the structure.
view_init = _library.rtsv_composite_view_init
view_init.argtypes = [
    ctypes.POINTER(View), ctypes.c_uint64
]
view_init.errcheck = _check
view_init.restype = ctypes.c_uint32

# Collective: renders a picture, which goes to the root.
renderer_render = _library.rtsv_composite_renderer_render
renderer_render.argtypes = [
    ctypes.c_void_p, ctypes.POINTER(View), ctypes.POINTER(Picture)
]
renderer_render.errcheck = _check
renderer_render.restype = ctypes.c_uint32

# What this rank's scene and the last picture lack of what was asked for, and why: a line for
# each, empty for none. The text belongs to the renderer until its next call.
renderer_warnings = _library.rtsv_composite_renderer_warnings
renderer_warnings.argtypes = [
    ctypes.c_void_p, ctypes.POINTER(ctypes.c_char_p)
]
renderer_warnings.errcheck = _check
renderer_warnings.restype = ctypes.c_uint32

# Frees a renderer and its picture; null is allowed.
renderer_free = _library.rtsv_composite_renderer_free
renderer_free.argtypes = [
    ctypes.c_void_p
]
renderer_free.errcheck = _check
renderer_free.restype = ctypes.c_uint32

# Fills a shot; struct_bytes is sizeof of the structure.
shot_init = _library.rtsv_composite_shot_init
shot_init.argtypes = [
    ctypes.POINTER(Shot), ctypes.c_uint64
]
shot_init.errcheck = _check
shot_init.restype = ctypes.c_uint32

# Collective: photographs a gas of which every rank gives a brick (or null for none): light that
# is bent by differences of density, also across the borders of bricks. Bricks of neighbours share
# the points between them, and overlap by one layer of points more on either side for
# RTSV_COMPOSITE_TRILINEAR_GRADIENT; points that several ranks have are the same on all. values of
# a brick are densities, kg/m^3, which are read where they are and not copied, and may have any
# strides; what is no finite number blocks light. The picture has the bits of one process.
photograph = _library.rtsv_composite_photograph
photograph.argtypes = [
    ctypes.c_void_p, ctypes.POINTER(Gas), ctypes.POINTER(Brick), ctypes.POINTER(Shot),
    ctypes.POINTER(Photograph)
]
photograph.errcheck = _check
photograph.restype = ctypes.c_uint32
