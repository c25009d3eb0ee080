// Converts props to surfaces. Which of them are traced decides the bridge from facts about them.
#include "rtv_arrays.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <vtkActor.h>
#include <vtkAssembly.h>
#include <vtkAssemblyNode.h>
#include <vtkAssemblyPath.h>
#include <vtkCompositeDataDisplayAttributes.h>
#include <vtkCompositeDataSet.h>
#include <vtkVersionMacros.h>
// From VTK 9.3 on, vtkCompositePolyDataMapper has the attributes of blocks, and the older
// vtkCompositePolyDataMapper2 goes.
#if VTK_VERSION_NUMBER >= VTK_VERSION_CHECK(9, 3, 0)
#include <vtkCompositePolyDataMapper.h>
#endif
#if __has_include(<vtkCompositePolyDataMapper2.h>)
#include <vtkCompositePolyDataMapper2.h>
#endif
#include <vtkDataSetSurfaceFilter.h>
#include <vtkGlyph3DMapper.h>
#include <vtkInformation.h>
#include <vtkMapper.h>
#include <vtkMatrix4x4.h>
#include <vtkMultiBlockDataSet.h>
#include <vtkPartitionedDataSet.h>
#include <vtkPartitionedDataSetCollection.h>
#include <vtkPlane.h>
#include <vtkPlaneCollection.h>
#include <vtkPolyData.h>
#include <vtkProperty.h>
#include <vtkRenderer.h>
#include <vtkShaderProperty.h>
#include <vtkTexture.h>
#include <vtkVolume.h>

