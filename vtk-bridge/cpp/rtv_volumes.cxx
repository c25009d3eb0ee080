// Passes volumes on uniform grids to the bridge: decides which of them rt-core can draw as VTK
// does, and why OpenGL draws the others.
#include "rtv_arrays.h"

#include <algorithm>
#include <cmath>
#include <vector>
#include <vtkColorTransferFunction.h>
#include <vtkCompositeDataIterator.h>
#include <vtkCompositeDataSet.h>
#include <vtkContourValues.h>
#include <vtkDataArray.h>
#include <vtkDataSet.h>
#include <vtkFloatArray.h>
#include <vtkGPUVolumeRayCastMapper.h>
#include <vtkImageData.h>
#include <vtkLight.h>
#include <vtkLightCollection.h>
#include <vtkMatrix3x3.h>
#include <vtkMatrix4x4.h>
#include <vtkPiecewiseFunction.h>
#include <vtkPlaneCollection.h>
#include <vtkSmartVolumeMapper.h>
#include <vtkUnsignedCharArray.h>
#include <vtkVersionMacros.h>
#include <vtkVolume.h>
#include <vtkVolumeMapper.h>
#include <vtkVolumeProperty.h>

namespace
{
// The number of entries of OpenGL's tables.
const int Entries = 1024;

const char* ClassReason(vtkVolume* volume, vtkVolumeMapper* mapper)
{
  if (strcmp(volume->GetClassName(), "vtkVolume") && strcmp(volume->GetClassName(), "vtkPVLODVolume"))
  {
    return "OpenGL draws volumes of this class";
  }
  static const char* const known[] = { "vtkSmartVolumeMapper", "vtkGPUVolumeRayCastMapper", "vtkOpenGLGPUVolumeRayCastMapper",
    "vtkFixedPointVolumeRayCastMapper", "vtkMultiBlockVolumeMapper" };
  for (const char* name : known)
  {
    if (mapper && !strcmp(mapper->GetClassName(), name))
    {
      return nullptr;
    }
  }
  return "OpenGL draws volume mappers of this class";
}

// The upper end of OpenGL's gradient-opacity table, as a fraction of the scalar range.
const double GradientRange = 0.25;

// RTV_BLEND_* of a mapper's blend mode, or -1.
int BlendOf(int mode)
{
  switch (mode)
  {
    case vtkVolumeMapper::COMPOSITE_BLEND:
      return RTV_BLEND_COMPOSITE;
    case vtkVolumeMapper::MAXIMUM_INTENSITY_BLEND:
      return RTV_BLEND_MAXIMUM;
    case vtkVolumeMapper::MINIMUM_INTENSITY_BLEND:
      return RTV_BLEND_MINIMUM;
    case vtkVolumeMapper::AVERAGE_INTENSITY_BLEND:
      return RTV_BLEND_AVERAGE;
    case vtkVolumeMapper::ADDITIVE_BLEND:
      return RTV_BLEND_ADDITIVE;
    case vtkVolumeMapper::ISOSURFACE_BLEND:
      return RTV_BLEND_ISOSURFACES;
    default:
      return -1;
  }
}

bool HasGradientOpacity(vtkVolumeProperty* property)
{
  return !property->GetDisableGradientOpacity(0) && property->HasGradientOpacity(0);
}

const char* BlendReason(int mode, vtkVolumeProperty* property)
{
  const int blend = BlendOf(mode);
  if (blend < 0)
  {
    return mode == vtkVolumeMapper::SLICE_BLEND ? "a volume with slice blending" : "a volume with a blend mode that is not known";
  }
  if (blend != RTV_BLEND_COMPOSITE && HasGradientOpacity(property))
  {
    return "a volume with gradient opacity and another blending than composite";
  }
  // OpenGL shades the largest scalar with the gradient at the end of the ray.
  if ((blend == RTV_BLEND_MAXIMUM || blend == RTV_BLEND_MINIMUM) && property->GetShade(0))
  {
    return "a shaded volume with maximum or minimum intensity blending";
  }
  return nullptr;
}

// The lights of shaded volumes.
struct Lights
{
  // Six numbers per light, as in RtvVolume; empty for one white headlight.
  std::vector<float> List;
  // Whether OpenGL uses its other formula, which applies unless there is exactly one headlight: no
  // ambient term, and different highlights.
  bool Several = false;
};

const char* ReadLights(vtkRenderer* renderer, Lights& out)
{
  vtkLightCollection* lights = renderer->GetLights();
  vtkCollectionSimpleIterator it;
  lights->InitTraversal(it);
  bool plain = true, colored = false;
  int on = 0;
  while (vtkLight* light = lights->GetNextLight(it))
  {
    if (!light->GetSwitch())
    {
      continue;
    }
    ++on;
    if (light->GetPositional())
    {
      return "a shaded volume under lights that have a place";
    }
    const double* color = light->GetDiffuseColor();
    const double* ambient = light->GetAmbientColor();
    const double* highlight = light->GetSpecularColor();
    const double strength = light->GetIntensity();
    // OpenGL handles a headlight of another strength like several lights.
    plain = plain && light->LightTypeIsHeadlight() && strength == 1.0;
    double from[3], to[3];
    light->GetTransformedPosition(from);
    light->GetTransformedFocalPoint(to);
    for (int c = 0; c < 3; ++c)
    {
      colored = colored || strength * color[c] != 1.0 || strength * highlight[c] != 1.0;
      if (ambient[c] != 0.0)
      {
        return "a shaded volume under lights with an ambient colour";
      }
      out.List.push_back(static_cast<float>(from[c] - to[c]));
    }
    for (int c = 0; c < 3; ++c)
    {
      out.List.push_back(static_cast<float>(strength * color[c]));
    }
  }
  if (on == 0)
  {
    return "a shaded volume without a light";
  }
  out.Several = on > 1 || !plain;
  if (on > 6)
  {
    return "a shaded volume under more than six lights";
  }
  if (!out.Several && colored)
  {
    // A single headlight is at the viewer, not directional.
    std::fill(out.List.begin(), out.List.begin() + 3, 0.0f);
  }
  else if (!out.Several)
  {
    out.List.clear();
  }
  return nullptr;
}

const char* MapperReason(vtkVolumeMapper* mapper)
{
  if (mapper->GetCropping())
  {
    return "a cropped volume";
  }
  if (mapper->GetClippingPlanes() && mapper->GetClippingPlanes()->GetNumberOfItems() > 0)
  {
    return "a volume with clipping planes";
  }
  if (auto gpu = vtkGPUVolumeRayCastMapper::SafeDownCast(mapper))
  {
    if (gpu->GetMaskInput())
    {
      return "a volume with a mask";
    }
#if VTK_VERSION_NUMBER >= VTK_VERSION_CHECK(9, 2, 0)
    if (gpu->GetGlobalIlluminationReach() > 0.0f || gpu->GetVolumetricScatteringBlending() > 0.0f)
    {
      return "a volume with shadows or scattering of its own";
    }
#endif
  }
  if (auto smart = vtkSmartVolumeMapper::SafeDownCast(mapper))
  {
    if (smart->GetVectorMode() != vtkSmartVolumeMapper::DISABLED)
    {
      return "a volume of vectors";
    }
#if VTK_VERSION_NUMBER >= VTK_VERSION_CHECK(9, 2, 0)
    if (smart->GetGlobalIlluminationReach() > 0.0f || smart->GetVolumetricScatteringBlending() > 0.0f)
    {
      return "a volume with shadows or scattering of its own";
    }
#endif
  }
  return nullptr;
}

const char* PropertyReason(vtkVolumeProperty* property)
{
  if (property->GetTransferFunctionMode() != vtkVolumeProperty::TF_1D)
  {
    return "a volume with a two-dimensional transfer function";
  }
  if (property->HasLabelGradientOpacity() || property->GetLabelColor(1) || property->GetLabelScalarOpacity(1))
  {
    return "a volume with labels";
  }
  return nullptr;
}

const char* AddGrid(RtvBridge* bridge, vtkVolumeMapper* mapper, vtkVolume* volume, vtkImageData* image, const Lights& lights,
  const std::string& name, std::string& answer)
{
  vtkVolumeProperty* property = volume->GetProperty();
  RtvVolume v = {};
  v.name = name.c_str();
  int extent[6], cellFlag = 0;
  image->GetExtent(extent);
  for (int axis = 0; axis < 3; ++axis)
  {
    v.dims[axis] = static_cast<uint32_t>(extent[2 * axis + 1] - extent[2 * axis] + 1);
    v.spacing[axis] = image->GetSpacing()[axis];
    if (extent[2 * axis + 1] <= extent[2 * axis])
    {
      return "a volume one point thick";
    }
  }
  if (image->HasAnyBlankPoints() || image->HasAnyBlankCells())
  {
    return "a volume with blanked parts";
  }
  vtkDataArray* scalars = vtkAbstractMapper::GetScalars(
    image, mapper->GetScalarMode(), mapper->GetArrayAccessMode(), mapper->GetArrayId(), mapper->GetArrayName(), cellFlag);
  if (!scalars || cellFlag != 0)
  {
    return scalars ? "a volume of cells' values" : "a volume without scalars";
  }
  if (scalars->GetNumberOfComponents() != 1)
  {
    return "a volume of several components";
  }

  // ---- Scalars, unless they are cached.
  RtvKeep keep;
  v.scalar_key = rtvMix(rtvMix(rtvMix(rtvMix(1469598103934665603ull, scalars), scalars->GetMTime()), v.dims), v.spacing);
  if (!rtvApi->has_volume(bridge, v.scalar_key))
  {
    uint32_t kind = RTV_NONE;
    switch (scalars->HasStandardMemoryLayout() ? scalars->GetDataType() : VTK_VOID)
    {
      case VTK_UNSIGNED_CHAR:
        kind = RTV_U8;
        break;
      case VTK_INT:
        kind = RTV_I32;
        break;
      case VTK_FLOAT:
        kind = RTV_F32;
        break;
      case VTK_DOUBLE:
        kind = RTV_F64;
        break;
      default:
      {
        auto copy = vtkSmartPointer<vtkFloatArray>::New();
        copy->DeepCopy(scalars);
        keep.Object(copy);
        v.scalars = RtvArray{ copy->GetPointer(0), static_cast<uint64_t>(copy->GetNumberOfTuples()), 1, RTV_F32 };
      }
    }
    if (kind != RTV_NONE)
    {
      v.scalars = RtvArray{ scalars->GetVoidPointer(0), static_cast<uint64_t>(scalars->GetNumberOfTuples()), 1, kind };
    }
  }

  // ---- Transform: index times spacing, rotated by the image's directions, moved to its first
  // point, then the prop's matrix.
  double first[3];
  image->TransformIndexToPhysicalPoint(extent[0], extent[2], extent[4], first);
  vtkNew<vtkMatrix4x4> local;
  for (int row = 0; row < 3; ++row)
  {
    for (int column = 0; column < 3; ++column)
    {
      local->SetElement(row, column, image->GetDirectionMatrix()->GetElement(row, column));
    }
    local->SetElement(row, 3, first[row]);
  }
  vtkNew<vtkMatrix4x4> world;
  vtkMatrix4x4::Multiply4x4(volume->GetMatrix(), local, world);
  std::copy(&world->Element[0][0], &world->Element[0][0] + 16, v.world_from_data);

  // ---- Tables over the range of the scalars, as in OpenGL.
  scalars->GetFiniteRange(v.range, 0);
  if (!(v.range[1] > v.range[0]))
  {
    v.range[1] = v.range[0] + std::max(1e-6 * std::abs(v.range[0]), 1e-30);
  }
  const int blend = BlendOf(mapper->GetBlendMode());
  std::vector<float> colors(3 * Entries), opacities(Entries), gradients;
  std::vector<double> isovalues;
  if (blend == RTV_BLEND_AVERAGE || blend == RTV_BLEND_ADDITIVE)
  {
    // Average and additive blending use the scalars themselves, mapped from black to white.
    for (int i = 0; i < 3 * Entries; ++i)
    {
      colors[i] = static_cast<float>(i / 3) / (Entries - 1);
    }
    const double* range = mapper->GetAverageIPScalarRange();
    if (blend == RTV_BLEND_AVERAGE && (range[0] > v.range[0] || range[1] < v.range[1]))
    {
      return "a volume with average intensity blending of a part of its scalars";
    }
  }
  else if (property->GetColorChannels(0) == 1)
  {
    std::vector<float> gray(Entries);
    property->GetGrayTransferFunction(0)->GetTable(v.range[0], v.range[1], Entries, gray.data());
    for (int i = 0; i < 3 * Entries; ++i)
    {
      colors[i] = gray[i / 3];
    }
  }
  else
  {
    property->GetRGBTransferFunction(0)->GetTable(v.range[0], v.range[1], Entries, colors.data());
  }
  property->GetScalarOpacity(0)->GetTable(v.range[0], v.range[1], Entries, opacities.data());
  v.colors = RtvArray{ colors.data(), Entries, 3, RTV_F32 };
  v.opacities = RtvArray{ opacities.data(), Entries, 1, RTV_F32 };
  v.unit_distance = property->GetScalarOpacityUnitDistance(0);
  v.nearest = property->GetInterpolationType() == VTK_NEAREST_INTERPOLATION ? 1 : 0;
  v.blend = static_cast<uint32_t>(blend);
  if (blend == RTV_BLEND_ISOSURFACES)
  {
    vtkContourValues* values = property->GetIsoSurfaceValues();
    isovalues.assign(values->GetValues(), values->GetValues() + values->GetNumberOfContours());
    v.isovalues = RtvArray{ isovalues.data(), isovalues.size(), 1, RTV_F64 };
  }
  if (HasGradientOpacity(property))
  {
    // OpenGL takes central differences over n / (n - 1) of the point spacing, and scales them by
    // the mean of the spacings.
    double spacing = 0.0, reach = 0.0;
    for (int axis = 0; axis < 3; ++axis)
    {
      spacing += v.spacing[axis] / 3.0;
      reach += v.dims[axis] / (v.dims[axis] - 1.0) / 3.0;
    }
    const double steepest = GradientRange * (v.range[1] - v.range[0]);
    gradients.resize(Entries);
    property->GetGradientOpacity(0)->GetTable(0.0, steepest, Entries, gradients.data());
    v.gradient_opacities = RtvArray{ gradients.data(), Entries, 1, RTV_F32 };
    v.steepest = steepest / (spacing * reach);
  }
  v.shade = property->GetShade(0) ? 1 : 0;
  v.lights = RtvArray{ lights.List.data(), lights.List.size() / 6, 6, RTV_F32 };
  v.ambient = lights.Several ? 0.0f : static_cast<float>(property->GetAmbient(0));
  v.diffuse = static_cast<float>(property->GetDiffuse(0));
  v.specular = static_cast<float>(property->GetSpecular(0));
  v.specular_power = static_cast<float>(property->GetSpecularPower(0));
#if VTK_VERSION_NUMBER >= VTK_VERSION_CHECK(9, 2, 0)
  v.specular_mirrored = 1;
#endif
  const char* reason = rtvApi->volume(bridge, &v);
  answer = reason ? reason : "";
  return reason ? answer.c_str() : nullptr;
}
}

