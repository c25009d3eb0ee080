// What the choice between rays and OpenGL is made from.
#include "rtv_arrays.h"

#include <cmath>
#include <string>
#include <vtkActor.h>
#include <vtkActor2D.h>
#include <vtkCellArray.h>
#include <vtkDataSet.h>
#include <vtkGlyph3DMapper.h>
#include <vtkMapper.h>
#include <vtkPolyData.h>
#include <vtkProperty.h>
#include <vtkRenderWindow.h>
#include <vtkVolume.h>

namespace
{
uint64_t TrianglesOf(vtkPolyData* data)
{
  uint64_t sum = 0;
  for (vtkCellArray* cells : { data->GetPolys(), data->GetStrips() })
  {
    const vtkIdType corners = cells->GetNumberOfConnectivityIds(), count = cells->GetNumberOfCells();
    sum += corners > 2 * count ? corners - 2 * count : 0;
  }
  return sum;
}

// Triangles that a mapper draws, as of its last update; an estimate for data other than polygons.
uint64_t TrianglesOf(vtkMapper* mapper)
{
  vtkDataObject* data =
    mapper && mapper->GetNumberOfInputConnections(0) > 0 ? mapper->GetInputDataObject(0, 0) : nullptr;
  if (!data)
  {
    return 0;
  }
  if (auto glyphs = vtkGlyph3DMapper::SafeDownCast(mapper))
  {
    vtkPolyData* source = glyphs->GetSource(0);
    return source ? data->GetNumberOfElements(vtkDataObject::POINT) * TrianglesOf(source) : 0;
  }
  if (auto polygons = vtkPolyData::SafeDownCast(data))
  {
    return TrianglesOf(polygons);
  }
  const vtkIdType cells = data->GetNumberOfElements(vtkDataObject::CELL);
  // Of a block of n cells, about 6 n^(2/3) faces are outside.
  return vtkDataSet::SafeDownCast(data) ? static_cast<uint64_t>(12 * std::pow(cells, 2.0 / 3.0)) : cells;
}

// Whether an actor shows polygons and nothing else.
bool IsSurface(vtkActor* actor)
{
  vtkMapper* mapper = actor->GetMapper();
  if (TrianglesOf(mapper) == 0 || actor->GetProperty()->GetRepresentation() != VTK_SURFACE)
  {
    return false;
  }
  auto data = vtkPolyData::SafeDownCast(mapper->GetInputDataObject(0, 0));
  return !data || (data->GetNumberOfVerts() == 0 && data->GetNumberOfLines() == 0);
}
}

bool RtvChoice::OpenGLDraws(RtvBridge* bridge, vtkRenderer* renderer, vtkProp** props, int count)
{
  int width = 0, height = 0, x = 0, y = 0;
  renderer->GetTiledSizeAndOrigin(&width, &height, &x, &y);
  RtvSceneFacts facts = {};
  facts.pixels = static_cast<uint64_t>(width) * height;
  facts.props = static_cast<uint32_t>(count);
  facts.shadows = renderer->GetUseShadows() ? 1 : 0;
  facts.interactive = renderer->GetRenderWindow()->GetDesiredUpdateRate() > 1.0 ? 1 : 0;
  uint32_t answer = rtvApi->choose(bridge, &facts);
  if (answer == RTV_CHOICE_ASK_AGAIN)
  {
    if (this->Software < 0)
    {
      const char* text = renderer->GetRenderWindow()->ReportCapabilities();
      const std::string capabilities = text ? text : "";
      this->Software = 0;
      for (const char* name : { "llvmpipe", "softpipe", "swrast", "SWR" })
      {
        this->Software |= capabilities.find(name) != std::string::npos ? 1 : 0;
      }
    }
    facts.known = 1;
    facts.software = static_cast<uint32_t>(this->Software);
    for (int i = 0; i < count; ++i)
    {
      if (auto actor = vtkActor::SafeDownCast(props[i]))
      {
        facts.triangles += TrianglesOf(actor->GetMapper());
        facts.translucent += actor->HasTranslucentPolygonalGeometry() ? 1 : 0;
        facts.edges += actor->GetProperty()->GetEdgeVisibility() ? 1 : 0;
        facts.others += IsSurface(actor) ? 0 : 1;
      }
      else if (auto volume = vtkVolume::SafeDownCast(props[i]))
      {
        facts.volumes += 1;
        rtvChooseVolume(bridge, volume, renderer, rtvView(renderer, width, height));
      }
      else if (!vtkActor2D::SafeDownCast(props[i]))
      {
        facts.others += 1;
      }
    }
    answer = rtvApi->choose(bridge, &facts);
  }
  return answer == RTV_CHOICE_OPENGL;
}
