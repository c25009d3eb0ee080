// A blast in air: the equations of Euler in three dimensions, on bricks of the ranks of MPI. Each
// tenth step the ranks make two pictures while they compute: a volume of the density, and a
// schlieren photograph whose light is bent across the bricks of all ranks.
//
// mpirun -n 8 ./blast OUT [CELLS [STEPS [PIXELS]]]; rank 0 writes OUT-STEP.volume (RGBA) and
// OUT-STEP.schlieren (grey), raw floats, PIXELS x PIXELS. The files have the same bytes for any
// number of ranks. BLAST_STALL=RANK and BLAST_DIE=RANK show what becomes of the others.
// Without the classes of C++ that MPI had before version 3.
#define OMPI_SKIP_MPICXX
#define MPICH_SKIP_MPICXX
#include <mpi.h>
#include <rtsv_composite.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <unistd.h>
#include <utility>
#include <vector>

namespace {

// The picture needs one layer of other ranks' cells above a brick, and light one more on each side.
constexpr int GHOSTS = 2;
constexpr double GAMMA = 1.4, SIDE_M = 0.1;

void check(RtsvCompositeStatus status) {
  if (status == RTSV_COMPOSITE_OK) return;
  std::fprintf(stderr, "%s\n", rtsv_composite_last_error());
  MPI_Abort(MPI_COMM_WORLD, 1);
}

using State = std::array<double, 5>;  // density, momentum, energy

State flux(const State& u, int axis) {
  const double v = u[1 + axis] / u[0];
  const double kinetic = (u[1] * u[1] + u[2] * u[2] + u[3] * u[3]) / (2 * u[0]);
  const double p = (GAMMA - 1) * (u[4] - kinetic);
  State f = {u[0] * v, u[1] * v, u[2] * v, u[3] * v, (u[4] + p) * v};
  f[1 + axis] += p;
  return f;
}

double speed(const State& u, int axis) {
  const double kinetic = (u[1] * u[1] + u[2] * u[2] + u[3] * u[3]) / (2 * u[0]);
  return std::fabs(u[1 + axis] / u[0]) +
         std::sqrt(GAMMA * (GAMMA - 1) * (u[4] - kinetic) / u[0]);
}

// Rusanov's flux: the mean of both sides, and diffusion by the fastest wave.
State between(const State& a, const State& b, int axis) {
  const State fa = flux(a, axis), fb = flux(b, axis);
  const double fastest = std::max(speed(a, axis), speed(b, axis));
  State f;
  for (int c = 0; c < 5; ++c) f[c] = 0.5 * (fa[c] + fb[c]) - 0.5 * fastest * (b[c] - a[c]);
  return f;
}

class Blast {
 public:
  explicit Blast(int cells) : cells_(cells), h_(SIDE_M / cells) {
    int ranks, dims[3] = {0, 0, 0}, periods[3] = {0, 0, 0}, at[3];
    MPI_Comm_size(MPI_COMM_WORLD, &ranks);
    MPI_Dims_create(ranks, 3, dims);
    MPI_Cart_create(MPI_COMM_WORLD, 3, dims, periods, 0, &cart_);
    MPI_Comm_rank(cart_, &rank_);
    MPI_Cart_coords(cart_, rank_, 3, at);
    for (int c = 0; c < 3; ++c) {
      first_[c] = static_cast<int>(static_cast<long>(cells) * at[c] / dims[c]);
      own_[c] = static_cast<int>(static_cast<long>(cells) * (at[c] + 1) / dims[c]) - first_[c];
      size_[c] = own_[c] + 2 * GHOSTS;
      if (own_[c] < GHOSTS) MPI_Abort(MPI_COMM_WORLD, 2);
    }
    for (auto& part : u_) part.assign(static_cast<size_t>(size_[0]) * size_[1] * size_[2], 0.0);
    next_ = u_;
    for_all([&](int i, int j, int k) {
      const double x = (first_[0] + i + 0.5) * h_ / SIDE_M - 0.45;
      const double y = (first_[1] + j + 0.5) * h_ / SIDE_M - 0.5;
      const double z = (first_[2] + k + 0.5) * h_ / SIDE_M - 0.55;
      const bool inside = x * x + y * y + z * z < 0.2 * 0.2;
      const size_t n = index(i, j, k);
      u_[0][n] = 1.2;
      u_[4][n] = (inside ? 8e5 : 1e5) / (GAMMA - 1);
    });
  }

