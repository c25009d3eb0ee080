// Converts VTK's arrays to the form that the bridge reads.
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

// Copies of arrays whose types the bridge does not read. They must live until the bridge has read
// them.
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

// A surface that is ready for the bridge, with all data that its pointers refer to.
struct RtvPending
{
  RtvSurface Surface = {};
  RtvMaps Maps = {};
  RtvKeep Keep;
  std::string Name;
  std::vector<double> Matrices;
  std::vector<unsigned char> Colors;
};

// All surfaces of a prop. They are passed to the bridge together, and only if it can trace all of
// them: parts drawn by the bridge and parts drawn by OpenGL would be blended twice where they are
// translucent.
using RtvBatch = std::vector<std::unique_ptr<RtvPending>>;

// Functions below that return a text give the reason why OpenGL has to draw a prop, as the bridge
// words it, or null. The text is valid until the bridge gives another one.

// Passes a prop's surfaces to the bridge: all, or none.
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

// Offsets or point numbers of cells from any array. Refers to the array's memory if it holds
// integers of 32 or 64 bits, else to a copy. False if it has other than one component.
bool rtvIds(vtkDataArray* array, RtvArray& out, RtvKeep& keep);
// Points, cells, normals, texture coordinates, and the key of all of them. `points`: every point is
// a vertex. False if an array of cells cannot be read; `facts` then describes it.
bool rtvAddShape(RtvSurface& s, vtkPolyData* data, bool points, RtvKeep& keep, RtvSurfaceFacts& facts);
// Colours of points, cells or a map, as the mapper makes them; only if the bridge has not cached
// them.
void rtvAddColors(RtvBridge* bridge, RtvSurface& s, vtkMapper* mapper, vtkPolyData* data, RtvKeep& keep);
void rtvAddTexture(RtvSurface& s, vtkTexture* texture, RtvKeep& keep);
// The textures of a physically based property other than its colour; `maps` must live until the
// bridge has read it. Null if there are none.
const RtvMaps* rtvMapsOf(const RtvSurface& s, vtkProperty* property, RtvMaps& maps, RtvKeep& keep);
// Bits RTV_TEXTURE and following of a texture; 0 for none.
uint32_t rtvTextureBits(vtkTexture* texture);
// A volume.
const char* rtvAddVolume(RtvBridge* bridge, vtkVolume* volume, vtkRenderer* renderer, const std::string& name);
// Tells the choice between rays and OpenGL of a volume.
void rtvChooseVolume(RtvBridge* bridge, vtkVolume* volume, vtkRenderer* renderer, const RtvView& view);
// Copies of the sources of a glyph mapper.
const char* rtvAddGlyphs(RtvBridge* bridge, vtkActor* actor, vtkGlyph3DMapper* mapper, vtkDataObject* data,
  const RtvProperty& property, const std::string& name);