namespace
{
// Properties that a block inherits from its parents in the tree.
struct BlockState
{
  bool Visible = true;
  bool HasColor = false;
  double Color[3] = { 1.0, 1.0, 1.0 };
  double Opacity;
};

// Colours of points and cells replace those of blocks; before VTK 9.4 it was the reverse.
const bool ScalarsOverBlocks = VTK_VERSION_NUMBER >= VTK_VERSION_CHECK(9, 4, 0);

struct Actor
{
  RtvBridge* Bridge;
  vtkActor* Prop;
  vtkMapper* Mapper;
  vtkMatrix4x4* Matrix;
  vtkCompositeDataDisplayAttributes* Attributes = nullptr;
  RtvBatch Batch;
  std::string Name;
  double PointRadius, LineRadius;
  bool Edges = false, Points = false;
};

void CopyColor(const double* from, float* to)
{
  for (int c = 0; c < 3; ++c)
  {
    to[c] = static_cast<float>(from[c]);
  }
}

// What properties have since VTK 9.3: widths and opacities of edges. Overloads with `long` are for
// versions without.
template <class P>
auto EdgeOpacity(P* p, int) -> decltype(static_cast<double>(p->GetEdgeOpacity()))
{
  return p->GetEdgeOpacity();
}

template <class P>
double EdgeOpacity(P*, long)
{
  return 1.0;
}

template <class P>
auto EdgeWidth(P* p, int) -> decltype(p->GetUseLineWidthForEdgeThickness(), static_cast<float>(p->GetEdgeWidth()))
{
  return p->GetUseLineWidthForEdgeThickness() ? p->GetLineWidth() : p->GetEdgeWidth();
}

template <class P>
float EdgeWidth(P* p, long)
{
  return p->GetLineWidth();
}

RtvProperty PropertyOf(vtkProperty* p)
{
  RtvProperty out = {};
  CopyColor(p->GetAmbientColor(), out.ambient_color);
  CopyColor(p->GetDiffuseColor(), out.diffuse_color);
  CopyColor(p->GetSpecularColor(), out.specular_color);
  out.ambient = static_cast<float>(p->GetAmbient());
  out.diffuse = static_cast<float>(p->GetDiffuse());
  out.specular = static_cast<float>(p->GetSpecular());
  out.specular_power = static_cast<float>(p->GetSpecularPower());
  out.opacity = static_cast<float>(p->GetOpacity());
  out.metallic = static_cast<float>(p->GetMetallic());
  out.roughness = static_cast<float>(p->GetRoughness());
  out.base_ior = static_cast<float>(p->GetBaseIOR());
  out.flat = p->GetInterpolation() == VTK_FLAT;
  out.lighting = p->GetLighting() ? 1 : 0;
  out.pbr = p->GetInterpolation() == VTK_PBR;
  out.cull_front = p->GetFrontfaceCulling() ? 1 : 0;
  out.cull_back = p->GetBackfaceCulling() ? 1 : 0;
  CopyColor(p->GetEdgeColor(), out.edge_color);
  // OpenGL's lines are never thinner than this.
  const bool edges = p->GetEdgeVisibility() && p->GetRepresentation() == VTK_SURFACE;
  out.edge_width = edges ? std::max(1.1f, EdgeWidth(p, 0)) : 0.0f;
  return out;
}

// Clipping planes are given in world coordinates; a plane with normal n through o keeps n (M x - o)
// >= 0.
void AddClipPlanes(Actor& a, RtvPending& pending)
{
  vtkPlaneCollection* planes = a.Mapper->GetClippingPlanes();
  const int count = planes ? planes->GetNumberOfItems() : 0;
  if (count == 0)
  {
    return;
  }
  double* out = pending.Keep.Doubles(4 * count);
  for (int i = 0; i < count; ++i)
  {
    vtkPlane* plane = planes->GetItem(i);
    double world[4];
    plane->GetNormal(world);
    const double* origin = plane->GetOrigin();
    world[3] = -(world[0] * origin[0] + world[1] * origin[1] + world[2] * origin[2]);
    for (int column = 0; column < 4; ++column)
    {
      out[4 * i + column] = 0.0;
      for (int row = 0; row < 4; ++row)
      {
        out[4 * i + column] += world[row] * a.Matrix->GetElement(row, column);
      }
    }
  }
  pending.Surface.clip_planes = RtvArray{ out, static_cast<uint64_t>(count), 4, RTV_F64 };
  for (int i = 0; i < 4 * count; ++i)
  {
    pending.Surface.shape_key = rtvMix(pending.Surface.shape_key, out[i]);
  }
}

// Prepares the surface of one data set for the bridge.
const char* AddPolyData(Actor& a, vtkPolyData* data, const BlockState& block, const std::string& blockName)
{
  const bool others = data->GetNumberOfVerts() + data->GetNumberOfLines() > 0;
  const bool polygons = data->GetNumberOfPolys() + data->GetNumberOfStrips() > 0;
  RtvSurfaceFacts facts = {};
  facts.representation = static_cast<uint32_t>(a.Prop->GetProperty()->GetRepresentation());
  facts.num_verts = static_cast<uint64_t>(data->GetNumberOfVerts());
  facts.num_lines = static_cast<uint64_t>(data->GetNumberOfLines());
  if (const char* reason = rtvApi->check_surface(a.Bridge, &facts))
  {
    return reason;
  }
  if (data->GetNumberOfPoints() == 0 || (!polygons && !others && !a.Points))
  {
    return nullptr;
  }
  a.Batch.emplace_back(new RtvPending);
  RtvPending& pending = *a.Batch.back();
  RtvSurface& s = pending.Surface;
  RtvKeep& keep = pending.Keep;
  pending.Name = blockName.empty() ? a.Name : a.Name + ", block " + blockName;
  s.property = PropertyOf(a.Prop->GetProperty());
  s.property.opacity = static_cast<float>(block.Opacity);
  if (block.HasColor)
  {
    CopyColor(block.Color, s.property.ambient_color);
    CopyColor(block.Color, s.property.diffuse_color);
  }
  std::copy(&a.Matrix->Element[0][0], &a.Matrix->Element[0][0] + 16, s.world_from_data);
  if (vtkProperty* back = a.Prop->GetBackfaceProperty())
  {
    // The back face has the shading model of the front face.
    s.has_back = 1;
    s.back = s.property;
    const RtvProperty own = PropertyOf(back);
    memcpy(&s.back, &own, offsetof(RtvProperty, metallic));
    s.back.opacity = 1.0f;
    if (block.HasColor)
    {
      // A block's colour is that of both sides.
      CopyColor(block.Color, s.back.ambient_color);
      CopyColor(block.Color, s.back.diffuse_color);
      s.back.ambient = s.property.ambient;
      s.back.diffuse = s.property.diffuse;
    }
  }
  s.point_radius = a.PointRadius;
  s.line_radius = a.LineRadius;
  s.edges_only = a.Edges ? 1 : 0;
  if (!rtvAddShape(s, data, a.Points, keep, facts))
  {
    return rtvApi->check_surface(a.Bridge, &facts);
  }
  AddClipPlanes(a, pending);
  if (!block.HasColor || ScalarsOverBlocks)
  {
    rtvAddColors(a.Bridge, s, a.Mapper, data, keep);
  }
  if (s.has_back && s.color_source != RTV_COLOR_PROPERTY)
  {
    // Colours of points and cells are visible on both sides.
    s.has_back = 0;
  }
  vtkTexture* texture = a.Prop->GetTexture();
  if (vtkTexture* own = a.Prop->GetProperty()->GetTexture("albedoTex"))
  {
    texture = own;
    // The texture's alpha replaces the opacity.
    s.property.opacity = 1.0f;
  }
  s.maps = rtvMapsOf(s, a.Prop->GetProperty(), pending.Maps, keep);
  facts.edges = s.property.edge_width > 0.0f ? 1 : 0;
  facts.texture = texture ? 1 : 0;
  facts.maps = s.maps ? 1 : 0;
  facts.has_back = s.has_back;
  facts.color_source = s.color_source;
  if (const char* reason = rtvApi->check_surface(a.Bridge, &facts))
  {
    return reason;
  }
  if (texture)
  {
    rtvAddTexture(s, texture, keep);
  }
  return nullptr;
}

// The attributes of a mapper's blocks; null for mappers that have none.
vtkCompositeDataDisplayAttributes* BlockAttributes(vtkMapper* mapper)
{
#if VTK_VERSION_NUMBER >= VTK_VERSION_CHECK(9, 3, 0)
  if (auto composite = vtkCompositePolyDataMapper::SafeDownCast(mapper))
  {
    return composite->GetCompositeDataDisplayAttributes();
  }
#endif
#if __has_include(<vtkCompositePolyDataMapper2.h>)
  if (auto composite = vtkCompositePolyDataMapper2::SafeDownCast(mapper))
  {
    return composite->GetCompositeDataDisplayAttributes();
  }
#endif
  return nullptr;
}

const char* AddTree(Actor& a, vtkDataObject* data, BlockState block, const std::string& name)
{
  if (!data)
  {
    return nullptr;
  }
  if (vtkCompositeDataDisplayAttributes* attributes = a.Attributes)
  {
    // The properties of a block apply to all blocks below it until one overrides them.
    if (attributes->HasBlockVisibility(data))
    {
      block.Visible = attributes->GetBlockVisibility(data);
    }
    if (attributes->HasBlockOpacity(data))
    {
      block.Opacity = attributes->GetBlockOpacity(data);
    }
    if (attributes->HasBlockColor(data))
    {
      block.HasColor = true;
      attributes->GetBlockColor(data, block.Color);
    }
  }
  const char* reason = nullptr;
  auto child = [&](vtkDataObject* of, unsigned int i, vtkInformation* meta) {
    const char* own = meta && meta->Has(vtkCompositeDataSet::NAME()) ? meta->Get(vtkCompositeDataSet::NAME()) : nullptr;
    const std::string part = own ? own : std::to_string(i);
    if (!reason)
    {
      reason = AddTree(a, of, block, name.empty() ? part : name + "/" + part);
    }
  };
  if (auto polydata = vtkPolyData::SafeDownCast(data))
  {
    return block.Visible ? AddPolyData(a, polydata, block, name) : nullptr;
  }
  if (auto blocks = vtkMultiBlockDataSet::SafeDownCast(data))
  {
    for (unsigned int i = 0; i < blocks->GetNumberOfBlocks(); ++i)
    {
      child(blocks->GetBlock(i), i, blocks->HasMetaData(i) ? blocks->GetMetaData(i) : nullptr);
    }
    return reason;
  }
  if (auto parts = vtkPartitionedDataSet::SafeDownCast(data))
  {
    for (unsigned int i = 0; i < parts->GetNumberOfPartitions(); ++i)
    {
      child(parts->GetPartitionAsDataObject(i), i, nullptr);
    }
    return reason;
  }
  if (auto sets = vtkPartitionedDataSetCollection::SafeDownCast(data))
  {
    for (unsigned int i = 0; i < sets->GetNumberOfPartitionedDataSets(); ++i)
    {
      child(sets->GetPartitionedDataSet(i), i, sets->HasMetaData(i) ? sets->GetMetaData(i) : nullptr);
    }
    return reason;
  }
  RtvSurfaceFacts facts = {};
  facts.not_polygons = 1;
  return rtvApi->check_surface(a.Bridge, &facts);
}

// What blocks may have of their own since VTK 9.3, which is not followed. The overload with `long`
// is for versions without.
template <class A>
auto HasScalarsOfBlocks(const A* a, int) -> decltype(a->HasBlockScalarVisibilities())
{
  return a->HasBlockScalarVisibilities() || a->HasBlockUseLookupTableScalarRanges() ||
    a->HasBlockInterpolateScalarsBeforeMappings() || a->HasBlockColorModes() || a->HasBlockScalarModes() ||
    a->HasBlockArrayAccessModes() || a->HasBlockArrayComponents() || a->HasBlockArrayIds() || a->HasBlockArrayNames() ||
    a->HasBlockScalarRanges() || a->HasBlockLookupTables() || a->HasBlockFieldDataTupleIds();
}

template <class A>
bool HasScalarsOfBlocks(const A*, long)
{
  return false;
}

// Textures of blocks, since VTK 9.7.
template <class A>
auto HasTexturesOfBlocks(const A* a, int) -> decltype(a->HasBlockTextures())
{
  return a->HasBlockTextures();
}

template <class A>
bool HasTexturesOfBlocks(const A*, long)
{
  return false;
}

RtvActorFacts FactsOf(vtkRenderer* renderer, vtkActor* actor, vtkMapper* mapper)
{
  RtvActorFacts facts = {};
  facts.actor_class = actor->GetClassName();
  facts.mapper_class = mapper->GetClassName();
  vtkProperty* p = actor->GetProperty();
  facts.representation = static_cast<uint32_t>(p->GetRepresentation());
  facts.pbr = p->GetInterpolation() == VTK_PBR ? 1 : 0;
  facts.edge_visibility = p->GetEdgeVisibility() ? 1 : 0;
  facts.edge_opacity = EdgeOpacity(p, 0);
  facts.lines_as_tubes = p->GetRenderLinesAsTubes() ? 1 : 0;
  facts.vertex_visibility = p->GetVertexVisibility() ? 1 : 0;
  vtkProperty* back = actor->GetBackfaceProperty();
  facts.has_back = back ? 1 : 0;
  facts.back_opacity = back ? back->GetOpacity() : 1.0;
  // It may look at all colours, so only where it matters.
  facts.translucent = (facts.edge_visibility || back) && actor->HasTranslucentPolygonalGeometry() ? 1 : 0;
  vtkPlaneCollection* planes = mapper->GetClippingPlanes();
  facts.num_clipping_planes = planes ? static_cast<uint32_t>(planes->GetNumberOfItems()) : 0;
  facts.coat_strength = p->GetCoatStrength();
  facts.anisotropy = p->GetAnisotropy();
  facts.metallic = p->GetMetallic();
  std::copy(p->GetEdgeTint(), p->GetEdgeTint() + 3, facts.edge_tint);
  vtkShaderProperty* shader = actor->GetShaderProperty();
  facts.shader_code = shader &&
      (shader->HasFragmentShaderCode() || shader->HasVertexShaderCode() || shader->GetNumberOfShaderReplacements() > 0)
    ? 1
    : 0;
  facts.glyphs = mapper->IsA("vtkGlyph3DMapper") ? 1 : 0;
  facts.texture = rtvTextureBits(actor->GetTexture());
  if (facts.texture && !p->GetShowTexturesOnBackface())
  {
    facts.texture |= RTV_TEXTURE_FRONT_ONLY;
  }
  double factor = 0.0, units = 0.0;
  if (vtkMapper::GetResolveCoincidentTopology() == VTK_RESOLVE_POLYGON_OFFSET)
  {
    mapper->GetCoincidentTopologyPolygonOffsetParameters(factor, units);
  }
  facts.image_lighting = renderer->GetUseImageBasedLighting() && renderer->GetEnvironmentTexture() ? 1 : 0;
  facts.polygon_offset = factor != 0.0 || units != 0.0 ? 1 : 0;
  const vtkCompositeDataDisplayAttributes* blocks = BlockAttributes(mapper);
  facts.block_scalars = blocks && (HasScalarsOfBlocks(blocks, 0) || HasTexturesOfBlocks(blocks, 0)) ? 1 : 0;
  facts.num_textures = static_cast<uint32_t>(p->GetAllTextures().size());
  facts.albedo = rtvTextureBits(p->GetTexture("albedoTex"));
  facts.material = rtvTextureBits(p->GetTexture("materialTex"));
  facts.normal = rtvTextureBits(p->GetTexture("normalTex"));
  facts.emissive = rtvTextureBits(p->GetTexture("emissiveTex"));
  return facts;
}
}

