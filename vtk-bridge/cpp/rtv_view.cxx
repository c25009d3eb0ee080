// Lights and camera.
#include "rtv_shim.h"

#include <algorithm>
#include <vtkCamera.h>
#include <vtkLight.h>
#include <vtkLightCollection.h>
#include <vtkMatrix4x4.h>
#include <vtkNew.h>
#include <vtkRenderWindow.h>

void rtvAddLights(RtvBridge* bridge, vtkRenderer* renderer)
{
  vtkLightCollection* lights = renderer->GetLights();
  vtkCollectionSimpleIterator it;
  lights->InitTraversal(it);
  while (vtkLight* light = lights->GetNextLight(it))
  {
    if (!light->GetSwitch())
    {
      continue;
    }
    RtvLight l = {};
    light->GetTransformedPosition(l.position);
    light->GetTransformedFocalPoint(l.focal_point);
    const double* color = light->GetDiffuseColor();
    const double* attenuation = light->GetAttenuationValues();
    for (int c = 0; c < 3; ++c)
    {
      l.color[c] = static_cast<float>(color[c] * light->GetIntensity());
      l.attenuation[c] = static_cast<float>(attenuation[c]);
    }
    l.cone_angle_deg = light->GetConeAngle();
    l.exponent = light->GetExponent();
    l.kind = !light->GetPositional() ? RTV_LIGHT_DIRECTIONAL
      : light->GetConeAngle() < 90.0 ? RTV_LIGHT_SPOT
                                     : RTV_LIGHT_POINT;
    l.headlight = light->LightTypeIsHeadlight() && !light->GetPositional() ? 1 : 0;
    rtvApi->light(bridge, &l);
  }
}

RtvView rtvView(vtkRenderer* renderer, int width, int height)
{
  RtvView view = {};
  vtkCamera* camera = renderer->GetActiveCamera();
  // These matrices contain everything: window centre, explicit projections, tiles, the matrix that
  // IceT sets, and the eye of a stereo pair (which GetCompositeProjectionTransformMatrix omits,
  // because it is meant for picking). Depth from -1 to 1, as in OpenGL.
  vtkNew<vtkMatrix4x4> matrix;
  vtkMatrix4x4::Multiply4x4(camera->GetProjectionTransformMatrix(renderer->GetTiledAspectRatio(), -1.0, 1.0),
    camera->GetModelViewTransformMatrix(), matrix);
  std::copy(&matrix->Element[0][0], &matrix->Element[0][0] + 16, view.clip_from_world);
  view.has_viewer = 1;
  vtkMatrix4x4::Invert(camera->GetModelViewTransformMatrix(), matrix);
  for (int c = 0; c < 3; ++c)
  {
    view.viewer[c] = matrix->GetElement(c, 3);
  }
  double bottom[3], top[3];
  renderer->GetBackground(bottom);
  renderer->GetBackground2(top);
  for (int c = 0; c < 3; ++c)
  {
    view.background_bottom[c] = static_cast<float>(bottom[c]);
    view.background_top[c] = static_cast<float>(renderer->GetGradientBackground() ? top[c] : bottom[c]);
  }
  view.focus_distance = camera->GetDistance();
  view.width = static_cast<uint32_t>(width);
  view.height = static_cast<uint32_t>(height);
  // While the mouse rotates the scene, interactors request several frames a second; for still
  // images far less than one.
  view.interactive = renderer->GetRenderWindow()->GetDesiredUpdateRate() > 1.0 ? 1 : 0;
  return view;
}
