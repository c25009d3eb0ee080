/* Every call with null pointers, handles that are none, sizes of other versions and values that
 * cannot be: each must end with a status and a text, and without a fault that valgrind sees. Prints
 * "done" at the end. */
#include <math.h>
#include <pthread.h>
#include <rtsv_composite.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int faults;

/* The call must end with this status and, if it fails, a text that contains `words`. */
static void expect_at(int line, uint32_t found, uint32_t wanted, const char* words) {
  const char* text = rtsv_composite_last_error();
  if (found != wanted || (wanted != RTSV_COMPOSITE_OK && !strstr(text, words))) {
    fprintf(stderr, "line %d: status %u, not %u, or no `%s` in: %s\n", line, found, wanted, words,
            text);
    ++faults;
  }
}
#define EXPECT(call, wanted, words) expect_at(__LINE__, (call), RTSV_COMPOSITE_##wanted, (words))
#define FINE(call) EXPECT(call, OK, "")

static int released;
static void release(void* owner) {
  ++released;
  ++*(int*)owner;
}
static RtsvCompositeScene* scene_in_call;
static void call_inside(void* owner) {
  (void)owner;
  const char* text;
  FINE(rtsv_composite_scene_copies(scene_in_call, &text));
  FINE(rtsv_composite_scene_free(scene_in_call));
}

static RtsvCompositeComm* comm;
static void* other_thread(void* unused) {
  EXPECT(rtsv_composite_comm_rank(comm, NULL, NULL), THREAD, "another thread");
  EXPECT(rtsv_composite_comm_free(comm), THREAD, "another thread");
  return unused;
}

/* Handles that are none: made up, an address, and a handle of another kind. */
static void wrong_handles(void* other) {
  static char memory[64];
  void* const none[] = {(void*)1, (void*)16, (void*)-1, memory, other, (void*)0x52545351};
  uint32_t number;
  const char* text;
  RtsvCompositeCompositor* compositor = NULL;
  RtsvCompositeRenderer* renderer = NULL;
  for (int k = 0; k < 7; ++k) {
    void* h = k < 6 ? none[k] : NULL;
    const uint32_t wanted = h ? RTSV_COMPOSITE_HANDLE : RTSV_COMPOSITE_POINTER;
    const uint32_t freed = h ? RTSV_COMPOSITE_HANDLE : RTSV_COMPOSITE_OK;
    expect_at(__LINE__, rtsv_composite_comm_rank(h, &number, &number), wanted, "group of ranks");
    expect_at(__LINE__, rtsv_composite_comm_abort(h, "why"), wanted, "group of ranks");
    expect_at(__LINE__, rtsv_composite_comm_free(h), freed, "group of ranks");
    expect_at(__LINE__,
              rtsv_composite_compositor_new(h, RTSV_COMPOSITE_DEPTH_U8, NULL, &compositor), wanted,
              "group of ranks");
    expect_at(__LINE__, rtsv_composite_compositor_order(h, NULL, 0), wanted, "compositor");
    expect_at(__LINE__, rtsv_composite_composite(h, NULL, NULL), wanted, "compositor");
    expect_at(__LINE__, rtsv_composite_composite_wall(h, NULL, NULL, 0, NULL), wanted,
              "compositor");
    expect_at(__LINE__, rtsv_composite_compositor_copies(h, &text), wanted, "compositor");
    expect_at(__LINE__, rtsv_composite_compositor_free(h), freed, "compositor");
    if (h != other) {
      expect_at(__LINE__, rtsv_composite_scene_material(h, NULL, NULL), wanted, "scene");
      expect_at(__LINE__, rtsv_composite_scene_light(h, NULL), wanted, "scene");
      expect_at(__LINE__, rtsv_composite_scene_surroundings(h, NULL), wanted, "scene");
      expect_at(__LINE__, rtsv_composite_scene_copies(h, &text), wanted, "scene");
      expect_at(__LINE__, rtsv_composite_scene_free(h), freed, "scene");
    }
    expect_at(__LINE__, rtsv_composite_renderer_new(h, NULL, NULL, &renderer), wanted,
              "group of ranks");
    expect_at(__LINE__, rtsv_composite_renderer_replace(h, NULL), wanted, "renderer");
    expect_at(__LINE__, rtsv_composite_renderer_render(h, NULL, NULL), wanted, "renderer");
    expect_at(__LINE__, rtsv_composite_renderer_warnings(h, &text), wanted, "renderer");
    expect_at(__LINE__, rtsv_composite_renderer_free(h), freed, "renderer");
  }
}

