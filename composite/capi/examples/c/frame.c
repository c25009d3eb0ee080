/* Ranks of MPI composite images that they have drawn, and render a scene that none has whole.
 * mpirun -n 4 ./frame OUT [GROUPS]; rank 0 of each group writes OUT-GROUP.depth, .alpha, .picture
 * (raw RGBA: bytes, floats, floats). */
#include <mpi.h>
#include <rtsv_composite.h>
#include <stdio.h>
#include <stdlib.h>
enum { WIDTH = 96, HEIGHT = 64, PIXELS = WIDTH * HEIGHT };

static void check(RtsvCompositeStatus status) {
  if (status == RTSV_COMPOSITE_OK) return;
  fprintf(stderr, "%s\n", rtsv_composite_last_error());
  MPI_Abort(MPI_COMM_WORLD, 1);
}

static void save(const char *out, int group, const char *end, const void *data, size_t bytes) {
  char path[4096];
  snprintf(path, sizeof path, "%s-%d.%s", out, group, end);
  FILE *file = data ? fopen(path, "wb") : NULL; /* Only one rank has the image. */
  if (file && fwrite(data, 1, bytes, file) + fclose(file) != bytes) perror(path);
}

/* A chequered board of each rank, in bytes with depth and in floats with an alpha of a quarter. */
static void draw(unsigned rank, unsigned char *color, float *depth, float *blended) {
  for (unsigned k = 0; k < PIXELS; ++k) {
    unsigned x = k % WIDTH, y = k / WIDTH, drawn = ((x + 5 * rank) / 16 + y / 16) % 2 == 0;
    unsigned channels[4] = {(60 * rank + 40) % 256, 2 * x, 3 * y, 256};
    for (int c = 0; c < 4; ++c) {
      color[4 * k + c] = drawn ? (channels[c] < 256 ? channels[c] : 255) : 0;
      blended[4 * k + c] = drawn ? channels[c] / 1024.0f : 0.0f;
    }
    depth[k] = drawn ? (x + 3 * y + 17 * rank) % 64 / 64.0f : 1.0f;
  }
}

static void composite(RtsvCompositeComm *comm, unsigned format, const void *color,
                      const float *depth, const char *out, int group, size_t bytes) {
  RtsvCompositeCompositor *compositor;
  check(rtsv_composite_compositor_new(comm, format, NULL, &compositor));
  RtsvCompositeFrame frame = {.struct_bytes = sizeof frame, .width = WIDTH, .height = HEIGHT};
  frame.color.data = color;
  frame.depth.data = depth;
  RtsvCompositeImage image = {.struct_bytes = sizeof image};
  check(rtsv_composite_composite(compositor, &frame, &image));
  save(out, group, depth ? "depth" : "alpha", image.color, bytes);
  check(rtsv_composite_compositor_free(compositor));
}

int main(int argc, char **argv) {
  MPI_Init(&argc, &argv);
  int world_rank, groups = argc > 2 ? atoi(argv[2]) : 1;
  MPI_Comm_rank(MPI_COMM_WORLD, &world_rank);
  const int group = world_rank % groups;
  MPI_Comm ours = MPI_COMM_WORLD;
  if (groups > 1) MPI_Comm_split(MPI_COMM_WORLD, group, 0, &ours);
  RtsvCompositeComm *comm;
  check(rtsv_composite_comm_from_mpi(&ours, sizeof ours, &comm));
  uint32_t rank, ranks;
  check(rtsv_composite_comm_rank(comm, &rank, &ranks));

  /* Buffers in, image out. */
  static unsigned char color[4 * PIXELS];
  static float depth[PIXELS], blended[4 * PIXELS];
  draw(rank, color, depth, blended);
  composite(comm, RTSV_COMPOSITE_DEPTH_U8, color, depth, argv[1], group, sizeof color);
  composite(comm, RTSV_COMPOSITE_ALPHA_F32, blended, NULL, argv[1], group, sizeof blended);

  /* A scene: each rank has a strip of the ground and a ball whose shadow leaves the strip. */
  RtsvCompositeScene *scene;
  check(rtsv_composite_scene_new(&scene));
  RtsvCompositeMaterial material;
  check(rtsv_composite_material_init(&material, sizeof material));
  check(rtsv_composite_scene_material(scene, &material, NULL));
  RtsvCompositeLight light;
  check(rtsv_composite_light_init(&light, sizeof light));
  light.color[0] = light.color[1] = light.color[2] = 0.25f;
  check(rtsv_composite_scene_light(scene, &light));
  light.kind = RTSV_COMPOSITE_DIRECTIONAL;
  light.direction[0] = -1, light.direction[1] = -0.5, light.direction[2] = 1;
  light.color[0] = light.color[1] = light.color[2] = 0.75f;
  check(rtsv_composite_scene_light(scene, &light));

  const float x = rank, corners[12] = {x, 0, 0, x + 1, 0, 0, x + 1, 4, 0, x, 4, 0};
  const uint32_t triangles[6] = {0, 1, 2, 0, 2, 3};
  RtsvCompositeMesh mesh = {.struct_bytes = sizeof mesh, .name = "ground"};
  mesh.positions = (RtsvCompositeArray){corners, 4, 3, RTSV_COMPOSITE_F32, 0, NULL, NULL};
  mesh.triangles = (RtsvCompositeArray){triangles, 2, 3, RTSV_COMPOSITE_U32, 0, NULL, NULL};
  check(rtsv_composite_scene_mesh(scene, &mesh));
  const double center[3] = {rank + 0.5, 1.5 + rank % 3 * 0.5, 0.75};
  const float tint[4] = {rank % 2, 0.5f, 1.0f - rank % 2, 1};
  RtsvCompositeSpheres balls = {.struct_bytes = sizeof balls, .name = "balls", .radius = 0.5f};
  balls.centers = (RtsvCompositeArray){center, 1, 3, RTSV_COMPOSITE_F64, 0, NULL, NULL};
  balls.colors = (RtsvCompositeArray){tint, 1, 4, RTSV_COMPOSITE_F32, 0, NULL, NULL};
  check(rtsv_composite_scene_spheres(scene, &balls));

  RtsvCompositeRenderer *renderer;
  check(rtsv_composite_renderer_new(comm, scene, NULL, &renderer));
  RtsvCompositeView view;
  check(rtsv_composite_view_init(&view, sizeof view));
  view.width = 320, view.height = 200;
  view.eye[0] = 0.5 * ranks, view.eye[1] = -0.625 * ranks, view.eye[2] = 0.5 * ranks;
  view.target[0] = 0.5 * ranks, view.target[1] = 2, view.target[2] = 0;
  view.up[1] = 0, view.up[2] = 1;
  RtsvCompositePicture picture = {.struct_bytes = sizeof picture};
  check(rtsv_composite_renderer_render(renderer, &view, &picture));
  save(argv[1], group, "picture", picture.color, 16ul * picture.width * picture.height);

  check(rtsv_composite_renderer_free(renderer));
  check(rtsv_composite_scene_free(scene));
  check(rtsv_composite_comm_free(comm));
  if (groups > 1) MPI_Comm_free(&ours);
  return MPI_Finalize();
}
