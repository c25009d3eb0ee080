"""Draws frames with VTK's wheel while the camera turns, and prints what they took.

One argument, a JSON object: {"scene": name, "tracer": name, "size": pixels, "warm": n,
"frames": n}. Frames after the first `warm` count as steady. CPU is user and system time of all
threads.
"""

import json
import os
import resource
import sys
import time

# Isovalues on 201^3 points of VTK's wavelet, for about so many triangles.
ISOVALUES = {
    "isosurfaces 1 M": [121, 189],
    "isosurfaces 4 M": [115, 128.33, 141.67, 155, 168.33, 181.67, 195],
    "isosurfaces small": [121, 189],
}
#: Points from the middle of the wavelet to its sides.
REACH = {"isosurfaces small": 30}


def cpu():
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


def isosurfaces(vtk, name):
    source = vtk.vtkRTAnalyticSource()
    reach = REACH.get(name, 100)
    source.SetWholeExtent(*([-reach, reach] * 3))
    contour = vtk.vtkFlyingEdges3D()
    contour.SetInputConnection(source.GetOutputPort())
    for i, value in enumerate(ISOVALUES[name]):
        contour.SetValue(i, value)
    contour.Update()
    mapper = vtk.vtkPolyDataMapper()
    mapper.SetInputData(contour.GetOutput())
    mapper.SetScalarRange(100, 200)
    actor = vtk.vtkActor()
    actor.SetMapper(mapper)
    return [actor]


def spheres(vtk, _):
    """500 actors of 96 triangles each, in a cube."""
    actors = []
    for number in range(500):
        source = vtk.vtkSphereSource()
        source.SetThetaResolution(8)
        source.SetPhiResolution(8)
        source.SetRadius(0.35)
        source.SetCenter(number % 8, number // 8 % 8, number // 64)
        mapper = vtk.vtkPolyDataMapper()
        mapper.SetInputConnection(source.GetOutputPort())
        actor = vtk.vtkActor()
        actor.SetMapper(mapper)
        actor.GetProperty().SetColor(0.4 + 0.6 * (number % 7) / 6, 0.6, 0.8)
        actors.append(actor)
    return actors


def volume(vtk, name):
    """A smooth field of which about half is clear, on the cube of points that the name says."""
    import numpy as np
    from vtkmodules.util.numpy_support import numpy_to_vtk

    points = int(name.split()[1])
    x = np.linspace(-1, 1, points, dtype=np.float32)
    bell = np.exp(-x * x)
    values = 0.24 + 0.52 * bell[None, None, :] * bell[None, :, None] * bell[:, None, None]
    values += 0.08 * (np.sin(9 * x)[None, None, :] + np.cos(13 * x)[:, None, None])
    values += 0.08 * np.sin(11 * x)[None, :, None]
    image = vtk.vtkImageData()
    image.SetDimensions(points, points, points)
    image.SetSpacing(*([1 / (points - 1)] * 3))
    image.GetPointData().SetScalars(numpy_to_vtk(values.astype(np.float32).ravel(), deep=True))
    colors = vtk.vtkColorTransferFunction()
    for value, *rgb in ((0, 0.1, 0.2, 0.9), (0.5, 0.9, 0.9, 0.7), (1, 0.9, 0.1, 0.1)):
        colors.AddRGBPoint(value, *rgb)
    opacity = vtk.vtkPiecewiseFunction()
    for value, of in ((0, 0), (0.5, 0), (1, 0.05)):
        opacity.AddPoint(value, of)
    mapper = vtk.vtkGPUVolumeRayCastMapper()
    mapper.SetInputData(image)
    # A sample a spacing, which the smart mapper takes too.
    mapper.SetAutoAdjustSampleDistances(False)
    mapper.SetLockSampleDistanceToInputSpacing(False)
    mapper.SetSampleDistance(1 / (points - 1))
    actor = vtk.vtkVolume()
    actor.SetMapper(mapper)
    look = actor.GetProperty()
    look.SetColor(colors)
    look.SetScalarOpacity(opacity)
    look.SetScalarOpacityUnitDistance(1 / 64)
    look.SetInterpolationTypeToLinear()
    look.SetShade("shaded" in name)
    return [actor]


def ellipsoid(vtk, _):
    """One translucent surface of 20,000 triangles: two layers."""
    shape = vtk.vtkParametricEllipsoid()
    shape.SetYRadius(0.6)
    shape.SetZRadius(0.5)
    source = vtk.vtkParametricFunctionSource()
    source.SetParametricFunction(shape)
    source.SetUResolution(100)
    source.SetVResolution(100)
    mapper = vtk.vtkPolyDataMapper()
    mapper.SetInputConnection(source.GetOutputPort())
    actor = vtk.vtkActor()
    actor.SetMapper(mapper)
    actor.GetProperty().SetOpacity(0.4)
    return [actor]


#: What makes a scene, by the first word of its name.
MAKERS = {
    "500": spheres,
    "isosurfaces": isosurfaces,
    "translucent": ellipsoid,
    "volume": volume,
}


def main():
    order = json.loads(sys.argv[1])
    if order["tracer"] != "stock":
        os.environ["RTV_ALWAYS_TRACE"] = "1" if order["tracer"] == "rtvtk, always" else "0"
        import rtvtk  # noqa: F401
    import vtk

    make = MAKERS[order["scene"].split()[0]]
    renderer = vtk.vtkRenderer()
    for prop in make(vtk, order["scene"]):
        renderer.AddViewProp(prop)
    window = vtk.vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(0)
    window.SetSize(order["size"], order["size"])
    window.AddRenderer(renderer)
    renderer.ResetCamera()
    camera = renderer.GetActiveCamera()
    camera.Elevation(20)
    frames = []
    for _ in range(1 + order["warm"] + order["frames"]):
        start, used = time.perf_counter(), cpu()
        window.Render()
        window.WaitForCompletion()
        frames.append([cpu() - used, time.perf_counter() - start])
        camera.Azimuth(15)
        renderer.ResetCameraClippingRange()
    triangles = 0
    for actor in renderer.GetActors():
        actor.GetMapper().Update()
        triangles += actor.GetMapper().GetInput().GetNumberOfPolys()
    print(
        json.dumps(
            {
                "triangles": triangles,
                "window": window.GetClassName(),
                "vtk": vtk.vtkVersion.GetVTKVersion(),
                "frames": frames,
                "peak_bytes": 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss,
            }
        )
    )


main()
