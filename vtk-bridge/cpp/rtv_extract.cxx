// Converts props to surfaces: decides which are traced, and why the others are not.
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
#include <vtkCompositePolyDataMapper2.h>
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

struct Actor
{
  RtvBridge* Bridge;
  vtkActor* Prop;
  vtkMapper* Mapper;
  vtkMatrix4x4* Matrix;
  vtkCompositeDataDisplayAttributes* Attributes = nullptr;
  RtvBatch Batch;
  std::string Name;
  // Storage for a reason that is composed at run time.
  std::string Answer;
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
  out.edge_width = p->GetEdgeVisibility() && p->GetRepresentation() == VTK_SURFACE ? std::max(1.1f, p->GetLineWidth()) : 0.0f;
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

// Prepares the surface of one data set for the bridge. Returns why not, or null.
const char* AddPolyData(Actor& a, vtkPolyData* data, const BlockState& block, const std::string& blockName)
{
  const bool surface = !a.Edges && !a.Points;
  const bool others = data->GetNumberOfVerts() + data->GetNumberOfLines() > 0;
  const bool polygons = data->GetNumberOfPolys() + data->GetNumberOfStrips() > 0;
  if (surface && data->GetNumberOfVerts() > 0 && a.PointRadius <= 0.0)
  {
    return "it has vertices (set RTV_POINT_RADIUS to trace them as spheres)";
  }
  if (surface && data->GetNumberOfLines() > 0 && a.LineRadius <= 0.0)
  {
    return "it has lines (set RTV_LINE_RADIUS to trace them as tubes)";
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
  }
  s.point_radius = a.PointRadius;
  s.line_radius = a.LineRadius;
  s.edges_only = a.Edges ? 1 : 0;
  if (const char* reason = rtvAddShape(s, data, a.Points, keep, a.Answer))
  {
    return reason;
  }
  AddClipPlanes(a, pending);
  if (!block.HasColor)
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
  if (texture)
  {
    if (s.has_back)
    {
      return "a texture on a surface whose backs have a property of their own";
    }
    if (s.color_source != RTV_COLOR_PROPERTY)
    {
      return "it has a texture and colours";
    }
    rtvAddTexture(s, texture, keep);
  }
  s.maps = rtvMapsOf(s, a.Prop->GetProperty(), pending.Maps, keep);
  if (s.maps && s.has_back)
  {
    return "textures of the property on a surface whose backs have a property of their own";
  }
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
  return "its data are not polygons";
}

// Why OpenGL has to draw an actor, as far as the actor's own properties decide; null if it can be
// traced.
const char* WhyNot(vtkActor* actor, vtkMapper* mapper, double pointRadius, double lineRadius)
{
  static const char* const known[] = { "vtkActor", "vtkOpenGLActor", "vtkPVLODActor", "vtkLODActor", "vtkQuadricLODActor" };
  bool plain = false;
  for (const char* name : known)
  {
    plain = plain || !strcmp(actor->GetClassName(), name);
  }
  if (!plain)
  {
    return "OpenGL draws props of this class";
  }
  vtkProperty* property = actor->GetProperty();
  if (property->GetRepresentation() == VTK_WIREFRAME && lineRadius <= 0.0)
  {
    return "wireframe (set RTV_LINE_RADIUS to trace edges as tubes)";
  }
  if (property->GetRepresentation() == VTK_POINTS && pointRadius <= 0.0)
  {
    return "points (set RTV_POINT_RADIUS to trace them as spheres)";
  }
  if (property->GetRepresentation() == VTK_SURFACE && property->GetEdgeVisibility())
  {
    if (property->GetRenderLinesAsTubes())
    {
      return "edges as shaded tubes on the surface";
    }
    if (actor->HasTranslucentPolygonalGeometry())
    {
      return "edges on a translucent surface";
    }
    if (mapper->GetClippingPlanes() && mapper->GetClippingPlanes()->GetNumberOfItems() > 0)
    {
      return "edges on a clipped surface";
    }
  }
  if (property->GetRepresentation() == VTK_SURFACE && property->GetVertexVisibility())
  {
    return "vertices on the surface";
  }
  if (vtkProperty* back = actor->GetBackfaceProperty())
  {
    if (actor->HasTranslucentPolygonalGeometry() || back->GetOpacity() < 1.0)
    {
      return "translucent backs with a property of their own";
    }
    if (mapper->IsA("vtkGlyph3DMapper"))
    {
      return "glyphs whose backs have a property of their own";
    }
  }
  if (property->GetInterpolation() == VTK_PBR)
  {
    const double* tint = property->GetEdgeTint();
    if (property->GetCoatStrength() > 0.0 || property->GetAnisotropy() != 0.0)
    {
      return "a clear coat or anisotropy";
    }
    if (property->GetMetallic() > 0.0 && (tint[0] != 1.0 || tint[1] != 1.0 || tint[2] != 1.0))
    {
      return "a metal with an edge tint";
    }
  }
  for (const auto& texture : property->GetAllTextures())
  {
    static const char* const known[] = { "albedoTex", "materialTex", "normalTex", "emissiveTex" };
    const auto same = [&](const char* name) { return texture.first == name; };
    if (std::none_of(std::begin(known), std::end(known), same))
    {
      return "textures of the property for coats or anisotropy, or of a program's own shader";
    }
    if (mapper->IsA("vtkGlyph3DMapper") && texture.first != known[0])
    {
      return "glyphs with textures of the property other than its base colour";
    }
    if (actor->GetTexture())
    {
      return "a texture and a texture of the property";
    }
    if (property->GetInterpolation() != VTK_PBR)
    {
      return "textures of the property without physically based shading";
    }
    if (const char* reason = rtvTextureReason(texture.second))
    {
      return reason;
    }
  }
  vtkShaderProperty* shader = actor->GetShaderProperty();
  if (shader && (shader->HasFragmentShaderCode() || shader->HasVertexShaderCode() || shader->GetNumberOfShaderReplacements() > 0))
  {
    return "shader code of its own";
  }
  if (vtkTexture* texture = actor->GetTexture())
  {
    if (const char* reason = rtvTextureReason(texture))
    {
      return reason;
    }
  }
  static const char* const mappers[] = { "vtkPolyDataMapper", "vtkOpenGLPolyDataMapper", "vtkCompositePolyDataMapper",
    "vtkCompositePolyDataMapper2", "vtkDataSetMapper", "vtkGlyph3DMapper", "vtkOpenGLGlyph3DMapper" };
  for (const char* name : mappers)
  {
    if (!strcmp(mapper->GetClassName(), name))
    {
      return nullptr;
    }
  }
  return "OpenGL draws mappers of this class";
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
  a.Prop = vtkActor::SafeDownCast(prop);
  a.Mapper = a.Prop ? a.Prop->GetMapper() : nullptr;
  if (!a.Mapper)
  {
    if (auto volume = vtkVolume::SafeDownCast(prop))
    {
      std::string answer;
      const char* reason = rtvAddVolume(bridge, volume, renderer, a.Name, answer);
      if (reason)
      {
        rtvApi->warn(bridge, (a.Name + ": " + reason + "; OpenGL draws it").c_str());
      }
      return reason ? pass(reason) : true;
    }
    return pass("OpenGL draws props of this class");
  }
  if (const char* reason = WhyNot(a.Prop, a.Mapper, a.PointRadius, a.LineRadius))
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
    return pass("no data");
  }
  a.Points = a.Prop->GetProperty()->GetRepresentation() == VTK_POINTS;
  a.Edges = a.Prop->GetProperty()->GetRepresentation() == VTK_WIREFRAME;
  a.Matrix = a.Prop->GetMatrix();
  if (auto composite = vtkCompositePolyDataMapper2::SafeDownCast(a.Mapper))
  {
    a.Attributes = composite->GetCompositeDataDisplayAttributes();
  }
  if (auto glyphs = vtkGlyph3DMapper::SafeDownCast(a.Mapper))
  {
    const char* reason = rtvAddGlyphs(bridge, a.Prop, glyphs, data, PropertyOf(a.Prop->GetProperty()), a.Name, a.Answer);
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
