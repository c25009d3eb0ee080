#include "rtv_arrays.h"

#include <cmath>
#include <vtkAbstractMapper.h>
#include <vtkCellArray.h>
#include <vtkCellData.h>
#include <vtkDataArray.h>
#include <vtkFloatArray.h>
#include <vtkImageData.h>
#include <vtkMapper.h>
#include <vtkPointData.h>
#include <vtkPolyData.h>
#include <vtkProperty.h>
#include <vtkScalarsToColors.h>
#include <vtkTexture.h>
#include <vtkUnsignedCharArray.h>

double* RtvKeep::Doubles(size_t count)
{
  this->DoubleArrays.emplace_back(new double[count]);
  return this->DoubleArrays.back().get();
}

int64_t* RtvKeep::Ids(size_t count)
{
  this->IdArrays.emplace_back(new int64_t[count]);
  return this->IdArrays.back().get();
}

unsigned char* RtvKeep::Bytes(size_t count)
{
  this->ByteArrays.emplace_back(new unsigned char[count]);
  return this->ByteArrays.back().get();
}

namespace
{
const RtvArray NoArray = { nullptr, 0, 0, RTV_NONE };

RtvArray ArrayOf(vtkDataArray* array, uint32_t kind)
{
  return RtvArray{ array->GetVoidPointer(0), static_cast<uint64_t>(array->GetNumberOfTuples()),
    static_cast<uint32_t>(array->GetNumberOfComponents()), kind };
}

// Returns `array` in single precision: itself, or a copy.
RtvArray FloatArray(vtkDataArray* array, int components, RtvKeep& keep)
{
  if (!array || array->GetNumberOfComponents() < components)
  {
    return NoArray;
  }
  if (array->GetNumberOfComponents() == components && vtkFloatArray::FastDownCast(array))
  {
    return ArrayOf(array, RTV_F32);
  }
  auto copy = vtkSmartPointer<vtkFloatArray>::New();
  copy->SetNumberOfComponents(components);
  copy->SetNumberOfTuples(array->GetNumberOfTuples());
  for (vtkIdType i = 0; i < array->GetNumberOfTuples(); ++i)
  {
    for (int c = 0; c < components; ++c)
    {
      copy->SetTypedComponent(i, c, static_cast<float>(array->GetComponent(i, c)));
    }
  }
  keep.Object(copy);
  return ArrayOf(copy, RTV_F32);
}

RtvArray PointArray(vtkDataArray* array, RtvKeep& keep)
{
  if (vtkFloatArray::FastDownCast(array))
  {
    return ArrayOf(array, RTV_F32);
  }
  if (array->GetDataType() == VTK_DOUBLE && array->HasStandardMemoryLayout())
  {
    return ArrayOf(array, RTV_F64);
  }
  // Integers and other layouts; doubles can represent all of them.
  double* copy = keep.Doubles(3 * array->GetNumberOfTuples());
  for (vtkIdType i = 0; i < array->GetNumberOfTuples(); ++i)
  {
    array->GetTuple(i, copy + 3 * i);
  }
  return RtvArray{ copy, static_cast<uint64_t>(array->GetNumberOfTuples()), 3, RTV_F64 };
}

// Cells in any storage of vtkCellArray: since VTK 9.6 cells of one size have offsets that are
// computed, and both arrays may be of any type. False if one cannot be read.
bool CellsOf(
  vtkCellArray* cells, RtvCells& out, uint64_t& key, RtvKeep& keep, RtvSurfaceFacts& facts)
{
  out = RtvCells{ NoArray, NoArray };
  if (!cells || cells->GetNumberOfCells() == 0)
  {
    return true;
  }
  vtkDataArray* offsets = cells->GetOffsetsArray();
  vtkDataArray* connectivity = cells->GetConnectivityArray();
  key = rtvMix(rtvMix(key, static_cast<vtkObject*>(cells)), cells->GetMTime());
  for (vtkDataArray* array : { offsets, connectivity })
  {
    if (!array || !rtvIds(array, array == offsets ? out.offsets : out.connectivity, keep))
    {
      facts.unreadable_cells = 1;
      facts.cell_components = array ? static_cast<uint32_t>(array->GetNumberOfComponents()) : 0;
      facts.cell_type = array ? array->GetDataTypeAsString() : nullptr;
      facts.cell_array_class = array ? array->GetClassName() : nullptr;
      return false;
    }
    key = rtvMix(rtvMix(key, static_cast<vtkObject*>(array)), array->GetMTime());
  }
  return true;
}

uint64_t Mixed(uint64_t key, vtkObject* object)
{
  key = rtvMix(key, object);
  return object ? rtvMix(key, object->GetMTime()) : key;
}
}

