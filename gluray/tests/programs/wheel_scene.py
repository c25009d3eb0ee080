"""Surfaces as PyVista and today's VTK draw them, one kind of scene a run: wheel_scene.py [KIND [SAMPLES [FRAMES]]]."""
import sys
import vtk
from egl_window import show

kind = sys.argv[1] if len(sys.argv) > 1 else "plain"
samples = int(sys.argv[2]) if len(sys.argv) > 2 else 0
frames = int(sys.argv[3]) if len(sys.argv) > 3 else 1
renderer = vtk.vtkRenderer()


def made(factory, **values):
    """A thing of VTK's with values set; by methods, as older versions want it."""
    out = getattr(vtk, "vtk" + factory)()
    for name, value in values.items():
        set_value = getattr(out, "Set" + name)
        set_value(*value) if isinstance(value, tuple) else set_value(value)
    return out


def place(i):
    return 1.1 * (i % 2), 1.1 * (i // 2), 0


def number_cells(data, mapper, number):
    """Gives cells values that `number` makes of their numbers, and colours by these."""
    values = vtk.vtkFloatArray()
    values.SetName("values")
    for cell in range(data.GetNumberOfCells()):
        values.InsertNextValue(number(cell))
    data.GetCellData().SetScalars(values)
    mapper.SetScalarModeToUseCellData()
    mapper.SetScalarRange(values.GetRange())


def sphere(i, radius=0.5, normals=True, cells=False, points=False, resolution=32):
    """The sphere at place `i` of four as an actor; with colours of cells or points where asked for."""
    source = made("SphereSource", ThetaResolution=resolution, PhiResolution=resolution, Radius=radius, Center=place(i))
    heights = made("ElevationFilter", LowPoint=(0, 0, -0.5), HighPoint=(0, 0, 0.5))
    heights.SetInputConnection(source.GetOutputPort())
    heights.Update()
    data = vtk.vtkPolyData()
    data.ShallowCopy(heights.GetOutput())
    if not normals:
        data.GetPointData().SetNormals(None)
    mapper = made("PolyDataMapper", ScalarVisibility=cells or points)
    mapper.SetInputData(data)
    if cells:
        number_cells(data, mapper, lambda cell: cell * 7 % 13)
    actor = made("Actor", Mapper=mapper)
    actor.GetProperty().SetColor(0.9, 0.4, 0.2)
    actor.GetProperty().SetSpecular(0.3)
    actor.GetProperty().SetSpecularPower(20)
    renderer.AddActor(actor)
    return actor


def plain():
    """Without normals, with colour maps that are applied after interpolation, under a headlight."""
    for i in range(4):
        sphere(i, normals=i % 2 == 0, points=i >= 2).GetMapper().InterpolateScalarsBeforeMappingOn()


def flat():
    for i in range(4):
        sphere(i, normals=i % 2 == 0, points=i >= 2).GetProperty().SetInterpolationToFlat()


def cells():
    """Colours of cells, smooth and flat, of triangles and of quads that VTK splits."""
    for i in range(3):
        sphere(i, normals=i % 2 == 0, cells=True)
    plane = made("PlaneSource", XResolution=9, YResolution=7, Origin=(0.6, 0.6, 0), Point1=(1.6, 0.6, 0.3), Point2=(0.6, 1.6, 0.2))
    plane.Update()
    mapper = vtk.vtkPolyDataMapper()
    mapper.SetInputData(plane.GetOutput())
    number_cells(plane.GetOutput(), mapper, lambda cell: cell)
    renderer.AddActor(made("Actor", Mapper=mapper))


def translucent():
    """Layers that VTK sums up in any order, before and behind something opaque."""
    sphere(0).GetProperty().SetOpacity(0.4)
    sphere(0, radius=0.3)
    sphere(1, points=True).GetProperty().SetOpacity(0.6)
    sphere(1, radius=0.7, normals=False).GetProperty().SetOpacity(0.3)
    sphere(2, cells=True).GetProperty().SetOpacity(0.5)
    sphere(3, radius=0.8).GetProperty().SetOpacity(0.2)


def peeled():
    translucent()
    renderer.SetUseDepthPeeling(1)
    renderer.SetMaximumNumberOfPeels(50)
    renderer.SetOcclusionRatio(0.0)


def clip(actor, i, *normals):
    for normal in normals:
        x, y, _ = place(i)
        actor.GetMapper().AddClippingPlane(made("Plane", Origin=(x, y, 0.1), Normal=normal))


def clipped():
    """Two planes cut the mapper's triangles; what is inside is seen."""
    for i in range(4):
        clip(sphere(i, normals=i % 2 == 0, cells=i >= 2), i, (-1, 0.3, -0.2), (0, -1, 0.2))


def lights(material=lambda actor: None):
    """A lamp, a spot, and light from far away."""
    for i in range(4):
        material(sphere(i, normals=i % 2 == 0, points=i >= 2))
    renderer.AutomaticLightCreationOff()
    for cone, color in (90, (1, 1, 1)), (20, (0.5, 0.5, 1)), (None, (0.5, 0.1, 0.1)):
        light = made("Light", Color=color, FocalPoint=(0.5, 0.5, 0), Position=(-1 if cone is None else 1, 1, 2))
        if cone is not None:
            light.SetPositional(1)
            light.SetConeAngle(cone)
            light.SetExponent(2)
            light.SetAttenuationValues(0.5, 0.1, 0.1)
        renderer.AddLight(light)


def light_kit():
    for i in range(4):
        sphere(i, normals=i % 2 == 0, points=i >= 2)
    renderer.AutomaticLightCreationOff()
    vtk.vtkLightKit().AddLightsToRenderer(renderer)


def both_sides():
    """Hemispheres, whose insides have a material of their own."""
    for i in range(4):
        actor = sphere(i, normals=i % 2 == 0)
        clip(actor, i, (-1, 0.3, -0.6))
        actor.SetBackfaceProperty(made("Property", Color=(0.1, 0.8, 0.3), Specular=0.2))


def metal(actor):
    actor.GetProperty().SetInterpolationToPBR()
    actor.GetProperty().SetMetallic(0.4)
    actor.GetProperty().SetRoughness(0.35)


def physical():
    """Physically based, under a light at the eye."""
    for i in range(4):
        metal(sphere(i, normals=i % 2 == 0, points=i >= 2))


def physical_lights():
    lights(metal)


def edges():
    """Lines along the edges of cells."""
    for i in range(4):
        actor = sphere(i, normals=i % 2 == 0, cells=i == 2, resolution=14)
        actor.GetProperty().SetEdgeVisibility(True)
        actor.GetProperty().SetEdgeColor(0.1, 0.1, 0.6)
        actor.GetProperty().SetLineWidth(1 + i % 2)
        if i == 3:
            clip(actor, i, (-1, 0.3, -0.6))


def shadows():
    """Lit by lamps, whose shadows VTK adds by drawing everything again."""
    lights()
    both = vtk.vtkRenderPassCollection()
    pass_of_shadows = vtk.vtkShadowMapPass()
    both.AddItem(vtk.vtkRenderStepsPass())
    both.AddItem(pass_of_shadows.GetShadowMapBakerPass())
    both.AddItem(pass_of_shadows)
    sequence = vtk.vtkSequencePass()
    sequence.SetPasses(both)
    camera = vtk.vtkCameraPass()
    camera.SetDelegatePass(sequence)
    renderer.SetPass(camera)


globals()[kind]()
show(renderer, samples, frames)
