// ParaView's plugin: the shim, and a page of settings for the options.
//
// Written without paraview_add_plugin: that needs cmake and the development files of some fifteen other packages, this only ParaView's
// headers. What the macro would make is a description of the plugin, the XML of its proxies, and the wrapping of its class.
#define PARAVIEW_BUILDING_PLUGIN
#define PARAVIEW_PLUGIN_BUILT_SHARED 1
#include "rtv_panel.h"
#include "rtv_shim.h"

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <dlfcn.h>
#include <map>
#include <string>
#include <vtkClientServerInterpreter.h>
#include <vtkClientServerStream.h>
#include <vtkObjectFactory.h>
#include <vtkPVPlugin.h>
#include <vtkPVServerManagerPluginInterface.h>

extern "C" uint32_t rtv_shim_init(const RtvApi* api);
extern "C" void rtv_shim_register();

namespace
{
// How a property's number becomes an option's text.
enum Kind
{
  Number,
  Inverted,  // 1 is off
  Automatic, // 0 is "auto"
  Unlimited, // 0 takes the option back
  Named      // one of the words
};

struct Property
{
  const char* Command;
  const char* Option;
  double Default;
  Kind Conversion;
  const char* Words[5];
};

const Property Properties[] = {
  { "SetEnableRayTracing", "RTV_OFF", 1, Inverted, {} },
  { "SetShadows", "RTV_SHADOWS", 0, Number, {} },
  { "SetLightSize", "RTV_LIGHT_SIZE", 0, Number, {} },
  { "SetAmbientSamples", "RTV_AO", 0, Number, {} },
  { "SetAmbientRadius", "RTV_AO_RADIUS", 0, Automatic, {} },
  { "SetAmbientStrength", "RTV_AO_STRENGTH", 0.5, Number, {} },
  { "SetSamplesPerPixel", "RTV_SAMPLES", 1, Number, {} },
  { "SetProgressivePasses", "RTV_PROGRESSIVE", 1, Number, {} },
  { "SetReflections", "RTV_REFLECTIONS", 0, Number, {} },
  { "SetMirror", "RTV_MIRROR", 0, Number, {} },
  { "SetMaterial", "RTV_MATERIAL", 0, Named, { "scene", "matte", "metal", "glass", "transparent" } },
  { "SetRoughness", "RTV_ROUGHNESS", 0.2, Number, {} },
  { "SetIndexOfRefraction", "RTV_IOR", 1.5, Number, {} },
  { "SetPathTracing", "RTV_MODE", 0, Named, { "scivis", "path" } },
  { "SetAperture", "RTV_APERTURE", 0, Number, {} },
  { "SetFocalDistance", "RTV_FOCUS", 0, Automatic, {} },
  { "SetRobustness", "RTV_ROBUSTNESS", 0, Named, { "watertight", "fast" } },
  { "SetThreads", "RTV_THREADS", 0, Unlimited, {} },
};

std::string Text(const Property& p, double value)
{
  const int word = static_cast<int>(value);
  if (p.Conversion == Named)
  {
    return word >= 0 && word < 5 && p.Words[word] ? p.Words[word] : p.Words[0];
  }
  if (value == 0.0 && (p.Conversion == Automatic || p.Conversion == Unlimited))
  {
    return p.Conversion == Automatic ? "auto" : "";
  }
  char text[64];
  snprintf(text, sizeof(text), "%.17g", p.Conversion == Inverted ? 1.0 - value : value);
  return text;
}

// The folder of this plugin is PREFIX/plugins/FLAVOUR; the library is PREFIX/autoload/librtv_loader.so.
std::string LibraryFile()
{
  std::string prefix = getenv("RTV_HOME") ? getenv("RTV_HOME") : "";
  Dl_info info;
  if (prefix.empty() && dladdr(reinterpret_cast<void*>(&rtv_shim_register), &info) && info.dli_fname)
  {
    prefix = info.dli_fname;
    for (int i = 0; i < 3; ++i)
    {
      const size_t slash = prefix.rfind('/');
      prefix = slash == std::string::npos ? std::string("..") : prefix.substr(0, slash);
    }
  }
  return prefix + "/autoload/librtv_loader.so";
}

// When ParaView opens the plugin: finds the library, and puts our renderer in the place of VTK's for views made from now on.
struct Start
{
  Start()
  {
    const std::string file = LibraryFile();
    void* library = dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
    const char* error = library ? "another version" : dlerror();
    using Table = const RtvApi* (*)();
    Table table = library ? reinterpret_cast<Table>(dlsym(library, "rtv_api")) : nullptr;
    const RtvApi* api = table ? table() : nullptr;
    if (!api || api->abi() != rtv_shim_init(api))
    {
      fprintf(stderr, "vtk-bridge: not ray tracing: %s cannot be used by this plugin (%s); run `vtk-bridge install --plugin`\n",
        file.c_str(), error);
      return;
    }
    rtv_shim_register();
  }
} start;
}

