// ParaView sends a property of a view to the object on the server (each rank's) as a call by name. A build without OSPRay knows the
// names and does nothing. Here these calls pass by first: names in the table below become options of the view, everything goes on to
// ParaView's own function. A view's options are in force while its renderer draws, so that two views can differ.
#include "rtv_view_options.h"

#include <vtkCallbackCommand.h>
#include <vtkClientServerInterpreter.h>
#include <vtkClientServerInterpreterInitializer.h>
#include <vtkClientServerStream.h>
#include <vtkPVRenderView.h>
#include <vtkRenderer.h>
#include <vtkSmartPointer.h>

#include <cstring>
#include <map>
#include <string>

namespace
{
const char* const Class = "vtkPVRenderView";

// A property's command, the option it sets, and the value that means "as if not set".
struct Entry
{
  const char* Method;
  const char* Option;
  const char* Unset;
  const char* const* Names; // of an enumeration
};

const char* const Materials[] = { "scene", "matte", "metal", "glass", "transparent", nullptr };
const char* const Robustness[] = { "watertight", "fast", nullptr };

const Entry Entries[] = {
  // ParaView's own, as for OSPRay.
  { "SetShadows", "RTV_SHADOWS", nullptr, nullptr },
  { "SetAmbientOcclusionSamples", "RTV_AO", nullptr, nullptr },
  { "SetSamplesPerPixel", "RTV_SAMPLES", nullptr, nullptr },
  { "SetMaxFrames", "RTV_PROGRESSIVE", nullptr, nullptr },
  { "SetOSPRayRendererType", "RTV_MODE", nullptr, nullptr },
  // Those of rtv_view_properties.h.
  { "SetRtvThreads", "RTV_THREADS", "0", nullptr },
  { "SetRtvAmbientRadius", "RTV_AO_RADIUS", "0", nullptr },
  { "SetRtvAmbientStrength", "RTV_AO_STRENGTH", nullptr, nullptr },
  { "SetRtvLightSize", "RTV_LIGHT_SIZE", nullptr, nullptr },
  { "SetRtvReflections", "RTV_REFLECTIONS", nullptr, nullptr },
  { "SetRtvMirror", "RTV_MIRROR", nullptr, nullptr },
  { "SetRtvMaterial", "RTV_MATERIAL", nullptr, Materials },
  { "SetRtvRoughness", "RTV_ROUGHNESS", nullptr, nullptr },
  { "SetRtvIndexOfRefraction", "RTV_IOR", nullptr, nullptr },
  { "SetRtvMaximumBounces", "RTV_MAX_BOUNCES", nullptr, nullptr },
  { "SetRtvLensRadius", "RTV_APERTURE", nullptr, nullptr },
  { "SetRtvFocalDistance", "RTV_FOCUS", "0", nullptr },
  { "SetRtvRobustness", "RTV_ROBUSTNESS", nullptr, Robustness },
};

struct ViewOptions
{
  bool Effects = false;  // "Enable Ray Tracing"
  bool Geometry = true;  // "Ray Trace Geometry"
  std::map<std::string, std::string> Values;
};

const RtvApi* theApi = nullptr;
std::map<vtkObjectBase*, ViewOptions> theViews;
// Knows ParaView's own functions; ours stands before them in all other interpreters.
vtkSmartPointer<vtkClientServerInterpreter> theOriginal;

// ---- While a view's renderer draws, its options are those of the process ----------------------------------------------------------

void apply(const ViewOptions& view, bool on)
{
  const bool off = !view.Effects && !view.Geometry;
  if (off)
  {
    theApi->set_option("RTV_OFF", on ? "1" : "");
  }
  if (view.Effects)
  {
    for (const auto& option : view.Values)
    {
      theApi->set_option(option.first.c_str(), on ? option.second.c_str() : "");
    }
  }
}

void onRender(vtkObject*, unsigned long event, void* view, void*)
{
  auto found = theViews.find(static_cast<vtkObjectBase*>(view));
  if (found != theViews.end())
  {
    apply(found->second, event == vtkCommand::StartEvent);
  }
}

void onDelete(vtkObject* view, unsigned long, void*, void*)
{
  theViews.erase(view);
}

ViewOptions& optionsOf(vtkPVRenderView* view)
{
  auto found = theViews.find(view);
  if (found == theViews.end())
  {
    vtkNew<vtkCallbackCommand> render, gone;
    render->SetCallback(onRender);
    render->SetClientData(static_cast<vtkObjectBase*>(view));
    view->GetRenderer()->AddObserver(vtkCommand::StartEvent, render);
    view->GetRenderer()->AddObserver(vtkCommand::EndEvent, render);
    gone->SetCallback(onDelete);
    view->AddObserver(vtkCommand::DeleteEvent, gone);
    found = theViews.emplace(view, ViewOptions()).first;
  }
  return found->second;
}

// ---- Calls ----------------------------------------------------------------------------------------------------------------------------

// The call's only argument as text; false when it has none or several.
bool argument(const vtkClientServerStream& call, std::string& text)
{
  if (call.GetNumberOfArguments(0) != 3)
  {
    return false;
  }
  double number = 0;
  const char* string = nullptr;
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

// True when the call is one of ours.
bool take(vtkPVRenderView* view, const char* method, const vtkClientServerStream& call)
{
  std::string value;
  if (std::strncmp(method, "Set", 3) != 0 || !argument(call, value))
  {
    return false;
  }
  if (std::strcmp(method, "SetEnableOSPRay") == 0)
  {
    optionsOf(view).Effects = value != "0";
    return true;
  }
  if (std::strcmp(method, "SetRtvGeometry") == 0)
  {
    optionsOf(view).Geometry = value != "0";
    return true;
  }
  for (const Entry& entry : Entries)
  {
    if (std::strcmp(method, entry.Method) != 0)
    {
      continue;
    }
    ViewOptions& options = optionsOf(view);
    if (entry.Names)
    {
      const int wanted = std::atoi(value.c_str());
      for (int i = 0; i <= wanted && entry.Names[i]; ++i)
      {
        value = entry.Names[i];
      }
    }
    if (std::strcmp(entry.Option, "RTV_MODE") == 0)
    {
      // "OSPRay raycaster", "OSPRay pathtracer", or OptiX'.
      value = value.find("path") != std::string::npos ? "path" : "scivis";
    }
    if (entry.Unset && value == entry.Unset)
    {
      options.Values.erase(entry.Option);
    }
    else
    {
      options.Values[entry.Option] = value;
    }
    return true;
  }
  return false;
}

int call(vtkClientServerInterpreter*, vtkObjectBase* object, const char* method, const vtkClientServerStream& message,
  vtkClientServerStream& result, void*)
{
  vtkPVRenderView* view = vtkPVRenderView::SafeDownCast(object);
  if (view && take(view, method, message))
  {
    return 1;
  }
  return theOriginal->CallCommandFunction(Class, object, method, message, result);
}

void listen(vtkClientServerInterpreter* interpreter)
{
  if (interpreter != theOriginal)
  {
    interpreter->AddCommandFunction(Class, call);
  }
}
}

bool rtvListenToViews(const RtvApi* api)
{
  theApi = api;
  auto initializer = vtkClientServerInterpreterInitializer::GetInitializer();
  theOriginal.TakeReference(initializer->NewInterpreter());
  for (const char* n : { "vtkPVRenderView", "vtkPVView", "vtkView", "vtkObject", "vtkObjectBase" }) std::fprintf(stderr, "HAS %s %d\n", n, (int)theOriginal->HasCommandFunction(n));
  if (!theOriginal->HasCommandFunction(Class))
  {
    return false;
  }
  // Those there are, and those to come.
  initializer->RegisterCallback(listen);
  return true;
}