  // Layers of neighbours, axis after axis, so that edges and corners come too; at the walls of the
  // box the nearest cell again.
  void exchange() {
    for (int c = 0; c < 3; ++c) {
      int below, above;
      MPI_Cart_shift(cart_, c, 1, &below, &above);
      for (auto& part : u_) {
        send(part, c, GHOSTS, below, GHOSTS + own_[c], above);
        send(part, c, own_[c], above, 0, below);
        for (int side = 0; side < 2; ++side) {
          if ((side ? above : below) == MPI_PROC_NULL) repeat(part, c, side);
        }
      }
    }
  }

  void step() {
    exchange();
    double fastest = 0;
    for_all([&](int i, int j, int k) {
      const State u = at(index(i, j, k));
      for (int c = 0; c < 3; ++c) fastest = std::max(fastest, speed(u, c));
    });
    MPI_Allreduce(MPI_IN_PLACE, &fastest, 1, MPI_DOUBLE, MPI_MAX, cart_);
    const double ratio = 0.3 / fastest;  // of the time step to the width of a cell
    const size_t along[3] = {1, static_cast<size_t>(size_[0]),
                             static_cast<size_t>(size_[0]) * size_[1]};
    for_all([&](int i, int j, int k) {
      const size_t n = index(i, j, k);
      const State u = at(n);
      State sum = u;
      for (int c = 0; c < 3; ++c) {
        const State in = between(at(n - along[c]), u, c), out = between(u, at(n + along[c]), c);
        for (int q = 0; q < 5; ++q) sum[q] += ratio * (in[q] - out[q]);
      }
      for (int q = 0; q < 5; ++q) next_[q][n] = sum[q];
    });
    std::swap(u_, next_);
  }

  // This rank's densities with so many layers of neighbours below and above, where there are any:
  // a description of the solver's own array.
  RtsvCompositeBrick brick(int below, int above) const {
    RtsvCompositeBrick b = {};
    b.struct_bytes = sizeof b;
    int low[3];
    for (int c = 0; c < 3; ++c) {
      low[c] = std::max(first_[c] - below, 0);
      b.first[c] = static_cast<uint32_t>(low[c]);
      b.dims[c] = static_cast<uint32_t>(std::min(first_[c] + own_[c] + above, cells_) - low[c]);
    }
    b.values.data = &u_[0][index(low[0] - first_[0], low[1] - first_[1], low[2] - first_[2])];
    b.values.count = static_cast<uint64_t>(b.dims[0]) * b.dims[1] * b.dims[2];
    b.values.components = 1;
    b.values.kind = RTSV_COMPOSITE_F64;
    b.row_bytes = static_cast<int64_t>(sizeof(double)) * size_[0];
    b.slice_bytes = b.row_bytes * size_[1];
    return b;
  }

  int rank() const { return rank_; }
  double spacing_m() const { return h_; }
  MPI_Comm comm() const { return cart_; }

 private:
  template <typename F>
  void for_all(F f) const {
    for (int k = 0; k < own_[2]; ++k)
      for (int j = 0; j < own_[1]; ++j)
        for (int i = 0; i < own_[0]; ++i) f(i, j, k);
  }

  size_t index(int i, int j, int k) const {
    const size_t row = static_cast<size_t>(k + GHOSTS) * size_[1] + (j + GHOSTS);
    return row * size_[0] + (i + GHOSTS);
  }

  State at(size_t n) const { return {u_[0][n], u_[1][n], u_[2][n], u_[3][n], u_[4][n]}; }

