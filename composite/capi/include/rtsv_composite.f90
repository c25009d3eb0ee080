! The interface of composite for Fortran: what rtsv_composite.h is for C, which says what
! each call does. Handles are type(c_ptr), texts end with c_null_char, and what may be null
! in C is optional. Made from the Rust sources by tests/interface: do not edit.
module rtsv_composite
  use, intrinsic :: iso_c_binding
  implicit none
  public

  ! Version of this interface: major, minor and patch in a byte each. The library's own is that
  ! of rtsv_composite_library_version.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_VERSION = 256
  ! The number in the library's name, librtsv_composite.so.0: a change that breaks programs
  ! raises it.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_ABI = 0
  ! The call did what it says.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_OK = 0
  ! A pointer that must not be null is null, or not aligned.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_POINTER = 1
  ! A handle that was never made, has been freed, or is of another kind.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_HANDLE = 2
  ! A handle that another thread has made: only that one may use it.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_THREAD = 3
  ! A handle that another call of this thread is at work with.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_BUSY = 4
  ! struct_bytes is not the size of the structure: set it, or compile with this version's
  ! header.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_STRUCT = 5
  ! A value or an array cannot be used; the text names it.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_VALUE = 6
  ! MPI is not running, or the communicator cannot be used.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_MPI = 7
  ! What the ranks give does not fit together, or cannot be rendered. Every rank gets this
  ! status with the same text, and the group can be used further.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_DISAGREE = 8
  ! The group of ranks has ended: this rank or another has failed. Free the handles, and make a
  ! new group.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_ENDED = 9
  ! An error of this library, which ends the group.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_PANIC = 10
  ! RGBA in 8 bits a channel, with depth.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_DEPTH_U8 = 1
  ! RGBA in 16 bits a channel, with depth.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_DEPTH_U16 = 2
  ! RGBA in half precision, with depth.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_DEPTH_F16 = 3
  ! RGBA in single precision, with depth.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_DEPTH_F32 = 4
  ! Premultiplied RGBA in 8 bits a channel, blended in the order of the ranks.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_ALPHA_U8 = 5
  ! Premultiplied RGBA in 16 bits a channel.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_ALPHA_U16 = 6
  ! Premultiplied RGBA in half precision.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_ALPHA_F16 = 7
  ! Premultiplied RGBA in single precision.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_ALPHA_F32 = 8
  ! Each rank owns a tile of the image and gets it from all others.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_DIRECT_SEND = 0
  ! Half of the ranks send their images to the other half, round after round.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_TREE = 1
  ! Partners exchange halves.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_BINARY_SWAP = 2
  ! As binary swap, in groups of up to radix ranks.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_RADIX_K = 3
  ! What a model of the network, measured before the first frame, finds cheapest.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_AUTOMATIC = 4
  ! How to composite; the same on all ranks but for timeout_secs. rtsv_composite_options_init
  ! fills it.
  type, bind(c) :: RtsvCompositeOptions
    ! Size of this structure.
    integer(c_int64_t) :: struct_bytes = 56
    ! RTSV_COMPOSITE_DIRECT_SEND (the default) or another strategy: changes the time, not the
    ! image.
    integer(c_int32_t) :: strategy = 0
    ! Group size of RTSV_COMPOSITE_RADIX_K, a power of two (8).
    integer(c_int32_t) :: radix = 0
    ! The rank that gets the image (0); -1 leaves a piece of it on each rank.
    integer(c_int32_t) :: destination = 0
    ! 0 or 1 (the default): the image has its depths too.
    integer(c_int32_t) :: depth = 0
    ! 0 (the default) or 1: checksums cover the pixels of messages too.
    integer(c_int32_t) :: verify = 0
    ! 0 or 1 (the default): ranks of one machine merge in memory that they share.
    integer(c_int32_t) :: in_memory = 0
    ! 0 or 1 (the default): ranks wait for each other at the end, so that success on one means
    ! success on all.
    integer(c_int32_t) :: final_barrier = 0
    ! Not used; 0.
    integer(c_int32_t) :: reserved = 0
    ! Most pixels of a message, about; 0 (the default) chooses.
    integer(c_int64_t) :: slice_px = 0
    ! Longest wait for a rank that gives no sign of life, seconds (60).
    real(c_double) :: timeout_secs = 0
  end type
  ! Pixels of one kind in memory of the program. Pixel (x, y) begins at data + y * row_bytes + x
  ! * pixel_bytes.
  type, bind(c) :: RtsvCompositePlane
    ! The first pixel of row 0.
    type(c_ptr) :: data = c_null_ptr
    ! From one pixel to the next; 0 for pixels without gaps.
    integer(c_int64_t) :: pixel_bytes = 0
    ! From one row to the next, also negative; 0 for rows without gaps.
    integer(c_int64_t) :: row_bytes = 0
  end type
  ! What one rank has drawn. The order of rows is free, and the same on all ranks. The planes
  ! are read before the call returns, and not copied where pixels have no gaps and are aligned,
  ! rows ascend by whole pixels, and both planes have rows of one length. What lies between rows
  ! must be readable.
  type, bind(c) :: RtsvCompositeFrame
    ! Size of this structure.
    integer(c_int64_t) :: struct_bytes = 96
    ! Pixels per row.
    integer(c_int32_t) :: width = 0
    ! Rows.
    integer(c_int32_t) :: height = 0
    ! Four channels per pixel, as the compositor's format says.
    type(RtsvCompositePlane) :: color
    ! One float per pixel, 0 (near) to 1 (nothing drawn; so are NaN and more than 1); not read
    ! for premultiplied formats.
    type(RtsvCompositePlane) :: depth
    ! 0 or 1: bounds says where something was drawn; pixels outside count as not drawn.
    integer(c_int32_t) :: has_bounds = 0
    ! 0 or 1: depth_range is known, which checks the order of premultiplied frames.
    integer(c_int32_t) :: has_depth_range = 0
    ! First column, first row, column behind the last one, row behind the last one.
    integer(c_int32_t) :: bounds(4) = 0
    ! Nearest and farthest depth of what was drawn, in a unit that all ranks share.
    real(c_float) :: depth_range(2) = 0
  end type
  ! A tile of a display wall.
  type, bind(c) :: RtsvCompositeTile
    ! First column in the frame.
    integer(c_int32_t) :: x = 0
    ! First row in the frame.
    integer(c_int32_t) :: y = 0
    ! Columns.
    integer(c_int32_t) :: width = 0
    ! Rows.
    integer(c_int32_t) :: height = 0
    ! The rank that shows it.
    integer(c_int32_t) :: rank = 0
    ! Not used; 0.
    integer(c_int32_t) :: reserved = 0
  end type
  ! A composited image, or this rank's part of one; without gaps. Its memory belongs to the
  ! compositor until its next call.
  type, bind(c) :: RtsvCompositeImage
    ! Size of this structure; set it before the call.
    integer(c_int64_t) :: struct_bytes = 40
    ! Pixels per row; 0 on ranks that get nothing.
    integer(c_int32_t) :: width = 0
    ! Rows.
    integer(c_int32_t) :: height = 0
    ! First column in the frame.
    integer(c_int32_t) :: x = 0
    ! First row in the frame.
    integer(c_int32_t) :: y = 0
    ! Four channels per pixel, all 0 where nothing was drawn; null on ranks that get nothing.
    type(c_ptr) :: color = c_null_ptr
    ! One per pixel, 1 where nothing was drawn; null without depth.
    type(c_ptr) :: depth = c_null_ptr
  end type
  ! uint8_t
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_U8 = 1
  ! int8_t
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_I8 = 2
  ! uint16_t
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_U16 = 3
  ! int16_t
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_I16 = 4
  ! uint32_t
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_U32 = 5
  ! int32_t
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_I32 = 6
  ! uint64_t
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_U64 = 7
  ! int64_t
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_I64 = 8
  ! float
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_F32 = 9
  ! double
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_F64 = 10
  ! Tuples of numbers in memory of the program; all zero for none.
  type, bind(c) :: RtsvCompositeArray
    ! The first number of the first tuple; null only without tuples.
    type(c_ptr) :: data = c_null_ptr
    ! Number of tuples.
    integer(c_int64_t) :: count = 0
    ! Numbers of a tuple, one behind the other.
    integer(c_int32_t) :: components = 0
    ! What they are: RTSV_COMPOSITE_U8 to RTSV_COMPOSITE_F64.
    integer(c_int32_t) :: kind = 0
    ! From one tuple to the next, also negative or less than a tuple; 0 for tuples without gaps.
    integer(c_int64_t) :: stride_bytes = 0
    ! Called once with owner when the library needs the array no more, also after an error, or
    ! null. Not called if the structure that holds this array is null or has another size.
    type(c_funptr) :: release = c_null_funptr
    ! For release.
    type(c_ptr) :: owner = c_null_ptr
  end type
  ! Ideal diffuse.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_MATTE = 0
  ! The colour without lighting.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_UNLIT = 1
  ! OpenGL's model, with specular and shininess.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_PHONG = 2
  ! A metal with roughness: a mirror at 0.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_METAL = 3
  ! Clear glass with ior.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_GLASS = 4
  ! glTF's model, with metallic and roughness.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_PBR = 5
  ! A material. rtsv_composite_material_init fills it: matte, white, opaque.
  type, bind(c) :: RtsvCompositeMaterial
    ! Size of this structure.
    integer(c_int64_t) :: struct_bytes = 64
    ! RTSV_COMPOSITE_MATTE or another model.
    integer(c_int32_t) :: model = 0
    ! Linear RGB; multiplied by the colours of the object.
    real(c_float) :: color(3) = 0
    ! Emitted radiance, linear RGB.
    real(c_float) :: emission(3) = 0
    ! 1 opaque to 0 invisible.
    real(c_float) :: opacity = 0
    ! Strength of the highlight.
    real(c_float) :: specular = 0
    ! Exponent of the highlight.
    real(c_float) :: shininess = 0
    ! 0 smooth to 1.
    real(c_float) :: roughness = 0
    ! 0 or 1, or between.
    real(c_float) :: metallic = 0
    ! Refractive index.
    real(c_float) :: ior = 0
    ! 0 or 1: the normals of the triangles, not of their corners.
    integer(c_int32_t) :: flat = 0
  end type
  ! The same from all directions.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_AMBIENT = 0
  ! Parallel light from direction.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_DIRECTIONAL = 1
  ! Light from position in all directions.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_POINT = 2
  ! Light from position along direction, within cutoff_rad.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_SPOT = 3
  ! Parallel light along the view, without shadows.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_HEADLIGHT = 4
  ! A light. rtsv_composite_light_init fills it: ambient, white.
  type, bind(c) :: RtsvCompositeLight
    ! Size of this structure.
    integer(c_int64_t) :: struct_bytes = 96
    ! RTSV_COMPOSITE_AMBIENT or another kind.
    integer(c_int32_t) :: kind = 0
    ! 0 or 1: surfaces block it. Not for ambient light and headlights, which nothing blocks.
    integer(c_int32_t) :: shadows = 0
    ! Position in the world.
    real(c_double) :: position(3) = 0
    ! Directional: towards the light. Spot: away from it.
    real(c_double) :: direction(3) = 0
    ! Radius in world units, or of directional light half the angle it fills, radians; 0 for
    ! sharp shadows.
    real(c_double) :: size = 0
    ! Half angle of a spot, radians.
    real(c_double) :: cutoff_rad = 0
    ! Linear RGB.
    real(c_float) :: color(3) = 0
    ! Not used; 0.
    integer(c_int32_t) :: reserved = 0
  end type
  ! What surrounds the objects. rtsv_composite_surroundings_init fills it: nothing.
  type, bind(c) :: RtsvCompositeSurroundings
    ! Size of this structure.
    integer(c_int64_t) :: struct_bytes = 48
    ! Largest distance of an occluder of ambient light, world units, infinite for any.
    real(c_double) :: occlusion_distance = 0
    ! Rays of ambient occlusion for each point; 0 for no ambient occlusion.
    integer(c_int32_t) :: occlusion_rays = 0
    ! 0 or 1: a background of bottom to top, opaque. Else alpha is 0 where nothing is.
    integer(c_int32_t) :: has_background = 0
    ! Linear RGB of the bottom row.
    real(c_float) :: bottom(3) = 0
    ! Linear RGB of the top row.
    real(c_float) :: top(3) = 0
  end type
  ! This rank's triangles of an object. What ranks give under one name is one object.
  type, bind(c) :: RtsvCompositeMesh
    ! Size of this structure.
    integer(c_int64_t) :: struct_bytes = 288
    ! The object's name, UTF-8.
    type(c_ptr) :: name = c_null_ptr
    ! The material's number in the scene.
    integer(c_int32_t) :: material = 0
    ! 0 or 1: colors has one colour per triangle, not per vertex.
    integer(c_int32_t) :: colors_per_face = 0
    ! Positions are kept as float relative to this point; the same on all ranks. Choose it near
    ! the object where coordinates are large.
    real(c_double) :: origin(3) = 0
    ! Three floats or doubles per vertex.
    type(RtsvCompositeArray) :: positions
    ! Three integers per triangle, counter-clockwise seen from outside. Triangles with an index
    ! beyond the positions are left out, and counted (rtsv_composite_renderer_warnings).
    type(RtsvCompositeArray) :: triangles
    ! Three floats or doubles per vertex, or none.
    type(RtsvCompositeArray) :: normals
    ! Linear RGBA, four floats or doubles, or none.
    type(RtsvCompositeArray) :: colors
    ! Transforms to the world, twelve doubles each (three rows of four), or none for one without
    ! a transform. The same on all ranks that have a piece of the object.
    type(RtsvCompositeArray) :: places
  end type
  ! This rank's spheres of an object.
  type, bind(c) :: RtsvCompositeSpheres
    ! Size of this structure.
    integer(c_int64_t) :: struct_bytes = 240
    ! The object's name, UTF-8.
    type(c_ptr) :: name = c_null_ptr
    ! The material's number in the scene.
    integer(c_int32_t) :: material = 0
    ! Radius of all spheres, where radii has none.
    real(c_float) :: radius = 0
    ! As that of a mesh.
    real(c_double) :: origin(3) = 0
    ! Three floats or doubles per sphere.
    type(RtsvCompositeArray) :: centers
    ! One float or double per sphere, or none.
    type(RtsvCompositeArray) :: radii
    ! Linear RGBA, four floats or doubles per sphere, or none.
    type(RtsvCompositeArray) :: colors
    ! As those of a mesh.
    type(RtsvCompositeArray) :: places
  end type
  ! A volume, of which ranks have bricks. All ranks give the same description, in the same
  ! order.
  type, bind(c) :: RtsvCompositeVolume
    ! Size of this structure.
    integer(c_int64_t) :: struct_bytes = 192
    ! Its name, UTF-8.
    type(c_ptr) :: name = c_null_ptr
    ! Points per axis of the whole grid.
    integer(c_int32_t) :: dims(3) = 0
    ! 0: linear interpolation; 1: the value of the nearest point.
    integer(c_int32_t) :: nearest = 0
    ! World position of the first point.
    real(c_double) :: origin(3) = 0
    ! Distance of neighbouring points, world units.
    real(c_double) :: spacing(3) = 0
    ! Three floats or doubles (linear RGB) per entry, evenly spaced over range.
    type(RtsvCompositeArray) :: colors
    ! Values of the first and the last colour.
    real(c_float) :: range(2) = 0
    ! Two floats or doubles per entry, ascending: a value, and the opacity of a slab of
    ! unit_distance there.
    type(RtsvCompositeArray) :: opacities
    ! See opacities; world units.
    real(c_double) :: unit_distance = 0
  end type
  ! This rank's values on a box of points of a volume. Bricks of neighbours share the points
  ! between them.
  type, bind(c) :: RtsvCompositeBrick
    ! Size of this structure.
    integer(c_int64_t) :: struct_bytes = 104
    ! The volume's number in the scene.
    integer(c_int32_t) :: volume = 0
    ! Not used; 0.
    integer(c_int32_t) :: reserved = 0
    ! First point in the whole grid.
    integer(c_int32_t) :: first(3) = 0
    ! Points per axis of the brick.
    integer(c_int32_t) :: dims(3) = 0
    ! One number per point; stride_bytes leads along x.
    type(RtsvCompositeArray) :: values
    ! From one row of points to the next, along y; 0 for rows without gaps.
    integer(c_int64_t) :: row_bytes = 0
    ! From one slice of points to the next, along z; 0 for slices without gaps.
    integer(c_int64_t) :: slice_bytes = 0
  end type
  ! Rays go to the ranks whose bounds they enter: exact for every effect.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_FORWARD = 0
  ! Each rank also holds what lies within the distance of ambient occlusion around its part.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_GHOST_ZONES = 1
  ! Only the rank that was hit is asked: wrong near borders, for comparison.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_LOCAL_ONLY = 2
  ! How ranks render together; the same on all ranks but for timeout_secs and threads.
  ! rtsv_composite_render_options_init fills it.
  type, bind(c) :: RtsvCompositeRenderOptions
    ! Size of this structure.
    integer(c_int64_t) :: struct_bytes = 32
    ! The rank that gets the picture (0).
    integer(c_int32_t) :: root = 0
    ! RTSV_COMPOSITE_FORWARD (the default) or another way for light to cross borders.
    integer(c_int32_t) :: secondary_rays = 0
    ! 0 (the default) or 1: use all processors that the process may, not one thread for a rank.
    integer(c_int32_t) :: threads = 0
    ! Not used; 0.
    integer(c_int32_t) :: reserved = 0
    ! Longest wait for a rank that gives no sign of life, seconds (60).
    real(c_double) :: timeout_secs = 0
  end type
  ! A perspective view.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_PERSPECTIVE = 0
  ! A parallel projection.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_PARALLEL = 1
  ! The view of clip_from_world.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_MATRIX = 2
  ! What to render; the same on all ranks. rtsv_composite_view_init fills it: a perspective view
  ! from (0, 0, 1) to the origin, 640 x 480 pixels, one sample.
  type, bind(c) :: RtsvCompositeView
    ! Size of this structure.
    integer(c_int64_t) :: struct_bytes = 280
    ! Pixels per row.
    integer(c_int32_t) :: width = 0
    ! Rows.
    integer(c_int32_t) :: height = 0
    ! RTSV_COMPOSITE_PERSPECTIVE or another projection.
    integer(c_int32_t) :: projection = 0
    ! Samples per pixel.
    integer(c_int32_t) :: samples = 0
    ! Shadow rays per sample to each light that has a size (4).
    integer(c_int32_t) :: light_rays = 0
    ! Most reflections and refractions one behind the other; -1 (the default) for 8, or for no
    ! limit in path tracing.
    integer(c_int32_t) :: max_bounces = 0
    ! 0 or 1: light over many bounces.
    integer(c_int32_t) :: path_tracing = 0
    ! 0 or 1: the picture has depths too.
    integer(c_int32_t) :: depth = 0
    ! Another seed gives other noise.
    integer(c_int64_t) :: seed = 0
    ! Position of the eye in the world.
    real(c_double) :: eye(3) = 0
    ! A point in the middle of the picture.
    real(c_double) :: target(3) = 0
    ! What is up.
    real(c_double) :: up(3) = 0
    ! Full vertical angle of a perspective, radians.
    real(c_double) :: fov_y_rad = 0
    ! Height of the picture of a parallel projection, world units.
    real(c_double) :: parallel_height = 0
    ! Distance of the near plane.
    real(c_double) :: near = 0
    ! Distance of the far plane.
    real(c_double) :: far = 0
    ! Projection times view of OpenGL, row by row.
    real(c_double) :: clip_from_world(16) = 0
  end type
  ! A rendered picture. Rows start at the top. Its memory belongs to the renderer until its next
  ! call.
  type, bind(c) :: RtsvCompositePicture
    ! Size of this structure; set it before the call.
    integer(c_int64_t) :: struct_bytes = 32
    ! Pixels per row; 0 on all ranks but the root.
    integer(c_int32_t) :: width = 0
    ! Rows.
    integer(c_int32_t) :: height = 0
    ! Linear RGBA, premultiplied, four per pixel; null on all ranks but the root.
    type(c_ptr) :: color = c_null_ptr
    ! OpenGL's window depth, one per pixel; null if it was not asked for.
    type(c_ptr) :: depth = c_null_ptr
  end type
  ! A gas on a lattice of points, without its densities. All ranks give the same.
  type, bind(c) :: RtsvCompositeGas
    ! Size of this structure.
    integer(c_int64_t) :: struct_bytes = 88
    ! Points per axis of the whole lattice.
    integer(c_int32_t) :: dims(3) = 0
    ! Not used; 0.
    integer(c_int32_t) :: reserved = 0
    ! Position of the first point, metres.
    real(c_double) :: origin_m(3) = 0
    ! Distance of neighbouring points, metres.
    real(c_double) :: spacing_m(3) = 0
    ! K of the law of Gladstone and Dale, n = 1 + K rho, m^3/kg: 2.26e-4 for air.
    real(c_double) :: gladstone_dale = 0
    ! Density of the gas outside, kg/m^3.
    real(c_double) :: reference_density = 0
  end type
  ! A schlieren picture: a slit, and a knife's edge in the cut-off plane.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_KNIFE = 0
  ! A shadowgraph: no cut-off, and a film that is focused on a plane.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_SHADOWGRAPH = 1
  ! Gradients by central differences: needs one more layer of points around a brick's cells.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_TRILINEAR_GRADIENT = 0
  ! The gradient of linear interpolation, which jumps from cell to cell: needs no more layers.
  integer(c_int32_t), parameter :: RTSV_COMPOSITE_TRILINEAR = 1
  ! How a gas is photographed; the same on all ranks but for timeout_secs and threads.
  ! rtsv_composite_shot_init fills it: schlieren along z, 512 x 512 pixels that show the whole
  ! gas.
  type, bind(c) :: RtsvCompositeShot
    ! Size of this structure.
    integer(c_int64_t) :: struct_bytes = 144
    ! Pixels per row.
    integer(c_int32_t) :: width = 0
    ! Rows.
    integer(c_int32_t) :: height = 0
    ! RTSV_COMPOSITE_KNIFE or RTSV_COMPOSITE_SHADOWGRAPH.
    integer(c_int32_t) :: technique = 0
    ! RTSV_COMPOSITE_TRILINEAR_GRADIENT (the default) or RTSV_COMPOSITE_TRILINEAR.
    integer(c_int32_t) :: interpolant = 0
    ! The rank that gets the picture (0).
    integer(c_int32_t) :: root = 0
    ! 0 (the default) or 1: use all processors that the process may, not one thread for a rank.
    integer(c_int32_t) :: threads = 0
    ! Direction of the light, towards the film.
    real(c_double) :: direction(3) = 0
    ! What is up in the picture.
    real(c_double) :: up(3) = 0
    ! Side of a pixel in the gas, metres; 0 (the default) for pixels that show the whole gas.
    real(c_double) :: pixel_m = 0
    ! Longest step of a ray, in distances of points (1).
    real(c_double) :: step_voxels = 0
    ! Knife: deflections in this direction brighten the picture, degrees counter-clockwise from
    ! its right (0).
    real(c_double) :: angle_deg = 0
    ! Knife: width of the slit, across the edge (0.001).
    real(c_double) :: slit_width_m = 0
    ! Knife: focal length of both lenses (1.5).
    real(c_double) :: focal_length_m = 0
    ! Knife: fraction of the slit's image that is left open, the brightness without gas (0.5).
    real(c_double) :: open_fraction = 0
    ! Shadowgraph: distance of the plane in focus from the centre of the gas, along the light.
    real(c_double) :: focus_m = 0
    ! Longest wait for a rank that gives no sign of life, seconds (60).
    real(c_double) :: timeout_secs = 0
  end type
  ! A photograph. Rows start at the top.
  type, bind(c) :: RtsvCompositePhotograph
    ! Size of this structure; set it before the call.
    integer(c_int64_t) :: struct_bytes = 64
    ! Memory of the program for a float per pixel, which the call fills on the root: 1 for all
    ! light of the slit. Set it before the call; not used on other ranks.
    type(c_ptr) :: grey = c_null_ptr
    ! Floats that fit there; set it before the call.
    integer(c_int64_t) :: grey_count = 0
    ! Rays that this rank sent to others.
    integer(c_int64_t) :: rays_sent = 0
    ! Rays that ended at a density that is no finite number; on the root.
    integer(c_int64_t) :: masked = 0
    ! Rays that were turned back; on the root.
    integer(c_int64_t) :: turned = 0
    ! Bytes that this rank sent.
    integer(c_int64_t) :: bytes_sent = 0
    ! Rounds of rays that went from brick to brick.
    integer(c_int32_t) :: rounds = 0
    ! Copies of the densities that this rank made: none.
    integer(c_int32_t) :: copies = 0
  end type

  interface
    function rtsv_composite_last_error() &
        result(status) bind(c)
      import
      type(c_ptr) :: status
    end function
    function rtsv_composite_library_version() &
        result(status) bind(c)
      import
      integer(c_int32_t) :: status
    end function
    function rtsv_composite_comm_from_mpi(comm, comm_bytes, out) &
        result(status) bind(c)
      import
      type(c_ptr), value :: comm
      integer(c_int64_t), value :: comm_bytes
      type(c_ptr), intent(out) :: out
      integer(c_int32_t) :: status
    end function
    function rtsv_composite_comm_from_fortran(comm, out) &
        result(status) bind(c)
      import
      integer(c_int32_t), value :: comm
      type(c_ptr), intent(out) :: out
      integer(c_int32_t) :: status
    end function
    function rtsv_composite_comm_self(out) &
        result(status) bind(c)
      import
      type(c_ptr), intent(out) :: out
      integer(c_int32_t) :: status
    end function
    function rtsv_composite_comm_rank(comm, rank, size) &
        result(status) bind(c)
      import
      type(c_ptr), value :: comm
      integer(c_int32_t), intent(inout), optional :: rank
      integer(c_int32_t), intent(inout), optional :: size
      integer(c_int32_t) :: status
    end function
    function rtsv_composite_comm_abort(comm, reason) &
        result(status) bind(c)
      import
      type(c_ptr), value :: comm
      character(kind=c_char), intent(in) :: reason(*)
      integer(c_int32_t) :: status
    end function
    function rtsv_composite_comm_free(comm) &
        result(status) bind(c)
      import
      type(c_ptr), value :: comm
      integer(c_int32_t) :: status
    end function
    function rtsv_composite_options_init(options, struct_bytes) &
        result(status) bind(c)
      import
      type(RtsvCompositeOptions), intent(inout), optional :: options
      integer(c_int64_t), value :: struct_bytes
      integer(c_int32_t) :: status
    end function
    function rtsv_composite_compositor_new(comm, format, options, out) &
        result(status) bind(c)
      import
      type(c_ptr), value :: comm
      integer(c_int32_t), value :: format
      type(RtsvCompositeOptions), intent(in), optional :: options
      type(c_ptr), intent(out) :: out
      integer(c_int32_t) :: status
    end function
    function rtsv_composite_compositor_order(compositor, order, count) &
        result(status) bind(c)
      import
      type(c_ptr), value :: compositor
      integer(c_int32_t), intent(in), optional :: order(*)
      integer(c_int32_t), value :: count
      integer(c_int32_t) :: status
    end function
    function rtsv_composite_composite(compositor, frame, image) &
        result(status) bind(c)
      import
      type(c_ptr), value :: compositor
      type(RtsvCompositeFrame), intent(in), optional :: frame
      type(RtsvCompositeImage), intent(inout), optional :: image
      integer(c_int32_t) :: status
    end function
    function rtsv_composite_composite_wall(compositor, frame, tiles, count, images) &
        result(status) bind(c)
      import
      type(c_ptr), value :: compositor
      type(RtsvCompositeFrame), intent(in), optional :: frame
      type(RtsvCompositeTile), intent(in), optional :: tiles(*)
      integer(c_int32_t), value :: count
      type(RtsvCompositeImage), intent(inout), optional :: images(*)
      integer(c_int32_t) :: status
    end function
    function rtsv_composite_compositor_copies(compositor, text) &
        result(status) bind(c)
      import
      type(c_ptr), value :: compositor
      type(c_ptr), intent(out) :: text
      integer(c_int32_t) :: status
    end function
    function rtsv_composite_compositor_free(compositor) &
        result(status) bind(c)
      import
      type(c_ptr), value :: compositor
      integer(c_int32_t) :: status
    end function
    function rtsv_composite_scene_new(out) &
        result(status) bind(c)
      import
      type(c_ptr), intent(out) :: out
      integer(c_int32_t) :: status
    end function
    function rtsv_composite_material_init(material, struct_bytes) &
        result(status) bind(c)
      import
      type(RtsvCompositeMaterial), intent(inout), optional :: material
      integer(c_int64_t), value :: struct_bytes
      integer(c_int32_t) :: status
    end function
    function rtsv_composite_scene_material(scene, material, number) &
        result(status) bind(c)
      import
      type(c_ptr), value :: scene
      type(RtsvCompositeMaterial), intent(in), optional :: material
      integer(c_int32_t), intent(inout), optional :: number
      integer(c_int32_t) :: status
    end function
    function rtsv_composite_light_init(light, struct_bytes) &
        result(status) bind(c)
      import
      type(RtsvCompositeLight), intent(inout), optional :: light
      integer(c_int64_t), value :: struct_bytes
      integer(c_int32_t) :: status
    end function
    function rtsv_composite_scene_light(scene, light) &
        result(status) bind(c)
      import
      type(c_ptr), value :: scene
      type(RtsvCompositeLight), intent(in), optional :: light
      integer(c_int32_t) :: status
    end function
    function rtsv_composite_surroundings_init(surroundings, struct_bytes) &
        result(status) bind(c)
      import
      type(RtsvCompositeSurroundings), intent(inout), optional :: surroundings
      integer(c_int64_t), value :: struct_bytes
      integer(c_int32_t) :: status
    end function
    function rtsv_composite_scene_surroundings(scene, surroundings) &
        result(status) bind(c)
      import
      type(c_ptr), value :: scene
      type(RtsvCompositeSurroundings), intent(in), optional :: surroundings
      integer(c_int32_t) :: status
    end function
    function rtsv_composite_scene_mesh(scene, mesh) &
        result(status) bind(c)
      import
      type(c_ptr), value :: scene
      type(RtsvCompositeMesh), intent(in), optional :: mesh
      integer(c_int32_t) :: status
    end function
    function rtsv_composite_scene_spheres(scene, spheres) &
        result(status) bind(c)
      import
      type(c_ptr), value :: scene
      type(RtsvCompositeSpheres), intent(in), optional :: spheres
      integer(c_int32_t) :: status
    end function
    function rtsv_composite_scene_copies(scene, text) &
        result(status) bind(c)
      import
      type(c_ptr), value :: scene
      type(c_ptr), intent(out) :: text
      integer(c_int32_t) :: status
    end function
    function rtsv_composite_scene_free(scene) &
        result(status) bind(c)
      import
      type(c_ptr), value :: scene
      integer(c_int32_t) :: status
    end function
    function rtsv_composite_scene_volume(scene, volume, number) &
        result(status) bind(c)
      import
      type(c_ptr), value :: scene
      type(RtsvCompositeVolume), intent(in), optional :: volume
      integer(c_int32_t), intent(inout), optional :: number
      integer(c_int32_t) :: status
    end function
    function rtsv_composite_scene_brick(scene, brick) &
        result(status) bind(c)
      import
      type(c_ptr), value :: scene
      type(RtsvCompositeBrick), intent(in), optional :: brick
      integer(c_int32_t) :: status
    end function
    function rtsv_composite_render_options_init(options, struct_bytes) &
        result(status) bind(c)
      import
      type(RtsvCompositeRenderOptions), intent(inout), optional :: options
      integer(c_int64_t), value :: struct_bytes
      integer(c_int32_t) :: status
    end function
    function rtsv_composite_renderer_new(comm, scene, options, out) &
        result(status) bind(c)
      import
      type(c_ptr), value :: comm
      type(c_ptr), value :: scene
      type(RtsvCompositeRenderOptions), intent(in), optional :: options
      type(c_ptr), intent(out) :: out
      integer(c_int32_t) :: status
    end function
    function rtsv_composite_renderer_replace(renderer, scene) &
        result(status) bind(c)
      import
      type(c_ptr), value :: renderer
      type(c_ptr), value :: scene
      integer(c_int32_t) :: status
    end function
    function rtsv_composite_view_init(view, struct_bytes) &
        result(status) bind(c)
      import
      type(RtsvCompositeView), intent(inout), optional :: view
      integer(c_int64_t), value :: struct_bytes
      integer(c_int32_t) :: status
    end function
    function rtsv_composite_renderer_render(renderer, view, picture) &
        result(status) bind(c)
      import
      type(c_ptr), value :: renderer
      type(RtsvCompositeView), intent(in), optional :: view
      type(RtsvCompositePicture), intent(inout), optional :: picture
      integer(c_int32_t) :: status
    end function
    function rtsv_composite_renderer_warnings(renderer, text) &
        result(status) bind(c)
      import
      type(c_ptr), value :: renderer
      type(c_ptr), intent(out) :: text
      integer(c_int32_t) :: status
    end function
    function rtsv_composite_renderer_free(renderer) &
        result(status) bind(c)
      import
      type(c_ptr), value :: renderer
      integer(c_int32_t) :: status
    end function
    function rtsv_composite_shot_init(shot, struct_bytes) &
        result(status) bind(c)
      import
      type(RtsvCompositeShot), intent(inout), optional :: shot
      integer(c_int64_t), value :: struct_bytes
      integer(c_int32_t) :: status
    end function
    function rtsv_composite_photograph(comm, gas, brick, shot, photograph) &
        result(status) bind(c)
      import
      type(c_ptr), value :: comm
      type(RtsvCompositeGas), intent(in), optional :: gas
      type(RtsvCompositeBrick), intent(in), optional :: brick
      type(RtsvCompositeShot), intent(in), optional :: shot
      type(RtsvCompositePhotograph), intent(inout), optional :: photograph
      integer(c_int32_t) :: status
    end function
  end interface
end module
