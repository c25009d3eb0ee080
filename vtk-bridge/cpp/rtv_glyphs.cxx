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
// The glyph sources by index. Returns why not, or null.
const char* Sources(vtkGlyph3DMapper* mapper, std::vector<vtkPolyData*>& sources)
{
  const int count = mapper->GetSourceIndexing() ? mapper->GetNumberOfInputConnections(1)
                                                : std::min(mapper->GetNumberOfInputConnections(1), 1);
  if (count == 0)
  {
    return "glyphs without a source";
  }
  for (int i = 0; i < count; ++i)
  {
    mapper->GetInputAlgorithm(1, i)->Update();
    vtkPolyData* source = vtkPolyData::SafeDownCast(mapper->GetInputDataObject(1, i));
    if (!source || source->GetNumberOfPolys() + source->GetNumberOfStrips() == 0 ||
      source->GetNumberOfLines() + source->GetNumberOfVerts() > 0)
    {
      return "glyphs whose source is not polygons";
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

const char* AddGlyphsOf(RtvBatch& batch, std::string& answer, vtkActor* actor, vtkGlyph3DMapper* mapper, vtkDataSet* data,
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
    if (colors && (cellFlag != 0 || colors->GetNumberOfComponents() != 4))
    {
      return "glyphs with colours that are not of points";
    }
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
    if (const char* reason = rtvAddShape(s, sources[which], false, pending.Keep, answer))
    {
      return reason;
    }
    s.glyph_matrices = RtvArray{ matrices.data(), matrices.size() / 16, 16, RTV_F64 };
    s.glyph_colors =
      rgba.empty() ? RtvArray{ nullptr, 0, 0, RTV_NONE } : RtvArray{ rgba.data(), rgba.size() / 4, 4, RTV_U8 };
  }
  return nullptr;
}
}

const char* rtvAddGlyphs(RtvBridge* bridge, vtkActor* actor, vtkGlyph3DMapper* mapper, vtkDataObject* input,
  const RtvProperty& property, const std::string& name, std::string& answer)
{
  if (mapper->GetUseSourceTableTree())
  {
    return "glyphs from a tree of sources";
  }
  if (mapper->GetClippingPlanes() && mapper->GetClippingPlanes()->GetNumberOfItems() > 0)
  {
    return "glyphs with clipping planes";
  }
  std::vector<vtkPolyData*> sources;
  if (const char* reason = Sources(mapper, sources))
  {
    return reason;
  }
  RtvBatch batch;
  if (auto data = vtkDataSet::SafeDownCast(input))
  {
    const char* reason = AddGlyphsOf(batch, answer, actor, mapper, data, sources, property, name);
    return reason ? reason : rtvCommit(bridge, batch);
  }
  auto composite = vtkCompositeDataSet::SafeDownCast(input);
  vtkCompositeDataDisplayAttributes* blocks = mapper->GetBlockAttributes();
  if (!composite || (blocks && (blocks->HasBlockVisibilities() || blocks->HasBlockColors() || blocks->HasBlockOpacities())))
  {
    return "glyphs on blocks with colours or visibility of their own";
  }
  auto it = vtkSmartPointer<vtkCompositeDataIterator>::Take(composite->NewIterator());
  const char* reason = nullptr;
  for (it->InitTraversal(); !it->IsDoneWithTraversal() && !reason; it->GoToNextItem())
  {
    auto leaf = vtkDataSet::SafeDownCast(it->GetCurrentDataObject());
    reason = leaf ? AddGlyphsOf(batch, answer, actor, mapper, leaf, sources, property, name)
                  : "glyphs on data without points";
  }
  return reason ? reason : rtvCommit(bridge, batch);
}
