/* The part of Catalyst 2 and of Conduit's C interface that the example calls, for machines without
 * libcatalyst: see catalyst.c. */
#ifndef STAND_IN_CATALYST_H
#define STAND_IN_CATALYST_H
#include <stdint.h>

/* As in libcatalyst, whose Conduit has names of its own. */
#define conduit_node_create catalyst_conduit_node_create
#define conduit_node_destroy catalyst_conduit_node_destroy
#define conduit_node_fetch catalyst_conduit_node_fetch
#define conduit_node_has_path catalyst_conduit_node_has_path
#define conduit_node_fetch_path_as_char8_str catalyst_conduit_node_fetch_path_as_char8_str
#define conduit_node_set_path_char8_str catalyst_conduit_node_set_path_char8_str
#define conduit_node_set_path_int64 catalyst_conduit_node_set_path_int64
#define conduit_node_set_path_float64 catalyst_conduit_node_set_path_float64
#define conduit_node_set_path_external_float64_ptr catalyst_conduit_node_set_path_external_float64_ptr
#define conduit_node_set_path_external_float64_ptr_detailed \
  catalyst_conduit_node_set_path_external_float64_ptr_detailed
#define conduit_node_set_path_external_int64_ptr catalyst_conduit_node_set_path_external_int64_ptr
#define conduit_node_dtype catalyst_conduit_node_dtype
#define conduit_node_number_of_children catalyst_conduit_node_number_of_children
#define conduit_node_child catalyst_conduit_node_child
#define conduit_node_name catalyst_conduit_node_name
#define conduit_node_data_ptr catalyst_conduit_node_data_ptr
#define conduit_node_element_ptr catalyst_conduit_node_element_ptr
#define conduit_datatype_id catalyst_conduit_datatype_id
#define conduit_datatype_number_of_elements catalyst_conduit_datatype_number_of_elements
#define conduit_datatype_stride catalyst_conduit_datatype_stride
#define conduit_datatype_endianness catalyst_conduit_datatype_endianness

typedef struct conduit_node_impl conduit_node;
typedef struct conduit_node_impl conduit_datatype;

conduit_node *conduit_node_create(void);
void conduit_node_destroy(conduit_node *node);
conduit_node *conduit_node_fetch(conduit_node *node, const char *path);
int conduit_node_has_path(conduit_node *node, const char *path);
char *conduit_node_fetch_path_as_char8_str(conduit_node *node, const char *path);
void conduit_node_set_path_char8_str(conduit_node *node, const char *path, const char *value);
void conduit_node_set_path_int64(conduit_node *node, const char *path, int64_t value);
void conduit_node_set_path_float64(conduit_node *node, const char *path, double value);
void conduit_node_set_path_external_float64_ptr(conduit_node *node, const char *path,
                                                double *data, int64_t count);
void conduit_node_set_path_external_float64_ptr_detailed(conduit_node *node, const char *path,
                                                         double *data, int64_t count,
                                                         int64_t offset, int64_t stride,
                                                         int64_t element_bytes,
                                                         int64_t endianness);
void conduit_node_set_path_external_int64_ptr(conduit_node *node, const char *path, int64_t *data,
                                              int64_t count);
const conduit_datatype *conduit_node_dtype(const conduit_node *node);
int64_t conduit_node_number_of_children(conduit_node *node);
conduit_node *conduit_node_child(conduit_node *node, int64_t k);
char *conduit_node_name(const conduit_node *node);
void *conduit_node_data_ptr(conduit_node *node);
void *conduit_node_element_ptr(conduit_node *node, int64_t k);
int64_t conduit_datatype_id(const conduit_datatype *type);
int64_t conduit_datatype_number_of_elements(const conduit_datatype *type);
int64_t conduit_datatype_stride(const conduit_datatype *type);
int64_t conduit_datatype_endianness(const conduit_datatype *type);

int catalyst_initialize(const conduit_node *params);
int catalyst_execute(const conduit_node *params);
int catalyst_finalize(const conduit_node *params);
int catalyst_about(conduit_node *params);
int catalyst_results(conduit_node *params);
#endif
