// Pictures of several ranks, composited by IceT in floating point. Only in ParaView; elsewhere the class has nothing to do.
#pragma once
#include <vtkSmartPointer.h>

class vtkRenderer;
class vtkRenderPass;
class vtkRtvIceTPass;
class vtkWindow;

// ParaView composites bytes, and IceT cuts off what is behind the point at each blend: with three translucent layers that is up to two of 255. While
// one of these lives, the renderer's IceT pass is replaced by one for floats.
class RtvFloatCompositing
{
public:
  // `kept` holds the pass from frame to frame.
  RtvFloatCompositing(vtkRenderPass* pass, vtkSmartPointer<vtkRtvIceTPass>& kept);
  ~RtvFloatCompositing();
  static void Release(vtkSmartPointer<vtkRtvIceTPass>& kept, vtkWindow* window);

private:
  vtkRenderPass* Camera = nullptr;
  vtkRtvIceTPass* Own = nullptr;
};
