// Writes colour and depth of the traced image into OpenGL's framebuffer.
#include "rtv_shim.h"

#include <vtkOpenGLQuadHelper.h>
#include <vtkOpenGLRenderUtilities.h>
#include <vtkOpenGLRenderWindow.h>
#include <vtkOpenGLShaderCache.h>
#include <vtkOpenGLState.h>
#include <vtkShaderProgram.h>
#include <vtkTextureObject.h>
// VTK 9.4 and later load OpenGL with GLAD.
#if __has_include(<vtk_glad.h>)
#include <vtk_glad.h>
#else
#include <vtk_glew.h>
#endif

RtvBlit::~RtvBlit()
{
  delete this->Quad;
}

void RtvBlit::Release(vtkWindow* window)
{
  if (this->Quad)
  {
    this->Quad->ReleaseGraphicsResources(window);
    delete this->Quad;
    this->Quad = nullptr;
  }
  for (vtkSmartPointer<vtkTextureObject>* texture : { &this->Color, &this->Depth, &this->FirstDepth })
  {
    if (*texture)
    {
      (*texture)->ReleaseGraphicsResources(window);
      *texture = nullptr;
    }
  }
}

uint32_t rtvWindowSamples(vtkRenderer* renderer)
{
  auto window = vtkOpenGLRenderWindow::SafeDownCast(renderer->GetRenderWindow());
  int samples = 0;
  if (window)
  {
    // Of the framebuffer that is bound: passes and IceT draw into ones of their own.
    window->GetState()->vtkglGetIntegerv(GL_SAMPLES, &samples);
  }
  return samples > 1 ? static_cast<uint32_t>(samples) : 0;
}

void RtvBlit::Upload(vtkRenderer* renderer, const RtvPicture& p, bool covered)
{
  auto window = vtkOpenGLRenderWindow::SafeDownCast(renderer->GetRenderWindow());
  auto ready = [&](vtkSmartPointer<vtkTextureObject>& texture) {
    if (!texture)
    {
      texture = vtkSmartPointer<vtkTextureObject>::New();
      texture->AutoParametersOff();
    }
    texture->SetContext(window);
    // Otherwise the texture would keep the type of its first image: bytes, if nothing was
    // translucent then.
    texture->ResetFormatAndType();
    return texture.Get();
  };
  const int type = p.straight ? VTK_UNSIGNED_SHORT : p.blended ? VTK_FLOAT : VTK_UNSIGNED_CHAR;
  if (this->Color && this->ColorType != type)
  {
    // A texture keeps the format of its first data.
    this->Color->ReleaseGraphicsResources(window);
    this->Color = nullptr;
  }
  this->ColorType = type;
  this->Blended = type == VTK_FLOAT;
  this->Covered = p.straight || (covered && !this->Blended);
  this->Size[0] = static_cast<int>(p.width);
  this->Size[1] = static_cast<int>(p.height);
  if (this->Blended)
  {
    ready(this->Color)->Create2DFromRaw(p.width, p.height, 4, VTK_FLOAT, const_cast<float*>(p.blended));
    ready(this->FirstDepth)
      ->CreateDepthFromRaw(
        p.width, p.height, vtkTextureObject::Float32, VTK_FLOAT, const_cast<float*>(p.first_depth));
  }
  else
  {
    const void* color = p.straight ? static_cast<const void*>(p.straight) : p.opaque;
    ready(this->Color)->Create2DFromRaw(p.width, p.height, 4, type, const_cast<void*>(color));
  }
  ready(this->Depth)->CreateDepthFromRaw(
    p.width, p.height, vtkTextureObject::Float32, VTK_FLOAT, const_cast<float*>(p.depth));
}

