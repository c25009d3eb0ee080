// The C++ side of vtk-bridge: one subclass of vtkOpenGLRenderer. Only code for VTK's arrays and
// OpenGL is here; everything else is behind rtv.h. `vtk-bridge install` compiles it for each VTK on
// the machine, because the layout of VTK's classes differs between versions.
#pragma once
#include "rtv.h"
#include "rtv_compositing.h"

#include <map>
#include <vector>
#include <vtkOpenGLRenderer.h>
#include <vtkSmartPointer.h>

class vtkDataSet;
class vtkDataSetSurfaceFilter;
class vtkMapper;
class vtkOpenGLQuadHelper;
class vtkProp;
class vtkTextureObject;

// The bridge's functions; null until the loader or the plugin sets them.
extern const RtvApi* rtvApi;

// Converts the props of a renderer to surfaces of the bridge.
class RtvExtractor
{
public:
  // Adds `prop` to the frame. Returns false if OpenGL has to draw it; the report then gives the
  // reason.
  bool Add(RtvBridge* bridge, vtkRenderer* renderer, vtkProp* prop, int number);
  // Returns the surface of a data set that is not polygonal, made with the filter cached for
  // `mapper`.
  vtkDataSet* SurfaceOf(vtkMapper* mapper, vtkDataSet* data);
  // Removes the filters of mappers that were not used this frame.
  void EndFrame();

private:
  struct Kept
  {
    vtkSmartPointer<vtkDataSetSurfaceFilter> Filter;
    bool Used;
  };
  std::map<vtkMapper*, Kept> Filters;
};

// Pass the lights of a renderer to the bridge, and return its camera.
void rtvAddLights(RtvBridge* bridge, vtkRenderer* renderer);
RtvView rtvView(vtkRenderer* renderer, int width, int height);
// Samples of a pixel of the bound framebuffer; 0 for one without.
uint32_t rtvWindowSamples(vtkRenderer* renderer);

// Whether OpenGL draws these props of a renderer, because it is cheaper and the image the same.
class RtvChoice
{
public:
  bool OpenGLDraws(RtvBridge* bridge, vtkRenderer* renderer, vtkProp** props, int count);

private:
  // 1 if the driver works on the processor, 0 if not, -1 while that is not known.
  int Software = -1;
};

// Draws an image with its depth into the bound framebuffer.
class RtvBlit
{
public:
  ~RtvBlit();
  // With `covered`, the alpha of an opaque image is the part of a pixel that is covered.
  void Upload(vtkRenderer* renderer, const RtvPicture& picture, bool covered);
  // Stage 0: opaque pixels, with depth. Stage 1: translucent pixels, tested against the existing
  // depth.
  void Draw(vtkRenderer* renderer, int x, int y, int width, int height, int stage);
  void Release(vtkWindow* window);

private:
  vtkOpenGLQuadHelper* Quad = nullptr;
  vtkSmartPointer<vtkTextureObject> Color, Depth, FirstDepth;
  // Type of the numbers of Color.
  int ColorType = 0;
  // Colours are multiplied by their opacity, in two stages.
  bool Blended = false;
  // Colours are not, and opacities are not all 0 or 1.
  bool Covered = false;
  int Size[2] = { 0, 0 };
};

class vtkRtvRenderer : public vtkOpenGLRenderer
{
public:
  static vtkRtvRenderer* New();
  vtkTypeMacro(vtkRtvRenderer, vtkOpenGLRenderer);
  void DeviceRender() override;
  void DeviceRenderOpaqueGeometry(vtkFrameBufferObjectBase* fbo = nullptr) override;
  void ReleaseGraphicsResources(vtkWindow* window) override;
  RtvBridge* GetBridge() { return this->Bridge; }

protected:
  vtkRtvRenderer();
  ~vtkRtvRenderer() override;
  int UpdateGeometry(vtkFrameBufferObjectBase* fbo = nullptr) override;

private:
  void DrawPicture(int stage);
  void Antialias();

  RtvBridge* Bridge = nullptr;
  RtvExtractor Extractor;
  RtvChoice Choice;
  RtvBlit Blit;
  vtkSmartPointer<vtkRenderPass> Compositing;
  // Set while OpenGL draws the rest: the destination of the image.
  bool HasPicture = false;
  bool PictureIsBlended = false;
  int Area[4] = { 0, 0, 0, 0 };
};
