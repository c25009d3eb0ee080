/* What several ranks do together: display walls, planes of all forms, pieces, volumes, and faults
 * that end on all ranks with their cause. Each rank prints "done" at the end. */
#include <mpi.h>
#include <rtsv_composite.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { W = 61, H = 37, PAD = 3 };
typedef float Pixel[4];

static uint32_t rank, ranks;
static int faults;

static void fault_at(int line, const char* what) {
  fprintf(stderr, "rank %u, line %d: %s; last error: %s\n", rank, line, what,
          rtsv_composite_last_error());
  ++faults;
}
#define CHECK(condition) ((condition) ? (void)0 : fault_at(__LINE__, #condition))
#define FINE(call) CHECK((call) == RTSV_COMPOSITE_OK)
#define FAILS(call, status, words)           \
  do {                                       \
    CHECK((call) == RTSV_COMPOSITE_##status); \
    CHECK(strstr(rtsv_composite_last_error(), words) != NULL);   \
  } while (0)

/* A group. A rank that fails at once must not do so while others are still making it: they would
 * learn the cause there. */
static RtsvCompositeComm* group_of(MPI_Comm mpi) {
  RtsvCompositeComm* comm = NULL;
  FINE(rtsv_composite_comm_from_mpi(&mpi, sizeof mpi, &comm));
  MPI_Barrier(mpi);
  return comm;
}

static Pixel pixels[H][W], whole[H][W];
static uint32_t reversed[64];

static void draw(void) {
  for (unsigned y = 0; y < H; ++y)
    for (unsigned x = 0; x < W; ++x)
      for (unsigned c = 0; c < 4; ++c)
        pixels[y][x][c] = (x * (rank + 1) / 8 + y / 4) % 3 ? 0 : (x + y + c + rank) / 512.0f;
}

static RtsvCompositeFrame frame_of(const void* data, int64_t row_bytes) {
  RtsvCompositeFrame frame = {.struct_bytes = sizeof frame, .width = W, .height = H};
  frame.color.data = data;
  frame.color.row_bytes = row_bytes;
  return frame;
}

/* Whether an image has the pixels of the whole one at its place. */
static int is_part(const RtsvCompositeImage* image) {
  const float* colors = image->color;
  for (uint32_t y = 0; y < image->height; ++y)
    if (memcmp(colors + 4 * y * image->width, whole[image->y + y] + image->x,
               image->width * sizeof(Pixel)))
      return 0;
  return 1;
}

static RtsvCompositeCompositor* compositor_of(RtsvCompositeComm* comm, uint32_t strategy,
                                              int32_t destination) {
  RtsvCompositeCompositor* compositor = NULL;
  RtsvCompositeOptions options;
  FINE(rtsv_composite_options_init(&options, sizeof options));
  options.strategy = strategy;
  options.destination = destination;
  FINE(rtsv_composite_compositor_new(comm, RTSV_COMPOSITE_ALPHA_F32, &options, &compositor));
  FINE(rtsv_composite_compositor_order(compositor, reversed, ranks));
  return compositor;
}

static void one_image(RtsvCompositeComm* comm) {
  RtsvCompositeImage image = {.struct_bytes = sizeof image};
  RtsvCompositeFrame frame = frame_of(pixels, 0);
  RtsvCompositeCompositor* compositor = compositor_of(comm, RTSV_COMPOSITE_DIRECT_SEND, 0);
  FINE(rtsv_composite_composite(compositor, &frame, &image));
  CHECK((image.color != NULL) == (rank == 0) && image.depth == NULL);
  if (rank == 0) memcpy(whole, image.color, sizeof whole);
  MPI_Bcast(whole, 4 * W * H, MPI_FLOAT, 0, MPI_COMM_WORLD);

  /* Rows with padding are read where they are; rows that descend are copied, and named. */
  static Pixel padded[H][W + PAD], flipped[H][W];
  for (int y = 0; y < H; ++y) {
    memcpy(padded[y], pixels[y], sizeof pixels[y]);
    memcpy(flipped[H - 1 - y], pixels[y], sizeof pixels[y]);
  }
  const char* text = NULL;
  frame = frame_of(padded, sizeof padded[0]);
  FINE(rtsv_composite_composite(compositor, &frame, &image));
  CHECK(is_part(&image));
  FINE(rtsv_composite_compositor_copies(compositor, &text));
  CHECK(strcmp(text, "") == 0);
  frame = frame_of(flipped[H - 1], -(int64_t)sizeof flipped[0]);
  FINE(rtsv_composite_composite(compositor, &frame, &image));
  CHECK(is_part(&image));
  FINE(rtsv_composite_compositor_copies(compositor, &text));
  CHECK(strstr(text, "color: 61 x 37 pixels: copied: its rows descend") != NULL);
  FINE(rtsv_composite_compositor_free(compositor));

  /* All strategies, to the last rank and to pieces. */
  for (uint32_t strategy = 0; strategy <= RTSV_COMPOSITE_AUTOMATIC; ++strategy)
    for (int32_t to = -1; to < 2; ++to) {
      compositor = compositor_of(comm, strategy, to == 1 ? (int32_t)ranks - 1 : to);
      frame = frame_of(pixels, 0);
      FINE(rtsv_composite_composite(compositor, &frame, &image));
      CHECK(is_part(&image) && (to >= 0 || image.width <= W));
      FINE(rtsv_composite_compositor_free(compositor));
    }
}

/* Tiles that overlap and leave a gap: one for each rank, and a second one for rank 0. */
static void wall(RtsvCompositeComm* comm) {
  RtsvCompositeTile tiles[65] = {{0}};
  RtsvCompositeImage images[65];
  for (uint32_t k = 0; k <= ranks; ++k) {
    const uint32_t x = k * (W - 10) / (ranks + 1), width = (W - 10) / (ranks + 1) + 4;
    tiles[k] = (RtsvCompositeTile){x, 2 + k, width, H - 8 - k, k % ranks, 0};
    images[k].struct_bytes = sizeof images[k];
  }
  RtsvCompositeCompositor* compositor = compositor_of(comm, RTSV_COMPOSITE_DIRECT_SEND, 0);
  RtsvCompositeFrame frame = frame_of(pixels, 0);
  for (int times = 0; times < 2; ++times) {
    FINE(rtsv_composite_composite_wall(compositor, &frame, tiles, ranks + 1, images));
    for (uint32_t k = 0; k <= ranks; ++k) {
      CHECK((images[k].color != NULL) == (tiles[k].rank == rank));
      if (images[k].color == NULL) continue;
      CHECK(images[k].x == tiles[k].x && images[k].y == tiles[k].y && is_part(&images[k]));
      CHECK(images[k].width == tiles[k].width && images[k].height == tiles[k].height);
    }
  }
  FINE(rtsv_composite_compositor_free(compositor));
}

/* A fault of one rank: it gets its own status, and the others the cause. */
static void faults_of_one(void) {
  RtsvCompositeComm* comm = group_of(MPI_COMM_WORLD);
  RtsvCompositeCompositor* compositor = compositor_of(comm, RTSV_COMPOSITE_DIRECT_SEND, 0);
  RtsvCompositeImage image = {.struct_bytes = sizeof image};
  RtsvCompositeFrame frame = frame_of(rank == 1 ? NULL : pixels, 0);
  if (rank == 1)
    FAILS(rtsv_composite_composite(compositor, &frame, &image), POINTER, "color.data");
  else
    FAILS(rtsv_composite_composite(compositor, &frame, &image), ENDED, "color.data");
  FAILS(rtsv_composite_composite(compositor, &frame, &image), ENDED, "color.data");
  FINE(rtsv_composite_compositor_free(compositor));
  FINE(rtsv_composite_comm_free(comm));

  /* A group of the same communicator again; ranks that give other tiles. */
  comm = group_of(MPI_COMM_WORLD);
  compositor = compositor_of(comm, RTSV_COMPOSITE_DIRECT_SEND, 0);
  frame = frame_of(pixels, 0);
  RtsvCompositeTile tile = {rank == 1 ? 1 : 0, 0, 5, 5, 0, 0};
  CHECK(rtsv_composite_composite_wall(compositor, &frame, &tile, 1, &image) != RTSV_COMPOSITE_OK);
  CHECK(strstr(rtsv_composite_last_error(), "rank 1 gives other tiles") != NULL);
  FINE(rtsv_composite_compositor_free(compositor));
  FINE(rtsv_composite_comm_free(comm));

  /* A rank that gives up outside of a call. */
  comm = group_of(MPI_COMM_WORLD);
  compositor = compositor_of(comm, RTSV_COMPOSITE_DIRECT_SEND, 0);
  if (rank == 0) FINE(rtsv_composite_comm_abort(comm, "the disk is full"));
  FAILS(rtsv_composite_composite(compositor, &frame, &image), ENDED, "the disk is full");
  FINE(rtsv_composite_compositor_free(compositor));
  FINE(rtsv_composite_comm_free(comm));

  const MPI_Comm none = MPI_COMM_NULL, world = MPI_COMM_WORLD;
  FAILS(rtsv_composite_comm_from_mpi(&none, sizeof none, &comm), MPI, "MPI_COMM_NULL");
  FAILS(rtsv_composite_comm_from_mpi(&world, 12 - sizeof world, &comm), MPI, "compiled with");
  FAILS(rtsv_composite_comm_from_mpi(&world, 1000, &comm), MPI, "1000 bytes");
}

static int released;
static void release(void* owner) { released += *(int*)owner; }

/* A fog of which each rank has a slab, as doubles with gaps or as bytes without. */
static RtsvCompositeScene* fog(int gaps, float light_level) {
  enum { NX = 9, NY = 8, NZ = 7 };
  static double spread[NZ + 1][NY + 2][2 * 64];
  static uint8_t tight[NZ * NY * 64];
  static int one = 1;
  RtsvCompositeScene* scene = NULL;
  FINE(rtsv_composite_scene_new(&scene));
  RtsvCompositeLight light;
  FINE(rtsv_composite_light_init(&light, sizeof light));
  light.color[1] = light_level;
  FINE(rtsv_composite_scene_light(scene, &light));
  const float colors[6] = {1, 0, 0, 0, 0, 1};
  const double opacities[4] = {0, 0, 200, 0.5};
  RtsvCompositeVolume volume = {.struct_bytes = sizeof volume, .name = "fog"};
  volume.dims[0] = (NX - 1) * ranks + 1, volume.dims[1] = NY, volume.dims[2] = NZ;
  for (int k = 0; k < 3; ++k) volume.spacing[k] = 0.125;
  volume.colors = (RtsvCompositeArray){colors, 2, 3, RTSV_COMPOSITE_F32, 0, release, &one};
  volume.opacities = (RtsvCompositeArray){opacities, 2, 2, RTSV_COMPOSITE_F64, 0, NULL, NULL};
  volume.range[1] = 200;
  volume.unit_distance = 0.5;
  uint32_t number;
  FINE(rtsv_composite_scene_volume(scene, &volume, &number));
  for (uint32_t z = 0; z < NZ; ++z)
    for (uint32_t y = 0; y < NY; ++y)
      for (uint32_t x = 0; x < NX; ++x) {
        const uint32_t value = ((rank * (NX - 1) + x) * 13 + y * y * 7 + z * 29) % 200;
        spread[z][y][2 * x] = value;
        tight[(z * NY + y) * NX + x] = (uint8_t)value;
      }
  RtsvCompositeBrick brick = {.struct_bytes = sizeof brick, .volume = number};
  brick.first[0] = rank * (NX - 1);
  brick.dims[0] = NX, brick.dims[1] = NY, brick.dims[2] = NZ;
  const RtsvCompositeArray bytes = {tight, NX * NY * NZ, 1, RTSV_COMPOSITE_U8, 0, release, &one};
  brick.values = bytes;
  if (gaps) {
    brick.values.data = spread;
    brick.values.kind = RTSV_COMPOSITE_F64;
    brick.values.stride_bytes = 2 * sizeof(double);
    brick.row_bytes = sizeof spread[0][0];
    brick.slice_bytes = sizeof spread[0];
  }
  FINE(rtsv_composite_scene_brick(scene, &brick));
  brick.values.count -= 1;
  FAILS(rtsv_composite_scene_brick(scene, &brick), VALUE, "give one for each");
  return scene;
}

static void volumes(RtsvCompositeComm* comm) {
  RtsvCompositeScene* scenes[2] = {fog(0, 1), fog(1, 1)};
  CHECK(released == 6);
  RtsvCompositeRenderer* renderer = NULL;
  RtsvCompositeRenderOptions options;
  FINE(rtsv_composite_render_options_init(&options, sizeof options));
  options.root = ranks - 1;
  /* Ranks that contradict each other all get the same status, and go on. */
  RtsvCompositeScene* other = fog(0, rank == 1 ? 0.5f : 1);
  FAILS(rtsv_composite_renderer_new(comm, other, &options, &renderer), DISAGREE, "color");
  FINE(rtsv_composite_renderer_new(comm, scenes[0], &options, &renderer));
  FAILS(rtsv_composite_renderer_replace(renderer, other), DISAGREE, "color");
  FINE(rtsv_composite_scene_free(other));
  RtsvCompositeView view;
  FINE(rtsv_composite_view_init(&view, sizeof view));
  view.width = 70, view.height = 50;
  view.eye[0] = 0.5 * ranks, view.eye[1] = -2.0 * ranks, view.eye[2] = 1;
  view.target[0] = 0.5 * ranks, view.target[2] = 0.4;
  view.up[1] = 0, view.up[2] = 1;
  RtsvCompositePicture picture = {.struct_bytes = sizeof picture};
  view.samples = rank == 1 ? 2 : 1;
  FAILS(rtsv_composite_renderer_render(renderer, &view, &picture), DISAGREE, "samples");
  view.samples = 1;
  FINE(rtsv_composite_renderer_render(renderer, &view, &picture));
  CHECK((picture.color != NULL) == (rank == ranks - 1) && picture.depth == NULL);
  static Pixel first[50 * 70];
  if (picture.color) memcpy(first, picture.color, sizeof first);
  FINE(rtsv_composite_renderer_replace(renderer, scenes[1]));
  FINE(rtsv_composite_renderer_render(renderer, &view, &picture));
  if (picture.color) {
    CHECK(memcmp(first, picture.color, sizeof first) == 0);
    float most = 0;
    for (int k = 0; k < 50 * 70; ++k) most = first[k][3] > most ? first[k][3] : most;
    CHECK(most > 0.2f);
  }
  const char* text = NULL;
  FINE(rtsv_composite_renderer_warnings(renderer, &text));
  CHECK(strcmp(text, "") == 0);
  FINE(rtsv_composite_renderer_free(renderer));
  for (int k = 0; k < 2; ++k) FINE(rtsv_composite_scene_free(scenes[k]));
}

int main(int argc, char** argv) {
  MPI_Init(&argc, &argv);
  RtsvCompositeComm* comm = group_of(MPI_COMM_WORLD);
  FINE(rtsv_composite_comm_rank(comm, &rank, &ranks));
  for (uint32_t k = 0; k < ranks; ++k) reversed[k] = ranks - 1 - k;
  draw();
  one_image(comm);
  wall(comm);
  volumes(comm);
  FINE(rtsv_composite_comm_free(comm));
  faults_of_one();
  int all = 0;
  MPI_Allreduce(&faults, &all, 1, MPI_INT, MPI_SUM, MPI_COMM_WORLD);
  MPI_Finalize();
  if (all == 0) puts("done");
  return all != 0;
}
