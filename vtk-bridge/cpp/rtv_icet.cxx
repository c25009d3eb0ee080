// ParaView's pass that composites ranks with IceT, with floating-point pixels. This is a separate
// library, which the shim opens when there are several ranks: it needs ParaView's libraries, and if
// the shim depended on them, they would register their renderer before ours.
#include <algorithm>
#include <vector>
#include <vtkCamera.h>
#include <vtkCameraPass.h>
#include <vtkFloatArray.h>
#include <vtkIceTCompositePass.h>
#include <vtkIceTContext.h>
#include <vtkMatrix4x4.h>
#include <vtkMultiProcessController.h>
#include <vtkObjectFactory.h>
#include <vtkOpenGLFramebufferObject.h>
#include <vtkOpenGLRenderWindow.h>
#include <vtkOpenGLState.h>
#include <vtkRenderState.h>
#include <vtkRenderer.h>
#include <vtkUnsignedCharArray.h>
// VTK 9.4 and later load OpenGL with GLAD.
#if __has_include(<vtk_glad.h>)
#include <vtk_glad.h>
#else
#include <vtk_glew.h>
#endif

#include <IceT.h>

// ParaView's pass with floating-point pixels: ranks draw into a framebuffer of floats, IceT blends
// floats, and the result is rounded once.
class vtkRtvIceTPass : public vtkIceTCompositePass
{
public:
  static vtkRtvIceTPass* New();
  vtkTypeMacro(vtkRtvIceTPass, vtkIceTCompositePass);

  // Whether `pass` composites translucent images of several ranks.
  static bool Fits(vtkIceTCompositePass* pass)
  {
    vtkMultiProcessController* ranks = pass->GetController();
    return pass->GetUseOrderedCompositing() && pass->GetOrderedCompositingHelper() && ranks &&
      ranks->GetNumberOfProcesses() > 1 && !(pass->*(&vtkRtvIceTPass::EnableFloatValuePass));
  }

  void Borrow(vtkIceTCompositePass* from)
  {
    this->From = from;
    this->SetController(from->GetController());
    this->SetRenderPass(from->GetRenderPass());
    this->SetTileDimensions(from->GetTileDimensions());
    this->SetTileMullions(from->GetTileMullions());
    this->SetDataReplicatedOnAllProcesses(from->GetDataReplicatedOnAllProcesses());
    this->SetImageReductionFactor(from->GetImageReductionFactor());
    this->SetOrderedCompositingHelper(from->GetOrderedCompositingHelper());
    this->SetRenderEmptyImages(from->GetRenderEmptyImages());
    this->SetUseOrderedCompositing(from->GetUseOrderedCompositing());
    this->SetDisplayRGBAResults(from->GetDisplayRGBAResults());
    this->SetDisplayDepthResults(from->GetDisplayDepthResults());
    // For SetupContext: the format of colours.
    this->SetEnableFloatValuePass(true);
  }

  vtkIceTCompositePass* GiveBack()
  {
    vtkIceTCompositePass* from = this->From;
    // Callers request the result from ParaView's own pass, so store it there.
    std::swap(from->*(&vtkRtvIceTPass::LastRenderedRGBAColors), this->LastRenderedRGBAColors);
    (from->*(&vtkRtvIceTPass::LastRenderedDepths))->SetNumberOfTuples(0);
    (from->*(&vtkRtvIceTPass::LastRenderedRGBA32F))->SetNumberOfTuples(0);
    this->SetRenderPass(nullptr);
    this->SetOrderedCompositingHelper(nullptr);
    this->From = nullptr;
    return from;
  }

  void Render(const vtkRenderState* state) override
  {
    this->IceTContext->SetController(this->Controller);
    if (!this->IceTContext->IsValid())
    {
      vtkErrorMacro("IceT cannot be used with this controller.");
      return;
    }
    vtkRenderer* renderer = state->GetRenderer();
    auto window = vtkOpenGLRenderWindow::SafeDownCast(renderer->GetRenderWindow());
    vtkOpenGLState* gl = window->GetState();
    this->IceTContext->MakeCurrent();
    this->SetupContext(state);
    vtkOpenGLState::ScopedglViewport viewport(gl);
    vtkOpenGLState::ScopedglScissor scissor(gl);
    const int* size = window->GetActualSize();
    gl->vtkglViewport(0, 0, size[0], size[1]);
    gl->vtkglScissor(0, 0, size[0], size[1]);
    icetPhysicalRenderSize(size[0], size[1]);

    IceTInt whole[4];
    icetGetIntegerv(ICET_GLOBAL_VIEWPORT, whole);
    vtkCamera* camera = renderer->GetActiveCamera();
    vtkNew<vtkMatrix4x4> view, projection;
    view->DeepCopy(camera->GetModelViewTransformMatrix());
    view->Transpose();
    projection->DeepCopy(camera->GetProjectionTransformMatrix(static_cast<double>(whole[2]) / whole[3], -1, 1));
    projection->Transpose();
    const float nothing[4] = { 0.0f, 0.0f, 0.0f, 0.0f };
    Drawing = this;
    DrawingState = state;
    icetDrawCallback(&vtkRtvIceTPass::Draw);
    IceTImage image = icetDrawFrame(projection->Element[0], view->Element[0], nothing);
    Drawing = nullptr;
    DrawingState = nullptr;

    this->LastRenderedDepths->SetNumberOfTuples(0);
    this->LastRenderedRGBAColors->MarkInValid();
    if (icetImageGetColorFormat(image) != ICET_IMAGE_COLOR_NONE)
    {
      std::vector<float> colors(4 * static_cast<size_t>(icetImageGetNumPixels(image)));
      icetImageCopyColorf(image, colors.data(), ICET_IMAGE_COLOR_RGBA_FLOAT);
      this->LastRenderedRGBAColors->Resize(
        static_cast<int>(icetImageGetWidth(image)), static_cast<int>(icetImageGetHeight(image)), 4);
      unsigned char* out = this->LastRenderedRGBAColors->GetRawPtr()->GetPointer(0);
      std::transform(colors.begin(), colors.end(), out,
        [](float c) { return static_cast<unsigned char>(std::min(std::max(c, 0.0f), 1.0f) * 255.0f + 0.5f); });
      this->LastRenderedRGBAColors->MarkValid();
    }
    this->DisplayResultsIfNeeded(state);
    this->CleanupContext(state);
  }

