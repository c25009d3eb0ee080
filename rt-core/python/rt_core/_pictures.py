"""Pictures of meshes, spheres, tubes, isosurfaces and volumes."""

from dataclasses import dataclass, field

import numpy as np

from rt_core import _arrays, _png
from rt_core._camera import Camera, seen_from_outside
from rt_core._rt_core import Stage, exr_bytes

#: Viridis at nine places, linear between, as sRGB.
VIRIDIS = (
    (68, 1, 84), (71, 45, 123), (59, 82, 139), (44, 114, 142), (33, 145, 140),
    (40, 174, 128), (94, 201, 98), (173, 220, 48), (253, 231, 37),
)  # fmt: skip


def _linear(srgb):
    srgb = np.asarray(srgb, dtype=np.float64)
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def _color_map(colors):
    if colors is None:
        colors = _linear(np.array(VIRIDIS) / 255)
    array = _arrays.numbers("color_map", colors)
    if array.ndim != 2 or array.shape[1] not in (3, 4) or len(array) == 0:
        raise ValueError(f"color_map has shape {array.shape}; give (N, 3) or (N, 4), linear RGB")
    return _rgba("color_map", array)


def _rgba(name, array):
    array = array.astype(np.float32)
    if not ((array >= 0) & (array <= 1)).all():
        wrong = array[~((array >= 0) & (array <= 1))][0]
        raise ValueError(f"{name} has the number {wrong:g}; give 0 to 1, linear RGB")
    if array.shape[1] == 3:
        array = np.column_stack([array, np.ones(len(array), dtype=np.float32)])
    return np.ascontiguousarray(array).reshape(-1)


def _color(value):
    array = _arrays.numbers("color", value)
    if array.shape != (3,) or not ((array >= 0) & (array <= 1)).all():
        raise ValueError(f"color is {value!r}; give three numbers from 0 to 1, linear RGB")
    return tuple(array.tolist())


def _unit(name, value):
    return _arrays.scalar(name, value, "0 to 1", lambda v: 0 <= v <= 1)


def _values(name, values, counts):
    """One number for each element, of which there may be several counts."""
    array = _arrays.numbers(name, values)
    if array.ndim != 1 or len(array) not in counts:
        some = " or ".join(f"({c},)" for c in dict.fromkeys(counts))
        raise ValueError(f"{name} has shape {array.shape}; give {some}")
    return array.astype(np.float32)


@dataclass(kw_only=True)
class _Look:
    """How a thing looks.

    Parameters
    ----------
    color : three floats
        Linear RGB, 0 to 1.
    opacity : float
        0 to 1.
    shine : float
        Strength of the highlight; 0 for matte.
    scalars : array_like, optional
        One number per element, shown by `color_map`. NaN is magenta.
    colors : array_like, shape (N, 3) or (N, 4), optional
        One linear colour per element; instead of `scalars`.
    color_map : array_like, shape (K, 3), optional
        Linear colours, evenly spaced over `range`; viridis by default.
    range : two floats, optional
        Scalars at the ends of the colour map; the smallest and largest by default.
    """

    color: tuple = (0.8, 0.8, 0.8)
    opacity: float = 1.0
    shine: float = 0.0
    scalars: object = None
    colors: object = None
    color_map: object = None
    range: object = None

    def _look(self, counts):
        thing = {
            "color": _color(self.color),
            "opacity": _unit("opacity", self.opacity),
            "shine": _unit("shine", self.shine),
        }
        if self.scalars is not None and self.colors is not None:
            raise ValueError("scalars and colors are both given; give one of them")
        if self.scalars is not None:
            scalars = _values("scalars", self.scalars, counts)
            thing["scalars"] = scalars
            thing.update(self._map(scalars))
        if self.colors is not None:
            colors = _arrays.numbers("colors", self.colors)
            wrong = colors.ndim != 2 or colors.shape[1] not in (3, 4)
            if wrong or len(colors) not in counts:
                some = " or ".join(f"({c}, 3 or 4)" for c in dict.fromkeys(counts))
                raise ValueError(f"colors has shape {colors.shape}; give {some}")
            thing["colors"] = _rgba("colors", colors)
        return thing

    def _map(self, values):
        ends = self.range
        if ends is None:
            finite = values[np.isfinite(values)]
            ends = (finite.min(), finite.max()) if len(finite) else (0, 1)
        ends = _arrays.numbers("range", ends)
        if ends.shape != (2,) or not np.isfinite(ends).all():
            raise ValueError(f"range is {self.range!r}; give two finite numbers")
        return {"color_map": _color_map(self.color_map), "range": tuple(ends.tolist())}


