#include "rtv_compositing.h"

#include <dlfcn.h>
#include <string>
#include <vtkCameraPass.h>

namespace
{
struct Library
{
  vtkRenderPass* (*Begin)(vtkRenderPass*, vtkRenderPass*) = nullptr;
  void (*End)(vtkRenderPass*, vtkRenderPass*) = nullptr;
};

// The library librtv_icet.so in the same folder, if it was built and can be opened.
const Library& icet()
{
  static const Library library = [] {
    Library found;
    Dl_info self;
    if (!dladdr(reinterpret_cast<void*>(&icet), &self) || !self.dli_fname)
    {
      return found;
    }
    std::string path = self.dli_fname;
    path.resize(path.rfind('/') + 1);
    if (void* handle = dlopen((path + "librtv_icet.so").c_str(), RTLD_NOW | RTLD_LOCAL))
    {
      found.Begin = reinterpret_cast<decltype(found.Begin)>(dlsym(handle, "rtv_icet_begin"));
      found.End = reinterpret_cast<decltype(found.End)>(dlsym(handle, "rtv_icet_end"));
    }
    return found;
  }();
  return library;
}
}

RtvFloatCompositing::RtvFloatCompositing(vtkRenderPass* pass, vtkSmartPointer<vtkRenderPass>& kept)
{
  auto camera = vtkCameraPass::SafeDownCast(pass);
  vtkRenderPass* inner = camera ? camera->GetDelegatePass() : nullptr;
  if (!inner || strcmp(inner->GetClassName(), "vtkIceTCompositePass") || !icet().Begin || !icet().End)
  {
    return;
  }
  this->Own = icet().Begin(pass, kept);
  if (this->Own)
  {
    this->Camera = pass;
    if (!kept)
    {
      kept.TakeReference(this->Own);
    }
  }
}

RtvFloatCompositing::~RtvFloatCompositing()
{
  if (this->Own)
  {
    icet().End(this->Camera, this->Own);
  }
}
