// The options of a render view: `view.RayTracing` in Python, the button "Ray Tracing" in the panel.
#pragma once
#include "rtv.h"

#include <vtkProp.h>

#include <map>
#include <set>
#include <string>

// A prop that draws nothing. ParaView adds it to the view's renderer on every rank, as it does with
// the axes grid; so it knows the renderer whose options it holds. They are those of that renderer's
// bridge while it draws, and so two views can differ, also in two threads.
class vtkRtvViewOptions : public vtkProp
{
public:
  static vtkRtvViewOptions* New();
  vtkTypeMacro(vtkRtvViewOptions, vtkProp);

  // Makes ParaView know this class; `api` are the bridge's functions, `bridgeOf` gives a renderer's
  // bridge. False when this ParaView has no render views.
  static bool Enroll(const RtvApi* api, RtvBridge* (*bridgeOf)(vtkObjectBase* renderer));

  // Sets what a property's command (a row of the table in the .cxx) says. False when there is no
  // such command.
  bool Set(const std::string& command, const std::string& value);

  // There is nothing to see. Renderers ask this of their props before they draw, which is when we
  // get to know ours.
  vtkTypeBool GetVisibility() override;

protected:
  vtkRtvViewOptions();
  ~vtkRtvViewOptions() override;

private:
  void OnRender(vtkObject* renderer, unsigned long event, void* data);
  void Apply(vtkObject* renderer, bool on);

  std::map<std::string, std::string> Values;
  // Renderers that tell us when they begin and end a frame.
  std::set<vtkObject*> Renderers;
};
