// The object factory that replaces vtkRenderer (thesis section 3.2.1), and the entry point for the
// bridge's functions.
#include "rtv_shim.h"

#include <vtkObjectFactory.h>
#include <vtkVersion.h>

const RtvApi* rtvApi = nullptr;

// Passes the bridge's functions to the shim. Returns the version of the interface it was compiled
// for.
extern "C" VTK_ABI_EXPORT uint32_t rtv_shim_init(const RtvApi* api)
{
  if (api && api->abi() == RTV_ABI)
  {
    rtvApi = api;
    rtvApi->host(VTK_MAJOR_VERSION, VTK_MINOR_VERSION, VTK_BUILD_VERSION);
  }
  return RTV_ABI;
}

VTK_CREATE_CREATE_FUNCTION(vtkRtvRenderer);

class vtkRtvFactory : public vtkObjectFactory
{
public:
  static vtkRtvFactory* New()
  {
    vtkRtvFactory* factory = new vtkRtvFactory;
    factory->InitializeObjectBase();
    return factory;
  }
  vtkTypeMacro(vtkRtvFactory, vtkObjectFactory);
  const char* GetVTKSourceVersion() override { return VTK_SOURCE_VERSION; }
  const char* GetDescription() override { return "vtk-bridge: ray traced vtkRenderer"; }

protected:
  vtkRtvFactory()
  {
    this->RegisterOverride(
      "vtkRenderer", "vtkRtvRenderer", "ray tracing renderer", 1, vtkObjectFactoryCreatevtkRtvRenderer);
  }
};

VTK_FACTORY_INTERFACE_IMPLEMENT(vtkRtvFactory);

// For a plugin, which is loaded after VTK's own factories are registered: disables theirs for this
// class.
extern "C" VTK_ABI_EXPORT void rtv_shim_register()
{
  vtkObjectFactory::SetAllEnableFlags(0, "vtkRenderer", "vtkOpenGLRenderer");
  vtkRtvFactory* factory = vtkRtvFactory::New();
  vtkObjectFactory::RegisterFactory(factory);
  factory->Delete();
}