bool rtvIds(vtkDataArray* array, RtvArray& out, RtvKeep& keep)
{
  if (array->GetNumberOfComponents() != 1)
  {
    return false;
  }
  const int type = array->GetDataType();
  const bool isSigned = type == VTK_INT || type == VTK_LONG || type == VTK_LONG_LONG || type == VTK_ID_TYPE;
  // Use the element size of the array, not the storage type that the cells report.
  const int bytes = array->GetDataTypeSize();
  if (isSigned && (bytes == 4 || bytes == 8) && array->HasStandardMemoryLayout())
  {
    out = ArrayOf(array, bytes == 8 ? RTV_I64 : RTV_I32);
    return true;
  }
  // Computed arrays, other layouts, unsigned and narrow types, and even floating point, which VTK
  // also accepts. Doubles represent every index of a point in memory exactly; invalid numbers
  // become an index that no point has.
  const vtkIdType count = array->GetNumberOfTuples();
  int64_t* copy = keep.Ids(count);
  for (vtkIdType i = 0; i < count; ++i)
  {
    const double value = array->GetComponent(i, 0);
    copy[i] = std::fabs(value) < 9.2e18 ? static_cast<int64_t>(value) : -1;
  }
  out = RtvArray{ copy, static_cast<uint64_t>(count), 1, RTV_I64 };
  return true;
}

const char* rtvCommit(RtvBridge* bridge, const RtvBatch& batch)
{
  std::vector<RtvSurface> all;
  for (const auto& pending : batch)
  {
    all.push_back(pending->Surface);
    all.back().name = pending->Name.c_str();
  }
  RtvSurfaceFacts facts = {};
  facts.invalid_arrays = !all.empty() && rtvApi->surfaces(bridge, all.data(), all.size()) < 0 ? 1 : 0;
  return rtvApi->check_surface(bridge, &facts);
}

bool rtvAddShape(RtvSurface& s, vtkPolyData* data, bool points, RtvKeep& keep, RtvSurfaceFacts& facts)
{
  uint64_t key = 1469598103934665603ull;
  vtkDataArray* coordinates = data->GetPoints()->GetData();
  s.points = PointArray(coordinates, keep);
  key = Mixed(Mixed(key, data->GetPoints()), coordinates);
  if (points)
  {
    // Each point is its own vertex.
    const vtkIdType count = coordinates->GetNumberOfTuples();
    int64_t* ids = keep.Ids(count + 1);
    for (vtkIdType i = 0; i <= count; ++i)
    {
      ids[i] = i;
    }
    s.verts.offsets = RtvArray{ ids, static_cast<uint64_t>(count) + 1, 1, RTV_I64 };
    s.verts.connectivity = RtvArray{ ids, static_cast<uint64_t>(count), 1, RTV_I64 };
    s.lines = s.polys = s.strips = RtvCells{ NoArray, NoArray };
    s.shape_key = rtvMix(rtvMix(key, 1), s.point_radius);
    return true;
  }
  vtkCellArray* const cells[] = { data->GetVerts(), data->GetLines(), data->GetPolys(), data->GetStrips() };
  RtvCells* const to[] = { &s.verts, &s.lines, &s.polys, &s.strips };
  for (int i = 0; i < 4; ++i)
  {
    if (!CellsOf(cells[i], *to[i], key, keep, facts))
    {
      return false;
    }
  }
  vtkDataArray* ofPoints = data->GetPointData()->GetNormals();
  vtkDataArray* ofCells = data->GetCellData()->GetNormals();
  s.point_normals = s.property.flat ? NoArray : FloatArray(ofPoints, 3, keep);
  s.cell_normals = FloatArray(ofCells, 3, keep);
  vtkDataArray* texcoords = data->GetPointData()->GetTCoords();
  s.texcoords = FloatArray(texcoords, 2, keep);
  // The shader has a tangent frame for normal maps only if there are point normals.
  vtkDataArray* tangents = s.point_normals.kind == RTV_NONE ? nullptr : data->GetPointData()->GetTangents();
  s.tangents = FloatArray(tangents, 3, keep);
  key = Mixed(Mixed(Mixed(Mixed(key, s.property.flat ? nullptr : ofPoints), ofCells), texcoords), tangents);
  key = rtvMix(rtvMix(rtvMix(rtvMix(key, s.point_radius), s.line_radius), s.edges_only), s.has_back);
  s.shape_key = key;
  return true;
}

