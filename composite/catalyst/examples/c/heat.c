/* A hot ball of gas cools down: a simulation that calls Catalyst 2 each tenth step, and knows no
 * more of who makes the pictures.
 *   mpirun -n 4 ./heat [POINTS [STEPS]]     POINTS along each side of a metre (48), STEPS (40)
 * Ranks have slabs of the gas. Channels: "gas", uniform points with temperature and density;
 * "cells", the same as hexahedra, and the rank that has each. Without -DSERIAL it needs MPI. */
#include <catalyst.h>
#include <conduit.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#ifndef SERIAL
#include <mpi.h>
#endif

/* Planes of the neighbours that a slab has on each side: the solver needs one, a photograph two. */
enum { GHOSTS = 2 };
static int rank = 0, ranks = 1;

/* A slab: planes first to end of n, of which low to high are of this rank. */
typedef struct {
  int n, first, end, low, high;
  double h;
  double *temperature, *density, *next;
} Slab;

static size_t at(const Slab *s, int x, int y, int z) {
  return x + (size_t)s->n * (y + (size_t)s->n * (z - s->first));
}

static double *numbers(size_t count) {
  double *memory = calloc(count, sizeof *memory);
  if (!memory) {
    fprintf(stderr, "heat: out of memory\n");
    exit(1);
  }
  return memory;
}

static Slab slab_of(int n) {
  Slab s = {.n = n, .h = 1.0 / (n - 1)};
  s.low = (int)((int64_t)n * rank / ranks);
  s.high = (int)((int64_t)n * (rank + 1) / ranks);
  s.first = s.low < GHOSTS ? 0 : s.low - GHOSTS;
  s.end = s.high > n - GHOSTS ? n : s.high + GHOSTS;
  const size_t count = (size_t)n * n * (s.end - s.first);
  s.temperature = numbers(count);
  s.density = numbers(count);
  s.next = numbers(count);
  for (int z = s.first; z < s.end; ++z)
    for (int y = 0; y < n; ++y)
      for (int x = 0; x < n; ++x) {
        const double dx = x * s.h - 0.5, dy = y * s.h - 0.45, dz = z * s.h - 0.4;
        const double hot = dx * dx + dy * dy + dz * dz < 0.09;
        s.temperature[at(&s, x, y, z)] = 300 + 600 * hot;
      }
  return s;
}

