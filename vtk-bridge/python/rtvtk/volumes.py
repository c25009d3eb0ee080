"""Volumes of uniform grids: which of them the library can draw as VTK does, and why the others stay OpenGL."""
import ctypes as C

import numpy as np
from vtkmodules.vtkCommonCore import reference
from vtkmodules.vtkCommonDataModel import vtkCompositeDataSet, vtkImageData
from vtkmodules.vtkRenderingCore import vtkAbstractMapper

from . import library as rtv
from .arrays import key_of, numbers

# As many entries as OpenGL's tables have.
_ENTRIES = 1024
_KINDS = [np.dtype(t) for t in (np.float32, np.float64, np.uint8, np.int32)]
_MAPPERS = {"vtkSmartVolumeMapper", "vtkGPUVolumeRayCastMapper", "vtkOpenGLGPUVolumeRayCastMapper", "vtkFixedPointVolumeRayCastMapper",
            "vtkMultiBlockVolumeMapper"}
_BLENDS = {1: "maximum intensity", 2: "minimum intensity", 3: "average intensity", 4: "additive", 5: "isosurface", 6: "slice"}


def _why_not_mapper(mapper):
    mode = mapper.GetBlendMode()
    if mode != 0:
        return f"a volume with {_BLENDS.get(mode, 'unknown')} blending"
    if mapper.GetCropping():
        return "a cropped volume"
    if mapper.GetNumberOfClippingPlanes() > 0:
        return "a volume with clipping planes"
    if hasattr(mapper, "GetMaskInput") and mapper.GetMaskInput():
        return "a volume with a mask"
    for name in ("GetGlobalIlluminationReach", "GetVolumetricScatteringBlending"):
        if hasattr(mapper, name) and getattr(mapper, name)() > 0:
            return "a volume with shadows or scattering of its own"
    if hasattr(mapper, "GetVectorMode") and mapper.GetVectorMode() != -1:
        return "a volume of vectors"
    return None


def _why_not_property(p):
    if p.GetTransferFunctionMode() != 0:
        return "a volume with a two-dimensional transfer function"
    if not p.GetDisableGradientOpacity(0) and p.HasGradientOpacity(0):
        return "a volume with gradient opacity"
    if p.HasLabelGradientOpacity() or p.GetLabelColor(1) or p.GetLabelScalarOpacity(1):
        return "a volume with labels"
    return None


def _lit(renderer):
    """Whether a light shines on shaded volumes; `None` under lights with which OpenGL's formula is another than ours."""
    lights = renderer.GetLights()
    on = [light for light in (lights.GetItemAsObject(i) for i in range(lights.GetNumberOfItems())) if light.GetSwitch()]
    plain = all(light.LightTypeIsHeadlight() and not light.GetPositional() and light.GetIntensity() == 1 and tuple(light.GetDiffuseColor()) == (1, 1, 1)
                for light in on)
    return len(on) > 0 if plain and len(on) <= 1 else None


def _image_of(mapper):
    """The image of a mapper, or why there is none."""
    connected = mapper.GetNumberOfInputConnections(0) > 0
    if connected and mapper.GetInputAlgorithm(0, 0):
        mapper.GetInputAlgorithm(0, 0).Update()
    data = mapper.GetInputDataObject(0, 0) if connected else None
    if isinstance(data, vtkImageData):
        return data
    if isinstance(data, vtkCompositeDataSet):
        leaves, it = [], data.NewIterator()
        it.InitTraversal()
        while not it.IsDoneWithTraversal():
            leaves.append(it.GetCurrentDataObject())
            it.GoToNextItem()
        if len(leaves) == 1 and isinstance(leaves[0], vtkImageData):
            return leaves[0]
        if len(leaves) > 1:
            # Each block would need tables over the range of all.
            return "a volume of several blocks"
    return "a volume that is not image data"


