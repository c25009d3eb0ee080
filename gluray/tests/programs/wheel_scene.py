"""Surfaces as PyVista and today's VTK draw them, one kind of scene a run: wheel_scene.py [KIND [SAMPLES]]."""
import sys
import vtk
from egl_window import show

kind = sys.argv[1] if len(sys.argv) > 1 else "plain"
samples = int(sys.argv[2]) if len(sys.argv) > 2 else 0
renderer = vtk.vtkRenderer()


def sphere(i, radius=0.5, normals=True, cells=False, points=False):
    """The sphere at place `i` of four as an actor; with colours of cells or points where asked for."""
    source = vtk.vtkSphereSource(
        theta_resolution=32, phi_resolution=32, radius=radius, center=(1.1 * (i % 2), 1.1 * (i // 2), 0)
    )
    heights = vtk.vtkElevationFilter(low_point=(0, 0, -0.5), high_point=(0, 0, 0.5))
    heights.SetInputConnection(source.GetOutputPort())
    heights.Update()
    data = vtk.vtkPolyData()
    data.ShallowCopy(heights.GetOutput())
    if not normals:
        data.GetPointData().SetNormals(None)
    mapper = vtk.vtkPolyDataMapper()
    mapper.SetInputData(data)
    if cells:
        values = vtk.vtkFloatArray(name="values")
        for number in range(data.GetNumberOfCells()):
            values.InsertNextValue(number * 7 % 13)
        data.GetCellData().SetScalars(values)
        mapper.SetScalarModeToUseCellData()
        mapper.SetScalarRange(0, 12)
    mapper.scalar_visibility = cells or points
    actor = vtk.vtkActor()
    actor.SetMapper(mapper)
    actor.property.color = (0.9, 0.4, 0.2)
    actor.property.specular = 0.3
    actor.property.specular_power = 20
    renderer.AddActor(actor)
    return actor


def plain():
    """Without normals, with colour maps that are applied after interpolation, under a headlight."""
    for i in range(4):
        sphere(i, normals=i % 2 == 0, points=i >= 2).GetMapper().InterpolateScalarsBeforeMappingOn()


def flat():
    for i in range(4):
        sphere(i, normals=i % 2 == 0, points=i >= 2).property.SetInterpolationToFlat()


def cells():
    """Colours of cells, smooth and flat, of triangles and of quads that VTK splits."""
    for i in range(3):
        sphere(i, normals=i % 2 == 0, cells=True)
    plane = vtk.vtkPlaneSource(x_resolution=9, y_resolution=7)
    plane.SetOrigin(0.6, 0.6, 0)
    plane.SetPoint1(1.6, 0.6, 0.3)
    plane.SetPoint2(0.6, 1.6, 0.2)
    plane.Update()
    data = plane.GetOutput()
    values = vtk.vtkFloatArray(name="values")
    for number in range(data.GetNumberOfCells()):
        values.InsertNextValue(number)
    data.GetCellData().SetScalars(values)
    mapper = vtk.vtkPolyDataMapper()
    mapper.SetInputData(data)
    mapper.SetScalarRange(0, 62)
    actor = vtk.vtkActor()
    actor.SetMapper(mapper)
    renderer.AddActor(actor)


def translucent():
    """Layers that VTK sums up in any order, before and behind something opaque."""
    sphere(0).property.opacity = 0.4
    sphere(0, radius=0.3)
    sphere(1, points=True).property.opacity = 0.6
    sphere(1, radius=0.7, normals=False).property.opacity = 0.3
    sphere(2, cells=True).property.opacity = 0.5
    sphere(3, radius=0.8).property.opacity = 0.2


def peeled():
    translucent()
    renderer.SetUseDepthPeeling(1)
    renderer.SetMaximumNumberOfPeels(50)
    renderer.SetOcclusionRatio(0.0)


def clipped():
    """Two planes cut the mapper's triangles; what is inside is seen."""
    for i in range(4):
        actor = sphere(i, normals=i % 2 == 0, cells=i >= 2)
        for normal in (1, 0.3, 0.2), (0, -1, 0.2):
            plane = vtk.vtkPlane(origin=(1.1 * (i % 2), 1.1 * (i // 2), 0.1), normal=normal)
            actor.GetMapper().AddClippingPlane(plane)


def lights(*materials):
    """A lamp, a spot, and light from far away."""
    for i in range(4):
        actor = sphere(i, normals=i % 2 == 0, points=i >= 2)
        for material in materials:
            material(actor)
    renderer.AutomaticLightCreationOff()
    for cone, color in (90, (1, 1, 1)), (20, (0.5, 0.5, 1)), (None, (0.5, 0.1, 0.1)):
        light = vtk.vtkLight(color=color, focal_point=(0.5, 0.5, 0))
        light.SetPosition(-1 if cone is None else 1, 1, 2)
        if cone is not None:
            light.SetPositional(1)
            light.SetConeAngle(cone)
            light.SetExponent(2)
            light.SetAttenuationValues(0.5, 0.1, 0.1)
        renderer.AddLight(light)


def both_sides():
    """Hemispheres, whose insides have a material of their own."""
    for i in range(4):
        actor = sphere(i, normals=i % 2 == 0)
        plane = vtk.vtkPlane(origin=(1.1 * (i % 2), 1.1 * (i // 2), 0.1), normal=(-1, 0.3, -0.6))
        actor.GetMapper().AddClippingPlane(plane)
        back = vtk.vtkProperty(color=(0.1, 0.8, 0.3), specular=0.2)
        actor.SetBackfaceProperty(back)


def physical():
    """Physically based, under a light at the eye."""
    for i in range(4):
        metal(sphere(i, normals=i % 2 == 0, points=i >= 2))


def metal(actor):
    actor.property.SetInterpolationToPBR()
    actor.property.metallic = 0.4
    actor.property.roughness = 0.35


def physical_lights():
    lights(metal)


def edges():
    """Lines along the edges of cells."""
    for i in range(4):
        actor = sphere(i, normals=i % 2 == 0, cells=i == 2)
        actor.property.edge_visibility = True
        actor.property.edge_color = (0.1, 0.1, 0.6)
        actor.property.line_width = 1 + i % 2


{f.__name__: f for f in (plain, flat, cells, translucent, peeled, clipped, lights, both_sides, physical, physical_lights, edges)}[kind]()
show(renderer, samples)
