#include "rtv_view_options.h"

#include <vtkClientServerInterpreter.h>
#include <vtkClientServerInterpreterInitializer.h>
#include <vtkClientServerStream.h>
#include <vtkCommand.h>
#include <vtkObjectFactory.h>
#include <vtkRenderer.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>

vtkStandardNewMacro(vtkRtvViewOptions);

namespace
{
const RtvApi* theApi = nullptr;
RtvBridge* (*theBridgeOf)(vtkObjectBase* renderer) = nullptr;

// A property's command, the option it sets, its default, and the names of an enumeration. A
// property with its default value leaves the option as the environment sets it, so that RTV_*
// variables also work with the plugin.
struct Row
{
  const char* Command;
  const char* Option;
  const char* Default;
  const char* Names[6];
};

const Row Table[] = {
  { "SetEnableRayTracing", "RTV_OFF", "1", { "1", "0" } },
  { "SetBackEnd", "RTV_MODE", "0", { "scivis", "path" } },
  { "SetThreads", "RTV_THREADS", "0", {} },
  { "SetSamplesPerPixel", "RTV_SAMPLES", "1", {} },
  { "SetProgressivePasses", "RTV_PROGRESSIVE", "1", {} },
  { "SetShadows", "RTV_SHADOWS", "0", {} },
  { "SetLightSize", "RTV_LIGHT_SIZE", "0", {} },
  { "SetAmbientSamples", "RTV_AO", "0", {} },
  { "SetAmbientRadius", "RTV_AO_RADIUS", "0", {} },
  { "SetAmbientStrength", "RTV_AO_STRENGTH", "0.5", {} },
  { "SetReflections", "RTV_REFLECTIONS", "0", {} },
  { "SetMirrorReflection", "RTV_MIRROR", "0", {} },
  { "SetMaterial", "RTV_MATERIAL", "0", { "scene", "matte", "metal", "glass", "transparent" } },
  { "SetRoughness", "RTV_ROUGHNESS", "0.20000000000000001", {} },
  { "SetIndexOfRefraction", "RTV_IOR", "1.5", {} },
  { "SetMaximumBounces", "RTV_MAX_BOUNCES", "8", {} },
  { "SetLensRadius", "RTV_APERTURE", "0", {} },
  { "SetFocalDistance", "RTV_FOCUS", "0", {} },
  { "SetPointRadius", "RTV_POINT_RADIUS", "0", {} },
  { "SetLineRadius", "RTV_LINE_RADIUS", "0", {} },
  { "SetRobustness", "RTV_ROBUSTNESS", "0", { "watertight", "fast" } },
};

// The value, as text, that ParaView sends with a command.
bool valueOf(const vtkClientServerStream& call, std::string& text)
{
  const char* string = nullptr;
  double number = 0;
  if (call.GetNumberOfArguments(0) != 3)
  {
    return false;
  }
  if (call.GetArgument(0, 2, &string) && string)
  {
    text = string;
    return true;
  }
  if (call.GetArgument(0, 2, &number))
  {
    char buffer[40];
    std::snprintf(buffer, sizeof buffer, "%.17g", number);
    text = buffer;
    return true;
  }
  return false;
}

// Corresponds to the code that ParaView's wrapper generator would write for this class.
int command(vtkClientServerInterpreter* interpreter, vtkObjectBase* object, const char* method,
  const vtkClientServerStream& call, vtkClientServerStream& result, void*)
{
  vtkRtvViewOptions* options = vtkRtvViewOptions::SafeDownCast(object);
  std::string value;
  if (options && valueOf(call, value) && options->Set(method, value))
  {
    return 1;
  }
  return interpreter->CallCommandFunction("vtkProp", object, method, call, result);
}

vtkObjectBase* make(void*)
{
  return vtkRtvViewOptions::New();
}

void enroll(vtkClientServerInterpreter* interpreter)
{
  interpreter->AddNewInstanceFunction("vtkRtvViewOptions", make);
  interpreter->AddCommandFunction("vtkRtvViewOptions", command);
}
}

bool vtkRtvViewOptions::Register(const RtvApi* api, RtvBridge* (*bridgeOf)(vtkObjectBase*))
{
  theApi = api;
  theBridgeOf = bridgeOf;
  // For existing and future interpreters.
  vtkClientServerInterpreterInitializer::GetInitializer()->RegisterCallback(enroll);
  return vtkClientServerInterpreterInitializer::GetGlobalInterpreter()->HasCommandFunction("vtkPVRenderView");
}

vtkRtvViewOptions::vtkRtvViewOptions()
{
  this->VisibilityOff();
  this->PickableOff();
  this->UseBoundsOff();
}

vtkRtvViewOptions::~vtkRtvViewOptions() = default;

bool vtkRtvViewOptions::Set(const std::string& command, const std::string& value)
{
  for (const Row& row : Table)
  {
    if (command != row.Command)
    {
      continue;
    }
    std::string text = value;
    if (row.Names[0])
    {
      const int wanted = std::atoi(value.c_str());
      for (int i = 0; i <= wanted && i < 6 && row.Names[i]; ++i)
      {
        text = row.Names[i];
      }
    }
    if (value == row.Default)
    {
      this->Values.erase(row.Option);
    }
    else
    {
      this->Values[row.Option] = text;
    }
    this->Modified();
    return true;
  }
  return false;
}

void vtkRtvViewOptions::Apply(vtkObject* renderer, bool on)
{
  // Null for renderers that do not trace.
  RtvBridge* bridge = theBridgeOf(renderer);
  for (const Row& row : Table)
  {
    const auto found = this->Values.find(row.Option);
    const bool has = on && found != this->Values.end();
    theApi->set_bridge_option(bridge, row.Option, has ? found->second.c_str() : "");
  }
}

void vtkRtvViewOptions::OnRender(vtkObject* renderer, unsigned long event, void*)
{
  if (event == vtkCommand::DeleteEvent)
  {
    this->Renderers.erase(renderer);
  }
  else if (this->IsConsumer(renderer))
  {
    this->Apply(renderer, event == vtkCommand::StartEvent);
  }
}

vtkTypeBool vtkRtvViewOptions::GetVisibility()
{
  for (int i = 0; theApi && i < this->GetNumberOfConsumers(); ++i)
  {
    vtkObject* renderer = this->GetConsumer(i);
    if (vtkRenderer::SafeDownCast(renderer) && this->Renderers.insert(renderer).second)
    {
      // Observers with a method of a vtkObject are removed with that object.
      for (unsigned long event : { vtkCommand::StartEvent, vtkCommand::EndEvent, vtkCommand::DeleteEvent })
      {
        renderer->AddObserver(event, this, &vtkRtvViewOptions::OnRender);
      }
      // The renderer's first frame may already have begun.
      this->Apply(renderer, true);
    }
  }
  return 0;
}
