/* A C program that draws frames through rtv.h as the shim does, and misuses it: run by against_stock/memory.rs, also under valgrind. */
#include "rtv.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define WIDTH 24
#define HEIGHT 16

#define CHECK(what)                                                                                                  \
  if (!(what))                                                                                                       \
  {                                                                                                                  \
    fprintf(stderr, "line %d: %s\n", __LINE__, #what);                                                               \
    exit(1);                                                                                                         \
  }

static RtvArray array(void const* data, uint64_t tuples, uint32_t components, uint32_t kind)
{
  RtvArray made = { data, tuples, components, kind };
  return made;
}

/* Copies that are freed at once: if the bridge kept a pointer, it would read freed memory. */
static void* copy(void const* data, size_t size)
{
  void* made = malloc(size);
  memcpy(made, data, size);
  return made;
}

static const double identity[16] = { 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1 };

static int draw(RtvApi const* api, RtvBridge* bridge, uint64_t key, int colors, double shift, float opacity, RtvPicture* out)
{
  float points[] = { -0.8f, -0.8f, 0.2f, 0.8f, -0.8f, 0.2f, 0.8f, 0.8f, 0.4f, -0.8f, 0.8f, 0.4f };
  for (int i = 0; i < 4; ++i)
  {
    points[3 * i] += (float)shift;
  }
  const int64_t offsets[] = { 0, 4 }, connectivity[] = { 0, 1, 2, 3 };
  const float normals[] = { 0, 0, -1, 0, 0, -1, 0, 0, -1, 0, 0, -1 };
  const uint8_t rgba[] = { 255, 0, 0, 255, 0, 255, 0, 255, 0, 0, 255, 255, 255, 255, 255, 255 };
  void* kept[] = { copy(points, sizeof points), copy(offsets, sizeof offsets), copy(connectivity, sizeof connectivity),
    copy(normals, sizeof normals), copy(rgba, sizeof rgba) };
  RtvSurface s;
  memset(&s, 0, sizeof s);
  s.name = "a quad";
  s.shape_key = key;
  s.color_key = key + 100;
  s.points = array(kept[0], 4, 3, RTV_F32);
  s.polys.offsets = array(kept[1], 2, 1, RTV_I64);
  s.polys.connectivity = array(kept[2], 4, 1, RTV_I64);
  s.point_normals = array(kept[3], 4, 3, RTV_F32);
  if (colors)
  {
    s.color_source = RTV_COLOR_POINTS;
    s.colors = array(kept[4], 4, 4, RTV_U8);
  }
  s.property.diffuse_color[0] = s.property.diffuse_color[1] = s.property.diffuse_color[2] = 1;
  s.property.diffuse = 1;
  s.property.specular_power = 1;
  s.property.opacity = opacity;
  s.property.roughness = 0.5f;
  s.property.base_ior = 1.5f;
  s.property.lighting = 1;
  memcpy(s.world_from_data, identity, sizeof identity);
  CHECK(api->begin(bridge) == 1);
  const int added = api->surface(bridge, &s);
  for (int i = 0; i < 5; ++i)
  {
    free(kept[i]);
  }
  RtvLight light;
  memset(&light, 0, sizeof light);
  light.position[2] = -1;
  light.color[0] = light.color[1] = light.color[2] = 1;
  light.attenuation[0] = 1;
  light.headlight = 1;
  api->light(bridge, &light);
  api->pass(bridge, "axes", "annotation");
  RtvView view;
  memset(&view, 0, sizeof view);
  memcpy(view.clip_from_world, identity, sizeof identity);
  view.focus_distance = 1;
  view.width = WIDTH;
  view.height = HEIGHT;
  memset(out, 0, sizeof *out);
  const int drawn = api->render(bridge, &view, out);
  if (drawn)
  {
    /* The whole image can be read until the next call. */
    double sum = 0;
    for (int i = 0; i < WIDTH * HEIGHT; ++i)
    {
      sum += out->depth[i] + (out->opaque ? out->opaque[4 * i] : out->blended[4 * i]) +
        (out->first_depth ? out->first_depth[i] : 0);
    }
    CHECK(sum == sum);
  }
  api->end(bridge);
  return added == 1 && drawn;
}

int main(void)
{
  RtvApi const* api = rtv_api();
  CHECK(api && api->abi() == RTV_ABI);
  RtvBridge* bridges[2] = { api->new_bridge(), api->new_bridge() };
  RtvPicture picture;
  /* The same surface, other colours, other arrays, translucent, keys that are not cached. */
  for (uint64_t frame = 0; frame < 6; ++frame)
  {
    for (int b = 0; b < 2; ++b)
    {
      CHECK(draw(api, bridges[b], frame == 5 ? 0 : frame / 2 + 1, frame % 2, 0.01 * (double)(frame / 2), frame == 3 ? 0.5f : 1, &picture));
      CHECK(picture.width == WIDTH && picture.height == HEIGHT);
      const float depth = picture.depth[WIDTH * (HEIGHT / 2) + WIDTH / 2];
      /* The plane z = 0.3 in the middle: window depth 0.65. Translucent surfaces have none. */
      CHECK(frame == 3 ? depth == 1 : depth > 0.63f && depth < 0.67f);
    }
  }
  /* Options with every effect. */
  const char* const options[][2] = { { "RTV_AO", "2" }, { "RTV_SHADOWS", "1" }, { "RTV_MIRROR", "0.5" }, { "RTV_SAMPLES", "2" },
    { "RTV_REFLECTIONS", "1" }, { "RTV_APERTURE", "0.01" } };
  for (int i = 0; i < 6; ++i)
  {
    CHECK(api->set_option(options[i][0], options[i][1]) == 1);
    draw(api, bridges[0], 9, 1, 0, 1, &picture);
    CHECK(api->set_option(options[i][0], "") == 1);
  }
  CHECK(api->set_option("RTV_MATERIAL", "glass") == 1);
  draw(api, bridges[0], 9, 1, 0, 1, &picture);
  CHECK(api->set_option("RTV_MATERIAL", "") == 1 && api->set_option("RTV_AO", "many") == 0);
  /* Options of one bridge alone. */
  CHECK(api->set_bridge_option(bridges[0], "RTV_OFF", "1") == 1 && api->begin(bridges[0]) == 0 && api->begin(bridges[1]) == 1);
  api->end(bridges[1]);
  CHECK(api->bridge_option(bridges[0], "RTV_OFF") == 1 && api->bridge_option(bridges[1], "RTV_OFF") == 0);
  CHECK(api->set_bridge_option(bridges[0], "RTV_OFF", "") == 1 && api->set_bridge_option(0, "RTV_OFF", "1") == 0);
  /* Reasons of props that are not drawn, from facts that are freed at once. */
  RtvActorFacts facts;
  memset(&facts, 0, sizeof facts);
  facts.representation = RTV_SURFACE;
  facts.mapper_class = "vtkPolyDataMapper";
  char* class_name = copy("vtkActor", sizeof "vtkActor");
  facts.actor_class = class_name;
  CHECK(!api->check_actor(bridges[0], &facts));
  class_name[3] = 'F';
  char const* reason = api->check_actor(bridges[0], &facts);
  free(class_name);
  CHECK(reason && !strcmp(reason, "OpenGL draws props of this class"));
  RtvGlyphFacts glyphs;
  memset(&glyphs, 0, sizeof glyphs);
  CHECK(!strcmp(api->check_glyphs(bridges[0], &glyphs), "glyphs without a source"));
  /* Misuse: nothing may happen. */
  CHECK(api->check_actor(bridges[0], 0) && api->check_surface(0, 0) && api->check_glyphs(0, &glyphs) && api->check_volume(0, 0));
  CHECK(api->surfaces(bridges[0], 0, 3) == -1 && api->surfaces(0, 0, 0) == -1);
  api->free_bridge(0);
  CHECK(api->begin(0) == 0 && api->render(0, 0, 0) == 0 && api->surface(bridges[0], 0) == -1);
  api->light(bridges[0], 0);
  api->pass(bridges[0], 0, 0);
  api->warn(bridges[0], 0);
  api->end(0);
  /* Bridges freed in another order than created, one of them within a frame. */
  api->begin(bridges[1]);
  api->free_bridge(bridges[0]);
  api->free_bridge(bridges[1]);
  puts("done");
  return 0;
}
