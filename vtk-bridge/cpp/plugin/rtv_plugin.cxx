// The ParaView plugin. When ParaView loads it, it opens the bridge and the shim for this ParaView,
// registers the renderer's override, and tells ParaView about the views' options. If a part is
// missing, it prints one message, and ParaView works as without the plugin.
//
// Compiled by `vtk-bridge install --plugin` like the shim, with ParaView's headers only. ParaView's
// CMake package would generate the class below, but it requires the headers of a dozen libraries
// that Debian's paraview-dev does not depend on.
#define PARAVIEW_BUILDING_PLUGIN
#define PARAVIEW_PLUGIN_BUILT_SHARED 1
#include "rtv.h"
#include "rtv_view_options.h"
#include "rtv_view_properties.h"

#include <vtkObjectFactory.h>
#include <vtkObjectFactoryCollection.h>
#include <vtkPVPlugin.h>
#include <vtkPVPluginLoader.h>
#include <vtkPVServerManagerPluginInterface.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <dlfcn.h>
#include <string>
#include <sys/stat.h>

namespace
{
bool isFile(const std::string& path)
{
  struct stat status;
  return stat(path.c_str(), &status) == 0 && S_ISREG(status.st_mode);
}

const char* const ShimName = "/lib/" RTV_FLAVOUR "/librtv_shim.so";

// The folder of `vtk-bridge install`: RTV_HOME, or one above this file.
std::string home()
{
  const char* set = std::getenv("RTV_HOME");
  if (set && *set)
  {
    return set;
  }
  Dl_info self;
  if (!dladdr(reinterpret_cast<void*>(&home), &self) || !self.dli_fname)
  {
    return "";
  }
  std::string folder = self.dli_fname;
  for (size_t slash; (slash = folder.rfind('/')) != std::string::npos && slash > 0;)
  {
    folder.resize(slash);
    if (isFile(folder + ShimName))
    {
      return folder;
    }
  }
  return "";
}

bool isRegistered()
{
  vtkObjectFactoryCollection* all = vtkObjectFactory::GetRegisteredFactories();
  vtkCollectionSimpleIterator at;
  all->InitTraversal(at);
  while (vtkObjectFactory* factory = all->GetNextObjectFactory(at))
  {
    if (std::strstr(factory->GetDescription(), "vtk-bridge"))
    {
      return true;
    }
  }
  return false;
}

// Starts the bridge. Returns why it does not work, or an empty string.
std::string start()
{
  const std::string at = home();
  if (at.empty())
  {
    return std::string("there is no build for ParaView ") + RTV_FLAVOUR + " above this plugin; run `vtk-bridge install --plugin`";
  }
  void* bridge = dlopen((at + "/autoload/librtv_loader.so").c_str(), RTLD_NOW | RTLD_LOCAL);
  void* shim = bridge ? dlopen((at + ShimName).c_str(), RTLD_NOW | RTLD_LOCAL) : nullptr;
  if (!shim)
  {
    return dlerror();
  }
  auto table = reinterpret_cast<const RtvApi* (*)()>(dlsym(bridge, "rtv_api"));
  auto init = reinterpret_cast<uint32_t (*)(const RtvApi*)>(dlsym(shim, "rtv_shim_init"));
  auto enroll = reinterpret_cast<void (*)()>(dlsym(shim, "rtv_shim_register"));
  auto bridgeOf = reinterpret_cast<RtvBridge* (*)(vtkObjectBase*)>(dlsym(shim, "rtv_shim_bridge"));
  const RtvApi* api = table ? table() : nullptr;
  if (!api || !init || !enroll || !bridgeOf || api->abi() != RTV_ABI || init(api) != RTV_ABI)
  {
    return "the bridge in " + at + " is of another version; run `vtk-bridge install --plugin` again";
  }
  // VTK_AUTOLOAD_PATH may already have registered it.
  if (!isRegistered())
  {
    enroll();
  }
  return vtkRtvViewOptions::Register(api, bridgeOf) ? "" : "this ParaView has no render views";
}

}

class VtkBridgePlugin : public vtkPVPlugin, public vtkPVServerManagerPluginInterface
{
public:
  VtkBridgePlugin()
  {
    const std::string fault = start();
    this->Works = fault.empty();
    if (!this->Works)
    {
      std::fprintf(stderr, "vtk-bridge: the ParaView plugin does nothing: %s\n", fault.c_str());
    }
  }
  ~VtkBridgePlugin() override { vtkPVPluginLoader::PluginLibraryUnloaded("VtkBridge"); }

  const char* GetPluginName() override { return "VtkBridge"; }
  const char* GetPluginVersionString() override { return "1.0"; }
  bool GetRequiredOnServer() override { return true; }
  bool GetRequiredOnClient() override { return true; }
  const char* GetRequiredPlugins() override { return ""; }
  const char* GetDescription() override
  {
    return "Ray traces render views, with shadows, ambient occlusion, reflections, refraction and depth of field.";
  }
  const char* GetEULA() override { return nullptr; }

  // Options that have no effect are not shown.
  void GetXMLs(std::vector<std::string>& xmls) override
  {
    if (this->Works)
    {
      xmls.push_back(rtvViewProperties);
    }
  }
  vtkClientServerInterpreterInitializer::InterpreterInitializationCallback GetInitializeInterpreterCallback() override
  {
    return nullptr;
  }

private:
  bool Works = false;
};

PV_PLUGIN_EXPORT(VtkBridge, VtkBridgePlugin)
