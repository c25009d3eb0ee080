"""Volumes on uniform grids. Which of them are traced decides the library from facts about them."""
import ctypes as C
import math

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import reference
from vtkmodules.vtkCommonDataModel import vtkCompositeDataSet, vtkImageData
from vtkmodules.vtkRenderingCore import vtkAbstractMapper

from . import library as rtv
from .arrays import key_of, numbers
from .eligibility import require

# The number of entries of OpenGL's tables.
_ENTRIES = 1024
# What the choice between rays and OpenGL looks at: points per axis, and entries of the table.
_FEW_POINTS, _FEW_ENTRIES = 32, 256
_KINDS = [np.dtype(t) for t in (np.float32, np.float64, np.uint8, np.int32)]
# VTK's blend modes; the library uses the same numbers.
_AVERAGE, _ADDITIVE, _ISOSURFACES = 3, 4, 5
# Mappers that take samples in OpenGL.
_SAMPLING = ("vtkGPUVolumeRayCastMapper", "vtkSmartVolumeMapper")
# The upper end of OpenGL's gradient-opacity table, as a fraction of the scalar range.
_GRADIENT_RANGE = 0.25


def _has_gradient_opacity(p):
    return not p.GetDisableGradientOpacity(0) and p.HasGradientOpacity(0)


def _read_mapper(mapper, f):
    f.cropping, f.num_clipping_planes, f.blend_mode = bool(mapper.GetCropping()), mapper.GetNumberOfClippingPlanes(), mapper.GetBlendMode()
    f.cropping_regions = mapper.GetCroppingRegionFlags()
    f.mask = bool(hasattr(mapper, "GetMaskInput") and mapper.GetMaskInput())
    reach = ("GetGlobalIlluminationReach", "GetVolumetricScatteringBlending")
    f.scattering = any(hasattr(mapper, name) and getattr(mapper, name)() > 0 for name in reach)
    f.vectors = hasattr(mapper, "GetVectorMode") and mapper.GetVectorMode() != -1


def _read_property(p, f):
    f.transfer_function_2d = p.GetTransferFunctionMode() != 0
    f.labels = bool(p.HasLabelGradientOpacity() or p.GetLabelColor(1) or p.GetLabelScalarOpacity(1))
    f.gradient_opacity, f.shade, f.specular = bool(_has_gradient_opacity(p)), bool(p.GetShade(0)), p.GetSpecular(0)


class _Lights:
    """The lights of shaded volumes, six numbers each, in the library's layout; none for one white headlight."""

    def __init__(self, renderer, f):
        lights = renderer.GetLights()
        on = [light for light in (lights.GetItemAsObject(i) for i in range(lights.GetNumberOfItems())) if light.GetSwitch()]
        self.rows = []
        # OpenGL uses another formula unless there is exactly one headlight of full strength: no ambient term, and different highlights.
        self.several = len(on) > 1 or not all(light.LightTypeIsHeadlight() and light.GetIntensity() == 1 for light in on)
        f.num_lights, f.num_positional_lights = len(on), sum(bool(light.GetPositional()) for light in on)
        f.num_ambient_lights = sum(tuple(light.GetAmbientColor()) != (0, 0, 0) for light in on)
        white = all(tuple(light.GetDiffuseColor()) == tuple(light.GetSpecularColor()) == (1, 1, 1) for light in on)
        if self.several or not white:
            for light in on:
                # A single headlight is at the viewer, not directional.
                place = zip(light.GetTransformedPosition(), light.GetTransformedFocalPoint())
                towards = [a - b for a, b in place] if self.several else [0.0] * 3
                self.rows.append([*towards, *(light.GetIntensity() * c for c in light.GetDiffuseColor())])
        f.num_listed_lights = len(self.rows)


def _image_of(mapper, f, update=True):
    """The image data of a mapper, or `None`."""
    connected = mapper.GetNumberOfInputConnections(0) > 0
    if update and connected and mapper.GetInputAlgorithm(0, 0):
        mapper.GetInputAlgorithm(0, 0).Update()
    data = mapper.GetInputDataObject(0, 0) if connected else None
    if isinstance(data, vtkCompositeDataSet):
        leaves, it = [], data.NewIterator()
        it.InitTraversal()
        while not it.IsDoneWithTraversal():
            leaves.append(it.GetCurrentDataObject())
            it.GoToNextItem()
        f.num_blocks = len(leaves)
        # One block is as good as the image alone.
        data = leaves[0] if len(leaves) == 1 else None
    f.has_data, f.image = 1, isinstance(data, vtkImageData)
    return data if f.image else None


