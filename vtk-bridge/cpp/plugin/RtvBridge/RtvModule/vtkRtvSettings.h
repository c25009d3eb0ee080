// The options of vtk-bridge as an object with setters, for ParaView's panel and Python.
#ifndef vtkRtvSettings_h
#define vtkRtvSettings_h
#include "RtvBridgeSettingsModule.h"
#include <vtkObject.h>

class RTVBRIDGESETTINGS_EXPORT vtkRtvSettings : public vtkObject
{
public:
  static vtkRtvSettings* New();
  vtkTypeMacro(vtkRtvSettings, vtkObject);

  void SetEnableRayTracing(bool on);
  void SetShadows(bool on);
  void SetLightSize(double degrees);
  void SetAmbientSamples(int rays);
  void SetAmbientRadius(double radius);
  void SetAmbientStrength(double share);
  void SetSamplesPerPixel(int samples);
  void SetProgressivePasses(int passes);
  void SetReflections(bool on);
  void SetMirror(double share);
  void SetMaterial(int material);
  void SetRoughness(double roughness);
  void SetIndexOfRefraction(double index);
  void SetPathTracing(bool on);
  void SetAperture(double radius);
  void SetFocalDistance(double distance);
  void SetRobustness(int mode);
  void SetThreads(int threads);

protected:
  vtkRtvSettings();
  ~vtkRtvSettings() override = default;

private:
  void Set(const char* name, double value);
};
#endif
