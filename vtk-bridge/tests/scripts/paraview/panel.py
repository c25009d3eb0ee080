# Options of the plugin's panel, set as properties: each changes the picture.
from paraview import servermanager
from paraview.simple import *
from vtkmodules.vtkCommonCore import vtkUnsignedCharArray

view = CreateRenderView()
view.ViewSize = [200, 160]
view.UseFXAA = 0
view.OrientationAxesVisibility = 0
Show(Sphere(ThetaResolution=40, PhiResolution=30), view)
Show(Plane(Origin=[-2, -2, -0.6], Point1=[2, -2, -0.6], Point2=[-2, 2, -0.6]), view)
view.CameraPosition = [1, -5, 3]
view.CameraFocalPoint = [0, 0, 0]
view.CameraViewUp = [0, 0, 1]
Render(view)
renderer = view.SMProxy.GetRenderer()
assert renderer.GetClassName() == "vtkRtvRenderer", renderer.GetClassName()
settings = GetSettingsProxy("RayTracing")
assert settings is not None, "the plugin has no settings"


def pixels():
    Render(view)
    rgb = vtkUnsignedCharArray()
    view.GetRenderWindow().GetRGBACharPixelData(0, 0, 199, 159, 0, rgb)
    return [rgb.GetValue(i) for i in range(rgb.GetNumberOfValues())]


plain = pixels()
for name, value in [("Shadows", 1), ("AmbientSamples", 8), ("Mirror", 0.5), ("Material", "Metal"), ("Material", "Glass"), ("Material", "Transparent"), ("PathTracing", 1)]:
    before = getattr(settings, name)
    setattr(settings, name, value)
    changed = sum(abs(a - b) > 3 for a, b in zip(plain, pixels())) / len(plain)
    assert changed > 0.005, (name, value, changed)
    setattr(settings, name, before)
    assert pixels() == plain, name
settings.Threads = 1
settings.SamplesPerPixel = 4
assert pixels() != plain
print("survived")