/* A new group, as a failed collective call ends the old one. */
static RtsvCompositeComm* fresh(void) {
  RtsvCompositeComm* made = NULL;
  FINE(rtsv_composite_comm_self(&made));
  return made;
}

static void groups(void) {
  int handle = 0;
  EXPECT(rtsv_composite_comm_self(NULL), POINTER, "`out` is null");
  EXPECT(rtsv_composite_comm_self((void*)3), POINTER, "`out` is not aligned");
  EXPECT(rtsv_composite_comm_from_mpi(&handle, sizeof handle, NULL), POINTER, "`out`");
  EXPECT(rtsv_composite_comm_from_mpi(NULL, 8, &comm), POINTER, "`comm` is null");
  /* No MPI is in this process. */
  EXPECT(rtsv_composite_comm_from_mpi(&handle, sizeof handle, &comm), MPI, "MPI");
  EXPECT(rtsv_composite_comm_from_fortran(0, &comm), MPI, "MPI");
  comm = fresh();
  uint32_t rank = 7, size = 7;
  FINE(rtsv_composite_comm_rank(comm, &rank, &size));
  if (rank != 0 || size != 1) ++faults;
  EXPECT(rtsv_composite_comm_abort(comm, NULL), POINTER, "`reason` is null");
  EXPECT(rtsv_composite_comm_abort(comm, "\xff"), VALUE, "not UTF-8");
  pthread_t thread;
  if (pthread_create(&thread, NULL, other_thread, NULL) || pthread_join(thread, NULL)) ++faults;
}