// What the settings' proxy makes on client and servers.
class vtkRtvSettings : public vtkObject
{
public:
  static vtkRtvSettings* New();
  vtkTypeMacro(vtkRtvSettings, vtkObject);
  void Set(const Property& p, double value)
  {
    // A proxy pushes all its defaults when it is made: they must not hide what the environment says.
    if (rtvApi && (value != p.Default || this->Touched[p.Option]))
    {
      this->Touched[p.Option] = true;
      const std::string text = Text(p, value);
      if (!rtvApi->set_option(p.Option, text.c_str()))
      {
        vtkErrorMacro(<< p.Option << " cannot be " << text);
      }
    }
    this->Modified();
  }

private:
  std::map<std::string, bool> Touched;
};
vtkStandardNewMacro(vtkRtvSettings);

namespace
{
vtkObjectBase* NewSettings(void*)
{
  return vtkRtvSettings::New();
}

// Calls by name, which cmake's wrapping would make from a header.
int Command(vtkClientServerInterpreter* interpreter, vtkObjectBase* object, const char* method,
  const vtkClientServerStream& message, vtkClientServerStream& result, void*)
{
  auto settings = vtkRtvSettings::SafeDownCast(object);
  for (const Property& p : Properties)
  {
    double value = 0.0;
    int whole = 0;
    if (!settings || strcmp(p.Command, method) != 0)
    {
      continue;
    }
    if (!message.GetArgument(0, 2, &value) && message.GetArgument(0, 2, &whole))
    {
      value = whole;
    }
    settings->Set(p, value);
    return 1;
  }
  return interpreter->HasCommandFunction("vtkObject")
    ? interpreter->CallCommandFunction("vtkObject", object, method, message, result)
    : 0;
}

void InitializeInterpreter(vtkClientServerInterpreter* interpreter)
{
  interpreter->AddNewInstanceFunction("vtkRtvSettings", NewSettings);
  interpreter->AddCommandFunction("vtkRtvSettings", Command);
}
}

class RtvBridgePlugin
  : public vtkPVPlugin
  , public vtkPVServerManagerPluginInterface
{
public:
  const char* GetPluginName() override { return "RtvBridge"; }
  const char* GetPluginVersionString() override { return "1.0"; }
  bool GetRequiredOnServer() override { return true; }
  bool GetRequiredOnClient() override { return true; }
  const char* GetRequiredPlugins() override { return ""; }
  const char* GetDescription() override { return "Ray tracing in every view, by vtk-bridge."; }
  const char* GetEULA() override { return nullptr; }
  void GetXMLs(std::vector<std::string>& xmls) override { xmls.emplace_back(RtvPanelXML); }
  vtkClientServerInterpreterInitializer::InterpreterInitializationCallback GetInitializeInterpreterCallback() override
  {
    return InitializeInterpreter;
  }
};

PV_PLUGIN_EXPORT(RtvBridge, RtvBridgePlugin)