@dataclass
class Mesh(_Look):
    """Triangles to show.

    Parameters
    ----------
    vertices, triangles : array_like
        As `Scene` takes them.
    normals : array_like, shape (V, 3), optional
        Normals of the vertices, which make a smooth look; flat triangles by default.
    **look
        `color`, `opacity`, `shine`, and `scalars` or `colors` per vertex or per triangle.
    """

    vertices: object
    triangles: object
    normals: object = None

    def _thing(self):
        points, origin, _ = _arrays.vertices(self.vertices)
        faces, _ = _arrays.triangles(self.triangles, len(points))
        thing = {"kind": "mesh", "points": points.reshape(-1), "origin": origin}
        thing["triangles"] = faces.reshape(-1)
        if self.normals is not None:
            normals = _arrays.rows_of_three("normals", self.normals)
            if len(normals) != len(points) or _arrays.first_bad_row(normals) is not None:
                raise ValueError(
                    f"normals has shape {normals.shape}; give one finite row for each of "
                    f"{len(points)} vertices"
                )
            thing["normals"] = np.ascontiguousarray(normals, dtype=np.float32).reshape(-1)
        return thing | self._look((len(points), len(faces)))


def _radii(radii, count):
    array = np.atleast_1d(_arrays.numbers("radii", radii))
    if array.ndim != 1 or len(array) not in (1, count):
        raise ValueError(f"radii has shape {array.shape}; give one number, or ({count},)")
    bad = ~(np.isfinite(array) & (array > 0))
    if bad.any():
        row = int(bad.argmax())
        raise ValueError(f"radii[{row}] is {array[row]}; give a positive finite number")
    return array.astype(np.float32)


@dataclass
class Spheres(_Look):
    """Spheres, each met exactly and not as triangles.

    Parameters
    ----------
    centers : array_like, shape (N, 3)
    radii : float or array_like of shape (N,)
    **look
        `color`, `opacity`, `shine`, and `scalars` or `colors` per sphere.
    """

    centers: object
    radii: object

    def _thing(self):
        points, origin, _ = _points("centers", self.centers)
        thing = {"kind": "spheres", "points": points.reshape(-1), "origin": origin}
        thing["radii"] = _radii(self.radii, len(points))
        return thing | self._look((len(points),))


@dataclass
class Tubes(_Look):
    """Round tubes along lines.

    Parameters
    ----------
    points : array_like, shape (N, 3)
        Points of all lines, one line after the other.
    radii : float or array_like of shape (N,)
    offsets : array_like of int, optional
        Line i has the points ``offsets[i]`` up to ``offsets[i + 1]``; one line by default.
    **look
        `color`, `opacity`, `shine`, and `scalars` or `colors` per point.
    """

    points: object
    radii: object
    offsets: object = None

    def _thing(self):
        points, origin, _ = _points("points", self.points)
        offsets = [0, len(points)] if self.offsets is None else self.offsets
        offsets = _arrays.numbers("offsets", offsets)
        if offsets.ndim != 1 or offsets.dtype.kind not in "iu":
            raise TypeError(f"offsets has dtype {offsets.dtype}; give whole numbers in a row")
        if len(offsets) and (offsets.min() < 0 or offsets.max() > len(points)):
            raise IndexError(f"offsets reach {offsets.max()}, and there are {len(points)} points")
        thing = {"kind": "tubes", "points": points.reshape(-1), "origin": origin}
        thing["offsets"] = offsets.astype(np.uint32)
        thing["radii"] = _radii(self.radii, len(points))
        return thing | self._look((len(points),))


def _points(name, values):
    try:
        return _arrays.vertices(values)
    except (TypeError, ValueError) as error:
        raise type(error)(str(error).replace("vertices", name)) from None


def _grid(values, spacing, origin):
    array = _arrays.numbers("values", values)
    if array.ndim != 3 or min(array.shape) < 2:
        raise ValueError(f"values has shape {array.shape}; give (NX, NY, NZ), two or more each way")
    if max(array.shape) >= 2**31:
        raise ValueError(f"values has shape {array.shape}; give less than 2**31 each way")
    spacing = _arrays.numbers("spacing", spacing)
    if spacing.shape not in ((), (1,), (3,)):
        raise ValueError(f"spacing has shape {spacing.shape}; give one number, or three")
    spacing = np.broadcast_to(spacing, (3,))
    if not (np.isfinite(spacing) & (spacing > 0)).all():
        raise ValueError(f"spacing is {spacing.tolist()}; give positive finite numbers")
    return {
        "values": array.ravel(order="F").astype(np.float32, copy=False),
        "dims": array.shape,
        "spacing": tuple(float(s) for s in spacing),
        "origin": _arrays.vector("origin", origin),
    }