static void images(void) {
  enum { W = 5, H = 3 };
  unsigned char color[4 * W * H + 1];
  float depth[W * H];
  memset(color, 9, sizeof color);
  for (int k = 0; k < W * H; ++k) depth[k] = k == 4 ? NAN : 0.5f;
  RtsvCompositeCompositor* compositor = NULL;
  RtsvCompositeOptions options;
  EXPECT(rtsv_composite_options_init(NULL, sizeof options), POINTER, "options");
  EXPECT(rtsv_composite_options_init(&options, 8), STRUCT, "struct_bytes");
  FINE(rtsv_composite_options_init(&options, sizeof options));
  const uint32_t format = RTSV_COMPOSITE_DEPTH_U8;
  EXPECT(rtsv_composite_compositor_new(comm, format, &options, NULL), POINTER, "out");
  EXPECT(rtsv_composite_compositor_new(comm, 0, &options, &compositor), VALUE, "pixel format 0");
  EXPECT(rtsv_composite_compositor_new(comm, 99, NULL, &compositor), VALUE, "pixel format 99");
#define BAD_OPTION(member, value, words)                                                      \
  do {                                                                                        \
    RtsvCompositeOptions bad = options;                                                       \
    bad.member = (value);                                                                     \
    EXPECT(rtsv_composite_compositor_new(comm, format, &bad, &compositor), VALUE, words);     \
  } while (0)
  BAD_OPTION(strategy, 77, "strategy");
  BAD_OPTION(destination, -2, "destination");
  BAD_OPTION(depth, 2, "depth");
  BAD_OPTION(verify, 255, "verify");
  BAD_OPTION(in_memory, 9, "in_memory");
  BAD_OPTION(final_barrier, 9, "final_barrier");
  BAD_OPTION(reserved, 1, "reserved");
  BAD_OPTION(timeout_secs, NAN, "timeout_secs");
  BAD_OPTION(timeout_secs, 0, "timeout_secs");
  BAD_OPTION(timeout_secs, -1, "timeout_secs");
  BAD_OPTION(timeout_secs, INFINITY, "timeout_secs");
  BAD_OPTION(timeout_secs, 1e18, "timeout_secs");
  RtsvCompositeOptions small = options;
  small.struct_bytes = 8;
  EXPECT(rtsv_composite_compositor_new(comm, format, &small, &compositor), STRUCT, "struct_bytes");

  const RtsvCompositeFrame good = {.struct_bytes = sizeof good,
                                   .width = W,
                                   .height = H,
                                   .color = {color, 0, 0},
                                   .depth = {depth, 0, 0}};
  RtsvCompositeImage image = {.struct_bytes = sizeof image};
#define BAD_FRAME(change, wanted, words)                                            \
  do {                                                                              \
    RtsvCompositeComm* group = fresh();                                             \
    FINE(rtsv_composite_compositor_new(group, format, NULL, &compositor));          \
    RtsvCompositeFrame frame = good;                                                \
    change;                                                                         \
    EXPECT(rtsv_composite_composite(compositor, &frame, &image), wanted, words);    \
    frame = good;                                                                   \
    EXPECT(rtsv_composite_composite(compositor, &frame, &image), ENDED, "ended");   \
    FINE(rtsv_composite_compositor_free(compositor));                               \
    FINE(rtsv_composite_comm_free(group));                                          \
  } while (0)
  BAD_FRAME(frame.struct_bytes = 0, STRUCT, "RtsvCompositeFrame is 0");
  BAD_FRAME(frame.struct_bytes += 8, STRUCT, "header");
  BAD_FRAME(frame.color.data = NULL, POINTER, "color.data");
  BAD_FRAME(frame.depth.data = NULL, POINTER, "depth.data");
  BAD_FRAME(frame.color.row_bytes = W, VALUE, "overlap");
  BAD_FRAME(frame.color.pixel_bytes = 1, VALUE, "overlap");
  BAD_FRAME(frame.depth.row_bytes = INT64_MIN, VALUE, "no memory is so large");
  BAD_FRAME(frame.depth.pixel_bytes = INT64_MAX, VALUE, "no memory is so large");
  BAD_FRAME((frame.width = UINT32_MAX, frame.height = UINT32_MAX), VALUE, "no memory");
  BAD_FRAME(frame.has_bounds = 2, VALUE, "has_bounds");
  BAD_FRAME((frame.has_bounds = 1, frame.bounds[2] = W + 1, frame.bounds[3] = 1), VALUE, "bounds");
  BAD_FRAME((frame.has_depth_range = 1, frame.depth_range[0] = NAN), VALUE, "depth_range");
  BAD_FRAME((frame.has_depth_range = 1, frame.depth_range[0] = 1), VALUE, "depth_range");
  BAD_FRAME((image.struct_bytes = 3), STRUCT, "RtsvCompositeImage is 3");
  image.struct_bytes = sizeof image;

  RtsvCompositeComm* group = fresh();
  FINE(rtsv_composite_compositor_new(group, format, &options, &compositor));
  EXPECT(rtsv_composite_compositor_copies(compositor, NULL), POINTER, "text");
  FINE(rtsv_composite_composite(compositor, &good, &image));
  if (image.width != W || image.height != H || image.depth[4] != 1 || image.depth[0] != 0.5f)
    ++faults;
  /* Upside down, at an odd address, and transposed. */
  RtsvCompositeFrame frame = good;
  frame.color = (RtsvCompositePlane){color + 1 + 4 * W * (H - 1), 0, -4 * W};
  frame.depth = (RtsvCompositePlane){depth, 4 * H, 4};
  FINE(rtsv_composite_composite(compositor, &frame, &image));
  const char* text = NULL;
  FINE(rtsv_composite_compositor_copies(compositor, &text));
  if (!strstr(text, "color: 5 x 3 pixels: copied: its rows descend")) ++faults;
  if (!strstr(text, "depth: 5 x 3 pixels: copied: its pixels are 12 bytes apart")) ++faults;
  /* Images without pixels. */
  frame = good;
  frame.width = 0;
  frame.color.data = NULL;
  FINE(rtsv_composite_composite(compositor, &frame, &image));
  if (image.color) ++faults;
  const uint32_t order[2] = {0, 0};
  FINE(rtsv_composite_compositor_order(compositor, order, 2));
  EXPECT(rtsv_composite_composite(compositor, &good, &image), VALUE, "exactly once");
  FINE(rtsv_composite_comm_free(group));
  EXPECT(rtsv_composite_composite(compositor, &good, &image), HANDLE, "freed");
  FINE(rtsv_composite_compositor_free(compositor));
  EXPECT(rtsv_composite_compositor_free(compositor), HANDLE, "freed");

#define BAD_TILES(tiles, count, images, wanted, words)                                           \
  do {                                                                                           \
    RtsvCompositeComm* g = fresh();                                                              \
    FINE(rtsv_composite_compositor_new(g, format, NULL, &compositor));                           \
    EXPECT(rtsv_composite_composite_wall(compositor, &good, tiles, count, images), wanted,       \
           words);                                                                               \
    FINE(rtsv_composite_compositor_free(compositor));                                            \
    FINE(rtsv_composite_comm_free(g));                                                           \
  } while (0)
  RtsvCompositeTile tile = {1, 1, 4, 2, 0, 0};
  BAD_TILES(NULL, 1, &image, POINTER, "tiles");
  BAD_TILES(&tile, 1, NULL, POINTER, "images");
  tile.rank = 1;
  BAD_TILES(&tile, 1, &image, VALUE, "rank 1");
  tile.rank = 0, tile.x = 2;
  BAD_TILES(&tile, 1, &image, VALUE, "tile 0");
  tile.x = UINT32_MAX;
  BAD_TILES(&tile, 1, &image, VALUE, "beyond any image");
  tile.x = 1, tile.reserved = 5;
  BAD_TILES(&tile, 1, &image, VALUE, "reserved");
  tile.reserved = 0;
  BAD_TILES(&tile, 1, &image, OK, "");
}

