# Windows with several samples per pixel: glyph spheres, an isosurface, creases, a line that OpenGL
# draws, edges, and translucent surfaces.
import vtk

from capture import actor, look, save, window


def glyphs(ren):
    image = vtk.vtkImageData()
    image.SetDimensions(5, 5, 5)
    points = vtk.vtkProbeFilter()
    points.SetInputData(image)
    points.SetSourceData(image)
    ball = vtk.vtkSphereSource()
    ball.SetThetaResolution(16)
    ball.SetPhiResolution(16)
    ball.SetRadius(0.35)
    mapper = vtk.vtkGlyph3DMapper()
    mapper.SetInputData(image)
    mapper.SetSourceConnection(ball.GetOutputPort())
    mapper.ScalingOff()
    mapper.ScalarVisibilityOff()
    made = vtk.vtkActor()
    made.SetMapper(mapper)
    made.GetProperty().SetColor(0.9, 0.6, 0.2)
    ren.AddActor(made)


def isosurface(ren):
    source = vtk.vtkRTAnalyticSource()
    source.SetWholeExtent(-20, 20, -20, 20, -20, 20)
    contour = vtk.vtkContourFilter()
    contour.SetInputConnection(source.GetOutputPort())
    contour.GenerateValues(3, 120, 200)
    made = actor(contour)
    made.GetMapper().SetScalarRange(100, 220)
    ren.AddActor(made)


def creases(ren):
    for k in range(3):
        box = vtk.vtkCubeSource()
        made = actor(box, (0.3 + 0.3 * k, 0.8, 0.5))
        made.SetPosition(1.4 * k, 0.2 * k, 0)
        made.RotateZ(20 * k + 10)
        made.GetProperty().SetInterpolationToFlat()
        ren.AddActor(made)
    outline = vtk.vtkOutlineSource()
    outline.SetBounds(-0.7, 3.5, -0.8, 1.2, -0.7, 0.7)
    ren.AddActor(actor(outline, (1, 1, 1)))


def edges(ren):
    ball = vtk.vtkSphereSource()
    made = actor(ball, (0.4, 0.7, 0.9))
    made.GetProperty().EdgeVisibilityOn()
    ren.AddActor(made)


def translucent(ren):
    for k in range(3):
        ball = vtk.vtkSphereSource()
        ball.SetThetaResolution(30)
        ball.SetPhiResolution(30)
        made = actor(ball, (0.9, 0.3 * k, 0.2))
        made.SetPosition(0.7 * k, 0, 0.1 * k)
        made.GetProperty().SetOpacity(1 if k == 1 else 0.4)
        ren.AddActor(made)


for samples in (4, 8):
    for scene in (glyphs, isosurface, creases, edges, translucent):
        ren = vtk.vtkRenderer()
        ren.SetBackground(0.1, 0.15, 0.25)
        ren.SetBackground2(0.5, 0.5, 0.6)
        ren.GradientBackgroundOn()
        scene(ren)
        win = window(300, 300, ren)
        win.SetMultiSamples(samples)
        look(ren, (3, -7, 4))
        ren.ResetCameraClippingRange()
        win.Render()
        save(win, f"{scene.__name__}_{samples}")