def _scalars_of(mapper, image, f):
    """The scalars of an image, which may be `None`, and facts about both."""
    extent = image.GetExtent()
    f.dims[:] = [max(0, extent[2 * a + 1] - extent[2 * a] + 1) for a in range(3)]
    f.average_range[:] = mapper.GetAverageIPScalarRange()
    f.blanked = bool(image.HasAnyBlankPoints() or image.HasAnyBlankCells())
    flag = reference(0)
    scalars = vtkAbstractMapper.GetScalars(
        image, mapper.GetScalarMode(), mapper.GetArrayAccessMode(), mapper.GetArrayId(), mapper.GetArrayName(), flag)
    f.scalars, f.cell_scalars = scalars is not None, int(flag) != 0
    directions = image.GetDirectionMatrix()
    f.turned = any(directions.GetElement(i, j) != (i == j) for i in range(3) for j in range(3))
    if scalars is not None:
        f.num_components = scalars.GetNumberOfComponents()
        low, high = scalars.GetFiniteRange(0)
        f.range[:] = low, high if high > low else low + max(1e-6 * abs(low), 1e-30)
    return scalars


def _sample_distance(mapper, image, dims, matrix):
    """The distance of the samples that OpenGL takes along a ray, in data units; 0 for mappers that
    take none in OpenGL, or that move them by noise, whose mean is the integral."""
    if any(mapper.IsA(kind) for kind in _SAMPLING) and mapper.GetUseJittering():
        return 0
    spacing = image.GetSpacing()
    # Half of the mean spacing, and less in grids of fewer than a million cells.
    size = min(1, math.prod(n - 1 for n in dims) ** 0.333 / 100)
    locked = sum(spacing) / 6 * (0.01 + 0.99 * size)
    if mapper.IsA("vtkGPUVolumeRayCastMapper"):
        adjusts, own = mapper.GetAutoAdjustSampleDistances(), mapper.GetSampleDistance()
        if mapper.GetLockSampleDistanceToInputSpacing() and not 0.999 <= own / locked <= 1.001:
            own = locked
    elif mapper.IsA("vtkSmartVolumeMapper"):
        own = locked
        adjusts = mapper.GetAutoAdjustSampleDistances()
        adjusts = adjusts and not mapper.GetInteractiveAdjustSampleDistances()
    else:
        return 0
    if not adjusts:
        return own
    # The smallest spacing in the world. While the user turns the scene OpenGL may take longer steps.
    row = lambda i: math.hypot(*(matrix.GetElement(i, j) for j in range(3)))
    return min(s * row(i) for i, s in enumerate(spacing))


def _world_from_image(volume, image):
    """Index times spacing, rotated by the image's directions, moved to its first point, then the prop's matrix."""
    first, local = [0.0] * 3, np.eye(4)
    image.TransformIndexToPhysicalPoint(*image.GetExtent()[::2], first)
    directions = image.GetDirectionMatrix()
    local[:3, :3] = [[directions.GetElement(i, j) for j in range(3)] for i in range(3)]
    local[:3, 3] = first
    return np.array(volume.GetMatrix().GetData()).reshape(4, 4) @ local