@dataclass
class Isosurface(_Look):
    """Where a scalar on a grid has some values; met exactly, without triangles.

    Parameters
    ----------
    values : array_like, shape (NX, NY, NZ)
        ``values[i, j, k]`` lies at ``origin + spacing * (i, j, k)``.
    isovalues : float or array_like
    spacing : float or three floats
    origin : three floats
    **look
        `color`, `opacity`, `shine`.
    """

    values: object
    isovalues: object
    spacing: object = 1.0
    origin: object = (0.0, 0.0, 0.0)

    def _thing(self):
        if self.scalars is not None or self.colors is not None:
            raise ValueError("scalars and colors are not for isosurfaces; give color")
        isovalues = np.atleast_1d(_arrays.numbers("isovalues", self.isovalues))
        if isovalues.ndim != 1 or not len(isovalues) or not np.isfinite(isovalues).all():
            raise ValueError(f"isovalues is {self.isovalues!r}; give finite numbers")
        thing = {"kind": "isosurface", "isovalues": isovalues.astype(np.float32)}
        grid = _grid(self.values, self.spacing, self.origin)
        if self.color_map is not None:
            thing.update(self._map(isovalues))
        return thing | grid | self._look(())


@dataclass
class Volume:
    """A scalar on a grid as a translucent medium.

    Parameters
    ----------
    values : array_like, shape (NX, NY, NZ)
        ``values[i, j, k]`` lies at ``origin + spacing * (i, j, k)``.
    opacity : array_like, shape (K, 2)
        Rows of a scalar and the opacity, 0 to 1, of a slab `unit_distance` thick.
    unit_distance : float
        In units of the world.
    spacing : float or three floats
    origin : three floats
    color_map : array_like, shape (K, 3), optional
        Linear colours, evenly spaced over `range`; viridis by default.
    range : two floats, optional
        Scalars at the ends of the colour map; the smallest and largest value by default.
    """

    values: object
    opacity: object
    unit_distance: float = 1.0
    spacing: object = 1.0
    origin: object = (0.0, 0.0, 0.0)
    color_map: object = field(default=None, kw_only=True)
    range: object = field(default=None, kw_only=True)

    def _thing(self):
        points = _arrays.numbers("opacity", self.opacity)
        if points.ndim != 2 or points.shape[1] != 2 or len(points) == 0:
            raise ValueError(f"opacity has shape {points.shape}; give (K, 2)")
        thing = {"kind": "volume", "opacity_points": points.astype(np.float32).reshape(-1)}
        thing["unit_distance"] = _arrays.positive("unit_distance", self.unit_distance)
        grid = _grid(self.values, self.spacing, self.origin)
        return thing | grid | _Look._map(self, grid["values"])


@dataclass(frozen=True)
class Picture:
    """A picture, row 0 at the top.

    Attributes
    ----------
    color : ndarray of float32, shape (H, W, 4)
        Linear RGB, premultiplied by the fourth channel, the coverage.
    rgba8 : ndarray of uint8, shape (H, W, 4)
        The same as sRGB, not premultiplied, as files have it.
    depth : ndarray of float32, shape (H, W)
        As OpenGL has it, 0 at `near` to 1 at `far`.
    distance : ndarray of float32, shape (H, W)
        From the eye along the ray through the pixel's centre; infinite where nothing is.
    normal : ndarray of float32, shape (H, W, 3)
    object, primitive : ndarray of uint32, shape (H, W)
        Number of the object in the call (volumes have none), and of its triangle, sphere, ...;
        `rt_core.NO_HIT` where nothing is.
    warnings : tuple of str
        Requests that changed nothing.
    """

    color: np.ndarray
    rgba8: np.ndarray
    depth: np.ndarray
    distance: np.ndarray
    normal: np.ndarray
    object: np.ndarray
    primitive: np.ndarray
    warnings: tuple

    def save(self, path):
        """Writes a file.

        Parameters
        ----------
        path : path-like
            ``.png`` for viewing; ``.exr`` with all layers as they are: `color` as R, G, B, A, and
            depth.Z, distance.Z, normal.X, normal.Y, normal.Z, id.instance (of `object`) and
            id.primitive, each with its unit as the attribute ``unit.NAME``.
        """
        ending = str(path).lower().rsplit(".", 1)[-1]
        if ending not in ("png", "exr"):
            raise ValueError(f"path is {str(path)!r}; give a name that ends with .png or .exr")
        if ending == "png":
            _png.write(path, self.rgba8)
            return
        height, width = self.depth.shape
        data = exr_bytes((width, height), self._channels(), "rt_core")
        with open(path, "wb") as file:
            file.write(data)

    def _channels(self):
        """Name, unit and numbers of each channel of an OpenEXR file."""
        ids = "index, 4294967295 for none"
        axes = "unit vector, world axes"
        linear = "linear, premultiplied"
        layers = [
            (("R", "G", "B", "A"), (linear, linear, linear, "coverage 0..1"), self.color),
            (("depth.Z",), ("OpenGL window depth 0..1",), self.depth[..., None]),
            (("distance.Z",), ("world units from the eye",), self.distance[..., None]),
            (("normal.X", "normal.Y", "normal.Z"), (axes,) * 3, self.normal),
            (("id.instance",), (ids,), self.object[..., None]),
            (("id.primitive",), (ids,), self.primitive[..., None]),
        ]
        return [
            (name, unit, np.ascontiguousarray(values[..., i]).reshape(-1))
            for names, units, values in layers
            for i, (name, unit) in enumerate(zip(names, units))
        ]


