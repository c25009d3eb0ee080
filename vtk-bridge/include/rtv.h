/* The C interface of vtk-bridge; src/capi tells how to use it.
 * Made from the Rust sources by tests/c_header.rs: do not edit. */
#ifndef RTV_H
#define RTV_H
#include <stdint.h>
#ifdef __cplusplus
extern "C" {
#endif

/* A renderer's side of the bridge. */
typedef struct RtvBridge RtvBridge;
/* Element type of an RtvArray: no array. */
#define RTV_NONE 0u
/* Unsigned bytes. */
#define RTV_U8 1u
/* 32-bit floating point. */
#define RTV_F32 2u
/* 64-bit floating point. */
#define RTV_F64 3u
/* 32-bit signed integers. */
#define RTV_I32 4u
/* 64-bit signed integers. */
#define RTV_I64 5u
/* Colours come from the property. */
#define RTV_COLOR_PROPERTY 0u
/* Four bytes per point. */
#define RTV_COLOR_POINTS 1u
/* Four bytes per cell. */
#define RTV_COLOR_CELLS 2u
/* Two floats per point: position in map, and above 0.5 for NaN. */
#define RTV_COLOR_MAPPED 3u
/* Parallel light. */
#define RTV_LIGHT_DIRECTIONAL 0u
/* Light from a point. */
#define RTV_LIGHT_POINT 1u
/* Light from a point in a cone. */
#define RTV_LIGHT_SPOT 2u
/* Emission and absorption. */
#define RTV_BLEND_COMPOSITE 0u
/* The largest scalar. */
#define RTV_BLEND_MAXIMUM 1u
/* The smallest scalar. */
#define RTV_BLEND_MINIMUM 2u
/* The mean of colour times opacity. */
#define RTV_BLEND_AVERAGE 3u
/* The integral of colour times opacity. */
#define RTV_BLEND_ADDITIVE 4u
/* Surfaces of given scalars. */
#define RTV_BLEND_ISOSURFACES 5u
/* tuples times components numbers, contiguous in memory. */
typedef struct RtvArray {
  /* First number; may be null if there are none. */
  void const* data;
  /* Tuples. */
  uint64_t tuples;
  /* Numbers per tuple. */
  uint32_t components;
  /* One of RTV_U8 to RTV_I64, or RTV_NONE. */
  uint32_t kind;
} RtvArray;
/* Cell i is connectivity[offsets[i] .. offsets[i + 1]]. */
typedef struct RtvCells {
  /* One more than the number of cells. */
  RtvArray offsets;
  /* Point numbers. */
  RtvArray connectivity;
} RtvCells;
/* vtkProperty. */
typedef struct RtvProperty {
  /* Ambient colour. */
  float ambient_color[3];
  /* Diffuse colour. */
  float diffuse_color[3];
  /* Specular colour. */
  float specular_color[3];
  /* Ambient coefficient. */
  float ambient;
  /* Diffuse coefficient. */
  float diffuse;
  /* Specular coefficient. */
  float specular;
  /* Specular exponent. */
  float specular_power;
  /* Opacity. */
  float opacity;
  /* Metallic, of the physically based model. */
  float metallic;
  /* Roughness, of the physically based model. */
  float roughness;
  /* Index of refraction, of the physically based model. */
  float base_ior;
  /* 1 for flat shading. */
  uint32_t flat;
  /* 0 for no lighting. */
  uint32_t lighting;
  /* 1 for the physically based model. */
  uint32_t pbr;
  /* 1 to cull front faces. */
  uint32_t cull_front;
  /* 1 to cull back faces. */
  uint32_t cull_back;
  /* Colour of the edges of polygons. */
  float edge_color[3];
  /* Their width in pixels; 0 for none. */
  float edge_width;
} RtvProperty;
/* An image, and how it is sampled. */
typedef struct RtvImage {
  /* Four RTV_U8 per texel, or none. */
  RtvArray texels;
  /* Changes whenever the texels change. */
  uint64_t key;
  /* Texels per row. */
  uint32_t width;
  /* 1: interpolated linearly between texels. */
  uint8_t interpolate;
  /* 1: repeated. */
  uint8_t repeat;
  /* 1: encoded as sRGB. */
  uint8_t srgb;
  /* Not used. */
  uint8_t reserved;
} RtvImage;
/* Textures of a physically based property other than its colour. */
typedef struct RtvMaps {
  /* Occlusion, roughness and metalness in red, green and blue. */
  RtvImage material;
  /* Normals; they need tangents. */
  RtvImage normal;
  /* Emitted radiance. */
  RtvImage emissive;
  /* Factor on the first two components of the normals. */
  float normal_scale;
  /* 0 for no occlusion, 1 for full occlusion. */
  float occlusion_strength;
  /* Factor on the radiance. */
  float emissive_factor[3];
  /* Not used. */
  uint32_t reserved;
} RtvMaps;
/* A surface to draw. Arrays are read before rtv_surface returns and not kept. */
typedef struct RtvSurface {
  /* Name for messages, UTF-8. */
  char const* name;
  /* Changes whenever points, cells, normals, texture coordinates, clipping planes or radii change; 0: not known. */
  uint64_t shape_key;
  /* Changes whenever the colours change; 0: not known. */
  uint64_t color_key;
  /* Changes whenever the texture changes. */
  uint64_t texture_key;
  /* Three RTV_F32 or RTV_F64. */
  RtvArray points;
  /* Vertices. */
  RtvCells verts;
  /* Polylines. */
  RtvCells lines;
  /* Polygons. */
  RtvCells polys;
  /* Strips. */
  RtvCells strips;
  /* Three RTV_F32 per point, or none. */
  RtvArray point_normals;
  /* Three RTV_F32 per cell, or none. */
  RtvArray cell_normals;
  /* Two RTV_F32 per point, or none. */
  RtvArray texcoords;
  /* Four RTV_F64 per plane: a x + b y + c z + d >= 0 remains. */
  RtvArray clip_planes;
  /* One of RTV_COLOR_*. */
  uint32_t color_source;
  /* 1: draw polygons as their edges (tubes). */
  uint32_t edges_only;
  /* The colours, as color_source says. */
  RtvArray colors;
  /* RTV_COLOR_MAPPED: four RTV_U8 per entry. */
  RtvArray map;
  /* RTV_COLOR_MAPPED: colour of NaN. */
  uint8_t nan_color[4];
  /* 1: interpolated linearly between texels. */
  uint8_t texture_interpolate;
  /* 1: the texture is repeated. */
  uint8_t texture_repeat;
  /* 1: the texture is encoded as sRGB. */
  uint8_t texture_srgb;
  /* Not used. */
  uint8_t reserved;
  /* Four RTV_U8 per texel, or none. */
  RtvArray texture;
  /* Texels per row. */
  uint32_t texture_width;
  /* 1: back faces of polygons have the property back. */
  uint32_t has_back;
  /* Answer to light. */
  RtvProperty property;
  /* Answer of backs. */
  RtvProperty back;
  /* Row by row. */
  double world_from_data[16];
  /* Sixteen RTV_F64 per copy (row by row), or none. */
  RtvArray glyph_matrices;
  /* Four RTV_U8 per copy, or none. */
  RtvArray glyph_colors;
  /* Radius of spheres for vertices; 0 for none. */
  double point_radius;
  /* Radius of tubes for lines and edges; 0 for none. */
  double line_radius;
  /* Three RTV_F32 per point, or none; they belong to the shape. */
  RtvArray tangents;
  /* Further textures, or null. */
  RtvMaps const* maps;
} RtvSurface;
/* A uniform grid of scalars as a medium. Arrays are read before rtv_volume returns and not kept. */
typedef struct RtvVolume {
  /* Name for messages, UTF-8. */
  char const* name;
  /* Changes whenever the scalars change; 0: not known. */
  uint64_t scalar_key;
  /* One number of any kind per point, or per cell with cells, x fastest; none when rtv_has_volume says that they are kept. */
  RtvArray scalars;
  /* Points per axis. */
  uint32_t dims[3];
  /* 1: the value of the nearest point; 0: linear interpolation. */
  uint32_t nearest;
  /* Distance between neighbouring points. */
  double spacing[3];
  /* Row by row; the first point is at zero of the data. */
  double world_from_data[16];
  /* Scalars of the first and the last entry of both tables. */
  double range[2];
  /* Three RTV_F32 per entry. */
  RtvArray colors;
  /* One RTV_F32 per entry: opacity of a slab of unit_distance. */
  RtvArray opacities;
  /* See opacities. */
  double unit_distance;
  /* Distance of the mapper's samples, data units, of which RTV_BLEND_COMPOSITE takes the same; 0 integrates instead. */
  double sample_distance;
  /* World position of the camera, with has_viewer. */
  double viewer[3];
  /* 1 for shading by the gradient. */
  uint32_t shade;
  /* Of the shading. */
  float ambient;
  /* Of the shading. */
  float diffuse;
  /* Of the shading. */
  float specular;
  /* Of the shading. */
  float specular_power;
  /* 1 for a highlight around the mirrored light instead of the half vector. */
  uint32_t specular_mirrored;
  /* Lights: for each the direction towards it, in the world (zero for one at the viewer), and its colour; none for a white one at the viewer. */
  RtvArray lights;
  /* Opacities by gradient, evenly spaced from 0 to steepest, that those of the scalars are multiplied by; none for 1. */
  RtvArray gradient_opacities;
  /* Gradient of the last of them, scalar per data unit. */
  double steepest;
  /* One of RTV_BLEND_*. */
  uint32_t blend;
  /* 1: lights at the viewer and highlights go by lines from viewer, not by the rays, which in parallel projections differ. */
  uint32_t has_viewer;
  /* Scalars of the surfaces of RTV_BLEND_ISOSURFACES, f64. */
  RtvArray isovalues;
  /* 1: the scalars belong to the cells between the points. */
  uint32_t cells;
  /* Regions that are drawn, bit x + 3 y + 9 z, where 0, 1 and 2 stand for below, between and above the planes of an axis; 0: all of the volume. */
  uint32_t cropping_regions;
  /* Lower and upper plane of each axis, data units, with cropping_regions. */
  double cropping_planes[6];
  /* Planes that cut off what is behind them, in the world: a point and the normal of each. */
  RtvArray clip_planes;
  /* 1: cropping planes are where OpenGL's mapper has them, which takes the grid for half a cell larger on each side, unless the scalars are those of cells. */
  uint32_t cropping_in_texels;
  /* 1: so are clipping planes, as before VTK 9.3.1. */
  uint32_t clipping_in_texels;
} RtvVolume;
/* A light that is on. */
typedef struct RtvLight {
  /* World position. */
  double position[3];
  /* World point that it is aimed at. */
  double focal_point[3];
  /* Half angle of a spot, degrees. */
  double cone_angle_deg;
  /* Exponent of a spot. */
  double exponent;
  /* Colour times intensity. */
  float color[3];
  /* Constant, linear, quadratic. */
  float attenuation[3];
  /* One of RTV_LIGHT_*. */
  uint32_t kind;
  /* 1 for a headlight. */
  uint32_t headlight;
} RtvLight;
/* What to render: a camera and a size. */
typedef struct RtvView {
  /* Projection times view, row by row, depth -1 to 1. */
  double clip_from_world[16];
  /* World position of the camera, with has_viewer. */
  double viewer[3];
  /* Background at the bottom. */
  float background_bottom[3];
  /* Background at the top. */
  float background_top[3];
  /* Distance from the camera to its focal point, world units. */
  double focus_distance;
  /* Pixels per row. */
  uint32_t width;
  /* Rows. */
  uint32_t height;
  /* 1 while the user turns the scene. */
  uint32_t interactive;
  /* 1 when the program itself asks for shadows. */
  uint32_t shadows;
  /* Samples of each pixel of the framebuffer that the image is drawn into; 0 or 1 for none. With more, the alpha of opaque images is the part of the pixel that is covered. */
  uint32_t window_samples;
  /* 1 when OpenGL draws nothing beside the image that is translucent or has a depth. */
  uint32_t one_layer;
  /* 1: parallel projections see highlights and lights at the viewer by lines from viewer, as OpenGL's shaders do, not by the rays. */
  uint32_t has_viewer;
} RtvView;
/* An image; rows start at the top, and the memory belongs to the bridge until its next call. */
typedef struct RtvPicture {
  /* Pixels per row. */
  uint32_t width;
  /* Rows. */
  uint32_t height;
  /* RGBA bytes, not premultiplied, or null when blended is not. */
  uint8_t const* opaque;
  /* Premultiplied RGBA, or null. */
  float const* blended;
  /* Window depth of the first opaque surface. */
  float const* depth;
  /* Window depth of the first surface, or null without blended or with straight. */
  float const* first_depth;
  /* blended as one layer, to be blended over everything with depth: RGBA, not premultiplied, 65535 for 1; null without one_layer or blended. */
  uint16_t const* straight;
} RtvPicture;
/* Representation of a property: every point. */
#define RTV_POINTS 0u
/* The edges of polygons. */
#define RTV_WIREFRAME 1u
/* Polygons. */
#define RTV_SURFACE 2u
/* Bits that describe a texture: it exists. */
#define RTV_TEXTURE 1u
/* It has a transform. */
#define RTV_TEXTURE_TRANSFORM 2u
/* It is a cube map. */
#define RTV_TEXTURE_CUBE_MAP 4u
/* It has mipmaps. */
#define RTV_TEXTURE_MIPMAP 8u
/* Back faces do not show it. */
#define RTV_TEXTURE_FRONT_ONLY 16u
/* A prop with its property and mapper. Asked about before the mapper is updated, and again if it then has no data. */
typedef struct RtvActorFacts {
  /* Name of the prop's VTK class. */
  char const* actor_class;
  /* Name of the mapper's VTK class; null for props other than actors and for actors without one. */
  char const* mapper_class;
  /* One of RTV_POINTS, RTV_WIREFRAME and RTV_SURFACE. */
  uint32_t representation;
  /* 1 for physically based shading. */
  uint32_t pbr;
  /* 1 if the edges of polygons are visible. */
  uint32_t edge_visibility;
  /* 1 if lines are drawn as shaded tubes. */
  uint32_t lines_as_tubes;
  /* 1 if the vertices of polygons are visible. */
  uint32_t vertex_visibility;
  /* HasTranslucentPolygonalGeometry; read only with edges or a back face property. */
  uint32_t translucent;
  /* Clipping planes of the mapper. */
  uint32_t num_clipping_planes;
  /* 1 if there is a back face property. */
  uint32_t has_back;
  /* Its opacity. */
  double back_opacity;
  /* Opacity of edges. */
  double edge_opacity;
  /* Strength of the clear coat. */
  double coat_strength;
  /* Anisotropy of the physically based model. */
  double anisotropy;
  /* Metallic, of the physically based model. */
  double metallic;
  /* Colour of a metal at grazing angles. */
  double edge_tint[3];
  /* 1 if it has shaders or shader replacements of its own. */
  uint32_t shader_code;
  /* 1 for a vtkGlyph3DMapper. */
  uint32_t glyphs;
  /* The actor's texture: bits RTV_TEXTURE and following. */
  uint32_t texture;
  /* Textures of the property, of any name. */
  uint32_t num_textures;
  /* Bits of the property's albedoTex. */
  uint32_t albedo;
  /* Bits of its materialTex. */
  uint32_t material;
  /* Bits of its normalTex. */
  uint32_t normal;
  /* Bits of its emissiveTex. */
  uint32_t emissive;
  /* 1 if the mapper was updated and has no data. */
  uint32_t no_data;
  /* 1 if blocks have scalars, colour maps or textures of their own. */
  uint32_t block_scalars;
  /* 1 if OpenGL moves the depths of its polygons, for lines and surfaces in the same plane. */
  uint32_t polygon_offset;
  /* 1 if an image lights the renderer's physically based surfaces. */
  uint32_t image_lighting;
} RtvActorFacts;
/* The data of an actor, or one of their blocks, and its surface. Asked about when the cells are known, and again when the surface is complete. */
typedef struct RtvSurfaceFacts {
  /* Vertices of the data. */
  uint64_t num_verts;
  /* Lines of the data. */
  uint64_t num_lines;
  /* As in RtvActorFacts. */
  uint32_t representation;
  /* 1 if the data are neither vtkPolyData nor blocks. */
  uint32_t not_polygons;
  /* 1 if polygons were cut into triangles, because they are not convex. */
  uint32_t triangulated;
  /* 1 if the edges of polygons are drawn on the surface. */
  uint32_t edges;
  /* 1 for a texture that gives the colour. */
  uint32_t texture;
  /* 1 for other textures of the property. */
  uint32_t maps;
  /* As in RtvSurface. */
  uint32_t has_back;
  /* As in RtvSurface. */
  uint32_t color_source;
  /* 1 if rtv_surfaces refused the arrays. */
  uint32_t invalid_arrays;
  /* 1 if cells have point numbers that cannot be read, in the array described below. */
  uint32_t unreadable_cells;
  /* Numbers per tuple of that array. */
  uint32_t cell_components;
  /* Not used. */
  uint32_t reserved;
  /* Name of its numbers' type. */
  char const* cell_type;
  /* Name of its VTK class; null if there is no array. */
  char const* cell_array_class;
} RtvSurfaceFacts;
/* A glyph mapper with its data. Asked about before its sources are updated, again for each source, and again for each data set with colours. */
typedef struct RtvGlyphFacts {
  /* 1 if the sources are in a tree. */
  uint32_t source_table_tree;
  /* Clipping planes of the mapper. */
  uint32_t num_clipping_planes;
  /* Sources that the mapper uses. */
  uint32_t num_sources;
  /* 1 if the data are one data set. */
  uint32_t data_set;
  /* 1 if they are blocks. */
  uint32_t composite;
  /* 1 if blocks have colours, opacities or visibilities of their own. */
  uint32_t block_attributes;
  /* Blocks that are no data sets. */
  uint32_t num_blocks_without_points;
  /* 1 if the two fields below describe a source. */
  uint32_t has_source;
  /* Polygons and strips of the source; 0 if it is not vtkPolyData. */
  uint64_t num_source_polygons;
  /* Its vertices and lines. */
  uint64_t num_other_source_cells;
  /* 1 if the fields below describe colours. */
  uint32_t has_colors;
  /* Bytes per colour. */
  uint32_t color_components;
  /* Colours of the data set. */
  uint64_t num_colors;
  /* Points of the data set. */
  uint64_t num_points;
} RtvGlyphFacts;
/* A volume with its mapper and property, the lights and its image. Asked about when its classes are known, again before the mapper's input is updated, and again with the image. */
typedef struct RtvVolumeFacts {
  /* Name of the volume's VTK class. */
  char const* volume_class;
  /* Name of the mapper's VTK class, or null. */
  char const* mapper_class;
  /* 1 if the mapper crops. */
  uint32_t cropping;
  /* Clipping planes of the mapper. */
  uint32_t num_clipping_planes;
  /* 1 if the mapper has a mask. */
  uint32_t mask;
  /* 1 if the mapper computes shadows or scattering. */
  uint32_t scattering;
  /* 1 if the mapper shows vectors. */
  uint32_t vectors;
  /* 1 if the transfer function has two dimensions. */
  uint32_t transfer_function_2d;
  /* 1 if the property has colours or opacities of labels. */
  uint32_t labels;
  /* The mapper's blend mode, with VTK's number: RTV_BLEND_*, or another. */
  uint32_t blend_mode;
  /* 1 if opacities depend on the gradient. */
  uint32_t gradient_opacity;
  /* 1 for shading by the gradient. */
  uint32_t shade;
  /* Lights that are on; this and the next three are read only with shade. */
  uint32_t num_lights;
  /* Of these, positional ones. */
  uint32_t num_positional_lights;
  /* Of these, ones with an ambient colour. */
  uint32_t num_ambient_lights;
  /* Lights in RtvVolume. */
  uint32_t num_listed_lights;
  /* Coefficient of the highlight. */
  double specular;
  /* 1 if the data are known, which the fields below describe. */
  uint32_t has_data;
  /* 1 if they are one image. */
  uint32_t image;
  /* Number of blocks, for blocks. */
  uint32_t num_blocks;
  /* Points per axis; these and the following are read only with image. */
  uint32_t dims[3];
  /* 1 if points or cells are blanked. */
  uint32_t blanked;
  /* 1 if there are scalars. */
  uint32_t scalars;
  /* 1 if they belong to cells. */
  uint32_t cell_scalars;
  /* Numbers per scalar. */
  uint32_t num_components;
  /* 1 if the axes of the image are not those of its space. */
  uint32_t turned;
  /* With cropping: which regions are drawn, with VTK's flags. */
  uint32_t cropping_regions;
  /* As in RtvVolume. */
  double range[2];
  /* Scalars that RTV_BLEND_AVERAGE takes the mean of. */
  double average_range[2];
} RtvVolumeFacts;
/* Answers of rtv_choose: rays. */
#define RTV_CHOICE_RAYS 0u
/* OpenGL: nothing is added to the frame. */
#define RTV_CHOICE_OPENGL 1u
/* The caller has to collect the scene's facts and ask again. */
#define RTV_CHOICE_ASK_AGAIN 2u
/* A renderer's scene, for the choice between rays and OpenGL. The first four fields are always set, the others only when rtv_choose asks for them. */
typedef struct RtvSceneFacts {
  /* Pixels of the viewport. */
  uint64_t pixels;
  /* Props. */
  uint32_t props;
  /* 1 when the program itself asks for shadows. */
  uint32_t shadows;
  /* As in RtvView. */
  uint32_t interactive;
  /* 1 when the fields below are set. */
  uint32_t known;
  /* 1 if OpenGL's driver works on the processor. */
  uint32_t software;
  /* 1 for the Python package. */
  uint32_t python;
  /* Visible volumes; those that rtv_choose_volume was told of and others. */
  uint32_t volumes;
  /* Visible props in space, other than volumes, that have no polygons or more than polygons. */
  uint32_t others;
  /* Visible props with translucent surfaces. */
  uint32_t translucent;
  /* Visible props with edges. */
  uint32_t edges;
  /* Triangles of the visible props, in all copies. */
  uint64_t triangles;
} RtvSceneFacts;
/* A visible volume of a scene, for the choice: what it is to draw. Its pipeline need not be up to date. */
typedef struct RtvSceneVolume {
  /* What rtv_check_volume would be asked with, but for range, which is that of the opacities. */
  RtvVolumeFacts const* facts;
  /* The view of the frame. */
  RtvView const* view;
  /* Scalars at a few points per axis, evenly spread from the first to the last: one RTV_F32 each, x fastest. */
  RtvArray scalars;
  /* How many per axis. */
  uint32_t dims[3];
  /* 1 if OpenGL takes fewer samples while the user turns the scene. */
  uint32_t adjusts;
  /* As in RtvVolume. */
  RtvArray opacities;
  /* As in RtvVolume. */
  double unit_distance;
  /* As in RtvVolume. */
  double sample_distance;
  /* World position of a point of the unit cube, which the image fills; row by row. */
  double world_from_unit[16];
} RtvSceneVolume;
/* Version of this interface, computed from its structures and calls (a test gives the value). A shim built for another version must not continue. */
#define RTV_ABI 3395303342u
/* All calls in one table, so that a shim needs only one symbol. */
typedef struct RtvApi {
  /* rtv_abi. */
  uint32_t (*abi)(void);
  /* rtv_new. */
  RtvBridge* (*new_bridge)(void);
  /* rtv_free. */
  void (*free_bridge)(RtvBridge*);
  /* rtv_set_option. */
  int32_t (*set_option)(char const*, char const*);
  /* rtv_option. */
  double (*option)(char const*);
  /* rtv_host. */
  void (*host)(uint32_t, uint32_t, uint32_t);
  /* rtv_begin. */
  int32_t (*begin)(RtvBridge*);
  /* rtv_surface. */
  int32_t (*surface)(RtvBridge*, RtvSurface const*);
  /* rtv_has_colors. */
  int32_t (*has_colors)(RtvBridge*, uint64_t, uint64_t);
  /* rtv_volume. */
  char const* (*volume)(RtvBridge*, RtvVolume const*);
  /* rtv_has_volume. */
  int32_t (*has_volume)(RtvBridge*, uint64_t);
  /* rtv_light. */
  void (*light)(RtvBridge*, RtvLight const*);
  /* rtv_pass. */
  void (*pass)(RtvBridge*, char const*, char const*);
  /* rtv_warn. */
  void (*warn)(RtvBridge*, char const*);
  /* rtv_render. */
  int32_t (*render)(RtvBridge*, RtvView const*, RtvPicture*);
  /* rtv_end. */
  void (*end)(RtvBridge*);
  /* rtv_set_bridge_option. */
  int32_t (*set_bridge_option)(RtvBridge*, char const*, char const*);
  /* rtv_bridge_option. */
  double (*bridge_option)(RtvBridge*, char const*);
  /* rtv_surfaces. */
  int32_t (*surfaces)(RtvBridge*, RtvSurface const*, uint64_t);
  /* rtv_check_actor. */
  char const* (*check_actor)(RtvBridge*, RtvActorFacts const*);
  /* rtv_check_surface. */
  char const* (*check_surface)(RtvBridge*, RtvSurfaceFacts const*);
  /* rtv_check_glyphs. */
  char const* (*check_glyphs)(RtvBridge*, RtvGlyphFacts const*);
  /* rtv_check_volume. */
  char const* (*check_volume)(RtvBridge*, RtvVolumeFacts const*);
  /* rtv_choose. */
  uint32_t (*choose)(RtvBridge*, RtvSceneFacts const*);
  /* rtv_choose_volume. */
  void (*choose_volume)(RtvBridge*, RtvSceneVolume const*);
} RtvApi;

/* RTV_ABI of the library. */
uint32_t rtv_abi(void);
/* Makes a bridge; free it with rtv_free. Null only if that is impossible. */
RtvBridge* rtv_new(void);
/* Frees a bridge; null is allowed. */
void rtv_free(RtvBridge* bridge);
/* Sets an option for all bridges of the process (RTV_AO, "16"). An empty value unsets it. Returns 1 if the option is valid. */
int32_t rtv_set_option(char const* name, char const* value);
/* Sets an option for one bridge, over those of the process; as rtv_set_option. Two bridges that draw in two threads do not see each other's. */
int32_t rtv_set_bridge_option(RtvBridge* bridge, char const* name, char const* value);
/* An option's value as a number: RTV_POINT_RADIUS, RTV_LINE_RADIUS, RTV_OFF; -1 for others. */
double rtv_option(char const* name);
/* As rtv_option, with the bridge's own options over those of the process: in a frame those that it began with, else those that one begun now would have; -1 also without a bridge. */
double rtv_bridge_option(RtvBridge* bridge, char const* name);
/* Tells which VTK the library is inside of: options whose default follows VTK's version (RTV_EDGES, RTV_VTK) take it from here, unless the environment or the program says otherwise. The build is VTK_BUILD_VERSION: 0 of 9.3.0, or a day, 20240617, between releases. For all bridges of the process. */
void rtv_host(uint32_t vtk_major, uint32_t vtk_minor, uint32_t vtk_build);
/* Begins a frame. Returns 0 if OpenGL should draw everything (RTV_OFF). */
int32_t rtv_begin(RtvBridge* bridge);
/* Says who draws this frame: one of RTV_CHOICE_*. Where the picture is the same either way and a model says that OpenGL is cheaper, it is OpenGL. Call it after rtv_begin, before anything is added; a caller that does not ask traces. */
uint32_t rtv_choose(RtvBridge* bridge, RtvSceneFacts const* facts);
/* Tells the choice of a visible volume: after rtv_choose has asked for facts, and before it is called with them. */
void rtv_choose_volume(RtvBridge* bridge, RtvSceneVolume const* volume);
/* Adds a surface: 1 if it will be traced, 0 if it has nothing to trace, -1 if its arrays are invalid. */
int32_t rtv_surface(RtvBridge* bridge, RtvSurface const* surface);
/* Adds all surfaces of one prop, or none of them, so that nothing is drawn twice. Returns how many will be traced, or -1 if the arrays of one are invalid (a warning names it). */
int32_t rtv_surfaces(RtvBridge* bridge, RtvSurface const* surfaces, uint64_t count);
/* Adds a volume: null if it will be traced, else the reason, as rtv_check_actor gives it. */
char const* rtv_volume(RtvBridge* bridge, RtvVolume const* volume);
/* Returns 1 if the scalars of this key are cached; rtv_volume then does not need them. */
int32_t rtv_has_volume(RtvBridge* bridge, uint64_t scalar_key);
/* Returns 1 if colours of these keys are cached from the last frame; rtv_surface then does not need their arrays. */
int32_t rtv_has_colors(RtvBridge* bridge, uint64_t shape_key, uint64_t color_key);
/* Adds a light. */
void rtv_light(RtvBridge* bridge, RtvLight const* light);
/* Why OpenGL has to draw an actor; null if nothing in these facts speaks against ray tracing it. The text is in memory of the bridge that is valid until it gives another one. */
char const* rtv_check_actor(RtvBridge* bridge, RtvActorFacts const* facts);
/* As rtv_check_actor, for the data of an actor or one of their blocks. */
char const* rtv_check_surface(RtvBridge* bridge, RtvSurfaceFacts const* facts);
/* As rtv_check_actor, for glyphs. */
char const* rtv_check_glyphs(RtvBridge* bridge, RtvGlyphFacts const* facts);
/* As rtv_check_actor, for volumes. rtv_volume may give a reason too. */
char const* rtv_check_volume(RtvBridge* bridge, RtvVolumeFacts const* facts);
/* Records for the report that OpenGL draws something, and why; null for the reason of rtv_choose. */
void rtv_pass(RtvBridge* bridge, char const* name, char const* reason);
/* Warns the user, once for each text. */
void rtv_warn(RtvBridge* bridge, char const* message);
/* Renders what was added: 1 with an image, 0 if it could not be rendered. The user is told why, and OpenGL should draw everything. */
int32_t rtv_render(RtvBridge* bridge, RtvView const* view, RtvPicture* picture);
/* Ends the frame: prints warnings and writes the report, even if nothing was drawn. */
void rtv_end(RtvBridge* bridge);
/* The table; valid as long as the library is loaded. */
RtvApi const* rtv_api(void);

#ifdef __cplusplus
}
#endif
#endif
