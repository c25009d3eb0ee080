/* Draws through ANARI's loader (its path is the argument) with the device rtv: every kind of object, and misuse. Prints "done". */
#include <dlfcn.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef void* H;
typedef void (*StatusCallback)(const void*, H, H, int, int, int, const char*);
typedef void (*Deleter)(const void*, const void*);

/* The functions of the loader that are used here. */
#define FUNCTIONS(F) \
  F(H, LoadLibrary, (const char*, StatusCallback, const void*)) \
  F(void, UnloadLibrary, (H)) \
  F(H, NewDevice, (H, const char*)) \
  F(H, NewArray1D, (H, const void*, Deleter, const void*, uint32_t, uint64_t)) \
  F(H, NewArray2D, (H, const void*, Deleter, const void*, uint32_t, uint64_t, uint64_t)) \
  F(H, NewArray3D, (H, const void*, Deleter, const void*, uint32_t, uint64_t, uint64_t, uint64_t)) \
  F(H, NewGeometry, (H, const char*)) \
  F(H, NewMaterial, (H, const char*)) \
  F(H, NewSampler, (H, const char*)) \
  F(H, NewSpatialField, (H, const char*)) \
  F(H, NewVolume, (H, const char*)) \
  F(H, NewLight, (H, const char*)) \
  F(H, NewInstance, (H, const char*)) \
  F(H, NewCamera, (H, const char*)) \
  F(H, NewRenderer, (H, const char*)) \
  F(H, NewSurface, (H)) \
  F(H, NewGroup, (H)) \
  F(H, NewWorld, (H)) \
  F(H, NewFrame, (H)) \
  F(void, SetParameter, (H, H, const char*, uint32_t, const void*)) \
  F(void, UnsetParameter, (H, H, const char*)) \
  F(void, CommitParameters, (H, H)) \
  F(void, Release, (H, H)) \
  F(void, Retain, (H, H)) \
  F(void*, MapArray, (H, H)) \
  F(void, UnmapArray, (H, H)) \
  F(int, GetProperty, (H, H, const char*, uint32_t, void*, uint64_t, uint32_t)) \
  F(void, RenderFrame, (H, H)) \
  F(int, FrameReady, (H, H, uint32_t)) \
  F(void, DiscardFrame, (H, H)) \
  F(const void*, MapFrame, (H, H, const char*, uint32_t*, uint32_t*, uint32_t*)) \
  F(void, UnmapFrame, (H, H, const char*))
#define DECLARE(result, name, arguments) static result(*anari##name) arguments;
FUNCTIONS(DECLARE)

enum { DATA_TYPE = 100, STRING = 101, ARRAY1D = 504, ARRAY2D = 505, ARRAY3D = 506, CAMERA = 507, GEOMETRY = 509, GROUP = 510, INSTANCE = 511, LIGHT = 512,
  MATERIAL = 513, RENDERER = 514, SURFACE = 515, SAMPLER = 516, SPATIAL_FIELD = 517, VOLUME = 518, WORLD = 519, UINT32 = 1020, UINT32_VEC2 = 1021,
  UINT32_VEC3 = 1022, UFIXED8_VEC4 = 1039, FLOAT32 = 1068, FLOAT32_VEC2 = 1069, FLOAT32_VEC3 = 1070, FLOAT32_VEC4 = 1071, FLOAT32_BOX3 = 2010, FLOAT32_MAT4 = 2014 };

static H device;
static int errors, warnings, made, deleted;

static void on_status(const void* user, H d, H source, int type, int severity, int code, const char* text)
{
  (void)user, (void)d, (void)source, (void)type, (void)code;
  errors += severity <= 2 && strlen(text) > 0;
  warnings += severity == 3;
}

static void free_copy(const void* user, const void* memory)
{
  (void)user;
  ++deleted;
  free((void*)memory);
}

static void fail(const char* what)
{
  fprintf(stderr, "failed: %s (%d errors, %d warnings)\n", what, errors, warnings);
  exit(1);
}

/* An array that owns a copy of its memory. */
static H array(uint32_t type, const void* values, size_t bytes, uint64_t x, uint64_t y, uint64_t z)
{
  ++made;
  void* copy = malloc(bytes);
  memcpy(copy, values, bytes);
  return z ? anariNewArray3D(device, copy, free_copy, NULL, type, x, y, z)
    : y    ? anariNewArray2D(device, copy, free_copy, NULL, type, x, y)
           : anariNewArray1D(device, copy, free_copy, NULL, type, x);
}

