"""Volumes on uniform grids: decides which of them the library can draw as VTK does, and says why OpenGL draws the others."""
import ctypes as C

import numpy as np
from vtkmodules.vtkCommonCore import reference
from vtkmodules.vtkCommonDataModel import vtkCompositeDataSet, vtkImageData
from vtkmodules.vtkRenderingCore import vtkAbstractMapper

from . import library as rtv
from .arrays import key_of, numbers

# The number of entries of OpenGL's tables.
_ENTRIES = 1024
_KINDS = [np.dtype(t) for t in (np.float32, np.float64, np.uint8, np.int32)]
_MAPPERS = {"vtkSmartVolumeMapper", "vtkGPUVolumeRayCastMapper", "vtkOpenGLGPUVolumeRayCastMapper", "vtkFixedPointVolumeRayCastMapper",
            "vtkMultiBlockVolumeMapper"}
# VTK's blend modes; the library uses the same numbers.
_COMPOSITE, _MAXIMUM, _MINIMUM, _AVERAGE, _ADDITIVE, _ISOSURFACES, _SLICE = range(7)
# The upper end of OpenGL's gradient-opacity table, as a fraction of the scalar range.
_GRADIENT_RANGE = 0.25


def _has_gradient_opacity(p):
    return not p.GetDisableGradientOpacity(0) and p.HasGradientOpacity(0)


def _why_not_blend(mode, p):
    if not _COMPOSITE <= mode <= _ISOSURFACES:
        return "a volume with slice blending" if mode == _SLICE else "a volume with a blend mode that is not known"
    if mode != _COMPOSITE and _has_gradient_opacity(p):
        return "a volume with gradient opacity and another blending than composite"
    # OpenGL shades the largest scalar with the gradient at the end of the ray.
    if mode in (_MAXIMUM, _MINIMUM) and p.GetShade(0):
        return "a shaded volume with maximum or minimum intensity blending"
    return None


def _why_not_mapper(mapper):
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
    if p.HasLabelGradientOpacity() or p.GetLabelColor(1) or p.GetLabelScalarOpacity(1):
        return "a volume with labels"
    return None


class _Lights:
    """The lights of shaded volumes, six numbers each, in the library's layout; none for one white headlight. `reason`: why OpenGL has to shade."""

    def __init__(self, renderer):
        lights = renderer.GetLights()
        on = [light for light in (lights.GetItemAsObject(i) for i in range(lights.GetNumberOfItems())) if light.GetSwitch()]
        self.rows, self.reason = [], None
        # OpenGL uses another formula unless there is exactly one headlight of full strength: no ambient term, and different highlights.
        self.several = len(on) > 1 or not all(light.LightTypeIsHeadlight() and light.GetIntensity() == 1 for light in on)
        if not on:
            self.reason = "a shaded volume without a light"
        elif any(light.GetPositional() for light in on):
            self.reason = "a shaded volume under lights that have a place"
        elif any(tuple(light.GetAmbientColor()) != (0, 0, 0) for light in on):
            self.reason = "a shaded volume under lights with an ambient colour"
        elif len(on) > 6:
            self.reason = "a shaded volume under more than six lights"
        white = all(tuple(light.GetDiffuseColor()) == tuple(light.GetSpecularColor()) == (1, 1, 1) for light in on)
        if self.several or not white:
            for light in on:
                # A single headlight is at the viewer, not directional.
                place = zip(light.GetTransformedPosition(), light.GetTransformedFocalPoint())
                towards = [p - f for p, f in place] if self.several else [0.0] * 3
                self.rows.append([*towards, *(light.GetIntensity() * c for c in light.GetDiffuseColor())])


def _image_of(mapper):
    """The image data of a mapper, or the reason why there are none."""
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
            # Each block would need tables over the range of all blocks.
            return "a volume of several blocks"
    return "a volume that is not image data"