void rtvAddColors(RtvBridge* bridge, RtvSurface& s, vtkMapper* mapper, vtkPolyData* data, RtvKeep& keep)
{
  if (!mapper->GetScalarVisibility())
  {
    return;
  }
  int cellFlag = 0;
  vtkAbstractArray* scalars = vtkAbstractMapper::GetAbstractScalars(data, mapper->GetScalarMode(),
    mapper->GetArrayAccessMode(), mapper->GetArrayId(), mapper->GetArrayName(), cellFlag);
  if (!scalars)
  {
    return;
  }
  if (cellFlag == 2 && mapper->GetFieldDataTupleId() < 0)
  {
    // A field-data array with one value per cell; with a tuple index it would be one colour for
    // everything.
    cellFlag = 1;
  }
  const bool byCell = cellFlag == 1;
  vtkScalarsToColors* table = mapper->GetLookupTable();
  uint64_t key = Mixed(Mixed(1469598103934665603ull, scalars), table);
  // A mapper's own modification time also changes for reasons that do not affect colours.
  const double* range = mapper->GetScalarRange();
  key = rtvMix(rtvMix(rtvMix(rtvMix(key, range[0]), range[1]), mapper->GetColorMode()), mapper->GetScalarMode());
  key = rtvMix(rtvMix(rtvMix(key, mapper->GetInterpolateScalarsBeforeMapping()), mapper->GetUseLookupTableScalarRange()), cellFlag);
  key = rtvMix(rtvMix(key, mapper->GetArrayComponent()), mapper->GetFieldDataTupleId());
  s.color_key = key;
  const bool mapped = mapper->CanUseTextureMapForColoring(data) != 0;
  const uint32_t source = byCell ? RTV_COLOR_CELLS : mapped ? RTV_COLOR_MAPPED : RTV_COLOR_POINTS;
  if (cellFlag != 2 && rtvApi->has_colors(bridge, s.shape_key, key))
  {
    s.color_source = source;
    return;
  }
  // A mapper caches one array of colours; another block's array must not be reused for this block.
  mapper->ClearColorArrays();
  vtkUnsignedCharArray* colors = mapper->MapScalars(data, 1.0, cellFlag);
  cellFlag = byCell ? 1 : cellFlag;
  vtkFloatArray* coordinates = mapper->GetColorCoordinates();
  vtkImageData* map = mapper->GetColorTextureMap();
  if (mapped && coordinates && map && cellFlag == 0)
  {
    auto texels = vtkUnsignedCharArray::SafeDownCast(map->GetPointData()->GetScalars());
    if (texels && texels->GetNumberOfComponents() == 4)
    {
      int size[3];
      map->GetDimensions(size);
      // The mapper releases these arrays when the next block is coloured.
      keep.Object(coordinates);
      keep.Object(texels);
      s.color_source = RTV_COLOR_MAPPED;
      s.colors = ArrayOf(coordinates, RTV_F32);
      s.map = RtvArray{ texels->GetPointer(0), static_cast<uint64_t>(size[0]), 4, RTV_U8 };
      memcpy(s.nan_color, texels->GetPointer(4 * (texels->GetNumberOfTuples() - 1)), 4);
      return;
    }
  }
  if (!colors || colors->GetNumberOfTuples() == 0)
  {
    return;
  }
  vtkUnsignedCharArray* rgba = colors;
  if (colors->GetNumberOfComponents() != 4)
  {
    auto copy = vtkSmartPointer<vtkUnsignedCharArray>::New();
    copy->SetNumberOfComponents(4);
    copy->SetNumberOfTuples(colors->GetNumberOfTuples());
    const int n = colors->GetNumberOfComponents();
    for (vtkIdType i = 0; i < colors->GetNumberOfTuples(); ++i)
    {
      const unsigned char* c = colors->GetPointer(n * i);
      unsigned char* out = copy->GetPointer(4 * i);
      for (int k = 0; k < 3; ++k)
      {
        out[k] = n >= 3 ? c[k] : c[0];
      }
      out[3] = n == 2 ? c[1] : 255;
    }
    rgba = copy;
  }
  keep.Object(rgba);
  if (cellFlag == 2)
  {
    // One colour for everything, from a tuple of field data.
    const unsigned char* c = rgba->GetPointer(0);
    for (int k = 0; k < 3; ++k)
    {
      s.property.ambient_color[k] = s.property.diffuse_color[k] = c[k] / 255.0f;
    }
    s.property.opacity *= c[3] / 255.0f;
    s.color_key = 0;
    return;
  }
  s.color_source = cellFlag == 1 ? RTV_COLOR_CELLS : RTV_COLOR_POINTS;
  s.colors = ArrayOf(rgba, RTV_U8);
}