vtkDataSet* RtvExtractor::SurfaceOf(vtkMapper* mapper, vtkDataSet* data)
{
  Kept& kept = this->Filters[mapper];
  if (!kept.Filter)
  {
    kept.Filter = vtkSmartPointer<vtkDataSetSurfaceFilter>::New();
  }
  kept.Used = true;
  // The input of a pipeline would be updated twice; the data's own modification time suffices.
  kept.Filter->SetInputData(data);
  kept.Filter->Update();
  return kept.Filter->GetOutput();
}

void RtvExtractor::EndFrame()
{
  for (auto it = this->Filters.begin(); it != this->Filters.end();)
  {
    it = it->second.Used ? (it->second.Used = false, std::next(it)) : this->Filters.erase(it);
  }
}

bool RtvExtractor::Add(RtvBridge* bridge, vtkRenderer* renderer, vtkProp* prop, int number)
{
  Actor a;
  a.Bridge = bridge;
  a.PointRadius = rtvApi->bridge_option(bridge, "RTV_POINT_RADIUS");
  a.LineRadius = rtvApi->bridge_option(bridge, "RTV_LINE_RADIUS");
  a.Name = std::string(prop->GetClassName()) + " " + std::to_string(number);
  auto pass = [&](const char* reason) {
    rtvApi->pass(bridge, a.Name.c_str(), reason);
    return false;
  };
  if (auto volume = vtkVolume::SafeDownCast(prop))
  {
    const char* reason = rtvAddVolume(bridge, volume, renderer, a.Name);
    if (reason)
    {
      rtvApi->warn(bridge, (a.Name + ": " + reason + "; OpenGL draws it").c_str());
    }
    return reason ? pass(reason) : true;
  }
  a.Prop = vtkActor::SafeDownCast(prop);
  a.Mapper = a.Prop ? a.Prop->GetMapper() : nullptr;
  RtvActorFacts facts = a.Mapper ? FactsOf(renderer, a.Prop, a.Mapper) : RtvActorFacts{};
  // Refuses everything without a mapper.
  if (const char* reason = rtvApi->check_actor(bridge, &facts))
  {
    return pass(reason);
  }
  if (!a.Mapper->GetStatic() && a.Mapper->GetNumberOfInputConnections(0) > 0)
  {
    a.Mapper->Update();
  }
  vtkDataObject* data =
    a.Mapper->GetNumberOfInputConnections(0) > 0 ? a.Mapper->GetInputDataObject(0, 0) : nullptr;
  if (!data)
  {
    facts.no_data = 1;
    return pass(rtvApi->check_actor(bridge, &facts));
  }
  a.Points = a.Prop->GetProperty()->GetRepresentation() == VTK_POINTS;
  a.Edges = a.Prop->GetProperty()->GetRepresentation() == VTK_WIREFRAME;
  a.Matrix = a.Prop->GetMatrix();
  a.Attributes = BlockAttributes(a.Mapper);
  if (auto glyphs = vtkGlyph3DMapper::SafeDownCast(a.Mapper))
  {
    const char* reason = rtvAddGlyphs(bridge, a.Prop, glyphs, data, PropertyOf(a.Prop->GetProperty()), a.Name);
    return reason ? pass(reason) : true;
  }
  vtkDataSet* set = vtkDataSet::SafeDownCast(data);
  if (set && !vtkPolyData::SafeDownCast(data))
  {
    data = this->SurfaceOf(a.Mapper, set);
  }
  BlockState root;
  root.Opacity = a.Prop->GetProperty()->GetOpacity();
  // Checks all blocks before any is passed on.
  const char* reason = AddTree(a, data, root, "");
  reason = reason ? reason : rtvCommit(bridge, a.Batch);
  return reason ? pass(reason) : true;
}
