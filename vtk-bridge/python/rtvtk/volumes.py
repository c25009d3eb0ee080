"""Volumes of image data: which the library can draw as VTK does, and why OpenGL draws the others."""
import ctypes as C

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkImageData

from . import arrays
from . import library as rtv

MAPPERS = {"vtkSmartVolumeMapper", "vtkGPUVolumeRayCastMapper", "vtkOpenGLGPUVolumeRayCastMapper", "vtkFixedPointVolumeRayCastMapper"}
BLENDS = ("composite", "maximum intensity", "minimum intensity", "average intensity", "additive", "isosurface", "slice")
ENTRIES = 1024
NEAREST = 0


def why_not(volume, mapper, renderer):
    """Why OpenGL has to draw a volume, or None."""
    p = volume.GetProperty()
    if volume.GetClassName() != "vtkVolume" or not MAPPERS & {c.__name__ for c in type(mapper).__mro__[:2]}:
        return "OpenGL draws volumes or volume mappers of this class"
    if mapper.GetBlendMode() != 0:
        blend = mapper.GetBlendMode()
        return f"a volume with {BLENDS[blend] if blend < len(BLENDS) else 'unknown'} blending"
    planes = mapper.GetClippingPlanes()
    if mapper.GetCropping() or (planes and planes.GetNumberOfItems()):
        return "a volume that is cropped or clipped"
    if hasattr(mapper, "GetMaskInput") and mapper.GetMaskInput() is not None:
        return "a volume with a mask"
    if any(getattr(mapper, name, lambda: 0.0)() > 0.0 for name in ("GetGlobalIlluminationReach", "GetVolumetricScatteringBlending")):
        return "a volume with shadows or scattering of its own"
    if hasattr(mapper, "GetVectorMode") and mapper.GetVectorMode() != -1:
        return "a volume of vectors"
    if p.GetTransferFunctionMode() != 0:
        return "a volume with a two-dimensional transfer function"
    if not p.GetDisableGradientOpacity(0) and p.HasGradientOpacity(0):
        return "a volume with gradient opacity"
    if p.GetShade(0) and p.GetSpecular(0) > 0.0:
        # Its highlight follows the mirrored light, that of the library's volumes the half vector.
        return "a shaded volume with a highlight"
    if p.GetShade(0):
        lights = [light for light in renderer.GetLights() if light.GetSwitch()]
        plain = all(light.LightTypeIsHeadlight() and not light.GetPositional() and light.GetIntensity() == 1.0
                    and tuple(light.GetDiffuseColor()) == (1.0, 1.0, 1.0) for light in lights)
        if len(lights) > 1 or not plain:
            return "a shaded volume under other lights than one white headlight"
    return None


def add(bridge, volume, renderer, name):
    """Gives a volume to the library; returns why it could not, or None."""
    mapper = volume.GetMapper()
    reason = "a volume without data" if mapper is None else why_not(volume, mapper, renderer)
    if reason:
        return reason
    if mapper.GetNumberOfInputConnections(0) > 0:
        mapper.GetInputAlgorithm(0, 0).Update()
    image = mapper.GetInputDataObject(0, 0)
    if not isinstance(image, vtkImageData):
        return "a volume that is not image data"
    extent = image.GetExtent()
    dims = [extent[2 * a + 1] - extent[2 * a] + 1 for a in range(3)]
    if min(dims) < 2:
        return "a volume one point thick"
    if image.HasAnyBlankPoints() or image.HasAnyBlankCells():
        return "a volume with blanked parts"
    scalars = image.GetPointData().GetScalars()
    if mapper.GetScalarMode() == 3:
        by_name = mapper.GetArrayAccessMode() == 1
        scalars = image.GetPointData().GetArray(mapper.GetArrayName() if by_name else mapper.GetArrayId())
    elif mapper.GetScalarMode() not in (0, 1) or scalars is None:
        return "a volume whose values are not those of points"
    if scalars is None or scalars.GetNumberOfComponents() != 1:
        return "a volume of several components, or of none"
    keep = []
    v = rtv.Volume()
    v.name = name.encode()
    v.dims[:], v.spacing[:] = dims, image.GetSpacing()
    v.scalar_key = arrays.key_of(scalars, scalars.GetMTime(), *dims, *image.GetSpacing())
    if not bridge.has_volume(v.scalar_key):
        values = vtk_to_numpy(scalars)
        if values.dtype not in (np.uint8, np.int32, np.float32, np.float64):
            values = values.astype(np.float32)
        keep.append(np.ascontiguousarray(values))
        v.scalars = rtv.Array.of(keep[-1])
    # Index times spacing, turned by the image's directions, moved to its first point, then the prop's matrix.
    local = np.eye(4)
    d = image.GetDirectionMatrix()
    local[:3, :3] = [[d.GetElement(i, j) for j in range(3)] for i in range(3)]
    first = [0.0, 0.0, 0.0]
    image.TransformIndexToPhysicalPoint(extent[0], extent[2], extent[4], first)
    local[:3, 3] = first
    m = volume.GetMatrix()
    world = np.array([[m.GetElement(i, j) for j in range(4)] for i in range(4)]) @ local
    v.world_from_data[:] = world.ravel().tolist()
    # Tables over the range of the scalars, as OpenGL's are.
    low, high = scalars.GetFiniteRange(0)
    if not high > low:
        high = low + max(1e-6 * abs(low), 1e-30)
    v.range[:] = low, high
    p = volume.GetProperty()
    at = np.linspace(low, high, ENTRIES)
    if p.GetColorChannels(0) == 1:
        gray = p.GetGrayTransferFunction(0)
        colors = np.array([[gray.GetValue(x)] * 3 for x in at], np.float32)
    else:
        rgb = p.GetRGBTransferFunction(0)
        colors = np.array([rgb.GetColor(x) for x in at], np.float32)
    opacity = p.GetScalarOpacity(0)
    opacities = np.array([opacity.GetValue(x) for x in at], np.float32)
    keep += [colors, opacities]
    v.colors, v.opacities = rtv.Array.of(colors), rtv.Array.of(opacities)
    v.unit_distance, v.nearest = p.GetScalarOpacityUnitDistance(0), p.GetInterpolationType() == NEAREST
    v.shade = bool(p.GetShade(0)) and any(light.GetSwitch() for light in renderer.GetLights())
    v.ambient, v.diffuse = p.GetAmbient(0), p.GetDiffuse(0)
    v.specular, v.specular_power = p.GetSpecular(0), p.GetSpecularPower(0)
    answer = bridge.volume(C.byref(v))
    return answer.decode() if answer else None