  // Layers from `from` on go to rank `to`, and those of rank `source` come to `into`.
  void send(std::vector<double>& part, int axis, int from, int to, int into, int source) {
    auto layers = [&](int start) {
      int sizes[3] = {size_[2], size_[1], size_[0]}, part_of[3], starts[3] = {0, 0, 0};
      for (int c = 0; c < 3; ++c) part_of[c] = sizes[c];
      part_of[2 - axis] = GHOSTS, starts[2 - axis] = start;
      MPI_Datatype type;
      MPI_Type_create_subarray(3, sizes, part_of, starts, MPI_ORDER_C, MPI_DOUBLE, &type);
      MPI_Type_commit(&type);
      return type;
    };
    MPI_Datatype out = layers(from), in = layers(into);
    MPI_Sendrecv(part.data(), 1, out, to, axis, part.data(), 1, in, source, axis, cart_,
                 MPI_STATUS_IGNORE);
    MPI_Type_free(&out);
    MPI_Type_free(&in);
  }

  void repeat(std::vector<double>& part, int axis, int side) {
    for (int k = 0; k < size_[2]; ++k)
      for (int j = 0; j < size_[1]; ++j)
        for (int i = 0; i < size_[0]; ++i) {
          int to[3] = {i, j, k}, from[3] = {i, j, k};
          const int last = GHOSTS + own_[axis] - 1;
          if (side ? to[axis] <= last : to[axis] >= GHOSTS) continue;
          from[axis] = side ? last : GHOSTS;
          part[index(i - GHOSTS, j - GHOSTS, k - GHOSTS)] =
              part[index(from[0] - GHOSTS, from[1] - GHOSTS, from[2] - GHOSTS)];
        }
  }

  int cells_, rank_ = 0, first_[3], own_[3], size_[3];
  double h_;
  MPI_Comm cart_;
  std::array<std::vector<double>, 5> u_, next_;
};

// The two pictures of a step.
class Cameras {
 public:
  Cameras(const Blast& blast, int cells, uint32_t pixels) : blast_(blast) {
    MPI_Comm comm = blast.comm();
    check(rtsv_composite_comm_from_mpi(&comm, sizeof comm, &group_));
    gas_.struct_bytes = sizeof gas_;
    volume_.struct_bytes = sizeof volume_;
    for (int c = 0; c < 3; ++c) {
      gas_.dims[c] = volume_.dims[c] = static_cast<uint32_t>(cells);
      gas_.origin_m[c] = volume_.origin[c] = 0.5 * blast.spacing_m();
      gas_.spacing_m[c] = volume_.spacing[c] = blast.spacing_m();
    }
    gas_.gladstone_dale = 2.26e-4;
    gas_.reference_density = 1.2;
    volume_.name = "density";
    volume_.colors = {colors_, 3, 3, RTSV_COMPOSITE_F32, 0, nullptr, nullptr};
    volume_.opacities = {opacities_, 4, 2, RTSV_COMPOSITE_F32, 0, nullptr, nullptr};
    volume_.range[0] = 0.5f, volume_.range[1] = 2.5f;
    volume_.unit_distance = 0.01;
    check(rtsv_composite_render_options_init(&options_, sizeof options_));
    check(rtsv_composite_view_init(&view_, sizeof view_));
    view_.width = view_.height = pixels;
    for (int c = 0; c < 3; ++c) view_.target[c] = 0.5 * SIDE_M;
    view_.eye[0] = 0.19, view_.eye[1] = -0.12, view_.eye[2] = 0.13;
    view_.up[1] = 0, view_.up[2] = 1;
    check(rtsv_composite_shot_init(&shot_, sizeof shot_));
    shot_.width = shot_.height = pixels;
    shot_.direction[0] = 0.6, shot_.direction[1] = 1, shot_.direction[2] = -0.3;
    shot_.up[1] = 0, shot_.up[2] = 1;
    options_.timeout_secs = shot_.timeout_secs = 10;
    if (blast.rank() == 0) grey_.resize(static_cast<size_t>(pixels) * pixels);
  }

  ~Cameras() {
    check(rtsv_composite_renderer_free(renderer_));
    check(rtsv_composite_comm_free(group_));
  }