const char* rtvAddVolume(
  RtvBridge* bridge, vtkVolume* volume, vtkRenderer* renderer, const std::string& name, std::string& answer)
{
  auto mapper = vtkVolumeMapper::SafeDownCast(volume->GetMapper());
  if (const char* reason = ClassReason(volume, mapper))
  {
    return reason;
  }
  if (const char* reason = MapperReason(mapper))
  {
    return reason;
  }
  if (const char* reason = PropertyReason(volume->GetProperty()))
  {
    return reason;
  }
  if (const char* reason = BlendReason(mapper->GetBlendMode(), volume->GetProperty()))
  {
    return reason;
  }
  Lights lights;
  if (volume->GetProperty()->GetShade(0))
  {
    if (const char* reason = ReadLights(renderer, lights))
    {
      return reason;
    }
    // In VTK 9.1, OpenGL's highlight under several lights is that of the last one, seen from a
    // mirrored position.
    if (!lights.List.empty() && volume->GetProperty()->GetSpecular(0) > 0.0)
    {
      return "a shaded volume with a highlight under other lights than one white headlight";
    }
  }
  if (mapper->GetNumberOfInputConnections(0) > 0 && mapper->GetInputAlgorithm(0, 0))
  {
    mapper->GetInputAlgorithm(0, 0)->Update();
  }
  vtkDataObject* data = mapper->GetNumberOfInputConnections(0) > 0 ? mapper->GetInputDataObject(0, 0) : nullptr;
  if (auto image = vtkImageData::SafeDownCast(data))
  {
    return AddGrid(bridge, mapper, volume, image, lights, name, answer);
  }
  auto composite = vtkCompositeDataSet::SafeDownCast(data);
  vtkImageData* only = nullptr;
  int leaves = 0;
  if (composite)
  {
    auto it = vtkSmartPointer<vtkCompositeDataIterator>::Take(composite->NewIterator());
    for (it->InitTraversal(); !it->IsDoneWithTraversal(); it->GoToNextItem())
    {
      only = vtkImageData::SafeDownCast(it->GetCurrentDataObject());
      ++leaves;
    }
  }
  if (leaves == 1 && only)
  {
    return AddGrid(bridge, mapper, volume, only, lights, name, answer);
  }
  // Each block would need tables over the range of all blocks.
  return leaves > 1 ? "a volume of several blocks" : "a volume that is not image data";
}