/* Explicit steps of the heat equation; the walls keep their temperature. */
static void step(Slab *s) {
  const int n = s->n;
  memcpy(s->next, s->temperature, sizeof(double) * n * n * (s->end - s->first));
  for (int z = s->low > 1 ? s->low : 1; z < s->high && z < n - 1; ++z)
    for (int y = 1; y < n - 1; ++y)
      for (int x = 1; x < n - 1; ++x) {
        const double *t = s->temperature + at(s, x, y, z);
        const double sum = t[-1] + t[1] + t[-n] + t[n] + t[-n * n] + t[n * n];
        s->next[at(s, x, y, z)] = *t + 0.15 * (sum - 6 * *t);
      }
  double *old = s->temperature;
  s->temperature = s->next;
  s->next = old;
#ifndef SERIAL
  const int plane = n * n, below = rank > 0 ? rank - 1 : MPI_PROC_NULL;
  const int above = rank + 1 < ranks ? rank + 1 : MPI_PROC_NULL;
  double *t = s->temperature;
  MPI_Sendrecv(t + at(s, 0, 0, s->high - GHOSTS), GHOSTS * plane, MPI_DOUBLE, above, 0,
               t + at(s, 0, 0, s->first), GHOSTS * plane, MPI_DOUBLE, below, 0, MPI_COMM_WORLD,
               MPI_STATUS_IGNORE);
  MPI_Sendrecv(t + at(s, 0, 0, s->low), GHOSTS * plane, MPI_DOUBLE, below, 1,
               t + at(s, 0, 0, s->high < n ? s->high : s->end - GHOSTS), GHOSTS * plane, MPI_DOUBLE,
               above, 1, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
#endif
}

static void text(conduit_node *node, const char *path, const char *value) {
  conduit_node_set_path_char8_str(node, path, value);
}

/* Arrays are handed over where they are. */
static void array(conduit_node *node, const char *path, double *values, int64_t count) {
  conduit_node_set_path_external_float64_ptr(node, path, values, count);
}

static void field(conduit_node *node, const char *name, const char *association, double *values,
                  int64_t count) {
  char path[256];
  const char *parts[3][2] = {
      {"association", association}, {"topology", "mesh"}, {"volume_dependent", "false"}};
  for (int k = 0; k < 3; ++k) {
    snprintf(path, sizeof path, "fields/%s/%s", name, parts[k][0]);
    text(node, path, parts[k][1]);
  }
  snprintf(path, sizeof path, "fields/%s/values", name);
  array(node, path, values, count);
}

/* The points of a slab, with the planes of the neighbours. */
static void gas(conduit_node *mesh, Slab *s) {
  const int64_t planes = s->end - s->first, count = (int64_t)s->n * s->n * planes;
  text(mesh, "coordsets/points/type", "uniform");
  const char *axes = "ijk", *origins = "xyz";
  for (int a = 0; a < 3; ++a) {
    char path[64];
    snprintf(path, sizeof path, "coordsets/points/dims/%c", axes[a]);
    conduit_node_set_path_int64(mesh, path, a < 2 ? s->n : planes);
    snprintf(path, sizeof path, "coordsets/points/origin/%c", origins[a]);
    conduit_node_set_path_float64(mesh, path, a < 2 ? 0 : s->first * s->h);
    snprintf(path, sizeof path, "coordsets/points/spacing/d%c", origins[a]);
    conduit_node_set_path_float64(mesh, path, s->h);
  }
  text(mesh, "topologies/mesh/type", "uniform");
  text(mesh, "topologies/mesh/coordset", "points");
  field(mesh, "temperature", "vertex", s->temperature, count);
  field(mesh, "density", "vertex", s->density, count);
}

/* Hexahedra of the slab's own planes, and of the gap to the next slab. Returns what to free. */
static void **cells(conduit_node *mesh, Slab *s) {
  const int n = s->n, top = s->high < n ? s->high : n - 1;
  const int64_t points = (int64_t)n * n * (top - s->low + 1);
  const int64_t count = (int64_t)(n - 1) * (n - 1) * (top - s->low);
  double *places = numbers(3 * points + 1), *owner = numbers(count + 1);
  int64_t *corners = calloc(8 * count + 1, sizeof *corners), *next = corners;
  void **memory = calloc(3, sizeof *memory);
  if (!corners || !memory) exit(1);
  for (int64_t k = 0; k < points; ++k) {
    places[3 * k] = k % n * s->h;
    places[3 * k + 1] = k / n % n * s->h;
    places[3 * k + 2] = (s->low + k / n / n) * s->h;
  }
  for (int64_t k = 0; k < count; ++k) {
    const int64_t x = k % (n - 1), y = k / (n - 1) % (n - 1), z = k / (n - 1) / (n - 1);
    const int64_t p = x + n * (y + n * z), up = (int64_t)n * n;
    const int64_t eight[8] = {p,      p + 1,      p + 1 + n,      p + n,
                              p + up, p + 1 + up, p + 1 + n + up, p + n + up};
    for (int c = 0; c < 8; ++c) *next++ = eight[c];
    owner[k] = rank;
  }
  text(mesh, "coordsets/points/type", "explicit");
  const char *axes[3] = {"coordsets/points/values/x", "coordsets/points/values/y",
                         "coordsets/points/values/z"};
  for (int a = 0; a < 3; ++a) /* x, y, z of a point lie side by side. */
    conduit_node_set_path_external_float64_ptr_detailed(
        mesh, axes[a], places, points, a * sizeof(double), 3 * sizeof(double), sizeof(double), 0);
  text(mesh, "topologies/mesh/type", "unstructured");
  text(mesh, "topologies/mesh/coordset", "points");
  text(mesh, "topologies/mesh/elements/shape", "hex");
  conduit_node_set_path_external_int64_ptr(mesh, "topologies/mesh/elements/connectivity", corners,
                                           8 * count);
  field(mesh, "temperature", "vertex", s->temperature + at(s, 0, 0, s->low), points);
  field(mesh, "owner", "element", owner, count);
  memory[0] = places, memory[1] = owner, memory[2] = corners;
  return memory;
}

static int call_catalyst(Slab *s, int done, double secs) {
  const size_t count = (size_t)s->n * s->n * (s->end - s->first);
  for (size_t k = 0; k < count; ++k) s->density[k] = 101325 / (287.05 * s->temperature[k]);
  conduit_node *params = conduit_node_create();
  conduit_node_set_path_int64(params, "catalyst/state/timestep", done);
  conduit_node_set_path_float64(params, "catalyst/state/time", secs);
  text(params, "catalyst/channels/gas/type", "mesh");
  text(params, "catalyst/channels/cells/type", "mesh");
  gas(conduit_node_fetch(params, "catalyst/channels/gas/data"), s);
  void **memory = cells(conduit_node_fetch(params, "catalyst/channels/cells/data"), s);
  const int status = catalyst_execute(params);
  conduit_node_destroy(params);
  for (int k = 0; k < 3; ++k) free(memory[k]);
  free(memory);
  return status;
}

static int simulate(int n, int steps) {
  conduit_node *params = conduit_node_create();
#ifndef SERIAL
  conduit_node_set_path_int64(params, "catalyst/mpi_comm", MPI_Comm_c2f(MPI_COMM_WORLD));
#endif
  int worst = catalyst_initialize(params);
  conduit_node_destroy(params);
  Slab slab = slab_of(n);
  for (int done = 1; done <= steps && worst == 0; ++done) {
    step(&slab);
    if (done % 10 == 0) worst = call_catalyst(&slab, done, done * slab.h * slab.h);
  }
  params = conduit_node_create();
  catalyst_finalize(params);
  conduit_node_destroy(params);
  if (worst) fprintf(stderr, "heat: Catalyst returned %d\n", worst);
  free(slab.temperature);
  free(slab.density);
  free(slab.next);
  return worst != 0;
}

int main(int argc, char **argv) {
#ifndef SERIAL
  MPI_Init(&argc, &argv);
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  MPI_Comm_size(MPI_COMM_WORLD, &ranks);
#endif
  const int n = argc > 1 ? atoi(argv[1]) : 48, steps = argc > 2 ? atoi(argv[2]) : 40;
  if (n < 2 * GHOSTS * ranks || n > 1024) {
    fprintf(stderr, "heat: give %d to 1024 points\n", 2 * GHOSTS * ranks);
    return 2;
  }
  const int status = simulate(n, steps);
#ifndef SERIAL
  MPI_Finalize();
#endif
  return status;
}
