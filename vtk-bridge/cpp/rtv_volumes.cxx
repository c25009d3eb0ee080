// Volumes of uniform grids to the bridge, which decides from facts about them which it can draw.
#include "rtv_arrays.h"

#include <algorithm>
#include <cmath>
#include <vector>
#include <vtkCamera.h>
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
#include <vtkMultiBlockVolumeMapper.h>
#include <vtkPiecewiseFunction.h>
#include <vtkPlane.h>
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

// What the choice between rays and OpenGL looks at: points per axis, and entries of the table.
const uint32_t FewPoints = 32;
const int FewEntries = 256;

// What OpenGL's table of opacities by gradient reaches to: a quarter of the range of the scalars.
const double GradientRange = 0.25;

bool HasGradientOpacity(vtkVolumeProperty* property)
{
  return !property->GetDisableGradientOpacity(0) && property->HasGradientOpacity(0);
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

void ReadLights(vtkRenderer* renderer, Lights& out, RtvVolumeFacts& facts)
{
  vtkLightCollection* lights = renderer->GetLights();
  vtkCollectionSimpleIterator it;
  lights->InitTraversal(it);
  bool plain = true, colored = false;
  while (vtkLight* light = lights->GetNextLight(it))
  {
    if (!light->GetSwitch())
    {
      continue;
    }
    const double* color = light->GetDiffuseColor();
    const double* ambient = light->GetAmbientColor();
    const double* highlight = light->GetSpecularColor();
    const double strength = light->GetIntensity();
    facts.num_lights += 1;
    facts.num_positional_lights += light->GetPositional() ? 1 : 0;
    facts.num_ambient_lights += ambient[0] != 0.0 || ambient[1] != 0.0 || ambient[2] != 0.0 ? 1 : 0;
    // OpenGL takes a headlight of another strength for one of several.
    plain = plain && light->LightTypeIsHeadlight() && strength == 1.0;
    double from[3], to[3];
    light->GetTransformedPosition(from);
    light->GetTransformedFocalPoint(to);
    for (int c = 0; c < 3; ++c)
    {
      colored = colored || strength * color[c] != 1.0 || strength * highlight[c] != 1.0;
      out.List.push_back(static_cast<float>(from[c] - to[c]));
    }
    for (int c = 0; c < 3; ++c)
    {
      out.List.push_back(static_cast<float>(strength * color[c]));
    }
  }
  out.Several = facts.num_lights > 1 || !plain;
  if (!out.Several && colored)
  {
    // A single headlight is at the viewer, not directional.
    std::fill(out.List.begin(), out.List.begin() + 3, 0.0f);
  }
  else if (!out.Several)
  {
    out.List.clear();
  }
  facts.num_listed_lights = static_cast<uint32_t>(out.List.size() / 6);
}

// What only some mappers and versions have; overloads with `long` are for the others.
template <class M>
auto HasScattering(M* m, int) -> decltype(m->GetVolumetricScatteringBlending(), m->GetGlobalIlluminationReach() > 0.0f)
{
  return m->GetGlobalIlluminationReach() > 0.0f || m->GetVolumetricScatteringBlending() > 0.0f;
}

template <class M>
bool HasScattering(M*, long)
{
  return false;
}

void ReadMapper(vtkVolumeMapper* mapper, RtvVolumeFacts& facts)
{
  vtkPlaneCollection* planes = mapper->GetClippingPlanes();
  facts.cropping = mapper->GetCropping() ? 1 : 0;
  facts.cropping_regions = static_cast<uint32_t>(mapper->GetCroppingRegionFlags());
  facts.num_clipping_planes = planes ? static_cast<uint32_t>(planes->GetNumberOfItems()) : 0;
  facts.blend_mode = static_cast<uint32_t>(mapper->GetBlendMode());
  auto gpu = vtkGPUVolumeRayCastMapper::SafeDownCast(mapper);
  auto smart = vtkSmartVolumeMapper::SafeDownCast(mapper);
  auto blocks = vtkMultiBlockVolumeMapper::SafeDownCast(mapper);
  facts.mask = gpu && gpu->GetMaskInput() ? 1 : 0;
  facts.scattering = (gpu && HasScattering(gpu, 0)) || (smart && HasScattering(smart, 0)) ||
      (blocks && HasScattering(blocks, 0))
    ? 1
    : 0;
  const int off = vtkSmartVolumeMapper::DISABLED;
  facts.vectors = (smart && smart->GetVectorMode() != off) || (blocks && blocks->GetVectorMode() != off) ? 1 : 0;
}

// The distance of the samples that OpenGL takes along a ray, in data units; 0 for mappers that take
// none in OpenGL, or that move them by noise, whose mean is the integral.
double SampleDistance(
  vtkVolumeMapper* mapper, vtkImageData* image, const uint32_t* dims, vtkMatrix4x4* matrix)
{
  const double* spacing = image->GetSpacing();
  double least = 0.0, cells = 1.0;
  for (int axis = 0; axis < 3; ++axis)
  {
    const double* row = matrix->Element[axis];
    const double world = spacing[axis] * std::hypot(row[0], row[1], row[2]);
    least = axis == 0 ? world : std::min(least, world);
    cells *= dims[axis] - 1.0;
  }
  // Half of the mean spacing, and less in grids of fewer than a million cells.
  const double mean = (spacing[0] + spacing[1] + spacing[2]) / 6.0;
  const double locked = mean * (0.01 + 0.99 * std::min(1.0, std::pow(cells, 0.333) / 100.0));
  // Adjusted distances are the smallest spacing in the world. While the user turns the scene OpenGL
  // may take longer steps.
  if (auto gpu = vtkGPUVolumeRayCastMapper::SafeDownCast(mapper))
  {
    if (gpu->GetUseJittering())
    {
      return 0.0;
    }
    const double own = gpu->GetSampleDistance();
    const bool locks = gpu->GetLockSampleDistanceToInputSpacing() != 0;
    const bool asGiven = !locks || std::abs(own / locked - 1.0) <= 0.001;
    return gpu->GetAutoAdjustSampleDistances() ? least : asGiven ? own : locked;
  }
  if (auto smart = vtkSmartVolumeMapper::SafeDownCast(mapper))
  {
#if VTK_VERSION_NUMBER >= VTK_VERSION_CHECK(9, 2, 0)
    if (smart->GetUseJittering())
    {
      return 0.0;
    }
#endif
    const bool turns = smart->GetInteractiveAdjustSampleDistances() != 0;
    return !turns && smart->GetAutoAdjustSampleDistances() ? least : locked;
  }
  return 0.0;
}

void ReadProperty(vtkVolumeProperty* property, RtvVolumeFacts& facts)
{
  facts.transfer_function_2d = property->GetTransferFunctionMode() != vtkVolumeProperty::TF_1D ? 1 : 0;
  facts.labels =
    property->HasLabelGradientOpacity() || property->GetLabelColor(1) || property->GetLabelScalarOpacity(1) ? 1 : 0;
  facts.gradient_opacity = HasGradientOpacity(property) ? 1 : 0;
  facts.shade = property->GetShade(0) ? 1 : 0;
  facts.specular = property->GetSpecular(0);
}

// The scalars of an image, which may be null, and facts about both.
vtkDataArray* ReadImage(vtkVolumeMapper* mapper, vtkImageData* image, RtvVolumeFacts& facts)
{
  int extent[6], cellFlag = 0;
  image->GetExtent(extent);
  for (int axis = 0; axis < 3; ++axis)
  {
    facts.dims[axis] = static_cast<uint32_t>(std::max(0, extent[2 * axis + 1] - extent[2 * axis] + 1));
  }
  facts.image = 1;
  facts.turned = image->GetDirectionMatrix()->IsIdentity() ? 0 : 1;
  facts.blanked = image->HasAnyBlankPoints() || image->HasAnyBlankCells() ? 1 : 0;
  vtkDataArray* scalars = vtkAbstractMapper::GetScalars(
    image, mapper->GetScalarMode(), mapper->GetArrayAccessMode(), mapper->GetArrayId(), mapper->GetArrayName(), cellFlag);
  facts.scalars = scalars ? 1 : 0;
  facts.cell_scalars = cellFlag != 0 ? 1 : 0;
  facts.num_components = scalars ? static_cast<uint32_t>(scalars->GetNumberOfComponents()) : 0;
  if (scalars)
  {
    scalars->GetFiniteRange(facts.range, 0);
    if (!(facts.range[1] > facts.range[0]))
    {
      facts.range[1] = facts.range[0] + std::max(1e-6 * std::abs(facts.range[0]), 1e-30);
    }
  }
  std::copy(mapper->GetAverageIPScalarRange(), mapper->GetAverageIPScalarRange() + 2, facts.average_range);
  return scalars;
}

// The one image of a mapper, or null.
vtkImageData* ImageOf(vtkVolumeMapper* mapper, RtvVolumeFacts& facts)
{
  vtkDataObject* data = mapper->GetNumberOfInputConnections(0) > 0 ? mapper->GetInputDataObject(0, 0) : nullptr;
  vtkImageData* image = vtkImageData::SafeDownCast(data);
  if (auto composite = vtkCompositeDataSet::SafeDownCast(data))
  {
    auto it = vtkSmartPointer<vtkCompositeDataIterator>::Take(composite->NewIterator());
    for (it->InitTraversal(); !it->IsDoneWithTraversal(); it->GoToNextItem())
    {
      // One block is as good as the image alone.
      image = facts.num_blocks == 0 ? vtkImageData::SafeDownCast(it->GetCurrentDataObject()) : nullptr;
      ++facts.num_blocks;
    }
  }
  facts.has_data = 1;
  return image;
}

// Index times spacing, rotated by the image's directions, moved to its first point, then the prop's
// matrix.
void ReadMatrix(vtkVolume* volume, vtkImageData* image, vtkMatrix4x4* world)
{
  const int* extent = image->GetExtent();
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
  vtkMatrix4x4::Multiply4x4(volume->GetMatrix(), local, world);
}

// What is drawn of the volume: cropping planes are in the image's space, clipping planes in the
// world.
void ReadRegion(vtkVolumeMapper* mapper, vtkImageData* image, RtvVolume& v, std::vector<double>& planes)
{
  v.cropping_in_texels = mapper->IsA("vtkFixedPointVolumeRayCastMapper") ? 0 : 1;
#if VTK_VERSION_NUMBER < VTK_VERSION_CHECK(9, 3, 1)
  v.clipping_in_texels = v.cropping_in_texels;
#endif
  if (mapper->GetCropping())
  {
    const int* extent = image->GetExtent();
    double first[3];
    image->TransformIndexToPhysicalPoint(extent[0], extent[2], extent[4], first);
    v.cropping_regions = static_cast<uint32_t>(mapper->GetCroppingRegionFlags());
    for (int i = 0; i < 6; ++i)
    {
      v.cropping_planes[i] = mapper->GetCroppingRegionPlanes()[i] - first[i / 2];
    }
  }
  if (vtkPlaneCollection* clipping = mapper->GetClippingPlanes())
  {
    vtkCollectionSimpleIterator it;
    clipping->InitTraversal(it);
    while (vtkPlane* plane = clipping->GetNextPlane(it))
    {
      planes.insert(planes.end(), plane->GetOrigin(), plane->GetOrigin() + 3);
      planes.insert(planes.end(), plane->GetNormal(), plane->GetNormal() + 3);
    }
    v.clip_planes = RtvArray{ planes.data(), planes.size() / 6, 6, RTV_F64 };
  }
}

const char* AddGrid(RtvBridge* bridge, vtkVolumeMapper* mapper, vtkVolume* volume, vtkImageData* image, vtkCamera* camera,
  const Lights& lights, const std::string& name, RtvVolumeFacts& facts)
{
  vtkVolumeProperty* property = volume->GetProperty();
  RtvVolume v = {};
  v.name = name.c_str();
  vtkDataArray* scalars = ReadImage(mapper, image, facts);
  std::copy(facts.dims, facts.dims + 3, v.dims);
  std::copy(image->GetSpacing(), image->GetSpacing() + 3, v.spacing);
  std::copy(facts.range, facts.range + 2, v.range);
  if (const char* reason = rtvApi->check_volume(bridge, &facts))
  {
    return reason;
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

  // ---- Transform.
  vtkNew<vtkMatrix4x4> world;
  ReadMatrix(volume, image, world);
  std::copy(&world->Element[0][0], &world->Element[0][0] + 16, v.world_from_data);

  std::vector<double> planes;
  v.cells = facts.cell_scalars;
  ReadRegion(mapper, image, v, planes);

  // ---- Tables over the range of the scalars, as OpenGL's are.
  v.blend = facts.blend_mode;
  std::vector<float> colors(3 * Entries), opacities(Entries), gradients;
  std::vector<double> isovalues;
  if (v.blend == RTV_BLEND_AVERAGE || v.blend == RTV_BLEND_ADDITIVE)
  {
    // Average and additive blending use the scalars themselves, mapped from black to white.
    for (int i = 0; i < 3 * Entries; ++i)
    {
      colors[i] = static_cast<float>(i / 3) / (Entries - 1);
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
  v.sample_distance = SampleDistance(mapper, image, v.dims, volume->GetMatrix());
  v.nearest = property->GetInterpolationType() == VTK_NEAREST_INTERPOLATION ? 1 : 0;
  if (v.blend == RTV_BLEND_ISOSURFACES)
  {
    vtkContourValues* values = property->GetIsoSurfaceValues();
    isovalues.assign(values->GetValues(), values->GetValues() + values->GetNumberOfContours());
    v.isovalues = RtvArray{ isovalues.data(), isovalues.size(), 1, RTV_F64 };
  }
  if (HasGradientOpacity(property))
  {
    // OpenGL takes central differences over n / (n - 1) of the point spacing, or over that of cells,
    // and scales them by the mean of the spacings.
    double spacing = 0.0, reach = 0.0;
    for (int axis = 0; axis < 3; ++axis)
    {
      spacing += v.spacing[axis] / 3.0;
      reach += (v.cells ? 1.0 : v.dims[axis] / (v.dims[axis] - 1.0)) / 3.0;
    }
    const double steepest = GradientRange * (v.range[1] - v.range[0]);
    gradients.resize(Entries);
    property->GetGradientOpacity(0)->GetTable(0.0, steepest, Entries, gradients.data());
    v.gradient_opacities = RtvArray{ gradients.data(), Entries, 1, RTV_F32 };
    v.steepest = steepest / (spacing * reach);
  }
  v.shade = property->GetShade(0) ? 1 : 0;
  if (camera->GetParallelProjection())
  {
    // OpenGL's light at the viewer shines from the camera's position then, too.
    v.has_viewer = 1;
    camera->GetPosition(v.viewer);
  }
  v.lights = RtvArray{ lights.List.data(), lights.List.size() / 6, 6, RTV_F32 };
  v.ambient = lights.Several ? 0.0f : static_cast<float>(property->GetAmbient(0));
  v.diffuse = static_cast<float>(property->GetDiffuse(0));
  v.specular = static_cast<float>(property->GetSpecular(0));
  v.specular_power = static_cast<float>(property->GetSpecularPower(0));
#if VTK_VERSION_NUMBER >= VTK_VERSION_CHECK(9, 2, 0)
  v.specular_mirrored = 1;
#endif
  return rtvApi->volume(bridge, &v);
}
}

const char* rtvAddVolume(RtvBridge* bridge, vtkVolume* volume, vtkRenderer* renderer, const std::string& name)
{
  auto mapper = vtkVolumeMapper::SafeDownCast(volume->GetMapper());
  RtvVolumeFacts facts = {};
  facts.volume_class = volume->GetClassName();
  facts.mapper_class = mapper ? mapper->GetClassName() : nullptr;
  if (const char* reason = rtvApi->check_volume(bridge, &facts))
  {
    return reason;
  }
  ReadMapper(mapper, facts);
  ReadProperty(volume->GetProperty(), facts);
  Lights lights;
  if (facts.shade)
  {
    ReadLights(renderer, lights, facts);
  }
  if (const char* reason = rtvApi->check_volume(bridge, &facts))
  {
    return reason;
  }
  if (mapper->GetNumberOfInputConnections(0) > 0 && mapper->GetInputAlgorithm(0, 0))
  {
    mapper->GetInputAlgorithm(0, 0)->Update();
  }
  vtkImageData* image = ImageOf(mapper, facts);
  if (!image)
  {
    return rtvApi->check_volume(bridge, &facts);
  }
  vtkCamera* camera = renderer->GetActiveCamera();
  return AddGrid(bridge, mapper, volume, image, camera, lights, name, facts);
}

void rtvChooseVolume(RtvBridge* bridge, vtkVolume* volume, vtkRenderer* renderer, const RtvView& view)
{
  auto mapper = vtkVolumeMapper::SafeDownCast(volume->GetMapper());
  vtkVolumeProperty* property = volume->GetProperty();
  RtvVolumeFacts facts = {};
  vtkImageData* image = mapper && property ? ImageOf(mapper, facts) : nullptr;
  vtkDataArray* scalars = image ? ReadImage(mapper, image, facts) : nullptr;
  if (!scalars)
  {
    return;
  }
  facts.volume_class = volume->GetClassName();
  facts.mapper_class = mapper->GetClassName();
  ReadMapper(mapper, facts);
  ReadProperty(property, facts);
  Lights lights;
  if (facts.shade)
  {
    ReadLights(renderer, lights, facts);
  }
  RtvSceneVolume v = {};
  v.facts = &facts;
  v.view = &view;

  // ---- A few scalars. Those of cells stand for themselves.
  uint32_t dims[3];
  uint64_t count = 1;
  for (int axis = 0; axis < 3; ++axis)
  {
    dims[axis] = facts.dims[axis] - (facts.cell_scalars && facts.dims[axis] > 0 ? 1 : 0);
    v.dims[axis] = std::min(dims[axis], FewPoints);
    count *= v.dims[axis];
  }
  const vtkIdType values = facts.cell_scalars ? image->GetNumberOfCells() : image->GetNumberOfPoints();
  if (count == 0 || scalars->GetNumberOfTuples() != values)
  {
    return;
  }
  const auto at = [&](int axis, uint64_t i) {
    const uint64_t last = std::max(v.dims[axis], 2u) - 1;
    return (i * (dims[axis] - 1) + last / 2) / last;
  };
  std::vector<float> few;
  few.reserve(count);
  for (uint64_t k = 0; k < v.dims[2]; ++k)
  {
    for (uint64_t j = 0; j < v.dims[1]; ++j)
    {
      const uint64_t row = (at(2, k) * dims[1] + at(1, j)) * dims[0];
      for (uint64_t i = 0; i < v.dims[0]; ++i)
      {
        few.push_back(static_cast<float>(scalars->GetComponent(static_cast<vtkIdType>(row + at(0, i)), 0)));
      }
    }
  }
  v.scalars = RtvArray{ few.data(), count, 1, RTV_F32 };

  // ---- Opacities, samples and place.
  std::vector<float> opacities(FewEntries);
  property->GetScalarOpacity(0)->GetTable(facts.range[0], facts.range[1], FewEntries, opacities.data());
  v.opacities = RtvArray{ opacities.data(), opacities.size(), 1, RTV_F32 };
  v.unit_distance = property->GetScalarOpacityUnitDistance(0);
  v.sample_distance = SampleDistance(mapper, image, facts.dims, volume->GetMatrix());
  auto gpu = vtkGPUVolumeRayCastMapper::SafeDownCast(mapper);
  auto smart = vtkSmartVolumeMapper::SafeDownCast(mapper);
  v.adjusts = (gpu && gpu->GetAutoAdjustSampleDistances()) ||
      (smart && (smart->GetAutoAdjustSampleDistances() || smart->GetInteractiveAdjustSampleDistances()))
    ? 1
    : 0;
  vtkNew<vtkMatrix4x4> world;
  ReadMatrix(volume, image, world);
  for (int i = 0; i < 16; ++i)
  {
    const int axis = i % 4;
    const double size = axis < 3 ? image->GetSpacing()[axis] * (facts.dims[axis] - 1.0) : 1.0;
    v.world_from_unit[i] = world->Element[i / 4][axis] * size;
  }
  rtvApi->choose_volume(bridge, &v);
}