static void set_object(H o, const char* name, uint32_t type, H value)
{
  anariSetParameter(device, o, name, type, &value);
}

/* Sets an object as a parameter and releases it. */
static void set_and_release(H o, const char* name, uint32_t type, H value)
{
  set_object(o, name, type, value);
  anariRelease(device, value);
}

static void text(H o, const char* name, const char* value)
{
  anariSetParameter(device, o, name, STRING, value);
}

static void number(H o, const char* name, float value)
{
  anariSetParameter(device, o, name, FLOAT32, &value);
}

static H list(uint32_t type, H* objects, uint64_t n)
{
  return array(type, objects, n * sizeof(H), n, 0, 0);
}

static H surface(H geometry, H material)
{
  anariCommitParameters(device, geometry);
  anariCommitParameters(device, material);
  H s = anariNewSurface(device);
  set_and_release(s, "geometry", GEOMETRY, geometry);
  set_and_release(s, "material", MATERIAL, material);
  anariCommitParameters(device, s);
  return s;
}

static H round_thing(const char* subtype)
{
  const float points[][3] = { { -0.5f, 0, 0.2f }, { 0.4f, 0.3f, 0.1f } };
  H g = anariNewGeometry(device, subtype);
  set_and_release(g, "vertex.position", ARRAY1D, array(FLOAT32_VEC3, points, sizeof points, 2, 0, 0));
  number(g, "radius", 0.2f);
  return g;
}

static H sampler(const char* subtype, const char* attribute)
{
  const unsigned char texels[4][4] = { { 128, 128, 255, 255 }, { 200, 128, 220, 255 }, { 128, 60, 200, 255 }, { 150, 128, 250, 255 } };
  H s = anariNewSampler(device, subtype);
  set_and_release(s, "image", ARRAY2D, array(UFIXED8_VEC4, texels, sizeof texels, 2, 2, 0));
  text(s, "inAttribute", attribute);
  text(s, "wrapMode1", "clampToBorder");
  anariCommitParameters(device, s);
  return s;
}

static H sheet(void)
{
  const float points[][3] = { { -1, -1, 0 }, { 1, -1, 0 }, { 1, 1, 0.2f }, { -1, 1, 0 } };
  const float uv[][2] = { { 0, 0 }, { 1, 0 }, { 1, 1 }, { 0, 1 } };
  const uint32_t index[][3] = { { 0, 1, 2 }, { 0, 2, 3 }, { 0, 2, 77 } };
  H g = anariNewGeometry(device, "triangle");
  set_and_release(g, "vertex.position", ARRAY1D, array(FLOAT32_VEC3, points, sizeof points, 4, 0, 0));
  set_and_release(g, "vertex.attribute0", ARRAY1D, array(FLOAT32_VEC2, uv, sizeof uv, 4, 0, 0));
  set_and_release(g, "primitive.index", ARRAY1D, array(UINT32_VEC3, index, sizeof index, 3, 0, 0));
  return g;
}

static H textured_material(void)
{
  H m = anariNewMaterial(device, "physicallyBased");
  const char* channels[] = { "baseColor", "metallic", "roughness", "normal", "emissive", "occlusion", "opacity" };
  for (int i = 0; i < 7; ++i)
  {
    set_and_release(m, channels[i], SAMPLER, sampler("image2D", i == 6 ? "worldPosition" : "attribute0"));
  }
  text(m, "alphaMode", "blend");
  return m;
}

static H volume(void)
{
  float data[27];
  for (int i = 0; i < 27; ++i)
  {
    data[i] = (float)(i % 5) / 5;
  }
  const float colors[][4] = { { 1, 0, 0, 0 }, { 0, 1, 1, 0.6f } };
  H f = anariNewSpatialField(device, "structuredRegular");
  set_and_release(f, "data", ARRAY3D, array(FLOAT32, data, sizeof data, 3, 3, 3));
  text(f, "filter", "nearest");
  anariCommitParameters(device, f);
  H v = anariNewVolume(device, "transferFunction1D");
  set_and_release(v, "value", SPATIAL_FIELD, f);
  set_and_release(v, "color", ARRAY1D, array(FLOAT32_VEC4, colors, sizeof colors, 2, 0, 0));
  anariCommitParameters(device, v);
  return v;
}