class Volumes:
    """Tables of transfer functions; those of the last frame are cached."""

    def __init__(self):
        self._kept, self._used = {}, {}

    def end_frame(self):
        self._kept, self._used = self._used, {}

    def add(self, bridge, volume, renderer, name):
        """Passes a volume to the bridge. Returns why OpenGL has to draw it, or `None`."""
        mapper = volume.GetMapper()
        if volume.GetClassName() != "vtkVolume":
            return "OpenGL draws volumes of this class"
        if mapper is None or mapper.GetClassName() not in _MAPPERS:
            return "OpenGL draws volume mappers of this class"
        p = volume.GetProperty()
        reason = _why_not_mapper(mapper) or _why_not_property(p) or _why_not_blend(mapper.GetBlendMode(), p)
        if reason:
            return reason
        lights = _Lights(renderer)
        if p.GetShade(0) and lights.reason:
            return lights.reason
        if p.GetShade(0) and lights.rows and p.GetSpecular(0) > 0:
            return "a shaded volume with a highlight under other lights than one white headlight"
        image = _image_of(mapper)
        return image if isinstance(image, str) else self._add_grid(bridge, mapper, volume, image, lights, name)

    def _add_grid(self, bridge, mapper, volume, image, lights, name):
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

        # ---- Transform: index times spacing, rotated by the image's directions, moved to its first point, then the prop's matrix.
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
        blend = mapper.GetBlendMode()
        colors, opacities, gradients = self._tables(p, low, high)
        if blend in (_AVERAGE, _ADDITIVE):
            # Average and additive blending use the scalars themselves, mapped from black to white.
            colors = np.repeat(np.linspace(0, 1, _ENTRIES, dtype=np.float32)[:, None], 3, 1)
            keep.append(colors)
            first, last = mapper.GetAverageIPScalarRange()
            if blend == _AVERAGE and (first > low or last < high):
                return "a volume with average intensity blending of a part of its scalars"
        if blend == _ISOSURFACES:
            values = p.GetIsoSurfaceValues()
            keep.append(np.array([values.GetValue(i) for i in range(values.GetNumberOfContours())], np.float64).reshape(-1, 1))
            v.isovalues = rtv.Array.of(keep[-1])
        v.colors, v.opacities, v.blend = rtv.Array.of(colors), rtv.Array.of(opacities), blend
        if gradients is not None:
            # OpenGL takes central differences over n / (n - 1) of the point spacing, and scales them by the mean of the spacings.
            reach = sum(n / (n - 1) for n in dims) / 3
            v.gradient_opacities, v.steepest = rtv.Array.of(gradients), _GRADIENT_RANGE * (high - low) / (sum(image.GetSpacing()) / 3 * reach)
        v.unit_distance = p.GetScalarOpacityUnitDistance(0)
        v.nearest, v.shade = p.GetInterpolationType() == 0, bool(p.GetShade(0))
        if lights.rows:
            keep.append(np.array(lights.rows, np.float32))
            v.lights = rtv.Array.of(keep[-1])
        v.ambient, v.diffuse, v.specular = 0.0 if lights.several else p.GetAmbient(0), p.GetDiffuse(0), p.GetSpecular(0)
        v.specular_power, v.specular_mirrored = p.GetSpecularPower(0), 1
        reason = bridge.volume(C.byref(v))
        return reason.decode() if reason else None

    def _tables(self, p, low, high):
        gray = p.GetColorChannels(0) == 1
        color, opacity = p.GetGrayTransferFunction(0) if gray else p.GetRGBTransferFunction(0), p.GetScalarOpacity(0)
        gradient = p.GetGradientOpacity(0) if _has_gradient_opacity(p) else None
        key = key_of(color, opacity, gradient, low, high)
        found = self._kept.get(key)
        if found is None:
            at = np.linspace(low, high, _ENTRIES).tolist()
            colors = [[color.GetValue(x)] * 3 if gray else color.GetColor(x) for x in at]
            opacities = [opacity.GetValue(x) for x in at]
            gradients = None
            if gradient is not None:
                gradients = np.array([gradient.GetValue(x) for x in np.linspace(0, _GRADIENT_RANGE * (high - low), _ENTRIES).tolist()], np.float32)
            found = np.array(colors, np.float32), np.array(opacities, np.float32).reshape(-1, 1), gradients
        self._used[key] = found
        return found