def _set_region(v, mapper, image, keep):
    """What is drawn of the volume: cropping planes are in the image's space, clipping planes in the world."""
    v.cropping_in_texels = not mapper.IsA("vtkFixedPointVolumeRayCastMapper")
    if mapper.GetCropping():
        first = [0.0] * 3
        image.TransformIndexToPhysicalPoint(*image.GetExtent()[::2], first)
        v.cropping_regions = mapper.GetCroppingRegionFlags()
        v.cropping_planes[:] = [x - first[i // 2] for i, x in enumerate(mapper.GetCroppingRegionPlanes())]
    planes = mapper.GetClippingPlanes()
    if planes is not None and planes.GetNumberOfItems():
        found = (planes.GetItem(i) for i in range(planes.GetNumberOfItems()))
        keep.append(np.array([[*plane.GetOrigin(), *plane.GetNormal()] for plane in found], np.float64))
        v.clip_planes = rtv.Array.of(keep[-1])


def _few_scalars(scalars, dims):
    """Scalars at a few points per axis, evenly spread from the first to the last, indexed by z, y and x."""
    few = [min(n, _FEW_POINTS) for n in dims]
    at = [(np.arange(m) * (n - 1) + (m - 1) // 2) // max(m - 1, 1) for m, n in zip(few, dims)]
    return np.ascontiguousarray(vtk_to_numpy(scalars).reshape(dims[::-1])[np.ix_(*at[::-1])], np.float32)


def choose(bridge, volume, renderer, view):
    """Tells the choice between rays and OpenGL of a volume. Updates nothing."""
    mapper, p, f = volume.GetMapper(), volume.GetProperty(), rtv.VolumeFacts(volume_class=volume.GetClassName().encode())
    # Others are not known to the library either.
    if mapper is None or not any(mapper.IsA(kind) for kind in _SAMPLING):
        return
    image = _image_of(mapper, f, update=False)
    scalars = None if image is None else _scalars_of(mapper, image, f)
    # Those of cells stand for themselves.
    dims = [n - 1 if f.cell_scalars else n for n in f.dims]
    if scalars is None or not scalars.HasStandardMemoryLayout() or scalars.GetNumberOfValues() != math.prod(dims):
        return
    f.mapper_class = mapper.GetClassName().encode()
    _read_mapper(mapper, f)
    _read_property(p, f)
    if f.shade:
        _Lights(renderer, f)
    few, (low, high), opacity = _few_scalars(scalars, dims), f.range, p.GetScalarOpacity(0)
    opacities = np.array([opacity.GetValue(x) for x in np.linspace(low, high, _FEW_ENTRIES).tolist()], np.float32).reshape(-1, 1)
    v = rtv.SceneVolume(facts=C.pointer(f), view=C.pointer(view), scalars=rtv.Array.of(few.reshape(-1, 1)), opacities=rtv.Array.of(opacities))
    v.dims[:] = few.shape[::-1]
    v.adjusts = any(hasattr(mapper, name) and getattr(mapper, name)() for name in ("GetAutoAdjustSampleDistances", "GetInteractiveAdjustSampleDistances"))
    v.unit_distance, v.sample_distance = p.GetScalarOpacityUnitDistance(0), _sample_distance(mapper, image, list(f.dims), volume.GetMatrix())
    size = np.append(np.array(image.GetSpacing()) * (np.array(f.dims) - 1.0), 1.0)
    v.world_from_unit[:] = (_world_from_image(volume, image) * size).ravel().tolist()
    bridge.choose_volume(C.byref(v))


class Volumes:
    """Tables of transfer functions; those of the last frame are cached."""

    def __init__(self):
        self._kept, self._used = {}, {}

    def end_frame(self):
        self._kept, self._used = self._used, {}

    def add(self, bridge, volume, renderer, name):
        """Passes a volume to the bridge, or raises `Untraceable`."""
        mapper, f = volume.GetMapper(), rtv.VolumeFacts(volume_class=volume.GetClassName().encode())
        f.mapper_class = None if mapper is None else mapper.GetClassName().encode()
        require(bridge.check_volume, f)
        _read_mapper(mapper, f)
        _read_property(volume.GetProperty(), f)
        lights = _Lights(renderer, f)
        require(bridge.check_volume, f)
        image = _image_of(mapper, f)
        if image is None:
            require(bridge.check_volume, f)
        self._add_grid(bridge, mapper, volume, image, renderer.GetActiveCamera(), lights, name, f)

    def _add_grid(self, bridge, mapper, volume, image, camera, lights, name, f):
        p, v, keep = volume.GetProperty(), rtv.Volume(), []
        v.name = name.encode()
        scalars = _scalars_of(mapper, image, f)
        dims = list(f.dims)
        require(bridge.check_volume, f)
        v.dims[:], v.spacing[:] = dims, image.GetSpacing()
        v.scalar_key = key_of(scalars, *dims, *image.GetSpacing())
        if not bridge.has_volume(v.scalar_key):
            v.scalars = rtv.Array.of(numbers(scalars, _KINDS, keep).reshape(-1, 1))

        v.world_from_data[:] = _world_from_image(volume, image).ravel().tolist()
        v.cells = f.cell_scalars
        _set_region(v, mapper, image, keep)

        # ---- Tables over the range of the scalars, as OpenGL's are.
        low, high = v.range[:] = f.range[:]
        blend = f.blend_mode
        colors, opacities, gradients = self._tables(p, low, high)
        if blend in (_AVERAGE, _ADDITIVE):
            # Average and additive blending use the scalars themselves, mapped from black to white.
            colors = np.repeat(np.linspace(0, 1, _ENTRIES, dtype=np.float32)[:, None], 3, 1)
            keep.append(colors)
        if blend == _ISOSURFACES:
            values = p.GetIsoSurfaceValues()
            keep.append(np.array([values.GetValue(i) for i in range(values.GetNumberOfContours())], np.float64).reshape(-1, 1))
            v.isovalues = rtv.Array.of(keep[-1])
        v.colors, v.opacities, v.blend = rtv.Array.of(colors), rtv.Array.of(opacities), blend
        if gradients is not None:
            # OpenGL takes central differences over n / (n - 1) of the point spacing, or over that of cells, and scales them by the mean of the spacings.
            reach = 1 if v.cells else sum(n / (n - 1) for n in dims) / 3
            v.gradient_opacities, v.steepest = rtv.Array.of(gradients), _GRADIENT_RANGE * (high - low) / (sum(image.GetSpacing()) / 3 * reach)
        v.unit_distance = p.GetScalarOpacityUnitDistance(0)
        v.sample_distance = _sample_distance(mapper, image, dims, volume.GetMatrix())
        v.nearest, v.shade = p.GetInterpolationType() == 0, bool(p.GetShade(0))
        if camera.GetParallelProjection():
            # OpenGL's light at the viewer shines from the camera's position then, too.
            v.has_viewer, v.viewer[:] = 1, camera.GetPosition()
        if lights.rows:
            keep.append(np.array(lights.rows, np.float32))
            v.lights = rtv.Array.of(keep[-1])
        v.ambient, v.diffuse, v.specular = 0.0 if lights.several else p.GetAmbient(0), p.GetDiffuse(0), p.GetSpecular(0)
        v.specular_power, v.specular_mirrored = p.GetSpecularPower(0), 1
        require(bridge.volume, v)

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