static H isosurface(void)
{
  const float data[8] = { 0, 1, 0, 1, 0, 1, 1, 1 };
  H f = anariNewSpatialField(device, "structuredRegular");
  set_and_release(f, "data", ARRAY3D, array(FLOAT32, data, sizeof data, 2, 2, 2));
  anariCommitParameters(device, f);
  H g = anariNewGeometry(device, "isosurface");
  set_and_release(g, "field", SPATIAL_FIELD, f);
  number(g, "isovalue", 0.5f);
  return g;
}

static H world(void)
{
  H surfaces[] = { surface(sheet(), textured_material()), surface(round_thing("sphere"), anariNewMaterial(device, "matte")), surface(round_thing("cylinder"), anariNewMaterial(device, "matte")),
    surface(round_thing("cone"), anariNewMaterial(device, "matte")), surface(round_thing("curve"), anariNewMaterial(device, "matte")), surface(isosurface(), anariNewMaterial(device, "matte")),
    surface(round_thing("teapot"), anariNewMaterial(device, "velvet")) };
  H volumes[] = { volume() };
  const char* kinds[] = { "directional", "point", "spot", "ring", "quad" };
  H lights[5];
  for (int i = 0; i < 5; ++i)
  {
    const float place[3] = { 0.3f, 0.2f, 2.0f };
    lights[i] = anariNewLight(device, kinds[i]);
    anariSetParameter(device, lights[i], "position", FLOAT32_VEC3, place);
    number(lights[i], "radius", 0.3f);
    anariCommitParameters(device, lights[i]);
  }
  H group = anariNewGroup(device);
  set_and_release(group, "surface", ARRAY1D, list(SURFACE, surfaces, 7));
  set_and_release(group, "volume", ARRAY1D, list(VOLUME, volumes, 1));
  set_and_release(group, "light", ARRAY1D, list(LIGHT, lights, 5));
  anariCommitParameters(device, group);
  const float matrix[16] = { 0.9f, 0, 0, 0, 0, 0.9f, 0, 0, 0, 0, 0.9f, 0, 0.1f, 0, 0, 1 };
  H instances[] = { anariNewInstance(device, "transform"), anariNewInstance(device, "motionTransform") };
  for (int i = 0; i < 2; ++i)
  {
    set_object(instances[i], "group", GROUP, group);
    anariSetParameter(device, instances[i], "transform", FLOAT32_MAT4, matrix);
    anariCommitParameters(device, instances[i]);
  }
  H w = anariNewWorld(device);
  set_and_release(w, "instance", ARRAY1D, list(INSTANCE, instances, 2));
  anariCommitParameters(device, w);
  for (int i = 0; i < 7; ++i)
  {
    anariRelease(device, surfaces[i]);
  }
  for (int i = 0; i < 5; ++i)
  {
    anariRelease(device, lights[i]);
  }
  anariRelease(device, volumes[0]);
  anariRelease(device, group);
  anariRelease(device, instances[0]);
  anariRelease(device, instances[1]);
  return w;
}

/* Draws the view of `camera`; returns the number of different colours. */
static int draw(H w, const char* camera_type, const char* renderer_type)
{
  const float eye[3] = { 0.2f, 0.1f, 3.0f };
  const uint32_t size[2] = { 24, 18 };
  H camera = anariNewCamera(device, camera_type);
  anariSetParameter(device, camera, "position", FLOAT32_VEC3, eye);
  number(camera, "height", 2.5f);
  anariCommitParameters(device, camera);
  H renderer = anariNewRenderer(device, renderer_type);
  number(renderer, "ambientRadiance", 0.3f);
  anariCommitParameters(device, renderer);
  H frame = anariNewFrame(device);
  set_object(frame, "world", WORLD, w);
  set_and_release(frame, "camera", CAMERA, camera);
  set_and_release(frame, "renderer", RENDERER, renderer);
  anariSetParameter(device, frame, "size", UINT32_VEC2, size);
  const char* names[] = { "channel.color", "channel.depth", "channel.normal", "channel.albedo", "channel.objectId" };
  const uint32_t types[] = { UFIXED8_VEC4, FLOAT32, FLOAT32_VEC3, FLOAT32_VEC3, UINT32 };
  for (int i = 0; i < 5; ++i)
  {
    anariSetParameter(device, frame, names[i], DATA_TYPE, &types[i]);
  }
  anariCommitParameters(device, frame);
  anariRenderFrame(device, frame);
  anariDiscardFrame(device, frame);
  anariRenderFrame(device, frame);
  anariFrameReady(device, frame, 1);
  int colors = 0;
  for (int i = 0; i < 5; ++i)
  {
    uint32_t width = 0, height = 0, type = 0;
    const uint32_t* pixels = anariMapFrame(device, frame, names[i], &width, &height, &type);
    if (!pixels || width != 24 || height != 18 || type != types[i])
    {
      fail(names[i]);
    }
    for (uint32_t p = 1; i == 0 && p < width * height; ++p)
    {
      colors += pixels[p] != pixels[p - 1];
    }
    anariUnmapFrame(device, frame, names[i]);
  }
  anariUnmapFrame(device, frame, "channel.color");
  anariRelease(device, frame);
  return colors;
}

