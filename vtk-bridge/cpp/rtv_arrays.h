// VTK's arrays as the bridge reads them.
#pragma once
#include "rtv_shim.h"

#include <cstring>
#include <memory>
#include <string>
#include <vector>
#include <vtkObject.h>

class vtkActor;
class vtkDataArray;
class vtkDataObject;
class vtkGlyph3DMapper;
class vtkPolyData;
class vtkProperty;
class vtkTexture;
class vtkVolume;

// Copies that must live until the bridge has read them: arrays of types it does not read itself.
class RtvKeep
{
public:
  void Object(vtkObject* object) { this->Objects.push_back(object); }
  double* Doubles(size_t count);
  int64_t* Ids(size_t count);
  unsigned char* Bytes(size_t count);

private:
  std::vector<vtkSmartPointer<vtkObject>> Objects;
  std::vector<std::unique_ptr<double[]>> DoubleArrays;
  std::vector<std::unique_ptr<int64_t[]>> IdArrays;
  std::vector<std::unique_ptr<unsigned char[]>> ByteArrays;
};

// A surface that is ready for the bridge, with all that its pointers lead to.
struct RtvPending
{
  RtvSurface Surface = {};
  RtvMaps Maps = {};
  RtvKeep Keep;
  std::string Name;
  std::vector<double> Matrices;
  std::vector<unsigned char> Colors;
};

// All surfaces of a prop. They go to the bridge together when nothing in the prop is refused: what
// is drawn by the bridge and by OpenGL would be blended twice where it is translucent.
using RtvBatch = std::vector<std::unique_ptr<RtvPending>>;

// Gives a prop's surfaces to the bridge: all, or none. Returns why not, or null.
const char* rtvCommit(RtvBridge* bridge, const RtvBatch& batch);

// A key of everything that was mixed in (FNV-1a).
template <class T>
uint64_t rtvMix(uint64_t key, const T& value)
{
  unsigned char bytes[sizeof(T)];
  memcpy(bytes, &value, sizeof(T));
  for (unsigned char b : bytes)
  {
    key = (key ^ b) * 1099511628211ull;
  }
  return key;
}

// Offsets or point numbers of cells, whatever array they are in: where that lies in memory as whole
// numbers of 32 or 64 bits itself, else a copy. False when it has other than one component.
bool rtvIds(vtkDataArray* array, RtvArray& out, RtvKeep& keep);
// Points, cells, normals, texture coordinates, and the key of all of them. `points`: every point is
// a vertex. Returns why not, or null; `answer` keeps the text.
const char* rtvAddShape(
  RtvSurface& s, vtkPolyData* data, bool points, RtvKeep& keep, std::string& answer);
// Colours of points, cells or a map, as the mapper makes them; only when the bridge does not have them.
void rtvAddColors(RtvBridge* bridge, RtvSurface& s, vtkMapper* mapper, vtkPolyData* data, RtvKeep& keep);
void rtvAddTexture(RtvSurface& s, vtkTexture* texture, RtvKeep& keep);
// The textures of a physically based property besides that of its colour; `maps` must live until the bridge has read it. Null without any.
const RtvMaps* rtvMapsOf(const RtvSurface& s, vtkProperty* property, RtvMaps& maps, RtvKeep& keep);
// Why a texture cannot be traced, or null.
const char* rtvTextureReason(vtkTexture* texture);
// A volume. Returns why not, or null; `answer` keeps the text.
const char* rtvAddVolume(
  RtvBridge* bridge, vtkVolume* volume, vtkRenderer* renderer, const std::string& name, std::string& answer);
// Copies of the sources of a glyph mapper. Returns why not, or null; `answer` keeps the text.
const char* rtvAddGlyphs(RtvBridge* bridge, vtkActor* actor, vtkGlyph3DMapper* mapper, vtkDataObject* data,
  const RtvProperty& property, const std::string& name, std::string& answer);
