# A texture on a plane.
import sys

import vtk
from paraview.simple import *

from capture_view import save, view

pixels = vtk.vtkImageCanvasSource2D()
pixels.SetExtent(0, 15, 0, 15, 0, 0)
pixels.SetScalarTypeToUnsignedChar()
pixels.SetNumberOfScalarComponents(3)
pixels.SetDrawColor(200, 80, 40)
pixels.FillBox(0, 15, 0, 15)
pixels.SetDrawColor(40, 120, 220)
pixels.FillTriangle(2, 2, 13, 4, 6, 14)
writer = vtk.vtkPNGWriter()
writer.SetInputConnection(pixels.GetOutputPort())
writer.SetFileName(sys.argv[1] + "/texture.tmp.png")
writer.Write()
v = view([260, 220])
shown = Show(Plane(), v)
shown.Texture = CreateTexture(sys.argv[1] + "/texture.tmp.png")
v.CameraPosition, v.CameraFocalPoint, v.CameraViewUp = [0.3, -0.8, 1.6], [0, 0, 0], [0, 1, 0]
save(v, "textures")