static void misuse(void)
{
  const int before = errors;
  H sphere = round_thing("sphere");
  const float nan3[3] = { 0.0f / 0.0f, 1e30f, -1e30f };
  anariSetParameter(device, sphere, "radius", FLOAT32_VEC3, nan3);
  anariSetParameter(device, sphere, "vertex.position", FLOAT32, nan3);
  text(sphere, "vertex.radius", "wide");
  anariUnsetParameter(device, sphere, "nothing");
  anariCommitParameters(device, sphere);
  anariRelease(device, sphere);
  anariRelease(device, sphere);
  anariCommitParameters(device, sphere);
  anariSetParameter(device, (H)(intptr_t)12345, "radius", FLOAT32, nan3);
  float box[6];
  anariGetProperty(device, sphere, "bounds", FLOAT32_BOX3, box, sizeof box, 1);
  if (anariNewArray1D(device, NULL, NULL, NULL, FLOAT32_VEC3, 0) || anariNewArray1D(device, NULL, NULL, NULL, 77, 4))
  {
    fail("arrays that cannot be");
  }
  /* Shared memory that is freed together with its array. */
  float* shared = malloc(3 * sizeof(float));
  shared[0] = shared[1] = shared[2] = 0;
  H points = anariNewArray1D(device, shared, NULL, NULL, FLOAT32_VEC3, 1);
  H g = anariNewGeometry(device, "sphere");
  set_object(g, "vertex.position", ARRAY1D, points);
  anariCommitParameters(device, g);
  anariRelease(device, points);
  free(shared);
  H s = surface(g, anariNewMaterial(device, "matte"));
  H w = anariNewWorld(device);
  set_and_release(w, "surface", ARRAY1D, list(SURFACE, &s, 1));
  anariRelease(device, s);
  anariCommitParameters(device, w);
  if (draw(w, "orthographic", "default") < 10)
  {
    fail("a ball of released memory");
  }
  anariRelease(device, w);
  if (errors < before + 6)
  {
    fail("errors that were not reported");
  }
}

int main(int count, char** arguments)
{
  void* loader = dlopen(count > 1 ? arguments[1] : "libanari.so", RTLD_NOW | RTLD_GLOBAL);
  if (!loader)
  {
    fail(dlerror());
  }
#define FIND(result, name, arguments) *(void**)&anari##name = dlsym(loader, "anari" #name);
  FUNCTIONS(FIND)
  H library = anariLoadLibrary("rtv", on_status, NULL);
  device = library ? anariNewDevice(library, "default") : NULL;
  if (!device)
  {
    fail("no device");
  }
  anariCommitParameters(device, device);
  H w = world();
  const char* cameras[] = { "perspective", "orthographic", "omnidirectional" };
  for (int i = 0; i < 3; ++i)
  {
    if (draw(w, cameras[i], "default") < 10)
    {
      fail(cameras[i]);
    }
  }
  if (draw(w, cameras[0], "pathtracer") < 10)
  {
    fail("pathtracer");
  }
  misuse();
  anariRelease(device, w);
  const int back = deleted;
  anariRelease(device, device);
  anariUnloadLibrary(library);
  if (back != made || deleted != made)
  {
    fail("memory that was not given back");
  }
  puts("done");
  return 0;
}
