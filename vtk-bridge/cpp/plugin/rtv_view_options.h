// The options of a render view: `view.RayTracing` in Python, the button "Ray Tracing" in the panel.
#pragma once
#include "rtv.h"

#include <vtkProp.h>

#include <map>
#include <set>
#include <string>

// A prop that draws nothing and holds the options of one view. ParaView adds it to the view's
// renderer on every rank, like the axes grid, and so the prop finds its renderer. While that
// renderer draws, the options apply to its bridge. Two views can therefore differ, even in two
// threads.
class vtkRtvViewOptions : public vtkProp
{
public:
  static vtkRtvViewOptions* New();
  vtkTypeMacro(vtkRtvViewOptions, vtkProp);

  // Registers this class with ParaView. `api` contains the bridge's functions; `bridgeOf` returns a
  // renderer's bridge. Returns false when this ParaView has no render views.
  static bool Register(const RtvApi* api, RtvBridge* (*bridgeOf)(vtkObjectBase* renderer));

  // Applies a property's command (a row of the table in the .cxx). Returns false when the command
  // is unknown.
  bool Set(const std::string& command, const std::string& value);

  // Always invisible. Renderers call this for their props before they draw, which is when the prop
  // finds its renderers.
  vtkTypeBool GetVisibility() override;

protected:
  vtkRtvViewOptions();
  ~vtkRtvViewOptions() override;

private:
  void OnRender(vtkObject* renderer, unsigned long event, void* data);
  void Apply(vtkObject* renderer, bool on);

  std::map<std::string, std::string> Values;
  // Renderers whose start and end of a frame are observed.
  std::set<vtkObject*> Renderers;
};
