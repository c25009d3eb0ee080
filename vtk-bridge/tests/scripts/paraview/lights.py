# ParaView's light kit switched off, with custom lights on specular and physically based surfaces.
from paraview.simple import *

from capture_view import save, view

v = view([360, 240])
balls = [Sphere(Center=[1.1 * i, 0, 0], ThetaResolution=40, PhiResolution=40) for i in range(3)]
shown = [Show(ball, v) for ball in balls]
shown[0].DiffuseColor = [0.9, 0.5, 0.2]
shown[0].Specular = 0.8
shown[0].SpecularPower = 30
shown[2].Interpolation = "PBR"
shown[2].Metallic = 0.7
shown[2].Roughness = 0.4
shown[2].DiffuseColor = [0.9, 0.8, 0.5]
floor = Plane(Origin=[-2, -2, -0.6], Point1=[4, -2, -0.6], Point2=[-2, 2, -0.6])
Show(floor, v).DiffuseColor = [0.7, 0.7, 0.7]
v.CameraPosition, v.CameraFocalPoint, v.CameraViewUp = [1.1, -4.5, 2], [1.1, 0, 0], [0, 0, 1]
save(v, "light_kit")
v.UseLight = 0
light = AddLight(view=v)
light.Coords = "Scene"
light.Position = [3, -4, 6]
light.FocalPoint = [1, 0, 0]
light.DiffuseColor = [1, 0.9, 0.8]
light.Intensity = 0.9
save(v, "one_light")
# Ambient light affects this surface; the physically based one is hidden.
Hide(balls[2], v)
shown[1].Ambient = 0.3
shown[1].Diffuse = 0.6
save(v, "ambient")