static RtsvCompositeArray array(const void* data, uint64_t count, uint32_t components,
                                uint32_t kind) {
  return (RtsvCompositeArray){data, count, components, kind, 0, release, &released};
}

static void scenes(void) {
  const float points[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  const int64_t indices[12] = {0, 1, 2, 0, -1, 2, 0, 1, INT64_MAX, 0, 1, 2};
  RtsvCompositeScene* scene = NULL;
  EXPECT(rtsv_composite_scene_new(NULL), POINTER, "out");
  FINE(rtsv_composite_scene_new(&scene));
  RtsvCompositeMaterial material;
  EXPECT(rtsv_composite_material_init(NULL, sizeof material), POINTER, "material");
  EXPECT(rtsv_composite_material_init(&material, 1), STRUCT, "RtsvCompositeMaterial is 1");
  FINE(rtsv_composite_material_init(&material, sizeof material));
  EXPECT(rtsv_composite_scene_material(scene, NULL, NULL), POINTER, "material");
  material.model = 55;
  EXPECT(rtsv_composite_scene_material(scene, &material, NULL), VALUE, "model");
  material.model = RTSV_COMPOSITE_MATTE, material.flat = 2;
  EXPECT(rtsv_composite_scene_material(scene, &material, NULL), VALUE, "flat");
  material.flat = 0;
  uint32_t number = 9;
  FINE(rtsv_composite_scene_material(scene, &material, &number));
  if (number != 0) ++faults;
  RtsvCompositeLight light;
  EXPECT(rtsv_composite_light_init(NULL, sizeof light), POINTER, "light");
  EXPECT(rtsv_composite_light_init(&light, 1), STRUCT, "RtsvCompositeLight is 1");
  FINE(rtsv_composite_light_init(&light, sizeof light));
  EXPECT(rtsv_composite_scene_light(scene, NULL), POINTER, "light");
  light.kind = 44;
  EXPECT(rtsv_composite_scene_light(scene, &light), VALUE, "kind");
  light.kind = RTSV_COMPOSITE_AMBIENT, light.size = 1;
  EXPECT(rtsv_composite_scene_light(scene, &light), VALUE, "no size");
  light.size = 0, light.reserved = 1;
  EXPECT(rtsv_composite_scene_light(scene, &light), VALUE, "reserved");
  light.reserved = 0;
  FINE(rtsv_composite_scene_light(scene, &light));
  RtsvCompositeSurroundings around;
  EXPECT(rtsv_composite_surroundings_init(NULL, sizeof around), POINTER, "surroundings");
  EXPECT(rtsv_composite_surroundings_init(&around, 1), STRUCT, "Surroundings is 1");
  FINE(rtsv_composite_surroundings_init(&around, sizeof around));
  EXPECT(rtsv_composite_scene_surroundings(scene, NULL), POINTER, "surroundings");
  around.has_background = 3;
  EXPECT(rtsv_composite_scene_surroundings(scene, &around), VALUE, "has_background");
  around.has_background = 0;
  FINE(rtsv_composite_scene_surroundings(scene, &around));

  RtsvCompositeMesh mesh = {.struct_bytes = sizeof mesh, .name = "wall"};
  EXPECT(rtsv_composite_scene_mesh(scene, NULL), POINTER, "mesh");
  EXPECT(rtsv_composite_scene_mesh(NULL, &mesh), POINTER, "scene");
  mesh.struct_bytes = 4;
  EXPECT(rtsv_composite_scene_mesh(scene, &mesh), STRUCT, "RtsvCompositeMesh is 4");
  mesh.struct_bytes = sizeof mesh;
  mesh.positions = array(points, 3, 3, RTSV_COMPOSITE_F32);
  mesh.triangles = array(indices, 4, 3, RTSV_COMPOSITE_I64);
#define BAD_MESH(change, status, words)                                      \
  do {                                                                       \
    RtsvCompositeMesh bad = mesh;                                            \
    change;                                                                  \
    const int before = released;                                             \
    EXPECT(rtsv_composite_scene_mesh(scene, &bad), status, words);           \
    if (released != before + 4) expect_at(__LINE__, 0, 1, "release");        \
  } while (0)
  BAD_MESH(bad.name = NULL, POINTER, "name");
  BAD_MESH(bad.name = "\xc3\x28", VALUE, "not UTF-8");
  BAD_MESH(bad.positions.data = NULL, VALUE, "`wall`: positions: 3 tuples at a null pointer");
  BAD_MESH(bad.positions.kind = RTSV_COMPOSITE_U8, VALUE, "give float, double");
  BAD_MESH(bad.positions.kind = 99, VALUE, "its kind is 99");
  BAD_MESH(bad.positions.components = 2, VALUE, "2 components: give 3");
  BAD_MESH(bad.positions.count = UINT64_MAX, VALUE, "no memory is so large");
  BAD_MESH(bad.positions.stride_bytes = INT64_MIN, VALUE, "no memory is so large");
  BAD_MESH(bad.triangles.kind = RTSV_COMPOSITE_F64, VALUE, "triangles: its kind is 10");
  BAD_MESH(bad.colors_per_face = 4, VALUE, "colors_per_face");
  if (released != 20 * 2) expect_at(__LINE__, 0, 1, "each array is released once");

  RtsvCompositeSpheres balls = {.struct_bytes = sizeof balls, .name = "balls", .radius = 1};
  EXPECT(rtsv_composite_scene_spheres(scene, NULL), POINTER, "spheres");
  EXPECT(rtsv_composite_scene_spheres(NULL, &balls), POINTER, "scene");
  balls.struct_bytes = 0;
  EXPECT(rtsv_composite_scene_spheres(scene, &balls), STRUCT, "Spheres is 0");
  balls.struct_bytes = sizeof balls;
  balls.centers = array(points, 3, 3, RTSV_COMPOSITE_F32);
  balls.radii = array(points, 2, 1, RTSV_COMPOSITE_F32);
  EXPECT(rtsv_composite_scene_spheres(scene, &balls), VALUE, "`balls`");
  balls.radii = array(points, 3, 1, RTSV_COMPOSITE_U16);
  EXPECT(rtsv_composite_scene_spheres(scene, &balls), VALUE, "radii: its kind is 3");

  RtsvCompositeVolume volume = {.struct_bytes = sizeof volume, .name = "cloud"};
  EXPECT(rtsv_composite_scene_volume(scene, NULL, NULL), POINTER, "volume");
  EXPECT(rtsv_composite_scene_volume(NULL, &volume, NULL), POINTER, "scene");
  EXPECT(rtsv_composite_scene_volume(scene, &volume, NULL), VALUE, "colors: none");
  volume.colors = array(points, 3, 3, RTSV_COMPOSITE_F32);
  volume.opacities = array(points, 1, 2, RTSV_COMPOSITE_F32);
  EXPECT(rtsv_composite_scene_volume(scene, &volume, NULL), VALUE, "`cloud`");
  volume.unit_distance = NAN;
  EXPECT(rtsv_composite_scene_volume(scene, &volume, NULL), VALUE, "`cloud`");
  volume.struct_bytes = 1;
  EXPECT(rtsv_composite_scene_volume(scene, &volume, NULL), STRUCT, "Volume is 1");
  RtsvCompositeBrick brick = {.struct_bytes = sizeof brick};
  EXPECT(rtsv_composite_scene_brick(scene, NULL), POINTER, "brick");
  EXPECT(rtsv_composite_scene_brick(NULL, &brick), POINTER, "scene");
  EXPECT(rtsv_composite_scene_brick(scene, &brick), VALUE, "add the volume first");

  /* Triangles with impossible indices are left out, by number. */
  FINE(rtsv_composite_scene_mesh(scene, &mesh));
  const char* text = NULL;
  EXPECT(rtsv_composite_scene_copies(scene, NULL), POINTER, "text");
  FINE(rtsv_composite_scene_copies(scene, &text));
  if (!strstr(text, "object `wall`: triangles: 4 x 3 int64_t: copied: meshes own")) ++faults;
  RtsvCompositeRenderOptions options;
  EXPECT(rtsv_composite_render_options_init(NULL, sizeof options), POINTER, "options");
  EXPECT(rtsv_composite_render_options_init(&options, 0), STRUCT, "RenderOptions is 0");
  FINE(rtsv_composite_render_options_init(&options, sizeof options));
  RtsvCompositeRenderer* renderer = NULL;
#define BAD_RENDERER(change, scene, out, wanted, words)                                        \
  do {                                                                                         \
    RtsvCompositeComm* group = fresh();                                                        \
    RtsvCompositeRenderOptions bad = options;                                                  \
    change;                                                                                    \
    EXPECT(rtsv_composite_renderer_new(group, scene, &bad, out), wanted, words);               \
    FINE(rtsv_composite_comm_free(group));                                                     \
  } while (0)
  BAD_RENDERER(, NULL, &renderer, POINTER, "scene is null");
  BAD_RENDERER(, (void*)comm, &renderer, HANDLE, "of a group of ranks, not of a scene");
  BAD_RENDERER(, scene, NULL, POINTER, "out");
  BAD_RENDERER(bad.struct_bytes = 9, scene, &renderer, STRUCT, "RenderOptions is 9");
  BAD_RENDERER(bad.root = 1, scene, &renderer, VALUE, "root");
  BAD_RENDERER(bad.secondary_rays = 8, scene, &renderer, VALUE, "secondary_rays");
  BAD_RENDERER(bad.threads = 8, scene, &renderer, VALUE, "threads");
  BAD_RENDERER(bad.reserved = 8, scene, &renderer, VALUE, "reserved");
  BAD_RENDERER(bad.timeout_secs = NAN, scene, &renderer, VALUE, "timeout_secs");

  RtsvCompositeView view;
  EXPECT(rtsv_composite_view_init(NULL, sizeof view), POINTER, "view");
  EXPECT(rtsv_composite_view_init(&view, 0), STRUCT, "View is 0");
  FINE(rtsv_composite_view_init(&view, sizeof view));
  view.width = 16, view.height = 12, view.eye[2] = 3;
  RtsvCompositePicture picture = {.struct_bytes = sizeof picture};
#define BAD_VIEW(change, wanted, words)                                                 \
  do {                                                                                  \
    RtsvCompositeComm* group = fresh();                                                 \
    FINE(rtsv_composite_renderer_new(group, scene, NULL, &renderer));                   \
    RtsvCompositeView bad = view;                                                       \
    change;                                                                             \
    EXPECT(rtsv_composite_renderer_render(renderer, &bad, &picture), wanted, words);    \
    FINE(rtsv_composite_renderer_free(renderer));                                       \
    FINE(rtsv_composite_comm_free(group));                                              \
  } while (0)
  BAD_VIEW(bad.struct_bytes = 5, STRUCT, "View is 5");
  BAD_VIEW(bad.width = 0, VALUE, "width");
  BAD_VIEW(bad.height = UINT32_MAX, VALUE, "height");
  BAD_VIEW(bad.projection = 7, VALUE, "projection");
  BAD_VIEW(bad.samples = 0, VALUE, "samples");
  BAD_VIEW(bad.light_rays = 0, VALUE, "light_rays");
  BAD_VIEW(bad.max_bounces = -9, VALUE, "max_bounces");
  BAD_VIEW(bad.path_tracing = 9, VALUE, "path_tracing");
  BAD_VIEW(bad.depth = 9, VALUE, "depth");
  BAD_VIEW(bad.eye[0] = NAN, VALUE, "RtsvCompositeView");
  BAD_VIEW(bad.eye[2] = 0, VALUE, "RtsvCompositeView");
  BAD_VIEW(bad.fov_y_rad = 4, VALUE, "fov_y_rad");
  BAD_VIEW(bad.near = -1, VALUE, "near");
  BAD_VIEW(bad.far = 0, VALUE, "far");
  BAD_VIEW((bad.projection = RTSV_COMPOSITE_MATRIX, bad.clip_from_world[0] = 0), VALUE, "View");
  BAD_VIEW(picture.struct_bytes = 5, STRUCT, "Picture is 5");
  picture.struct_bytes = sizeof picture;

  RtsvCompositeComm* group = fresh();
  FINE(rtsv_composite_renderer_new(group, scene, &options, &renderer));
  FINE(rtsv_composite_scene_free(scene));
  view.depth = 1;
  FINE(rtsv_composite_renderer_render(renderer, &view, &picture));
  if (picture.width != 16 || !picture.depth || picture.color[3 + 4 * (5 * 16 + 9)] != 1) ++faults;
  EXPECT(rtsv_composite_renderer_warnings(renderer, NULL), POINTER, "text");
  FINE(rtsv_composite_renderer_warnings(renderer, &text));
  if (!strstr(text, "2 primitives of this rank are left out")) ++faults;
  EXPECT(rtsv_composite_renderer_replace(renderer, scene), HANDLE, "no such scene");
  FINE(rtsv_composite_renderer_free(renderer));
  FINE(rtsv_composite_comm_free(group));
}

static void photographs(void) {
  double density[27];
  for (int k = 0; k < 27; ++k) density[k] = 1.2;
  float grey[20] = {0};
  int releases = 0;
  RtsvCompositeGas gas = {.struct_bytes = sizeof gas, .dims = {3, 3, 3}};
  gas.spacing_m[0] = gas.spacing_m[1] = gas.spacing_m[2] = 0.01;
  gas.gladstone_dale = 2.26e-4, gas.reference_density = 1.2;
  RtsvCompositeBrick brick = {.struct_bytes = sizeof brick, .dims = {3, 3, 3}};
  brick.values = (RtsvCompositeArray){density, 27, 1, RTSV_COMPOSITE_F64, 0, release, &releases};
  RtsvCompositeShot shot;
  EXPECT(rtsv_composite_shot_init(NULL, sizeof shot), POINTER, "shot");
  EXPECT(rtsv_composite_shot_init(&shot, 1), STRUCT, "Shot is 1");
  FINE(rtsv_composite_shot_init(&shot, sizeof shot));
  shot.width = 5, shot.height = 4;
  RtsvCompositePhotograph photo = {.struct_bytes = sizeof photo, .grey = grey, .grey_count = 20};
  int photographs = 0;
#define BAD_PHOTO(change, wanted, words)                                              \
  do {                                                                                \
    RtsvCompositeComm* group = fresh();                                               \
    RtsvCompositeGas g = gas, *gp = &g;                                               \
    RtsvCompositeBrick b = brick;                                                     \
    RtsvCompositeShot s = shot, *sp = &s;                                             \
    RtsvCompositePhotograph p = photo, *pp = &p;                                      \
    change;                                                                           \
    EXPECT(rtsv_composite_photograph(group, gp, &b, sp, pp), wanted, words);          \
    ++photographs;                                                                    \
    FINE(rtsv_composite_comm_free(group));                                            \
  } while (0)
  BAD_PHOTO(gp = NULL, POINTER, "gas");
  BAD_PHOTO(sp = NULL, POINTER, "shot");
  BAD_PHOTO(pp = NULL, POINTER, "photograph");
  BAD_PHOTO(p.grey = NULL, POINTER, "grey");
  BAD_PHOTO(p.grey_count = 19, VALUE, "20 pixels");
  BAD_PHOTO(p.struct_bytes = 3, STRUCT, "Photograph is 3");
  BAD_PHOTO(g.struct_bytes = 3, STRUCT, "Gas is 3");
  BAD_PHOTO(g.reserved = 3, VALUE, "reserved");
  BAD_PHOTO(g.dims[1] = 0, DISAGREE, "along y");
  BAD_PHOTO(g.dims[1] = 5, DISAGREE, "no rank has");
  BAD_PHOTO(g.dims[0] = 2, DISAGREE, "the gas has [2, 3, 3] nodes");
  BAD_PHOTO(g.spacing_m[2] = NAN, DISAGREE, "along z");
  BAD_PHOTO(g.gladstone_dale = NAN, DISAGREE, "gladstone_dale");
  BAD_PHOTO(b.reserved = 1, VALUE, "reserved");
  BAD_PHOTO(b.volume = 1, VALUE, "volume");
  BAD_PHOTO(b.values.count = 26, VALUE, "26 values for [3, 3, 3] points");
  BAD_PHOTO(b.values.kind = RTSV_COMPOSITE_U8, VALUE, "give float, double");
  BAD_PHOTO(b.values.data = NULL, VALUE, "null pointer");
  BAD_PHOTO(b.slice_bytes = INT64_MIN, VALUE, "no memory is so large");
  BAD_PHOTO(b.first[0] = UINT32_MAX, DISAGREE, "from node [4294967295, 0, 0]");
  BAD_PHOTO(s.struct_bytes = 3, STRUCT, "Shot is 3");
  BAD_PHOTO(s.technique = 9, VALUE, "technique");
  BAD_PHOTO(s.interpolant = 9, VALUE, "interpolant");
  BAD_PHOTO(s.threads = 9, VALUE, "threads");
  BAD_PHOTO(s.timeout_secs = -1, VALUE, "timeout_secs");
  BAD_PHOTO(s.root = 1, DISAGREE, "root is 1");
  BAD_PHOTO(s.width = 0, DISAGREE, "0x4");
  BAD_PHOTO(s.direction[2] = 0, DISAGREE, "direction of light");
  BAD_PHOTO(s.step_voxels = 0, DISAGREE, "step_voxels");
  BAD_PHOTO(s.pixel_m = -1, DISAGREE, "pixel_m");
  BAD_PHOTO(s.open_fraction = 2, DISAGREE, "open_fraction");
  BAD_PHOTO(s.slit_width_m = 0, DISAGREE, "slit_width_m");
  BAD_PHOTO((s.technique = RTSV_COMPOSITE_SHADOWGRAPH, s.focus_m = NAN), DISAGREE, "focus_m");
  EXPECT(rtsv_composite_photograph(NULL, &gas, &brick, &shot, &photo), POINTER, "group of ranks");
  ++photographs;
  RtsvCompositeComm* group = fresh();
  EXPECT(rtsv_composite_photograph(group, &gas, NULL, &shot, &photo), DISAGREE, "no rank has");
  FINE(rtsv_composite_photograph(group, &gas, &brick, &shot, &photo));
  ++photographs;
  for (int k = 0; k < 20; ++k) faults += grey[k] < 0.499f || grey[k] > 0.501f;
  FINE(rtsv_composite_comm_free(group));
  if (releases != photographs) expect_at(__LINE__, 0, 1, "each array is released once");
}

int main(void) {
  if (rtsv_composite_library_version() != RTSV_COMPOSITE_VERSION) ++faults;
  if (strcmp(rtsv_composite_last_error(), "") != 0) ++faults;
  RtsvCompositeScene* other = NULL;
  FINE(rtsv_composite_scene_new(&other));
  wrong_handles(other);
  groups();
  images();
  scenes();
  photographs();
  /* A release function may make calls, and even free the scene. */
  const float points[3] = {0};
  scene_in_call = other;
  RtsvCompositeSpheres balls = {.struct_bytes = sizeof balls, .name = "balls", .radius = 1};
  balls.centers = (RtsvCompositeArray){points, 1, 3, RTSV_COMPOSITE_F32, 0, call_inside, NULL};
  FINE(rtsv_composite_scene_spheres(other, &balls));
  EXPECT(rtsv_composite_scene_free(other), HANDLE, "no such scene");
  FINE(rtsv_composite_comm_free(comm));
  if (faults) return 1;
  puts("done");
  return 0;
}
