// Composites the images of several ranks in floating point.
#pragma once
#include <vtkSmartPointer.h>

class vtkRenderPass;

// ParaView composites bytes, and IceT truncates each blend to whole numbers: with three translucent
// layers the error is up to two of 255. While one of these objects lives, a pass for floats, of
// librtv_icet.so, replaces the renderer's IceT pass.
class RtvFloatCompositing
{
public:
  // `kept` stores that pass between frames.
  RtvFloatCompositing(vtkRenderPass* pass, vtkSmartPointer<vtkRenderPass>& kept);
  ~RtvFloatCompositing();

private:
  vtkRenderPass* Camera = nullptr;
  vtkRenderPass* Own = nullptr;
};
