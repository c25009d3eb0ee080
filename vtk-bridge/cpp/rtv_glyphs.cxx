// Glyphs as instances. Recomputes the matrices that vtkGlyph3DMapper makes for OpenGL, because it
// does not expose them.
#include "rtv_arrays.h"

#include <algorithm>
#include <cmath>
#include <vtkActor.h>
#include <vtkBitArray.h>
#include <vtkCompositeDataDisplayAttributes.h>
#include <vtkCompositeDataIterator.h>
#include <vtkCompositeDataSet.h>
#include <vtkDataArray.h>
#include <vtkDataSet.h>
#include <vtkGlyph3DMapper.h>
#include <vtkInformation.h>
#include <vtkMath.h>
#include <vtkMatrix4x4.h>
#include <vtkPlaneCollection.h>
#include <vtkPointData.h>
#include <vtkPolyData.h>
#include <vtkTransform.h>
#include <vtkUnsignedCharArray.h>

namespace
{
vtkDataArray* InputArray(vtkGlyph3DMapper* mapper, int index, vtkDataSet* data)
{
  vtkInformation* info = mapper->GetInputArrayInformation(index);
  vtkPointData* arrays = data->GetPointData();
  if (info->Has(vtkDataObject::FIELD_NAME()))
  {
    return arrays->GetArray(info->Get(vtkDataObject::FIELD_NAME()));
  }
  if (info->Has(vtkDataObject::FIELD_ATTRIBUTE_TYPE()))
  {
    return vtkDataArray::SafeDownCast(arrays->GetAbstractAttribute(info->Get(vtkDataObject::FIELD_ATTRIBUTE_TYPE())));
  }
  return nullptr;
}

// The rotation of one glyph, as vtkGlyph3DMapper documents it.
void Rotate(vtkTransform* transform, int mode, vtkDataArray* array, vtkIdType i)
{
  double o[4] = { 0.0, 0.0, 0.0, 0.0 };
  array->GetTuple(i, o);
  if (mode == vtkGlyph3DMapper::ROTATION)
  {
    transform->RotateZ(o[2]);
    transform->RotateX(o[0]);
    transform->RotateY(o[1]);
  }
  else if (mode == vtkGlyph3DMapper::DIRECTION)
  {
    if (o[1] == 0.0 && o[2] == 0.0)
    {
      if (o[0] < 0.0)
      {
        transform->RotateY(180.0);
      }
    }
    else
    {
      const double length = vtkMath::Norm(o);
      transform->RotateWXYZ(180.0, (o[0] + length) / 2.0, o[1] / 2.0, o[2] / 2.0);
    }
  }
  else
  {
    const double angle = vtkMath::DegreesFromRadians(2.0 * std::acos(std::max(-1.0, std::min(1.0, o[0]))));
    transform->RotateWXYZ(angle, o[1], o[2], o[3]);
  }
}

void Scale(vtkGlyph3DMapper* mapper, vtkDataArray* array, vtkIdType i, double scale[3])
{
  std::fill(scale, scale + 3, 1.0);
  const int mode = array ? mapper->GetScaleMode() : static_cast<int>(vtkGlyph3DMapper::NO_DATA_SCALING);
  if (mode == vtkGlyph3DMapper::SCALE_BY_MAGNITUDE)
  {
    double sum = 0.0;
    for (int c = 0; c < array->GetNumberOfComponents(); ++c)
    {
      sum += array->GetComponent(i, c) * array->GetComponent(i, c);
    }
    const double magnitude = array->GetNumberOfComponents() == 1 ? array->GetComponent(i, 0) : std::sqrt(sum);
    std::fill(scale, scale + 3, magnitude);
  }
  else if (mode == vtkGlyph3DMapper::SCALE_BY_COMPONENTS && array->GetNumberOfComponents() == 3)
  {
    array->GetTuple(i, scale);
  }
  if (mapper->GetClamping() && mode != vtkGlyph3DMapper::NO_DATA_SCALING)
  {
    const double* range = mapper->GetRange();
    const double width = range[1] != range[0] ? range[1] - range[0] : 1.0;
    for (int c = 0; c < 3; ++c)
    {
      scale[c] = (std::max(range[0], std::min(range[1], scale[c])) - range[0]) / width;
    }
  }
  for (int c = 0; c < 3; ++c)
  {
    scale[c] = mapper->GetScaling() ? scale[c] * mapper->GetScaleFactor() : 1.0;
    scale[c] = scale[c] == 0.0 ? 1.0e-10 : scale[c];
  }
}

// The sources by number, as far as the bridge can trace them.
const char* Sources(
  RtvBridge* bridge, vtkGlyph3DMapper* mapper, RtvGlyphFacts& facts, std::vector<vtkPolyData*>& sources)
{
  for (uint32_t i = 0; i < facts.num_sources; ++i)
  {
    mapper->GetInputAlgorithm(1, static_cast<int>(i))->Update();
    vtkPolyData* source = vtkPolyData::SafeDownCast(mapper->GetInputDataObject(1, static_cast<int>(i)));
    facts.has_source = 1;
    facts.num_source_polygons = source ? source->GetNumberOfPolys() + source->GetNumberOfStrips() : 0;
    facts.num_other_source_cells = source ? source->GetNumberOfLines() + source->GetNumberOfVerts() : 0;
    if (const char* reason = rtvApi->check_glyphs(bridge, &facts))
    {
      return reason;
    }
    sources.push_back(source);
  }
  return nullptr;
}

// Index of the source of a glyph.
size_t SourceOf(vtkDataArray* index, vtkIdType i, size_t count)
{
  if (!index)
  {
    return 0;
  }
  double sum = 0.0;
  for (int c = 0; c < index->GetNumberOfComponents(); ++c)
  {
    sum += index->GetComponent(i, c) * index->GetComponent(i, c);
  }
  const double value = std::sqrt(sum);
  return value >= static_cast<double>(count) ? count - 1 : static_cast<size_t>(value);
}

const char* AddGlyphsOf(RtvBridge* bridge, RtvBatch& batch, RtvGlyphFacts& facts, vtkActor* actor, vtkGlyph3DMapper* mapper, vtkDataSet* data,
  const std::vector<vtkPolyData*>& sources, const RtvProperty& property, const std::string& name)
{
  vtkDataArray* scales = InputArray(mapper, vtkGlyph3DMapper::SCALE, data);
  vtkDataArray* directions = mapper->GetOrient() ? InputArray(mapper, vtkGlyph3DMapper::ORIENTATION, data) : nullptr;
  // VTK accepts nothing else as a mask.
  vtkBitArray* mask =
    mapper->GetMasking() ? vtkBitArray::SafeDownCast(InputArray(mapper, vtkGlyph3DMapper::MASK, data)) : nullptr;
  vtkUnsignedCharArray* colors = nullptr;
  int cellFlag = 0;
  if (mapper->GetScalarVisibility())
  {
    mapper->ClearColorArrays();
    colors = mapper->MapScalars(data, 1.0, cellFlag);
  }
  facts.has_colors = colors ? 1 : 0;
  facts.color_components = colors ? static_cast<uint32_t>(colors->GetNumberOfComponents()) : 0;
  facts.num_colors = colors ? static_cast<uint64_t>(colors->GetNumberOfTuples()) : 0;
  facts.num_points = static_cast<uint64_t>(data->GetNumberOfPoints());
  if (const char* reason = rtvApi->check_glyphs(bridge, &facts))
  {
    return reason;
  }

  vtkDataArray* index =
    mapper->GetSourceIndexing() ? InputArray(mapper, vtkGlyph3DMapper::SOURCE_INDEX, data) : nullptr;
  std::vector<std::vector<double>> matricesOf(sources.size());
  std::vector<std::vector<unsigned char>> rgbaOf(sources.size());
  auto transform = vtkSmartPointer<vtkTransform>::New();
  for (vtkIdType i = 0; i < data->GetNumberOfPoints(); ++i)
  {
    if (mask && mask->GetComponent(i, 0) == 0.0)
    {
      continue;
    }
    double point[3], scale[3];
    data->GetPoint(i, point);
    Scale(mapper, scales, i, scale);
    transform->Identity();
    transform->Translate(point);
    if (directions)
    {
      Rotate(transform, mapper->GetOrientationMode(), directions, i);
    }
    transform->Scale(scale);
    const double* m = &transform->GetMatrix()->Element[0][0];
    const size_t which = SourceOf(index, i, sources.size());
    std::vector<double>& matrices = matricesOf[which];
    std::vector<unsigned char>& rgba = rgbaOf[which];
    matrices.insert(matrices.end(), m, m + 16);
    if (colors)
    {
      const unsigned char* c = colors->GetPointer(4 * i);
      rgba.insert(rgba.end(), c, c + 4);
    }
  }

  for (size_t which = 0; which < sources.size(); ++which)
  {
    if (matricesOf[which].empty())
    {
      continue;
    }
    batch.emplace_back(new RtvPending);
    RtvPending& pending = *batch.back();
    const std::vector<double>& matrices = pending.Matrices = std::move(matricesOf[which]);
    const std::vector<unsigned char>& rgba = pending.Colors = std::move(rgbaOf[which]);
    RtvSurface& s = pending.Surface;
    pending.Name = sources.size() > 1 ? name + ", source " + std::to_string(which) : name;
    s.property = property;
    const double* m = &actor->GetMatrix()->Element[0][0];
    std::copy(m, m + 16, s.world_from_data);
    RtvSurfaceFacts shape = {};
    if (!rtvAddShape(s, sources[which], false, pending.Keep, shape))
    {
      return rtvApi->check_surface(bridge, &shape);
    }
    s.glyph_matrices = RtvArray{ matrices.data(), matrices.size() / 16, 16, RTV_F64 };
    s.glyph_colors =
      rgba.empty() ? RtvArray{ nullptr, 0, 0, RTV_NONE } : RtvArray{ rgba.data(), rgba.size() / 4, 4, RTV_U8 };
  }
  return nullptr;
}
}