class Volumes:
    """Tables of transfer functions; those of the last frame are kept."""

    def __init__(self):
        self._kept, self._used = {}, {}

    def end_frame(self):
        self._kept, self._used = self._used, {}

    def add(self, bridge, volume, renderer, name):
        """Gives a volume to the bridge. Returns why OpenGL has to draw it, or `None`."""
        mapper = volume.GetMapper()
        if volume.GetClassName() != "vtkVolume":
            return "OpenGL draws volumes of this class"
        if mapper is None or mapper.GetClassName() not in _MAPPERS:
            return "OpenGL draws volume mappers of this class"
        p = volume.GetProperty()
        reason = _why_not_mapper(mapper) or _why_not_property(p)
        if reason:
            return reason
        lit = _lit(renderer)
        if p.GetShade(0) and lit is None:
            return "a shaded volume under other lights than one white headlight"
        image = _image_of(mapper)
        return image if isinstance(image, str) else self._add_grid(bridge, mapper, volume, image, bool(lit), name)

    def _add_grid(self, bridge, mapper, volume, image, lit, name):
        p, v, keep = volume.GetProperty(), rtv.Volume(), []
        v.name = name.encode()
        extent = image.GetExtent()
        dims = [extent[2 * a + 1] - extent[2 * a] + 1 for a in range(3)]
        if min(dims) <= 1:
            return "a volume one point thick"
        if image.HasAnyBlankPoints() or image.HasAnyBlankCells():
            return "a volume with blanked parts"
        flag = reference(0)
        scalars = vtkAbstractMapper.GetScalars(
            image, mapper.GetScalarMode(), mapper.GetArrayAccessMode(), mapper.GetArrayId(), mapper.GetArrayName(), flag)
        if scalars is None or int(flag) != 0:
            return "a volume without scalars" if scalars is None else "a volume of cells' values"
        if scalars.GetNumberOfComponents() != 1:
            return "a volume of several components"
        v.dims[:], v.spacing[:] = dims, image.GetSpacing()
        v.scalar_key = key_of(scalars, *dims, *image.GetSpacing())
        if not bridge.has_volume(v.scalar_key):
            v.scalars = rtv.Array.of(numbers(scalars, _KINDS, keep).reshape(-1, 1))

        # ---- Place: index times spacing, turned by the image's directions, moved to its first point, then the prop's matrix.
        first, local = [0.0] * 3, np.eye(4)
        image.TransformIndexToPhysicalPoint(extent[0], extent[2], extent[4], first)
        directions = image.GetDirectionMatrix()
        local[:3, :3] = [[directions.GetElement(i, j) for j in range(3)] for i in range(3)]
        local[:3, 3] = first
        v.world_from_data[:] = (np.array(volume.GetMatrix().GetData()).reshape(4, 4) @ local).ravel().tolist()

        # ---- Tables over the range of the scalars, as OpenGL's are.
        low, high = scalars.GetFiniteRange(0)
        if not high > low:
            high = low + max(1e-6 * abs(low), 1e-30)
        v.range[:] = low, high
        colors, opacities = self._tables(p, low, high)
        v.colors, v.opacities = rtv.Array.of(colors), rtv.Array.of(opacities)
        v.unit_distance = p.GetScalarOpacityUnitDistance(0)
        v.nearest, v.shade = p.GetInterpolationType() == 0, bool(p.GetShade(0)) and lit
        v.ambient, v.diffuse, v.specular = p.GetAmbient(0), p.GetDiffuse(0), p.GetSpecular(0)
        # VTK's highlight goes by the mirrored ray, the library's by half the angle: cos(2x)^n is cos(x)^(4n) up to the fourth order in x.
        v.specular_power = 4 * p.GetSpecularPower(0)
        reason = bridge.volume(C.byref(v))
        return reason.decode() if reason else None

    def _tables(self, p, low, high):
        gray = p.GetColorChannels(0) == 1
        color, opacity = p.GetGrayTransferFunction(0) if gray else p.GetRGBTransferFunction(0), p.GetScalarOpacity(0)
        key = key_of(color, opacity, low, high)
        found = self._kept.get(key)
        if found is None:
            at = np.linspace(low, high, _ENTRIES).tolist()
            colors = [[color.GetValue(x)] * 3 if gray else color.GetColor(x) for x in at]
            opacities = [opacity.GetValue(x) for x in at]
            found = np.array(colors, np.float32), np.array(opacities, np.float32).reshape(-1, 1)
        self._used[key] = found
        return found