  void photograph(const std::string& out) {
    const RtsvCompositeBrick brick = blast_.brick(1, 2);
    RtsvCompositePhotograph photo = {};
    photo.struct_bytes = sizeof photo;
    photo.grey = grey_.data();
    photo.grey_count = grey_.size();
    check(rtsv_composite_photograph(group_, &gas_, &brick, &shot_, &photo));
    copies_ += photo.copies;
    if (blast_.rank() == 0) save(out, grey_.data(), grey_.size());
  }

  void render(const std::string& out) {
    RtsvCompositeScene* scene;
    check(rtsv_composite_scene_new(&scene));
    check(rtsv_composite_scene_volume(scene, &volume_, nullptr));
    const RtsvCompositeBrick brick = blast_.brick(0, 1);
    check(rtsv_composite_scene_brick(scene, &brick));
    if (renderer_) {
      check(rtsv_composite_renderer_replace(renderer_, scene));
    } else {
      check(rtsv_composite_renderer_new(group_, scene, &options_, &renderer_));
    }
    check(rtsv_composite_scene_free(scene));
    RtsvCompositePicture picture = {};
    picture.struct_bytes = sizeof picture;
    check(rtsv_composite_renderer_render(renderer_, &view_, &picture));
    if (picture.color) save(out, picture.color, 4ul * picture.width * picture.height);
  }

  unsigned copies() const { return copies_; }

 private:
  static void save(const std::string& path, const float* data, size_t count) {
    std::FILE* file = std::fopen(path.c_str(), "wb");
    if (!file || std::fwrite(data, sizeof *data, count, file) + std::fclose(file) != count)
      std::perror(path.c_str());
  }

  const Blast& blast_;
  RtsvCompositeComm* group_ = nullptr;
  RtsvCompositeRenderer* renderer_ = nullptr;
  RtsvCompositeGas gas_ = {};
  RtsvCompositeVolume volume_ = {};
  RtsvCompositeRenderOptions options_ = {};
  RtsvCompositeView view_ = {};
  RtsvCompositeShot shot_ = {};
  const float colors_[9] = {0.1f, 0.2f, 0.9f, 0.9f, 0.9f, 0.9f, 0.9f, 0.3f, 0.1f};
  const float opacities_[8] = {0.4f, 0.6f, 1.15f, 0, 1.25f, 0, 2.5f, 0.7f};
  std::vector<float> grey_;
  unsigned copies_ = 0;
};

bool is_it(const char* variable, int rank) {
  const char* value = std::getenv(variable);
  return value && std::atoi(value) == rank;
}

}  // namespace

int main(int argc, char** argv) {
  MPI_Init(&argc, &argv);
  const std::string out = argc > 1 ? argv[1] : "blast";
  const int cells = argc > 2 ? std::atoi(argv[2]) : 64, steps = argc > 3 ? std::atoi(argv[3]) : 50;
  const int pixels = argc > 4 ? std::atoi(argv[4]) : 512;
  {
    Blast blast(cells);
    Cameras cameras(blast, cells, static_cast<uint32_t>(pixels));
    double solving = 0, photographing = 0, rendering = 0;
    for (int step = 1; step <= steps; ++step) {
      const double begin = MPI_Wtime();
      blast.step();
      solving += MPI_Wtime() - begin;
      if (step % 10 != 0) continue;
      blast.exchange();
      if (is_it("BLAST_STALL", blast.rank())) pause();
      if (is_it("BLAST_DIE", blast.rank())) std::raise(SIGKILL);
      const std::string name = out + "-" + std::to_string(step);
      const double middle = MPI_Wtime();
      cameras.photograph(name + ".schlieren");
      const double end = MPI_Wtime();
      cameras.render(name + ".volume");
      photographing += end - middle, rendering += MPI_Wtime() - end;
    }
    if (blast.rank() == 0) {
      std::printf("solver %.3f s, photographs %.3f s, pictures %.3f s, %u copies of densities\n",
                  solving, photographing, rendering, cameras.copies());
    }
  }
  return MPI_Finalize();
}
