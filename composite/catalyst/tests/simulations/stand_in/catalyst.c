/* A stand-in for libcatalyst, which Debian does not have: a tree with the calls of conduit.h that
 * the example and this project's library make, and the loader. Nothing else of either. The tests
 * use the real one where RTSV_CATALYST names it. */
#include "catalyst.h"
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { EMPTY = 0, OBJECT = 1, INT64 = 6, FLOAT64 = 12, TEXT = 13, MOST = 64 };

struct conduit_node_impl {
  int64_t id, count, offset, stride;
  char *name, *data;
  int owned;
  int64_t children;
  struct conduit_node_impl *child[MOST];
};

static void *memory(size_t bytes) {
  void *found = calloc(1, bytes);
  if (!found) abort();
  return found;
}

static char *copied(const char *text, size_t bytes) {
  return memcpy(memory(bytes + 1), text, bytes);
}

conduit_node *conduit_node_create(void) { return memory(sizeof(conduit_node)); }

void conduit_node_destroy(conduit_node *node) {
  for (int64_t k = 0; k < node->children; ++k) conduit_node_destroy(node->child[k]);
  if (node->owned) free(node->data);
  free(node->name);
  free(node);
}

/* The node at a path, which is made if `make` is set. */
static conduit_node *found(conduit_node *node, const char *path, int make) {
  while (*path) {
    const size_t length = strcspn(path, "/");
    conduit_node *next = NULL;
    for (int64_t k = 0; k < node->children && !next; ++k) {
      conduit_node *child = node->child[k];
      if (strlen(child->name) == length && !memcmp(child->name, path, length)) next = child;
    }
    if (!next) {
      if (!make) return NULL;
      if (node->children == MOST) abort();
      next = conduit_node_create();
      next->name = copied(path, length);
      node->child[node->children++] = next;
      node->id = OBJECT;
    }
    node = next;
    path += length + (path[length] == '/');
  }
  return node;
}

conduit_node *conduit_node_fetch(conduit_node *node, const char *path) {
  return found(node, path, 1);
}

int conduit_node_has_path(conduit_node *node, const char *path) {
  return found(node, path, 0) != NULL;
}

static void set(conduit_node *node, const char *path, int64_t id, const void *data, int64_t count,
                int64_t bytes, int owned) {
  node = found(node, path, 1);
  if (node->owned) free(node->data);
  node->id = id, node->count = count, node->stride = bytes, node->offset = 0;
  node->owned = owned;
  node->data = owned ? copied(data, count * bytes) : (char *)data;
}

void conduit_node_set_path_char8_str(conduit_node *node, const char *path, const char *value) {
  set(node, path, TEXT, value, strlen(value) + 1, 1, 1);
}

void conduit_node_set_path_int64(conduit_node *node, const char *path, int64_t value) {
  set(node, path, INT64, &value, 1, sizeof value, 1);
}

void conduit_node_set_path_float64(conduit_node *node, const char *path, double value) {
  set(node, path, FLOAT64, &value, 1, sizeof value, 1);
}

void conduit_node_set_path_external_float64_ptr(conduit_node *node, const char *path,
                                                double *data, int64_t count) {
  set(node, path, FLOAT64, data, count, sizeof *data, 0);
}

void conduit_node_set_path_external_float64_ptr_detailed(conduit_node *node, const char *path,
                                                         double *data, int64_t count,
                                                         int64_t offset, int64_t stride,
                                                         int64_t element_bytes,
                                                         int64_t endianness) {
  (void)element_bytes, (void)endianness;
  set(node, path, FLOAT64, data, count, stride, 0);
  found(node, path, 0)->offset = offset;
}

void conduit_node_set_path_external_int64_ptr(conduit_node *node, const char *path, int64_t *data,
                                              int64_t count) {
  set(node, path, INT64, data, count, sizeof *data, 0);
}

char *conduit_node_fetch_path_as_char8_str(conduit_node *node, const char *path) {
  node = found(node, path, 0);
  return node && node->id == TEXT ? node->data : NULL;
}

const conduit_datatype *conduit_node_dtype(const conduit_node *node) { return node; }
int64_t conduit_node_number_of_children(conduit_node *node) { return node->children; }
conduit_node *conduit_node_child(conduit_node *node, int64_t k) { return node->child[k]; }
char *conduit_node_name(const conduit_node *node) {
  return copied(node->name ? node->name : "", node->name ? strlen(node->name) : 0);
}
void *conduit_node_data_ptr(conduit_node *node) { return node->data; }
void *conduit_node_element_ptr(conduit_node *node, int64_t k) {
  return node->data + node->offset + k * node->stride;
}
int64_t conduit_datatype_id(const conduit_datatype *type) { return type->id; }
int64_t conduit_datatype_number_of_elements(const conduit_datatype *type) { return type->count; }
int64_t conduit_datatype_stride(const conduit_datatype *type) { return type->stride; }
int64_t conduit_datatype_endianness(const conduit_datatype *type) { return type ? 0 : 2; }

/* struct catalyst_impl of catalyst_impl.h. */
static const struct {
  int version;
  int (*initialize)(const conduit_node *), (*execute)(const conduit_node *);
  int (*finalize)(const conduit_node *);
  int (*about)(conduit_node *), (*results)(conduit_node *);
} * impl;

int catalyst_initialize(const conduit_node *params) {
  const char *name = getenv("CATALYST_IMPLEMENTATION_NAME");
  const char *folder = getenv("CATALYST_IMPLEMENTATION_PATHS");
  if (!name || !folder) return 0; /* Catalyst's own stub does nothing. */
  char path[4096];
  snprintf(path, sizeof path, "%s/libcatalyst-%s.so", folder, name);
  void *library = dlopen(path, RTLD_LAZY | RTLD_LOCAL);
  if (!library) return 3;
  impl = dlsym(library, "catalyst_api_impl");
  if (!impl) return 4;
  return impl->version == 1 ? impl->initialize(params) : 6;
}

int catalyst_execute(const conduit_node *params) { return impl ? impl->execute(params) : 1; }
int catalyst_finalize(const conduit_node *params) { return impl ? impl->finalize(params) : 1; }
int catalyst_about(conduit_node *params) { return impl ? impl->about(params) : 1; }
int catalyst_results(conduit_node *params) { return impl ? impl->results(params) : 1; }
