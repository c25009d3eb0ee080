# Arrows by the glyph filter and by the representation "3D Glyphs", and spheres of "Point Gaussian".
from paraview.simple import *

from capture_view import save, view

ball = Sphere(ThetaResolution=10, PhiResolution=10)
by_height = Elevation(Input=ball, LowPoint=[0, 0, -0.5], HighPoint=[0, 0, 0.5])
glyph = Glyph(Input=by_height, GlyphType="Arrow")
glyph.OrientationArray = ["POINTS", "Normals"]
glyph.ScaleFactor = 0.3
glyph.GlyphMode = "All Points"
v = view([400, 240])
shown = Show(glyph, v)
ColorBy(shown, ("POINTS", "Elevation"))
beside = Transform(Input=by_height)
beside.Transform.Translate = [1.8, 0, 0]
glyphs = Show(beside, v)
glyphs.SetRepresentationType("3D Glyphs")
glyphs.GlyphType = "Cone"
glyphs.Orient = 1
glyphs.OrientationMode = "Direction"
glyphs.SelectOrientationVectors = "Normals"
glyphs.Scaling = 1
glyphs.ScaleFactor = 0.2
ColorBy(glyphs, ("POINTS", "Elevation"))
v.CameraPosition, v.CameraFocalPoint, v.CameraViewUp = [0.9, -4, 1.5], [0.9, 0, 0], [0, 0, 1]
save(v, "glyphs")
