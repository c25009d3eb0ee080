// Pictures of several ranks, composited in floating point.
#pragma once
#include <vtkSmartPointer.h>

class vtkRenderPass;

// ParaView composites bytes, and IceT cuts off what is behind the point at each blend: with three translucent layers that is up to two of 255. While
// one of these lives, the renderer's IceT pass is replaced by one for floats, of librtv_icet.so.
class RtvFloatCompositing
{
public:
  // `kept` holds that pass from frame to frame.
  RtvFloatCompositing(vtkRenderPass* pass, vtkSmartPointer<vtkRenderPass>& kept);
  ~RtvFloatCompositing();

private:
  vtkRenderPass* Camera = nullptr;
  vtkRenderPass* Own = nullptr;
};
