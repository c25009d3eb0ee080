# Ray tracing options of a view, as a user of the plugin sets them; a second view keeps its own.
from paraview.simple import *

from capture_view import save, view

v = view([320, 240])
Show(Plane(Origin=[-6, -4, 0], Point1=[6, -4, 0], Point2=[-6, 12, 0]), v).DiffuseColor = [0.8, 0.8, 0.8]
Show(Box(Center=[0, 0, 0.5]), v).DiffuseColor = [0.9, 0.1, 0.1]
Show(Box(Center=[2, 9, 0.5]), v).DiffuseColor = [0.1, 0.8, 0.1]
v.UseLight = 0
lamp = AddLight(view=v)
lamp.Coords = "Scene"
lamp.Position = [-5, -3, 6]
lamp.FocalPoint = [0, -1, 0]
v.CameraPosition, v.CameraFocalPoint, v.CameraViewUp = [0, -6, 4], [0, -0.5, 0.5], [0, 0, 1]
v.CameraViewAngle = 40
v.UseColorPaletteForBackground = 0
v.Background = [0.2, 0.3, 0.5]
Render(v)
renderer = v.SMProxy.GetRenderer()


def pixel(*world):
    renderer.SetWorldPoint(*world, 1)
    renderer.WorldToDisplay()
    return [int(c) for c in renderer.GetDisplayPoint()[:2]]


places = dict(
    shadow=pixel(0.75, 0.2, 0),
    lit=pixel(-1.5, 0, 0),
    concave=pixel(-0.2, -0.53, 0),
    convex=pixel(-0.3, -0.4, 1),
    mirror_of_box=pixel(0, -0.75, 0),
    box_front=pixel(0, -0.5, 0.5),
)
rt = v.RayTracing
save(v, "plain", names=sorted(rt.ListProperties()), **places)
rt.Shadows = 1
save(v, "shadows", **places)
rt.Shadows = 0
rt.AmbientSamples = 32
rt.AmbientRadius = 1.0
save(v, "ambient", **places)
rt.AmbientSamples = 0
rt.MirrorReflection = 0.5
rt.Reflections = 1
save(v, "mirror", **places)
rt.MirrorReflection = 0
rt.Material = "Glass"
save(v, "glass", **places)
rt.Material = "Metal"
save(v, "metal", **places)
rt.Material = "Transparent"
save(v, "transparent", **places)
rt.Material = "Scene"
rt.Reflections = 0
rt.LensRadius = 0.15
rt.SamplesPerPixel = 16
save(v, "lens", **places)
rt.LensRadius = 0
rt.SamplesPerPixel = 1
rt.EnableRayTracing = 0
save(v, "off", **places)
rt.EnableRayTracing = 1
rt.Threads = 1
rt.Robustness = "Fast"
rt.BackEnd = "Scivis"
save(v, "back", **places)
rt.Shadows = 1
other = view([160, 120])
Show(Sphere(), other)
other.CameraPosition = [0, -3, 1]
save(other, "other", shadows=other.RayTracing.Shadows)