def _size(size):
    """Width and height in pixels."""
    try:
        width, height = size
    except (TypeError, ValueError):
        raise ValueError(f"size is {size!r}; give width and height in pixels") from None
    return tuple(_arrays.whole(f"size[{i}]", s, 1, 65536) for i, s in enumerate((width, height)))


def render(
    *objects,
    camera=None,
    size=(640, 480),
    samples=1,
    lights=(),
    ambient=0.0,
    ambient_occlusion=None,
    seed=0,
    threads=None,
):
    """Renders a picture.

    Parameters
    ----------
    *objects : Mesh, Spheres, Tubes, Isosurface or Volume
    camera : Camera, optional
        One that sees everything by default.
    size : (int, int)
        Width and height in pixels.
    samples : int
        Rays per pixel.
    lights : sequence of three floats
        Directions towards lights, which cast shadows; light along the view by default.
    ambient : float
        Share of light from everywhere, 0 to 1.
    ambient_occlusion : (float, int), optional
        Largest distance of what dims ambient light, and rays per sample. `ambient` is 0.5 then
        unless given.
    seed : int
        Another seed gives other noise.
    threads : int, optional
        All of the machine by default. The picture does not depend on it.

    Returns
    -------
    Picture

    Examples
    --------
    >>> import rt_core
    >>> ball = rt_core.Spheres([[0, 0, 0]], 1.0, color=(0.9, 0.4, 0.1))
    >>> camera = rt_core.Camera((0, -5, 0), (0, 0, 0))
    >>> picture = rt_core.render(ball, camera=camera, size=(65, 65))
    >>> picture.object[32, 32], picture.distance[32, 32]
    (np.uint32(0), np.float32(4.0))
    """
    things = []
    for number, thing in enumerate(objects):
        if not hasattr(thing, "_thing"):
            raise TypeError(
                f"object {number} is of type {type(thing).__name__}; give Mesh, Spheres, Tubes, "
                "Isosurface or Volume"
            )
        try:
            things.append(thing._thing())
        except (TypeError, ValueError, IndexError) as error:
            raise type(error)(f"object {number}: {error}") from None
    # The world numbers surfaces alone.
    surfaces = [n for n, t in enumerate(things) if t["kind"] != "volume"]
    width, height = _size(size)
    samples = _arrays.whole("samples", samples, 1, 2**31 - 1)
    seed = _arrays.whole("seed", seed, 0, 2**64 - 1)
    if ambient_occlusion is not None:
        try:
            distance, count = ambient_occlusion
        except (TypeError, ValueError):
            raise TypeError(
                f"ambient_occlusion is {ambient_occlusion!r}; give a distance and a number of rays"
            ) from None
        count = _arrays.whole("ambient_occlusion[1]", count, 1, 2**31 - 1)
        distance = _arrays.scalar("ambient_occlusion[0]", distance, "above 0", lambda v: v > 0)
        ambient_occlusion = (distance, count)
        ambient = ambient or 0.5
    towards = [_arrays.vector(f"lights[{i}]", light) for i, light in enumerate(lights)]
    threads = _arrays.threads(threads)
    stage = Stage(things, towards, _unit("ambient", ambient), ambient_occlusion, threads)
    if camera is None:
        camera = seen_from_outside(stage.bounds, (width, height))
    elif not isinstance(camera, Camera):
        raise TypeError(f"camera is of type {type(camera).__name__}; give rt_core.Camera")
    view, lens = camera._numbers()
    layers, warnings = stage.render(view, lens, (width, height), samples, seed, threads)
    shaped = {
        name: a.reshape((height, width) if a.size == width * height else (height, width, -1))
        for name, a in layers
    }
    # Numbers of surfaces, in the order of the call.
    given = np.array([*surfaces, 0], dtype=np.uint32)
    found = shaped["object"]
    hit = found != 0xFFFF_FFFF
    shaped["object"] = np.where(hit, given[np.where(hit, found, 0)], found)
    return Picture(**shaped, warnings=tuple(warnings))