const char* rtvAddGlyphs(RtvBridge* bridge, vtkActor* actor, vtkGlyph3DMapper* mapper, vtkDataObject* input,
  const RtvProperty& property, const std::string& name)
{
  const int connected = mapper->GetNumberOfInputConnections(1);
  vtkPlaneCollection* planes = mapper->GetClippingPlanes();
  vtkCompositeDataDisplayAttributes* blocks = mapper->GetBlockAttributes();
  RtvGlyphFacts facts = {};
  facts.source_table_tree = mapper->GetUseSourceTableTree() ? 1 : 0;
  facts.num_clipping_planes = planes ? static_cast<uint32_t>(planes->GetNumberOfItems()) : 0;
  facts.num_sources = static_cast<uint32_t>(mapper->GetSourceIndexing() ? connected : std::min(connected, 1));
  facts.block_attributes =
    blocks && (blocks->HasBlockVisibilities() || blocks->HasBlockColors() || blocks->HasBlockOpacities()) ? 1 : 0;
  std::vector<vtkDataSet*> leaves;
  if (auto data = vtkDataSet::SafeDownCast(input))
  {
    facts.data_set = 1;
    leaves.push_back(data);
  }
  else if (auto composite = vtkCompositeDataSet::SafeDownCast(input))
  {
    facts.composite = 1;
    auto it = vtkSmartPointer<vtkCompositeDataIterator>::Take(composite->NewIterator());
    for (it->InitTraversal(); !it->IsDoneWithTraversal(); it->GoToNextItem())
    {
      auto leaf = vtkDataSet::SafeDownCast(it->GetCurrentDataObject());
      facts.num_blocks_without_points += leaf ? 0 : 1;
      leaves.push_back(leaf);
    }
  }
  if (const char* reason = rtvApi->check_glyphs(bridge, &facts))
  {
    return reason;
  }
  std::vector<vtkPolyData*> sources;
  if (const char* reason = Sources(bridge, mapper, facts, sources))
  {
    return reason;
  }
  RtvBatch batch;
  for (vtkDataSet* leaf : leaves)
  {
    if (const char* reason = AddGlyphsOf(bridge, batch, facts, actor, mapper, leaf, sources, property, name))
    {
      return reason;
    }
  }
  return rtvCommit(bridge, batch);
}