uint32_t rtvTextureBits(vtkTexture* texture)
{
  return !texture ? 0
                  : RTV_TEXTURE | (texture->GetTransform() ? RTV_TEXTURE_TRANSFORM : 0u) |
      (texture->GetCubeMap() ? RTV_TEXTURE_CUBE_MAP : 0u) | (texture->GetMipmap() ? RTV_TEXTURE_MIPMAP : 0u);
}

namespace
{
RtvImage ImageOf(const RtvSurface& s, vtkTexture* texture, RtvKeep& keep)
{
  RtvImage r = RtvImage{};
  if (texture->GetInputAlgorithm())
  {
    texture->GetInputAlgorithm()->Update();
  }
  vtkImageData* image = texture->GetInput();
  vtkDataArray* const given = image ? image->GetPointData()->GetScalars() : nullptr;
  vtkDataArray* scalars = given;
  if (!scalars || s.texcoords.kind == RTV_NONE)
  {
    return r;
  }
  int size[3];
  image->GetDimensions(size);
  const bool direct = scalars->GetDataType() == VTK_UNSIGNED_CHAR && texture->GetColorMode() != VTK_COLOR_MODE_MAP_SCALARS;
  const int n = direct ? scalars->GetNumberOfComponents() : 4;
  if (direct && !scalars->HasStandardMemoryLayout())
  {
    auto copy = vtkSmartPointer<vtkUnsignedCharArray>::New();
    copy->DeepCopy(scalars);
    keep.Object(copy);
    scalars = copy;
  }
  const unsigned char* in = direct ? static_cast<const unsigned char*>(scalars->GetVoidPointer(0))
                                   : texture->MapScalarsToColors(scalars);
  const vtkIdType count = scalars->GetNumberOfTuples();
  if (!in || count < static_cast<vtkIdType>(size[0]) * size[1])
  {
    return r;
  }
  r.key = Mixed(Mixed(Mixed(1469598103934665603ull, image), given), texture);
  unsigned char* out = keep.Bytes(4 * count);
  for (vtkIdType i = 0; i < count; ++i)
  {
    for (int c = 0; c < 3; ++c)
    {
      out[4 * i + c] = n >= 3 ? in[n * i + c] : in[n * i];
    }
    out[4 * i + 3] = n == 4 ? in[4 * i + 3] : n == 2 ? in[2 * i + 1] : 255;
  }
  r.texels = RtvArray{ out, static_cast<uint64_t>(size[0]) * size[1], 4, RTV_U8 };
  r.width = static_cast<uint32_t>(size[0]);
  r.srgb = texture->GetUseSRGBColorSpace() ? 1 : 0;
  r.interpolate = texture->GetInterpolate() ? 1 : 0;
  r.repeat = texture->GetRepeat() ? 1 : 0;
  return r;
}
}

void rtvAddTexture(RtvSurface& s, vtkTexture* texture, RtvKeep& keep)
{
  const RtvImage image = ImageOf(s, texture, keep);
  s.texture = image.texels;
  s.texture_key = image.key;
  s.texture_width = image.width;
  s.texture_srgb = image.srgb;
  s.texture_interpolate = image.interpolate;
  s.texture_repeat = image.repeat;
}

const RtvMaps* rtvMapsOf(const RtvSurface& s, vtkProperty* property, RtvMaps& maps, RtvKeep& keep)
{
  maps = RtvMaps{};
  bool any = false;
  for (const auto& texture : property->GetAllTextures())
  {
    RtvImage* to = texture.first == "materialTex" ? &maps.material
      : texture.first == "normalTex"              ? &maps.normal
      : texture.first == "emissiveTex"            ? &maps.emissive
                                                  : nullptr;
    if (to)
    {
      *to = ImageOf(s, texture.second, keep);
      any = true;
    }
  }
  maps.normal_scale = static_cast<float>(property->GetNormalScale());
  maps.occlusion_strength = static_cast<float>(property->GetOcclusionStrength());
  for (int c = 0; c < 3; ++c)
  {
    maps.emissive_factor[c] = static_cast<float>(property->GetEmissiveFactor()[c]);
  }
  return any ? &maps : nullptr;
}
