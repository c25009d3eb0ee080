#include "vtkRtvSettings.h"

#include "rtv_shim.h"

#include <cstdio>
#include <cstdlib>
#include <dlfcn.h>
#include <string>
#include <vtkObjectFactory.h>

extern "C" uint32_t rtv_shim_init(const RtvApi* api);
extern "C" void rtv_shim_register();

namespace
{
// The folder this plugin was installed in is PREFIX/plugins/FLAVOUR; the library is PREFIX/autoload/librtv_loader.so.
std::string LibraryFile()
{
  if (const char* home = getenv("RTV_HOME"))
  {
    return std::string(home) + "/autoload/librtv_loader.so";
  }
  Dl_info info;
  if (!dladdr(reinterpret_cast<void*>(&rtv_shim_register), &info) || !info.dli_fname)
  {
    return "";
  }
  std::string path = info.dli_fname;
  for (int i = 0; i < 3; ++i)
  {
    const size_t slash = path.rfind('/');
    path = slash == std::string::npos ? std::string("..") : path.substr(0, slash);
  }
  return path + "/autoload/librtv_loader.so";
}

// When ParaView opens the plugin: finds the library, and puts our renderer in the place of VTK's for views made from now on.
struct Start
{
  Start()
  {
    const std::string file = LibraryFile();
    void* library = dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
    using Table = const RtvApi* (*)();
    Table table = library ? reinterpret_cast<Table>(dlsym(library, "rtv_api")) : nullptr;
    const RtvApi* api = table ? table() : nullptr;
    if (!api || api->abi() != rtv_shim_init(api))
    {
      fprintf(stderr, "vtk-bridge: not ray tracing: %s cannot be used by this plugin (%s); run `vtk-bridge install --plugin`\n",
        file.c_str(), library ? "another version" : dlerror());
      return;
    }
    // With VTK_AUTOLOAD_PATH the same override may be there already.
    rtv_shim_register();
  }
} start;
}

vtkStandardNewMacro(vtkRtvSettings);

vtkRtvSettings::vtkRtvSettings() = default;

void vtkRtvSettings::Set(const char* name, double value)
{
  char text[64];
  snprintf(text, sizeof(text), "%.17g", value);
  if (rtvApi && !rtvApi->set_option(name, text))
  {
    vtkErrorMacro(<< name << " cannot be " << text);
  }
  this->Modified();
}

void vtkRtvSettings::SetEnableRayTracing(bool on) { this->Set("RTV_OFF", on ? 0 : 1); }
void vtkRtvSettings::SetShadows(bool on) { this->Set("RTV_SHADOWS", on); }
void vtkRtvSettings::SetLightSize(double degrees) { this->Set("RTV_LIGHT_SIZE", degrees); }
void vtkRtvSettings::SetAmbientSamples(int rays) { this->Set("RTV_AO", rays); }
void vtkRtvSettings::SetAmbientStrength(double share) { this->Set("RTV_AO_STRENGTH", share); }
void vtkRtvSettings::SetSamplesPerPixel(int samples) { this->Set("RTV_SAMPLES", samples); }
void vtkRtvSettings::SetProgressivePasses(int passes) { this->Set("RTV_PROGRESSIVE", passes); }
void vtkRtvSettings::SetReflections(bool on) { this->Set("RTV_REFLECTIONS", on); }
void vtkRtvSettings::SetMirror(double share) { this->Set("RTV_MIRROR", share); }
void vtkRtvSettings::SetRoughness(double roughness) { this->Set("RTV_ROUGHNESS", roughness); }
void vtkRtvSettings::SetIndexOfRefraction(double index) { this->Set("RTV_IOR", index); }
void vtkRtvSettings::SetAperture(double radius) { this->Set("RTV_APERTURE", radius); }

namespace
{
void SetText(const char* name, const char* value)
{
  if (rtvApi)
  {
    rtvApi->set_option(name, value);
  }
}
}

void vtkRtvSettings::SetAmbientRadius(double radius)
{
  if (radius > 0.0)
  {
    this->Set("RTV_AO_RADIUS", radius);
  }
  else
  {
    SetText("RTV_AO_RADIUS", "auto");
  }
}

void vtkRtvSettings::SetFocalDistance(double distance)
{
  if (distance > 0.0)
  {
    this->Set("RTV_FOCUS", distance);
  }
  else
  {
    SetText("RTV_FOCUS", "auto");
  }
}

void vtkRtvSettings::SetMaterial(int material)
{
  static const char* const names[] = { "scene", "matte", "metal", "glass", "transparent" };
  if (material >= 0 && material < 5)
  {
    SetText("RTV_MATERIAL", names[material]);
  }
}

void vtkRtvSettings::SetPathTracing(bool on)
{
  SetText("RTV_MODE", on ? "path" : "scivis");
}

void vtkRtvSettings::SetRobustness(int mode)
{
  SetText("RTV_ROBUSTNESS", mode == 0 ? "watertight" : "fast");
}

void vtkRtvSettings::SetThreads(int threads)
{
  // 0 takes a limit back.
  SetText("RTV_THREADS", threads > 0 ? std::to_string(threads).c_str() : "");
}