void RtvBlit::Draw(vtkRenderer* renderer, int x, int y, int width, int height, int stage)
{
  auto window = vtkOpenGLRenderWindow::SafeDownCast(renderer->GetRenderWindow());
  if (!this->Quad)
  {
    std::string fragment = vtkOpenGLRenderUtilities::GetFullScreenQuadFragmentShaderTemplate();
    vtkShaderProgram::Substitute(fragment, "//VTK::FSQ::Decl",
      "uniform sampler2D color; uniform sampler2D depth; uniform sampler2D firstDepth;\n"
      "uniform int stage; uniform int blended; uniform ivec2 size;\n");
    // Rows of the image start at the top.
    vtkShaderProgram::Substitute(fragment, "//VTK::FSQ::Impl",
      "ivec2 at = ivec2(texCoord * vec2(size)); at.y = size.y - 1 - at.y;\n"
      "vec4 c = texelFetch(color, at, 0); float d = texelFetch(depth, at, 0).r;\n"
      "if (c.a <= 0.0) discard;\n"
      "if (blended != 0) { if ((d < 1.0) == (stage == 1)) discard;\n"
      "  if (stage == 1) d = texelFetch(firstDepth, at, 0).r; }\n"
      "gl_FragDepth = d; gl_FragData[0] = c;\n");
    this->Quad = new vtkOpenGLQuadHelper(
      window, vtkOpenGLRenderUtilities::GetFullScreenQuadVertexShader().c_str(), fragment.c_str(), "");
  }
  else
  {
    window->GetShaderCache()->ReadyShaderProgram(this->Quad->Program);
  }
  if (!this->Quad->Program)
  {
    return;
  }
  vtkTextureObject* first = this->Blended ? this->FirstDepth.Get() : this->Depth.Get();
  this->Color->Activate();
  this->Depth->Activate();
  first->Activate();
  vtkShaderProgram* program = this->Quad->Program;
  program->SetUniformi("color", this->Color->GetTextureUnit());
  program->SetUniformi("depth", this->Depth->GetTextureUnit());
  program->SetUniformi("firstDepth", first->GetTextureUnit());
  program->SetUniformi("stage", stage);
  program->SetUniformi("blended", this->Blended ? 1 : 0);
  program->SetUniform2i("size", this->Size);
  vtkOpenGLState* state = window->GetState();
  {
    vtkOpenGLState::ScopedglEnableDisable depthTest(state, GL_DEPTH_TEST), blend(state, GL_BLEND),
      scissorTest(state, GL_SCISSOR_TEST), cull(state, GL_CULL_FACE);
    vtkOpenGLState::ScopedglDepthFunc depthFunction(state);
    vtkOpenGLState::ScopedglDepthMask depthMask(state);
    vtkOpenGLState::ScopedglBlendFuncSeparate blendFunction(state);
    vtkOpenGLState::ScopedglViewport viewport(state);
    vtkOpenGLState::ScopedglScissor scissor(state);
    state->vtkglViewport(x, y, width, height);
    state->vtkglEnable(GL_SCISSOR_TEST);
    state->vtkglScissor(x, y, width, height);
    state->vtkglDisable(GL_CULL_FACE);
    state->vtkglEnable(GL_DEPTH_TEST);
    state->vtkglDepthFunc(GL_LEQUAL);
    state->vtkglDepthMask(stage == 0 ? GL_TRUE : GL_FALSE);
    if (this->Blended)
    {
      state->vtkglEnable(GL_BLEND);
      state->vtkglBlendFuncSeparate(GL_ONE, GL_ONE_MINUS_SRC_ALPHA, GL_ONE, GL_ONE_MINUS_SRC_ALPHA);
    }
    else if (this->Covered)
    {
      state->vtkglEnable(GL_BLEND);
      state->vtkglBlendFuncSeparate(GL_SRC_ALPHA, GL_ONE_MINUS_SRC_ALPHA, GL_ONE, GL_ONE_MINUS_SRC_ALPHA);
    }
    else
    {
      state->vtkglDisable(GL_BLEND);
    }
    this->Quad->Render();
  }
  first->Deactivate();
  this->Depth->Deactivate();
  this->Color->Deactivate();
}
