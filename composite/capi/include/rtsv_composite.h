/* The C interface of composite: sort-last compositing, and rendering of scenes that no
 * process has whole. Made from the Rust sources by tests/interface: do not edit.
 *
 * Collective calls are made by all ranks of a group in the same order. If one fails with
 * another status than RTSV_COMPOSITE_DISAGREE, the group has ended on all ranks. Handles
 * belong to the thread that made them. Arrays are not kept after a call. */
#ifndef RTSV_COMPOSITE_H
#define RTSV_COMPOSITE_H
#include <stdint.h>
#ifdef __cplusplus
extern "C" {
#endif

/* Version of this interface: major, minor and patch in a byte each. The library's own is that of
 * rtsv_composite_library_version. */
#define RTSV_COMPOSITE_VERSION 0x00000100u
/* The number in the library's name, librtsv_composite.so.0: a change that breaks programs raises
 * it. */
#define RTSV_COMPOSITE_ABI 0u
/* What a call returns: one of RTSV_COMPOSITE_OK and the statuses below. */
typedef uint32_t RtsvCompositeStatus;
/* The call did what it says. */
#define RTSV_COMPOSITE_OK 0u
/* A pointer that must not be null is null, or not aligned. */
#define RTSV_COMPOSITE_POINTER 1u
/* A handle that was never made, has been freed, or is of another kind. */
#define RTSV_COMPOSITE_HANDLE 2u
/* A handle that another thread has made: only that one may use it. */
#define RTSV_COMPOSITE_THREAD 3u
/* A handle that another call of this thread is at work with. */
#define RTSV_COMPOSITE_BUSY 4u
/* struct_bytes is not the size of the structure: set it, or compile with this version's header. */
#define RTSV_COMPOSITE_STRUCT 5u
/* A value or an array cannot be used; the text names it. */
#define RTSV_COMPOSITE_VALUE 6u
/* MPI is not running, or the communicator cannot be used. */
#define RTSV_COMPOSITE_MPI 7u
/* What the ranks give does not fit together, or cannot be rendered. Every rank gets this status
 * with the same text, and the group can be used further. */
#define RTSV_COMPOSITE_DISAGREE 8u
/* The group of ranks has ended: this rank or another has failed. Free the handles, and make a
 * new group. */
#define RTSV_COMPOSITE_ENDED 9u
/* An error of this library, which ends the group. */
#define RTSV_COMPOSITE_PANIC 10u
/* A group of ranks. */
typedef struct RtsvCompositeComm RtsvCompositeComm;
/* Composites images of one pixel format. */
typedef struct RtsvCompositeCompositor RtsvCompositeCompositor;
/* What one rank has of a scene. */
typedef struct RtsvCompositeScene RtsvCompositeScene;
/* One of the ranks that render a scene together. */
typedef struct RtsvCompositeRenderer RtsvCompositeRenderer;
/* RGBA in 8 bits a channel, with depth. */
#define RTSV_COMPOSITE_DEPTH_U8 1u
/* RGBA in 16 bits a channel, with depth. */
#define RTSV_COMPOSITE_DEPTH_U16 2u
/* RGBA in half precision, with depth. */
#define RTSV_COMPOSITE_DEPTH_F16 3u
/* RGBA in single precision, with depth. */
#define RTSV_COMPOSITE_DEPTH_F32 4u
/* Premultiplied RGBA in 8 bits a channel, blended in the order of the ranks. */
#define RTSV_COMPOSITE_ALPHA_U8 5u
/* Premultiplied RGBA in 16 bits a channel. */
#define RTSV_COMPOSITE_ALPHA_U16 6u
/* Premultiplied RGBA in half precision. */
#define RTSV_COMPOSITE_ALPHA_F16 7u
/* Premultiplied RGBA in single precision. */
#define RTSV_COMPOSITE_ALPHA_F32 8u
/* Each rank owns a tile of the image and gets it from all others. */
#define RTSV_COMPOSITE_DIRECT_SEND 0u
/* Half of the ranks send their images to the other half, round after round. */
#define RTSV_COMPOSITE_TREE 1u
/* Partners exchange halves. */
#define RTSV_COMPOSITE_BINARY_SWAP 2u
/* As binary swap, in groups of up to radix ranks. */
#define RTSV_COMPOSITE_RADIX_K 3u
/* What a model of the network, measured before the first frame, finds cheapest. */
#define RTSV_COMPOSITE_AUTOMATIC 4u
/* How to composite; the same on all ranks but for timeout_secs. rtsv_composite_options_init
 * fills it. */
typedef struct RtsvCompositeOptions {
  /* Size of this structure. */
  uint64_t struct_bytes;
  /* RTSV_COMPOSITE_DIRECT_SEND (the default) or another strategy: changes the time, not the
   * image. */
  uint32_t strategy;
  /* Group size of RTSV_COMPOSITE_RADIX_K, a power of two (8). */
  uint32_t radix;
  /* The rank that gets the image (0); -1 leaves a piece of it on each rank. */
  int32_t destination;
  /* 0 or 1 (the default): the image has its depths too. */
  uint32_t depth;
  /* 0 (the default) or 1: checksums cover the pixels of messages too. */
  uint32_t verify;
  /* 0 or 1 (the default): ranks of one machine merge in memory that they share. */
  uint32_t in_memory;
  /* 0 or 1 (the default): ranks wait for each other at the end, so that success on one means
   * success on all. */
  uint32_t final_barrier;
  /* Not used; 0. */
  uint32_t reserved;
  /* Most pixels of a message, about; 0 (the default) chooses. */
  uint64_t slice_px;
  /* Longest wait for a rank that gives no sign of life, seconds (60). */
  double timeout_secs;
} RtsvCompositeOptions;
/* Pixels of one kind in memory of the program. Pixel (x, y) begins at data + y * row_bytes + x *
 * pixel_bytes. */
typedef struct RtsvCompositePlane {
  /* The first pixel of row 0. */
  void const* data;
  /* From one pixel to the next; 0 for pixels without gaps. */
  int64_t pixel_bytes;
  /* From one row to the next, also negative; 0 for rows without gaps. */
  int64_t row_bytes;
} RtsvCompositePlane;
/* What one rank has drawn. The order of rows is free, and the same on all ranks. The planes are
 * read before the call returns, and not copied where pixels have no gaps and are aligned, rows
 * ascend by whole pixels, and both planes have rows of one length. What lies between rows must
 * be readable. */
typedef struct RtsvCompositeFrame {
  /* Size of this structure. */
  uint64_t struct_bytes;
  /* Pixels per row. */
  uint32_t width;
  /* Rows. */
  uint32_t height;
  /* Four channels per pixel, as the compositor's format says. */
  RtsvCompositePlane color;
  /* One float per pixel, 0 (near) to 1 (nothing drawn; so are NaN and more than 1); not read for
   * premultiplied formats. */
  RtsvCompositePlane depth;
  /* 0 or 1: bounds says where something was drawn; pixels outside count as not drawn. */
  uint32_t has_bounds;
  /* 0 or 1: depth_range is known, which checks the order of premultiplied frames. */
  uint32_t has_depth_range;
  /* First column, first row, column behind the last one, row behind the last one. */
  uint32_t bounds[4];
  /* Nearest and farthest depth of what was drawn, in a unit that all ranks share. */
  float depth_range[2];
} RtsvCompositeFrame;
/* A tile of a display wall. */
typedef struct RtsvCompositeTile {
  /* First column in the frame. */
  uint32_t x;
  /* First row in the frame. */
  uint32_t y;
  /* Columns. */
  uint32_t width;
  /* Rows. */
  uint32_t height;
  /* The rank that shows it. */
  uint32_t rank;
  /* Not used; 0. */
  uint32_t reserved;
} RtsvCompositeTile;
/* A composited image, or this rank's part of one; without gaps. Its memory belongs to the
 * compositor until its next call. */
typedef struct RtsvCompositeImage {
  /* Size of this structure; set it before the call. */
  uint64_t struct_bytes;
  /* Pixels per row; 0 on ranks that get nothing. */
  uint32_t width;
  /* Rows. */
  uint32_t height;
  /* First column in the frame. */
  uint32_t x;
  /* First row in the frame. */
  uint32_t y;
  /* Four channels per pixel, all 0 where nothing was drawn; null on ranks that get nothing. */
  void const* color;
  /* One per pixel, 1 where nothing was drawn; null without depth. */
  float const* depth;
} RtsvCompositeImage;
/* uint8_t */
#define RTSV_COMPOSITE_U8 1u
/* int8_t */
#define RTSV_COMPOSITE_I8 2u
/* uint16_t */
#define RTSV_COMPOSITE_U16 3u
/* int16_t */
#define RTSV_COMPOSITE_I16 4u
/* uint32_t */
#define RTSV_COMPOSITE_U32 5u
/* int32_t */
#define RTSV_COMPOSITE_I32 6u
/* uint64_t */
#define RTSV_COMPOSITE_U64 7u
/* int64_t */
#define RTSV_COMPOSITE_I64 8u
/* float */
#define RTSV_COMPOSITE_F32 9u
/* double */
#define RTSV_COMPOSITE_F64 10u
/* Tuples of numbers in memory of the program; all zero for none. */
typedef struct RtsvCompositeArray {
  /* The first number of the first tuple; null only without tuples. */
  void const* data;
  /* Number of tuples. */
  uint64_t count;
  /* Numbers of a tuple, one behind the other. */
  uint32_t components;
  /* What they are: RTSV_COMPOSITE_U8 to RTSV_COMPOSITE_F64. */
  uint32_t kind;
  /* From one tuple to the next, also negative or less than a tuple; 0 for tuples without gaps. */
  int64_t stride_bytes;
  /* Called once with owner when the library needs the array no more, also after an error, or
   * null. Not called if the structure that holds this array is null or has another size. */
  void (*release)(void*);
  /* For release. */
  void* owner;
} RtsvCompositeArray;
/* Ideal diffuse. */
#define RTSV_COMPOSITE_MATTE 0u
/* The colour without lighting. */
#define RTSV_COMPOSITE_UNLIT 1u
/* OpenGL's model, with specular and shininess. */
#define RTSV_COMPOSITE_PHONG 2u
/* A metal with roughness: a mirror at 0. */
#define RTSV_COMPOSITE_METAL 3u
/* Clear glass with ior. */
#define RTSV_COMPOSITE_GLASS 4u
/* glTF's model, with metallic and roughness. */
#define RTSV_COMPOSITE_PBR 5u
/* A material. rtsv_composite_material_init fills it: matte, white, opaque. */
typedef struct RtsvCompositeMaterial {
  /* Size of this structure. */
  uint64_t struct_bytes;
  /* RTSV_COMPOSITE_MATTE or another model. */
  uint32_t model;
  /* Linear RGB; multiplied by the colours of the object. */
  float color[3];
  /* Emitted radiance, linear RGB. */
  float emission[3];
  /* 1 opaque to 0 invisible. */
  float opacity;
  /* Strength of the highlight. */
  float specular;
  /* Exponent of the highlight. */
  float shininess;
  /* 0 smooth to 1. */
  float roughness;
  /* 0 or 1, or between. */
  float metallic;
  /* Refractive index. */
  float ior;
  /* 0 or 1: the normals of the triangles, not of their corners. */
  uint32_t flat;
} RtsvCompositeMaterial;
/* The same from all directions. */
#define RTSV_COMPOSITE_AMBIENT 0u
/* Parallel light from direction. */
#define RTSV_COMPOSITE_DIRECTIONAL 1u
/* Light from position in all directions. */
#define RTSV_COMPOSITE_POINT 2u
/* Light from position along direction, within cutoff_rad. */
#define RTSV_COMPOSITE_SPOT 3u
/* Parallel light along the view, without shadows. */
#define RTSV_COMPOSITE_HEADLIGHT 4u
/* A light. rtsv_composite_light_init fills it: ambient, white. */
typedef struct RtsvCompositeLight {
  /* Size of this structure. */
  uint64_t struct_bytes;
  /* RTSV_COMPOSITE_AMBIENT or another kind. */
  uint32_t kind;
  /* 0 or 1: surfaces block it. Not for ambient light and headlights, which nothing blocks. */
  uint32_t shadows;
  /* Position in the world. */
  double position[3];
  /* Directional: towards the light. Spot: away from it. */
  double direction[3];
  /* Radius in world units, or of directional light half the angle it fills, radians; 0 for sharp
   * shadows. */
  double size;
  /* Half angle of a spot, radians. */
  double cutoff_rad;
  /* Linear RGB. */
  float color[3];
  /* Not used; 0. */
  uint32_t reserved;
} RtsvCompositeLight;
/* What surrounds the objects. rtsv_composite_surroundings_init fills it: nothing. */
typedef struct RtsvCompositeSurroundings {
  /* Size of this structure. */
  uint64_t struct_bytes;
  /* Largest distance of an occluder of ambient light, world units, infinite for any. */
  double occlusion_distance;
  /* Rays of ambient occlusion for each point; 0 for no ambient occlusion. */
  uint32_t occlusion_rays;
  /* 0 or 1: a background of bottom to top, opaque. Else alpha is 0 where nothing is. */
  uint32_t has_background;
  /* Linear RGB of the bottom row. */
  float bottom[3];
  /* Linear RGB of the top row. */
  float top[3];
} RtsvCompositeSurroundings;
/* This rank's triangles of an object. What ranks give under one name is one object. */
typedef struct RtsvCompositeMesh {
  /* Size of this structure. */
  uint64_t struct_bytes;
  /* The object's name, UTF-8. */
  char const* name;
  /* The material's number in the scene. */
  uint32_t material;
  /* 0 or 1: colors has one colour per triangle, not per vertex. */
  uint32_t colors_per_face;
  /* Positions are kept as float relative to this point; the same on all ranks. Choose it near
   * the object where coordinates are large. */
  double origin[3];
  /* Three floats or doubles per vertex. */
  RtsvCompositeArray positions;
  /* Three integers per triangle, counter-clockwise seen from outside. Triangles with an index
   * beyond the positions are left out, and counted (rtsv_composite_renderer_warnings). */
  RtsvCompositeArray triangles;
  /* Three floats or doubles per vertex, or none. */
  RtsvCompositeArray normals;
  /* Linear RGBA, four floats or doubles, or none. */
  RtsvCompositeArray colors;
  /* Transforms to the world, twelve doubles each (three rows of four), or none for one without a
   * transform. The same on all ranks that have a piece of the object. */
  RtsvCompositeArray places;
} RtsvCompositeMesh;
/* This rank's spheres of an object. */
typedef struct RtsvCompositeSpheres {
  /* Size of this structure. */
  uint64_t struct_bytes;
  /* The object's name, UTF-8. */
  char const* name;
  /* The material's number in the scene. */
  uint32_t material;
  /* Radius of all spheres, where radii has none. */
  float radius;
  /* As that of a mesh. */
  double origin[3];
  /* Three floats or doubles per sphere. */
  RtsvCompositeArray centers;
  /* One float or double per sphere, or none. */
  RtsvCompositeArray radii;
  /* Linear RGBA, four floats or doubles per sphere, or none. */
  RtsvCompositeArray colors;
  /* As those of a mesh. */
  RtsvCompositeArray places;
} RtsvCompositeSpheres;
/* A volume, of which ranks have bricks. All ranks give the same description, in the same order. */
typedef struct RtsvCompositeVolume {
  /* Size of this structure. */
  uint64_t struct_bytes;
  /* Its name, UTF-8. */
  char const* name;
  /* Points per axis of the whole grid. */
  uint32_t dims[3];
  /* 0: linear interpolation; 1: the value of the nearest point. */
  uint32_t nearest;
  /* World position of the first point. */
  double origin[3];
  /* Distance of neighbouring points, world units. */
  double spacing[3];
  /* Three floats or doubles (linear RGB) per entry, evenly spaced over range. */
  RtsvCompositeArray colors;
  /* Values of the first and the last colour. */
  float range[2];
  /* Two floats or doubles per entry, ascending: a value, and the opacity of a slab of
   * unit_distance there. */
  RtsvCompositeArray opacities;
  /* See opacities; world units. */
  double unit_distance;
} RtsvCompositeVolume;
/* This rank's values on a box of points of a volume. Bricks of neighbours share the points
 * between them. */
typedef struct RtsvCompositeBrick {
  /* Size of this structure. */
  uint64_t struct_bytes;
  /* The volume's number in the scene. */
  uint32_t volume;
  /* Not used; 0. */
  uint32_t reserved;
  /* First point in the whole grid. */
  uint32_t first[3];
  /* Points per axis of the brick. */
  uint32_t dims[3];
  /* One number per point; stride_bytes leads along x. */
  RtsvCompositeArray values;
  /* From one row of points to the next, along y; 0 for rows without gaps. */
  int64_t row_bytes;
  /* From one slice of points to the next, along z; 0 for slices without gaps. */
  int64_t slice_bytes;
} RtsvCompositeBrick;
/* Rays go to the ranks whose bounds they enter: exact for every effect. */
#define RTSV_COMPOSITE_FORWARD 0u
/* Each rank also holds what lies within the distance of ambient occlusion around its part. */
#define RTSV_COMPOSITE_GHOST_ZONES 1u
/* Only the rank that was hit is asked: wrong near borders, for comparison. */
#define RTSV_COMPOSITE_LOCAL_ONLY 2u
/* How ranks render together; the same on all ranks but for timeout_secs and threads.
 * rtsv_composite_render_options_init fills it. */
typedef struct RtsvCompositeRenderOptions {
  /* Size of this structure. */
  uint64_t struct_bytes;
  /* The rank that gets the picture (0). */
  uint32_t root;
  /* RTSV_COMPOSITE_FORWARD (the default) or another way for light to cross borders. */
  uint32_t secondary_rays;
  /* 0 (the default) or 1: use all processors that the process may, not one thread for a rank. */
  uint32_t threads;
  /* Not used; 0. */
  uint32_t reserved;
  /* Longest wait for a rank that gives no sign of life, seconds (60). */
  double timeout_secs;
} RtsvCompositeRenderOptions;
/* A perspective view. */
#define RTSV_COMPOSITE_PERSPECTIVE 0u
/* A parallel projection. */
#define RTSV_COMPOSITE_PARALLEL 1u
/* The view of clip_from_world. */
#define RTSV_COMPOSITE_MATRIX 2u
/* What to render; the same on all ranks. rtsv_composite_view_init fills it: a perspective view
 * from (0, 0, 1) to the origin, 640 x 480 pixels, one sample. */
typedef struct RtsvCompositeView {
  /* Size of this structure. */
  uint64_t struct_bytes;
  /* Pixels per row. */
  uint32_t width;
  /* Rows. */
  uint32_t height;
  /* RTSV_COMPOSITE_PERSPECTIVE or another projection. */
  uint32_t projection;
  /* Samples per pixel. */
  uint32_t samples;
  /* Shadow rays per sample to each light that has a size (4). */
  uint32_t light_rays;
  /* Most reflections and refractions one behind the other; -1 (the default) for 8, or for no
   * limit in path tracing. */
  int32_t max_bounces;
  /* 0 or 1: light over many bounces. */
  uint32_t path_tracing;
  /* 0 or 1: the picture has depths too. */
  uint32_t depth;
  /* Another seed gives other noise. */
  uint64_t seed;
  /* Position of the eye in the world. */
  double eye[3];
  /* A point in the middle of the picture. */
  double target[3];
  /* What is up. */
  double up[3];
  /* Full vertical angle of a perspective, radians. */
  double fov_y_rad;
  /* Height of the picture of a parallel projection, world units. */
  double parallel_height;
  /* Distance of the near plane. */
  double near;
  /* Distance of the far plane. */
  double far;
  /* Projection times view of OpenGL, row by row. */
  double clip_from_world[16];
} RtsvCompositeView;
/* A rendered picture. Rows start at the top. Its memory belongs to the renderer until its next
 * call. */
typedef struct RtsvCompositePicture {
  /* Size of this structure; set it before the call. */
  uint64_t struct_bytes;
  /* Pixels per row; 0 on all ranks but the root. */
  uint32_t width;
  /* Rows. */
  uint32_t height;
  /* Linear RGBA, premultiplied, four per pixel; null on all ranks but the root. */
  float const* color;
  /* OpenGL's window depth, one per pixel; null if it was not asked for. */
  float const* depth;
} RtsvCompositePicture;
/* A gas on a lattice of points, without its densities. All ranks give the same. */
typedef struct RtsvCompositeGas {
  /* Size of this structure. */
  uint64_t struct_bytes;
  /* Points per axis of the whole lattice. */
  uint32_t dims[3];
  /* Not used; 0. */
  uint32_t reserved;
  /* Position of the first point, metres. */
  double origin_m[3];
  /* Distance of neighbouring points, metres. */
  double spacing_m[3];
  /* K of the law of Gladstone and Dale, n = 1 + K rho, m^3/kg: 2.26e-4 for air. */
  double gladstone_dale;
  /* Density of the gas outside, kg/m^3. */
  double reference_density;
} RtsvCompositeGas;
/* A schlieren picture: a slit, and a knife's edge in the cut-off plane. */
#define RTSV_COMPOSITE_KNIFE 0u
/* A shadowgraph: no cut-off, and a film that is focused on a plane. */
#define RTSV_COMPOSITE_SHADOWGRAPH 1u
/* Gradients by central differences: needs one more layer of points around a brick's cells. */
#define RTSV_COMPOSITE_TRILINEAR_GRADIENT 0u
/* The gradient of linear interpolation, which jumps from cell to cell: needs no more layers. */
#define RTSV_COMPOSITE_TRILINEAR 1u
/* How a gas is photographed; the same on all ranks but for timeout_secs and threads.
 * rtsv_composite_shot_init fills it: schlieren along z, 512 x 512 pixels that show the whole
 * gas. */
typedef struct RtsvCompositeShot {
  /* Size of this structure. */
  uint64_t struct_bytes;
  /* Pixels per row. */
  uint32_t width;
  /* Rows. */
  uint32_t height;
  /* RTSV_COMPOSITE_KNIFE or RTSV_COMPOSITE_SHADOWGRAPH. */
  uint32_t technique;
  /* RTSV_COMPOSITE_TRILINEAR_GRADIENT (the default) or RTSV_COMPOSITE_TRILINEAR. */
  uint32_t interpolant;
  /* The rank that gets the picture (0). */
  uint32_t root;
  /* 0 (the default) or 1: use all processors that the process may, not one thread for a rank. */
  uint32_t threads;
  /* Direction of the light, towards the film. */
  double direction[3];
  /* What is up in the picture. */
  double up[3];
  /* Side of a pixel in the gas, metres; 0 (the default) for pixels that show the whole gas. */
  double pixel_m;
  /* Longest step of a ray, in distances of points (1). */
  double step_voxels;
  /* Knife: deflections in this direction brighten the picture, degrees counter-clockwise from
   * its right (0). */
  double angle_deg;
  /* Knife: width of the slit, across the edge (0.001). */
  double slit_width_m;
  /* Knife: focal length of both lenses (1.5). */
  double focal_length_m;
  /* Knife: fraction of the slit's image that is left open, the brightness without gas (0.5). */
  double open_fraction;
  /* Shadowgraph: distance of the plane in focus from the centre of the gas, along the light. */
  double focus_m;
  /* Longest wait for a rank that gives no sign of life, seconds (60). */
  double timeout_secs;
} RtsvCompositeShot;
/* A photograph. Rows start at the top. */
typedef struct RtsvCompositePhotograph {
  /* Size of this structure; set it before the call. */
  uint64_t struct_bytes;
  /* Memory of the program for a float per pixel, which the call fills on the root: 1 for all
   * light of the slit. Set it before the call; not used on other ranks. */
  float* grey;
  /* Floats that fit there; set it before the call. */
  uint64_t grey_count;
  /* Rays that this rank sent to others. */
  uint64_t rays_sent;
  /* Rays that ended at a density that is no finite number; on the root. */
  uint64_t masked;
  /* Rays that were turned back; on the root. */
  uint64_t turned;
  /* Bytes that this rank sent. */
  uint64_t bytes_sent;
  /* Rounds of rays that went from brick to brick. */
  uint32_t rounds;
  /* Copies of the densities that this rank made: none. */
  uint32_t copies;
} RtsvCompositePhotograph;
/* Why the last call of this thread that failed did so; empty before. English, one line, UTF-8.
 * It belongs to the library until the next failure of this thread. */
char const* rtsv_composite_last_error(void);
/* RTSV_COMPOSITE_VERSION of the library that runs. */
uint32_t rtsv_composite_library_version(void);
/* Collective: a group of the ranks of an MPI communicator, which is duplicated. comm points to
 * the MPI_Comm and comm_bytes is its size: rtsv_composite_comm_from_mpi(&comm, sizeof comm,
 * &group). MPI is running, with a thread level that allows calls from this thread. */
RtsvCompositeStatus rtsv_composite_comm_from_mpi(
    void const* comm,
    uint64_t comm_bytes,
    RtsvCompositeComm** out);
/* Collective: as rtsv_composite_comm_from_mpi, for a communicator of Fortran: an INTEGER, or
 * comm%MPI_VAL of a type(MPI_Comm). */
RtsvCompositeStatus rtsv_composite_comm_from_fortran(int32_t comm, RtsvCompositeComm** out);
/* A group of this rank alone, without MPI: for programs that run on one process too. */
RtsvCompositeStatus rtsv_composite_comm_self(RtsvCompositeComm** out);
/* This rank in the group, and the number of ranks; either may be null. */
RtsvCompositeStatus rtsv_composite_comm_rank(
    RtsvCompositeComm const* comm,
    uint32_t* rank,
    uint32_t* size);
/* Ends the group: all ranks that wait, or will, get RTSV_COMPOSITE_ENDED with this reason. For a
 * rank that cannot go on outside of a call. */
RtsvCompositeStatus rtsv_composite_comm_abort(RtsvCompositeComm* comm, char const* reason);
/* Collective: frees a group, before MPI_Finalize; null is allowed. What was made with it must
 * not be used any more, but must still be freed. */
RtsvCompositeStatus rtsv_composite_comm_free(RtsvCompositeComm* comm);
/* Fills options with their defaults; struct_bytes is sizeof of the structure. */
RtsvCompositeStatus rtsv_composite_options_init(
    RtsvCompositeOptions* options,
    uint64_t struct_bytes);
/* A compositor for images of one pixel format (RTSV_COMPOSITE_DEPTH_U8, ...). It keeps its
 * buffers from one image to the next. Null options are the defaults. */
RtsvCompositeStatus rtsv_composite_compositor_new(
    RtsvCompositeComm* comm,
    uint32_t format,
    RtsvCompositeOptions const* options,
    RtsvCompositeCompositor** out);
/* Sets the order of the ranks for the next images: count ranks, each once, the one in front
 * first; null for rank 0 in front. The same on all ranks. */
RtsvCompositeStatus rtsv_composite_compositor_order(
    RtsvCompositeCompositor* compositor,
    uint32_t const* order,
    uint32_t count);
/* Collective: composites the frames of all ranks into image. */
RtsvCompositeStatus rtsv_composite_composite(
    RtsvCompositeCompositor* compositor,
    RtsvCompositeFrame const* frame,
    RtsvCompositeImage* image);
/* Collective: composites the frames of all ranks into the tiles of a display wall, which may
 * overlap. All ranks give the same count tiles. images[k] is tile k on the rank that shows it,
 * and without pixels on the others. The destination of the options is not used. */
RtsvCompositeStatus rtsv_composite_composite_wall(
    RtsvCompositeCompositor* compositor,
    RtsvCompositeFrame const* frame,
    RtsvCompositeTile const* tiles,
    uint32_t count,
    RtsvCompositeImage* images);
/* Which planes the last call had to copy, and why: a line for each, empty for none. The text
 * belongs to the compositor until its next call. */
RtsvCompositeStatus rtsv_composite_compositor_copies(
    RtsvCompositeCompositor* compositor,
    char const** text);
/* Frees a compositor and its images; null is allowed. */
RtsvCompositeStatus rtsv_composite_compositor_free(RtsvCompositeCompositor* compositor);
/* A scene of nothing. */
RtsvCompositeStatus rtsv_composite_scene_new(RtsvCompositeScene** out);
/* Fills a material: matte, white, opaque. struct_bytes is sizeof of the structure. */
RtsvCompositeStatus rtsv_composite_material_init(
    RtsvCompositeMaterial* material,
    uint64_t struct_bytes);
/* Adds a material; number gets its number, which counts from 0. All ranks add the same ones. */
RtsvCompositeStatus rtsv_composite_scene_material(
    RtsvCompositeScene* scene,
    RtsvCompositeMaterial const* material,
    uint32_t* number);
/* Fills a light: ambient, white. struct_bytes is sizeof of the structure. */
RtsvCompositeStatus rtsv_composite_light_init(RtsvCompositeLight* light, uint64_t struct_bytes);
/* Adds a light. All ranks add the same ones. */
RtsvCompositeStatus rtsv_composite_scene_light(
    RtsvCompositeScene* scene,
    RtsvCompositeLight const* light);
/* Fills surroundings: transparent, no ambient occlusion. struct_bytes is sizeof of the
 * structure. */
RtsvCompositeStatus rtsv_composite_surroundings_init(
    RtsvCompositeSurroundings* surroundings,
    uint64_t struct_bytes);
/* Sets what surrounds the objects. All ranks give the same. */
RtsvCompositeStatus rtsv_composite_scene_surroundings(
    RtsvCompositeScene* scene,
    RtsvCompositeSurroundings const* surroundings);
/* Adds this rank's triangles of an object. A rank leaves out the objects of which it has
 * nothing. */
RtsvCompositeStatus rtsv_composite_scene_mesh(
    RtsvCompositeScene* scene,
    RtsvCompositeMesh const* mesh);
/* Adds this rank's spheres of an object. */
RtsvCompositeStatus rtsv_composite_scene_spheres(
    RtsvCompositeScene* scene,
    RtsvCompositeSpheres const* spheres);
/* Which arrays were copied, and why: a line for each. The text belongs to the scene until its
 * next call. */
RtsvCompositeStatus rtsv_composite_scene_copies(RtsvCompositeScene* scene, char const** text);
/* Frees a scene; renderers that were made of it go on. Null is allowed. */
RtsvCompositeStatus rtsv_composite_scene_free(RtsvCompositeScene* scene);
/* Adds a volume without values; number gets its number, which counts from 0. All ranks add the
 * same ones in the same order. */
RtsvCompositeStatus rtsv_composite_scene_volume(
    RtsvCompositeScene* scene,
    RtsvCompositeVolume const* volume,
    uint32_t* number);
/* Adds this rank's values on a box of points of a volume, any number of times. */
RtsvCompositeStatus rtsv_composite_scene_brick(
    RtsvCompositeScene* scene,
    RtsvCompositeBrick const* brick);
/* Fills options with their defaults; struct_bytes is sizeof of the structure. */
RtsvCompositeStatus rtsv_composite_render_options_init(
    RtsvCompositeRenderOptions* options,
    uint64_t struct_bytes);
/* Collective: makes the ranks of a group render the sum of their scenes. A scene may be changed
 * or freed afterwards. Null options are the defaults. */
RtsvCompositeStatus rtsv_composite_renderer_new(
    RtsvCompositeComm* comm,
    RtsvCompositeScene const* scene,
    RtsvCompositeRenderOptions const* options,
    RtsvCompositeRenderer** out);
/* Collective: replaces what the ranks have, for the next time step; ranks whose part is the same
 * give the scene of before. After RTSV_COMPOSITE_DISAGREE the earlier scene remains. */
RtsvCompositeStatus rtsv_composite_renderer_replace(
    RtsvCompositeRenderer* renderer,
    RtsvCompositeScene const* scene);
/* Fills a view; struct_bytes is sizeof of the structure. */
RtsvCompositeStatus rtsv_composite_view_init(RtsvCompositeView* view, uint64_t struct_bytes);
/* Collective: renders a picture, which goes to the root. */
RtsvCompositeStatus rtsv_composite_renderer_render(
    RtsvCompositeRenderer* renderer,
    RtsvCompositeView const* view,
    RtsvCompositePicture* picture);
/* What this rank's scene and the last picture lack of what was asked for, and why: a line for
 * each, empty for none. The text belongs to the renderer until its next call. */
RtsvCompositeStatus rtsv_composite_renderer_warnings(
    RtsvCompositeRenderer* renderer,
    char const** text);
/* Frees a renderer and its picture; null is allowed. */
RtsvCompositeStatus rtsv_composite_renderer_free(RtsvCompositeRenderer* renderer);
/* Fills a shot; struct_bytes is sizeof of the structure. */
RtsvCompositeStatus rtsv_composite_shot_init(RtsvCompositeShot* shot, uint64_t struct_bytes);
/* Collective: photographs a gas of which every rank gives a brick (or null for none): light that
 * is bent by differences of density, also across the borders of bricks. Bricks of neighbours
 * share the points between them, and overlap by one layer of points more on either side for
 * RTSV_COMPOSITE_TRILINEAR_GRADIENT; points that several ranks have are the same on all. values
 * of a brick are densities, kg/m^3, which are read where they are and not copied, and may have
 * any strides; what is no finite number blocks light. The picture has the bits of one process. */
RtsvCompositeStatus rtsv_composite_photograph(
    RtsvCompositeComm* comm,
    RtsvCompositeGas const* gas,
    RtsvCompositeBrick const* brick,
    RtsvCompositeShot const* shot,
    RtsvCompositePhotograph* photograph);

#ifdef __cplusplus
}
#endif
#endif