  void ReleaseGraphicsResources(vtkWindow* window) override
  {
    if (this->Target)
    {
      this->Target->ReleaseGraphicsResources(window);
      this->Target = nullptr;
    }
    this->Superclass::ReleaseGraphicsResources(window);
  }

private:
  // Draws this rank's part with the projection that IceT passes.
  static void Draw(const IceTDouble* matrix, const IceTDouble*, const IceTFloat*, const IceTInt*, IceTImage result)
  {
    vtkRtvIceTPass* self = Drawing;
    if (!self || !self->RenderPass)
    {
      return;
    }
    vtkRenderer* renderer = DrawingState->GetRenderer();
    auto window = vtkOpenGLRenderWindow::SafeDownCast(renderer->GetRenderWindow());
    vtkOpenGLState* gl = window->GetState();
    const int width = window->GetActualSize()[0], height = window->GetActualSize()[1];
    gl->PushFramebufferBindings();
    if (!self->Target)
    {
      self->Target = vtkSmartPointer<vtkOpenGLFramebufferObject>::New();
      self->Target->SetContext(window);
    }
    int had[2];
    self->Target->GetLastSize(had);
    if (had[0] != width || had[1] != height)
    {
      self->Target->PopulateFramebuffer(width, height, true, 1, VTK_FLOAT, true, 32, 0);
    }
    auto bind = [&] {
      self->Target->Bind();
      self->Target->ActivateBuffer(0);
    };
    bind();
    gl->vtkglClearColor(0.0f, 0.0f, 0.0f, 0.0f);
    gl->vtkglClearDepth(1.0);
    gl->vtkglDepthMask(GL_TRUE);
    gl->vtkglClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);

    vtkCamera* camera = renderer->GetActiveCamera();
    vtkSmartPointer<vtkMatrix4x4> before = camera->GetExplicitProjectionTransformMatrix();
    const bool used = camera->GetUseExplicitProjectionTransformMatrix();
    vtkNew<vtkMatrix4x4> projection;
    std::copy(matrix, matrix + 16, &projection->Element[0][0]);
    projection->Transpose();
    camera->SetExplicitProjectionTransformMatrix(projection);
    camera->UseExplicitProjectionTransformMatrixOn();
    double viewport[4], background[3];
    renderer->GetViewport(viewport);
    renderer->GetBackground(background);
    renderer->SetViewport(0, 0, 1, 1);
    renderer->SetBackground(0, 0, 0);
    self->RenderPass->Render(DrawingState);
    renderer->SetBackground(background);
    renderer->SetViewport(viewport);
    camera->SetExplicitProjectionTransformMatrix(before);
    camera->SetUseExplicitProjectionTransformMatrix(used);

    bind();
    glReadPixels(0, 0, static_cast<int>(icetImageGetWidth(result)), static_cast<int>(icetImageGetHeight(result)), GL_RGBA,
      GL_FLOAT, icetImageGetColorf(result));
    gl->PopFramebufferBindings();
  }

  static vtkRtvIceTPass* Drawing;
  static const vtkRenderState* DrawingState;
  vtkIceTCompositePass* From = nullptr;
  vtkSmartPointer<vtkOpenGLFramebufferObject> Target;
};

vtkRtvIceTPass* vtkRtvIceTPass::Drawing = nullptr;
const vtkRenderState* vtkRtvIceTPass::DrawingState = nullptr;
vtkStandardNewMacro(vtkRtvIceTPass);

#define RTV_EXPORT extern "C" __attribute__((visibility("default")))

// Replaces ParaView's pass below `camera` with ours, which is `kept` or a new one. Returns null
// when ParaView's pass does not composite translucent images.
RTV_EXPORT vtkRenderPass* rtv_icet_begin(vtkRenderPass* camera, vtkRenderPass* kept)
{
  auto outer = vtkCameraPass::SafeDownCast(camera);
  auto icet = outer ? vtkIceTCompositePass::SafeDownCast(outer->GetDelegatePass()) : nullptr;
  if (!icet || !vtkRtvIceTPass::Fits(icet))
  {
    return nullptr;
  }
  vtkRtvIceTPass* own = kept ? vtkRtvIceTPass::SafeDownCast(kept) : vtkRtvIceTPass::New();
  // The camera's pass holds the only reference.
  icet->Register(nullptr);
  own->Borrow(icet);
  outer->SetDelegatePass(own);
  return own;
}

// Restores ParaView's pass and passes the result to it.
RTV_EXPORT void rtv_icet_end(vtkRenderPass* camera, vtkRenderPass* own)
{
  vtkIceTCompositePass* icet = vtkRtvIceTPass::SafeDownCast(own)->GiveBack();
  vtkCameraPass::SafeDownCast(camera)->SetDelegatePass(icet);
  icet->UnRegister(nullptr);
}
