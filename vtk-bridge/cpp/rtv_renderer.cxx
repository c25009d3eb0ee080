// The renderer: traces some props and lets OpenGL draw the others into the same image with correct
// depth.
//
// VTK's own DeviceRender, ParaView's passes and IceT's compositing pass all call UpdateGeometry.
// The superclass draws the rest: opaque, translucent, volumes, overlays. Opaque pixels of the image
// are drawn before its opaque props, the other pixels after them.
#include "rtv_shim.h"

#include <algorithm>
#include <string>
#include <vtkActor2D.h>
#include <vtkFrameBufferObjectBase.h>
#include <vtkObjectFactory.h>
#include <vtkOpenGLFXAAFilter.h>
#include <vtkRenderPass.h>
#include <vtkRenderTimerLog.h>
#include <vtkTimeStamp.h>

vtkStandardNewMacro(vtkRtvRenderer);

vtkRtvRenderer::vtkRtvRenderer()
{
  this->Bridge = rtvApi ? rtvApi->new_bridge() : nullptr;
}

vtkRtvRenderer::~vtkRtvRenderer()
{
  if (rtvApi)
  {
    rtvApi->free_bridge(this->Bridge);
  }
}

void vtkRtvRenderer::ReleaseGraphicsResources(vtkWindow* window)
{
  this->Blit.Release(window);
  if (this->Compositing)
  {
    this->Compositing->ReleaseGraphicsResources(window);
  }
  this->Superclass::ReleaseGraphicsResources(window);
}

// The bridge of a renderer, for the plugin, whose options belong to one bridge; null for other
// renderers.
extern "C" VTK_ABI_EXPORT RtvBridge* rtv_shim_bridge(vtkObjectBase* renderer)
{
  vtkRtvRenderer* own = vtkRtvRenderer::SafeDownCast(renderer);
  return own ? own->GetBridge() : nullptr;
}

void vtkRtvRenderer::DeviceRender()
{
  if (!this->Bridge || this->Selector || this->PreserveDepthBuffer || rtvApi->bridge_option(this->Bridge, "RTV_OFF") != 0.0)
  {
    this->Superclass::DeviceRender();
    return;
  }
  RtvFloatCompositing compositing(this->Pass, this->Compositing);
  this->Superclass::DeviceRender();
}

int vtkRtvRenderer::UpdateGeometry(vtkFrameBufferObjectBase* fbo)
{
  // The hardware selector draws selections through the stock mappers, so picking is unchanged.
  if (!this->Bridge || this->Selector || this->UseHiddenLineRemoval || this->PropArrayCount == 0 ||
    !rtvApi->begin(this->Bridge))
  {
    return this->Superclass::UpdateGeometry(fbo);
  }
  if (this->Choice.OpenGLDraws(this->Bridge, this, this->PropArray, this->PropArrayCount))
  {
    for (int i = 0; i < this->PropArrayCount; ++i)
    {
      const std::string name = std::string(this->PropArray[i]->GetClassName()) + " " + std::to_string(i);
      rtvApi->pass(this->Bridge, name.c_str(), nullptr);
    }
    rtvApi->end(this->Bridge);
    return this->Superclass::UpdateGeometry(fbo);
  }
  std::vector<vtkProp*> rest;
  for (int i = 0; i < this->PropArrayCount; ++i)
  {
    if (!this->Extractor.Add(this->Bridge, this, this->PropArray[i], i))
    {
      rest.push_back(this->PropArray[i]);
    }
  }
  this->Extractor.EndFrame();
  const int traced = this->PropArrayCount - static_cast<int>(rest.size());
  int x = 0, y = 0, width = 0, height = 0;
  if (fbo)
  {
    fbo->GetLastSize(width, height);
  }
  else
  {
    this->GetTiledSizeAndOrigin(&width, &height, &x, &y);
  }
  bool drawn = false;
  RtvPicture picture;
  bool covered = false;
  if (traced > 0 && width > 0 && height > 0)
  {
    rtvAddLights(this->Bridge, this);
    if (this->UseSSAO)
    {
      rtvApi->warn(this->Bridge, "SSAO does not see what is ray traced; use RTV_AO for ambient occlusion");
    }
    RtvView view = rtvView(this, width, height);
    view.shadows = this->UseShadows ? 1 : 0;
    view.window_samples = rtvWindowSamples(this);
    covered = view.window_samples > 1;
    const auto flat = [](vtkProp* prop) { return vtkActor2D::SafeDownCast(prop) != nullptr; };
    view.one_layer = std::all_of(rest.begin(), rest.end(), flat) ? 1 : 0;
    drawn = rtvApi->render(this->Bridge, &view, &picture) != 0;
  }
  if (drawn)
  {
    this->Blit.Upload(this, picture, covered);
    this->PictureIsBlended = picture.blended != nullptr && picture.straight == nullptr;
  }
  rtvApi->end(this->Bridge);
  if (!drawn)
  {
    return this->Superclass::UpdateGeometry(fbo);
  }

  const int area[4] = { x, y, width, height };
  std::copy(area, area + 4, this->Area);
  vtkProp** const props = this->PropArray;
  const int count = this->PropArrayCount;
  const vtkTypeBool shadows = this->UseShadows;
  const bool ssao = this->UseSSAO;
  this->HasPicture = true;
  this->PropArray = rest.data();
  this->PropArrayCount = static_cast<int>(rest.size());
  this->UseShadows = 0;
  this->UseSSAO = false;
  int byOpenGL = 0;
  if (rest.empty())
  {
    this->DrawPicture(0);
    this->DrawPicture(1);
    this->Antialias();
    this->RenderTime.Modified();
  }
  else
  {
    byOpenGL = this->Superclass::UpdateGeometry(fbo);
  }
  this->HasPicture = false;
  this->PropArray = props;
  this->PropArrayCount = count;
  this->UseShadows = shadows;
  this->UseSSAO = ssao;
  this->NumberOfPropsRendered = byOpenGL + traced;
  return this->NumberOfPropsRendered;
}

void vtkRtvRenderer::DeviceRenderOpaqueGeometry(vtkFrameBufferObjectBase* fbo)
{
  this->DrawPicture(0);
  this->Superclass::DeviceRenderOpaqueGeometry(fbo);
  this->DrawPicture(1);
}

// The superclass does this in UpdateGeometry, but it returns early when it has no prop to draw.
void vtkRtvRenderer::Antialias()
{
  if (!this->UseFXAA)
  {
    return;
  }
  if (!this->FXAAFilter)
  {
    this->FXAAFilter = vtkOpenGLFXAAFilter::New();
  }
  if (this->FXAAOptions)
  {
    this->FXAAFilter->UpdateConfiguration(this->FXAAOptions);
  }
  this->FXAAFilter->Execute(this);
}

void vtkRtvRenderer::DrawPicture(int stage)
{
  if (this->HasPicture && (stage == 0 || this->PictureIsBlended))
  {
    this->Blit.Draw(this, this->Area[0], this->Area[1], this->Area[2], this->Area[3], stage);
  }
}
